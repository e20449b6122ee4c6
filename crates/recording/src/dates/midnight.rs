//! A time of day in a column of its own: where it runs back and no date beside it tells another day, midnight has passed.

use super::{Order, Stamp};

/// Stands in the place of a date where there is none.
pub(super) const NO_DATE: &str = "1970-01-01";

const DAY_NS: i128 = 86_400_000_000_000;

/// Since midnight, ns; none for what is no time of day.
pub(super) fn of_day_ns(text: &str) -> Option<i128> {
    Order::YearFirst.instant_ns(&format!("{NO_DATE} {text}"))
}

/// Midnights between rows of one date.
#[derive(Clone, Debug, Default)]
pub(super) struct Midnights {
    date: String,
    before_ns: Option<i128>,
    /// Since the date was last written anew.
    days: i128,
    all: u64,
}

impl Midnights {
    /// What a stamp is later than it says, ns. Less than half a day back is a clock that was set, or a row out of order.
    pub fn passed_ns(&mut self, stamp: Stamp) -> i128 {
        let (date, of_day) = match stamp {
            Stamp::Whole(_) => return 0,
            Stamp::InTwo(date, of_day) => (date.trim(), of_day),
            Stamp::OfDay(of_day) => ("", of_day),
        };
        let Some(now_ns) = of_day_ns(of_day.trim()) else { return 0 };
        if date != self.date {
            self.date = date.to_owned();
            self.days = 0;
        } else if self.before_ns.is_some_and(|before_ns| before_ns - now_ns > DAY_NS / 2) {
            self.days += 1;
            self.all += 1;
        }
        self.before_ns = Some(now_ns);
        self.days * DAY_NS
    }

    /// That there were some.
    pub fn said(&self) -> Option<String> {
        (self.all > 0).then(|| {
            format!(
                "the time of day runs back by more than twelve hours {} time(s) under one date, or without any: midnight, and the next day",
                self.all
            )
        })
    }
}
