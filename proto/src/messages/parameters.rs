//! Named numbers.

use crate::text::Text;
#[cfg(feature = "transport")]
use iceoryx2::prelude::ZeroCopySend;

/// Most parameters of a controller in one message.
pub const LAW_PARAMETERS: usize = 48;
/// Most estimated parameters, and most parameters changed by one request.
pub const PARAMETERS: usize = 16;

message! { "kort.Parameter",
    /// A named number: parameter of a control law or of an estimator.
    Parameter {
        /// Name, unit last.
        name: Text<32>,
        /// Unit.
        unit: Text<16>,
        /// Value.
        value: f64,
        /// Standard error; NaN if it has none.
        std_error: f64,
        /// Smallest allowed value; NaN if not bounded.
        low: f64,
        /// Largest allowed value; NaN if not bounded.
        high: f64,
    }
}

message! { "kort.ParameterTable",
    /// All parameters of a controller, in two halves because arrays beyond 32 have no default.
    ParameterTable {
        /// The first half.
        first: [Parameter; LAW_PARAMETERS / 2],
        /// The second half.
        second: [Parameter; LAW_PARAMETERS / 2],
    }
}

impl ParameterTable {
    /// The parameter at a place; `None` beyond the end.
    pub fn get(&self, index: usize) -> Option<&Parameter> {
        self.first.get(index).or_else(|| self.second.get(index.checked_sub(LAW_PARAMETERS / 2)?))
    }

    /// As [`Self::get`], to write.
    pub fn get_mut(&mut self, index: usize) -> Option<&mut Parameter> {
        if index < LAW_PARAMETERS / 2 {
            self.first.get_mut(index)
        } else {
            self.second.get_mut(index - LAW_PARAMETERS / 2)
        }
    }

    /// The first `count` parameters.
    pub fn iter(&self, count: u32) -> impl Iterator<Item = &Parameter> {
        self.first.iter().chain(&self.second).take(count as usize)
    }
}
