//! A free number of a hypothesis: what it changes, where it may lie, and where it commonly does.

use kort_thruster::effects::Stretch;
use kort_thruster::parameters::Parameter as P;

use crate::data::Response;

/// What a free number changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// A parameter of the baseline.
    Base(P),
    /// When a channel was sampled, s late.
    Sampling {
        /// The channel.
        response: Response,
    },
    /// How long a sensor that is slower than the log takes the mean for a reading, s.
    Averaging {
        /// The channel.
        response: Response,
    },
    /// A value of an effect: which effect of the hypothesis, which value.
    Effect(usize, usize),
}

/// A free number.
#[derive(Clone, Debug, PartialEq)]
pub struct Free {
    /// What it changes.
    pub target: Target,
    /// Name for reports.
    pub name: &'static str,
    /// Unit for reports.
    pub unit: &'static str,
    /// Whether the rig states it.
    pub stated: bool,
    /// Prior mean.
    pub mean: f64,
    /// Prior standard deviation.
    pub sigma: f64,
    /// Least value allowed.
    pub low: f64,
    /// Greatest value allowed.
    pub high: f64,
    /// When it acts, if only for a while.
    pub acts: Option<Stretch>,
}

impl Free {
    /// Distance of a value from the prior's mean, in standard deviations.
    pub fn score(&self, value: f64) -> f64 {
        (value - self.mean) / self.sigma
    }

    /// A value within what is allowed; one that only rounding parts from the edge stands on it.
    pub fn within(&self, value: f64) -> f64 {
        let rounding = 1e-12 * (self.high - self.low);
        match value {
            low if low <= self.low + rounding => self.low,
            high if high >= self.high - rounding => self.high,
            inside => inside,
        }
    }

    /// Whether a value stands at the edge of what is allowed.
    pub fn at_bound(&self, value: f64) -> bool {
        let slack = 1e-6 * (self.high - self.low);
        value <= self.low + slack || value >= self.high - slack
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_only_rounding_parts_from_the_edge_stands_on_it() {
        let target = Target::Effect(0, 0);
        let (name, unit) = ("running_mean_share", "1");
        let free = Free {
            target,
            name,
            unit,
            stated: false,
            mean: 0.0,
            sigma: 0.3,
            low: 0.0,
            high: 1.0,
            acts: None,
        };
        assert_eq!(
            [1e-17, -3.0, 1.0 - 1e-16, 7.0, 0.25].map(|value| free.within(value)),
            [0.0, 0.0, 1.0, 1.0, 0.25]
        );
        assert!(free.at_bound(free.within(1e-17)) && !free.at_bound(0.25));
    }
}
