//! Stamps that are dates with their time of day. Year, day or month may stand first: a stamp is read in every order that all
//! stamps before it can be in. A number above 12 leaves one of them; where several would give different times, none is guessed.
//! The time of day may stand in a column of its own, beside the date or without one: then midnight may pass between two rows
//! of one date.

mod midnight;

use std::borrow::Cow;

use time::UtcDateTime;
use time::format_description::StaticFormatDescription;
use time::macros::format_description;
use time::parsing::Parsed;

use crate::cell::shown;
use crate::error::{Place, Problem};

/// What a column map calls the unit of such stamps.
pub const UNIT: &str = "date";

/// What a column map calls the unit of a time of day without a date.
pub const OF_DAY: &str = "time of day";

/// Forms that are read, for people.
pub(crate) const FORMS: &str = "2024-05-01 12:00:00.250 (or T between, Z or +02:00 behind), 01.05.2024 12:00:00,250, 05/01/2024 12:00:00 PM, 01-May-2024 12:00:00, milliseconds also as 12:00:00:250, all in one order";

/// Forms of a time of day, for people.
pub(crate) const FORMS_OF_DAY: &str = "12:00:00.250, 12:00:00,250, 12:00:00:250, 12:00:00 PM";

/// What stands between a date and its time of day.
const BETWEEN: StaticFormatDescription = format_description!(version = 2, "[first [T] [ ] [, ]]");
const HOUR_OF_12: StaticFormatDescription = format_description!(
    version = 2,
    "[hour repr:12 padding:none]:[minute][optional [:[second][optional [[first [.] [,]][subsecond]]]]]\
     [optional [ ]][period case_sensitive:false]"
);
const HOUR_OF_24: StaticFormatDescription = format_description!(
    version = 2,
    "[hour padding:none]:[minute][optional [:[second][optional [[first [.] [,]][subsecond]]]]]"
);
const ZONE: StaticFormatDescription = format_description!(
    version = 2,
    "[optional [[optional [ ]][first [Z] [UTC] [[offset_hour sign:mandatory]:[offset_minute]] \
     [[offset_hour sign:mandatory][offset_minute]] [[offset_hour sign:mandatory]]]]]"
);

/// What a date begins with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// 2024-05-31, as ISO 8601 has it.
    YearFirst,
    /// 31.05.2024, 31/05/2024, 31-May-2024.
    DayFirst,
    /// 05/31/2024.
    MonthFirst,
}

impl Order {
    /// All of them.
    pub const ALL: [Order; 3] = [Order::YearFirst, Order::DayFirst, Order::MonthFirst];

    /// As a column map writes it.
    pub fn name(self) -> &'static str {
        match self {
            Order::YearFirst => "year-first",
            Order::DayFirst => "day-first",
            Order::MonthFirst => "month-first",
        }
    }

    fn date(self) -> StaticFormatDescription {
        match self {
            Order::YearFirst => format_description!(
                version = 2,
                "[year][first [-] [/] [.]][month padding:none][first [-] [/] [.]][day padding:none]"
            ),
            Order::DayFirst => format_description!(
                version = 2,
                "[day padding:none][first [.] [/] [-]]\
                 [first [[month padding:none]] [[month repr:short case_sensitive:false]]][first [.] [/] [-]][year]"
            ),
            // Nobody writes dots behind a month that stands first.
            Order::MonthFirst => format_description!(
                version = 2,
                "[month padding:none][first [/] [-]][day padding:none][first [/] [-]][year]"
            ),
        }
    }

    /// Since 1970, ns; a stamp without a zone as if it were UTC, for only differences count.
    pub(crate) fn instant_ns(self, text: &str) -> Option<i128> {
        let text = with_point(text);
        let mut parsed = Parsed::new();
        let clock = parsed.parse_items(text.as_bytes(), self.date()).ok()?;
        let clock = parsed.parse_items(clock, BETWEEN).ok()?;
        let zone =
            parsed.parse_items(clock, HOUR_OF_12).or_else(|_| parsed.parse_items(clock, HOUR_OF_24)).ok()?;
        let behind = parsed.parse_items(zone, ZONE).ok()?;
        let instant = UtcDateTime::try_from(parsed).ok().filter(|_| behind.is_empty())?;
        Some(instant.unix_timestamp_nanos())
    }
}

/// Whether a text is a date with its time of day.
pub(crate) fn is_date(text: &str) -> bool {
    Order::ALL.iter().any(|order| order.instant_ns(text.trim()).is_some())
}

/// Whether a text is a date without a time of day.
pub(crate) fn is_day(text: &str) -> bool {
    let day = |order: &Order| order.instant_ns(&format!("{} 00:00", text.trim())).is_some();
    !text.contains(':') && Order::ALL.iter().any(day)
}

/// Whether a text is a time of day without a date.
pub(crate) fn is_time_of_day(text: &str) -> bool {
    midnight::of_day_ns(text.trim()).is_some()
}

/// Milliseconds behind a third colon, as 18:45:58:868, behind a point. Three digits, six or nine are a fraction of a second
/// for certain; fewer may count milliseconds, or frames.
fn with_point(text: &str) -> Cow<'_, str> {
    let third = text.match_indices(':').nth(2);
    let digits = |at: usize| text[at + 1..].bytes().take_while(u8::is_ascii_digit).count();
    match third.filter(|(at, _)| matches!(digits(*at), 3 | 6 | 9)) {
        Some((at, _)) => Cow::Owned(format!("{}.{}", &text[..at], &text[at + 1..])),
        None => Cow::Borrowed(text),
    }
}

