//! What a column of stamps holds, and how it is read.

use crate::cell::Cell;
use crate::dates::{Dates, Stamp};
use crate::error::{Place, Problem};
use crate::map::Stamps;

/// What the stamps are.
pub(super) enum Clock {
    Numbers { to_s: f64 },
    Dates(Box<Dates>),
    OfDay(Box<Dates>),
}

/// Stamps of our own, and those of a log of messages.
pub(super) const SECONDS: Clock = Clock::Numbers { to_s: 1.0 };

impl Clock {
    pub fn of(stamps: Stamps) -> Self {
        match stamps {
            Stamps::Numbers { to_s } => Clock::Numbers { to_s },
            Stamps::Dates { order } => Clock::Dates(Box::new(Dates::new(order))),
            Stamps::OfDay => Clock::OfDay(Box::new(Dates::of_day())),
        }
    }

    /// A stamp, in the file's unit, with the time of day of a date in a column of its own; NaN for an empty cell.
    pub fn read(
        &mut self,
        place: Place,
        at: (&str, Cell),
        beside: Option<(&str, Cell)>,
        comma: bool,
    ) -> Result<f64, Problem> {
        let (column, cell) = at;
        match (self, beside) {
            (Clock::Numbers { .. }, _) => cell.number(place, column, comma),
            (Clock::OfDay(dates), _) => dates.take(place, column, Stamp::OfDay(&cell.text())),
            (Clock::Dates(dates), None) => dates.take(place, column, Stamp::Whole(&cell.text())),
            (Clock::Dates(dates), Some((of_day, clock))) => {
                let columns = format!("{column}` with `{of_day}");
                dates.take(place, &columns, Stamp::InTwo(&cell.text(), &clock.text()))
            }
        }
    }

    pub fn dates(&self) -> Option<&Dates> {
        match self {
            Clock::Numbers { .. } => None,
            Clock::Dates(dates) | Clock::OfDay(dates) => Some(dates),
        }
    }

    pub fn to_s(&self) -> f64 {
        match self {
            Clock::Numbers { to_s } => *to_s,
            Clock::Dates(_) | Clock::OfDay(_) => 1.0,
        }
    }

    /// Two stamps one after the other, as the file has them.
    pub fn said(&self, before: f64, now: f64) -> [String; 2] {
        self.dates().map_or_else(|| [before, now].map(|stamp| stamp.to_string()), Dates::newest_two)
    }
}