/// A stamp as it stands in a row.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Stamp<'a> {
    /// A date with its time of day.
    Whole(&'a str),
    /// A date, and in another column its time of day.
    InTwo(&'a str, &'a str),
    /// A time of day.
    OfDay(&'a str),
}

impl Stamp<'_> {
    /// As it is shown.
    fn text(self) -> String {
        match self {
            Stamp::Whole(text) | Stamp::OfDay(text) => text.trim().to_owned(),
            Stamp::InTwo(date, of_day) => format!("{} {}", date.trim(), of_day.trim()).trim().to_owned(),
        }
    }
}

/// Reads the stamps of a column one after the other.
#[derive(Clone, Debug)]
pub(crate) struct Dates {
    /// Orders that all stamps so far can be in, each with the first stamp as it is in that order, ns.
    orders: Vec<(Order, Option<i128>)>,
    /// Two orders once gave different times.
    parted: bool,
    /// Of the newest stamp, where the orders may differ.
    newest_s: f64,
    /// Texts of stamps: the first, the one before the newest, the newest.
    said: [String; 3],
    midnights: midnight::Midnights,
}

impl Dates {
    /// Before the first stamp; with the order, if somebody states it.
    pub fn new(stated: Option<Order>) -> Self {
        let orders = Order::ALL.into_iter().filter(|order| stated.is_none_or(|stated| stated == *order));
        let orders = orders.map(|order| (order, None)).collect();
        Self {
            orders,
            parted: false,
            newest_s: 0.0,
            said: Default::default(),
            midnights: midnight::Midnights::default(),
        }
    }

    /// Before the first time of day.
    pub fn of_day() -> Self {
        Self::new(Some(Order::YearFirst))
    }

    /// Seconds from the first stamp to this one, as often as the orders that are left differ; none for a text that is no date in
    /// any of them.
    fn seconds(&mut self, stamp: Stamp) -> Vec<f64> {
        let text = match stamp {
            Stamp::OfDay(of_day) => format!("{} {}", midnight::NO_DATE, of_day.trim()),
            _ => stamp.text(),
        };
        let later_ns = self.midnights.passed_ns(stamp);
        let read = self.orders.iter().filter_map(|(order, first_ns)| {
            let now_ns = order.instant_ns(&text)? + later_ns;
            Some((*order, first_ns.unwrap_or(now_ns), now_ns))
        });
        let read: Vec<_> = read.collect();
        if !read.is_empty() {
            self.orders = read.iter().map(|(order, first_ns, _)| (*order, Some(*first_ns))).collect();
        }
        let mut since_ns: Vec<i128> =
            read.into_iter().map(|(_, first_ns, now_ns)| now_ns - first_ns).collect();
        since_ns.dedup();
        self.parted |= since_ns.len() > 1;
        since_ns.into_iter().map(|ns| ns as f64 / 1e9).collect()
    }

    /// Seconds from the first stamp to this one; place and column stand in errors.
    pub fn take(&mut self, place: Place, column: &str, stamp: Stamp) -> Result<f64, Problem> {
        let text = stamp.text();
        if text.is_empty() {
            return Ok(f64::NAN);
        }
        let column = column.to_owned();
        match (&self.seconds(stamp)[..], stamp) {
            ([since_s], _) => {
                self.remember(text);
                Ok(*since_s)
            }
            ([], Stamp::OfDay(_)) => Err(Problem::NotATimeOfDay { place, column, text: shown(&text) }),
            ([], _) => Err(Problem::NotADate { place, column, text: shown(&text), orders: self.names() }),
            _ => Err(Problem::DateOrder { place, column, text: shown(&text), orders: self.names() }),
        }
    }

    fn remember(&mut self, text: String) {
        if self.said[0].is_empty() {
            self.said[0].clone_from(&text);
        }
        self.said[1] = std::mem::replace(&mut self.said[2], text);
    }

    /// Seconds from the first stamp to this one, to say what is in a log: where the orders differ the one that comes nearest to
    /// the stamp before, and NaN for what is no date.
    pub fn nearest_s(&mut self, stamp: Stamp) -> f64 {
        let before_s = self.newest_s;
        let step = |since_s: &f64| (since_s - before_s).abs();
        let nearest = self.seconds(stamp).into_iter().min_by(|a, b| step(a).total_cmp(&step(b)));
        self.newest_s = nearest.unwrap_or(before_s);
        nearest.unwrap_or(f64::NAN)
    }

    /// That midnight passed where no date says so.
    pub fn midnights(&self) -> Option<String> {
        self.midnights.said()
    }

    /// The first stamp as the file has it.
    pub fn first(&self) -> &str {
        &self.said[0]
    }

    /// The newest stamp and the one before, as the file has them.
    pub fn newest_two(&self) -> [String; 2] {
        [self.said[1].clone(), self.said[2].clone()]
    }

    /// The line of a proposed column map that states the order.
    pub fn proposed(&self) -> String {
        match self.orders[..] {
            [(Order::YearFirst, _)] => String::new(),
            [(order, _)] => format!("order = {:?}\n", order.name()),
            _ if self.parted => {
                "# order = \"…\"   the log does not say it: day-first or month-first\n".into()
            }
            // Both give the same times.
            _ => String::new(),
        }
    }

    /// Orders that are left.
    fn names(&self) -> String {
        let names: Vec<&str> = self.orders.iter().map(|(order, _)| order.name()).collect();
        names.join(" or ")
    }
}

#[cfg(test)]
mod tests;
