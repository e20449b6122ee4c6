//! Which column of a table holds its stamps, and the instants that they tell.

use csv::ByteRecord;

use crate::dates::{self, Dates, Stamp, is_date, is_day, is_time_of_day};
use crate::decimal::{with_comma, with_point};
use crate::error::{Place, Problem};
use crate::log::names::symbol;
use crate::log::stamps::{is_time, is_time_by_unit, time_factor};

/// What makes the stamps.
pub(super) enum Stamps {
    /// The rows are counted.
    Rows,
    Numbers {
        column: usize,
        /// To seconds, if the log says it.
        factor: Option<f64>,
    },
    /// Dates, with the column of their time of day where that is another; with the time of the row under way.
    Dates { column: usize, of_day: Option<usize>, dates: Box<Dates>, now_s: f64 },
    /// Times of day without a date.
    OfDay { column: usize, dates: Box<Dates>, now_s: f64 },
}

/// The column of stamps: the one whose name says it, if a stamp stands in it in the first row; else the first one with a date
/// there, or a time of day, or the first number with a unit of time; and what is wrong with the one that has the name only.
pub(super) fn find(
    names: &[String],
    unit: impl Fn(usize) -> Option<String>,
    row: &ByteRecord,
    place: Place,
) -> (Stamps, Option<Problem>) {
    let cell = |at: usize| text(row, at);
    let number = |at: usize| with_point(cell(at)).is_some() || with_comma(cell(at)).is_some();
    let stamp = |at: &usize| number(*at) || is_date(cell(*at)) || is_time_of_day(cell(*at));
    let all = || 0..names.len();
    let named = || all().filter(|at| is_time(&names[*at]));
    let unit_of = |at: usize| unit(at).and_then(|unit| symbol(&unit)).filter(|unit| unit.si == "s");
    let by_unit = |at: &usize| number(*at) && (unit_of(*at).is_some() || is_time_by_unit(&names[*at]));
    let found = named()
        .find(stamp)
        .or_else(|| all().find(|at| is_date(cell(*at))))
        .or_else(|| all().find(|at| is_time_of_day(cell(*at))))
        .or_else(|| all().find(by_unit));
    let Some(column) = found else {
        let Some(column) = named().next() else { return (Stamps::Rows, None) };
        if cell(column).is_empty() {
            let factor = unit_of(column).map(|unit| unit.factor).or_else(|| time_factor(&names[column]));
            return (Stamps::Numbers { column, factor }, None);
        }
        let (name, text) = (names[column].clone(), crate::cell::shown(cell(column)));
        return (Stamps::Rows, Some(Problem::NotANumber { place, column: name, text }));
    };
    let stamps = if number(column) {
        let factor = unit_of(column).map(|unit| unit.factor).or_else(|| time_factor(&names[column]));
        Stamps::Numbers { column, factor }
    } else if is_date(cell(column)) {
        Stamps::Dates { column, of_day: None, dates: Box::new(Dates::new(None)), now_s: 0.0 }
    } else if let Some(day) = all().find(|at| is_day(cell(*at))) {
        Stamps::Dates { column: day, of_day: Some(column), dates: Box::new(Dates::new(None)), now_s: 0.0 }
    } else {
        Stamps::OfDay { column, dates: Box::new(Dates::of_day()), now_s: 0.0 }
    };
    (stamps, None)
}

impl Stamps {
    /// What they count from.
    pub fn clock(&self) -> &'static str {
        match self {
            Stamps::Rows => "none: no column that can be read looks like time; rows are counted",
            Stamps::Numbers { factor: Some(_), .. } => "those of its time column",
            Stamps::Numbers { factor: None, .. } => {
                "those of its time column, whose unit the log does not say: taken as seconds here"
            }
            Stamps::Dates { of_day: None, .. } => "the dates of its time column, counted from the first",
            Stamps::Dates { of_day: Some(_), .. } => {
                "the dates of one column with the times of day of another, counted from the first"
            }
            Stamps::OfDay { .. } => "the times of day of its time column, counted from the first",
        }
    }

    /// What a column map calls the unit of this column, if it is one of dates or times of day.
    pub fn unit(&self, at: usize) -> Option<&'static str> {
        match self {
            Stamps::Dates { column, .. } if *column == at => Some(dates::UNIT),
            Stamps::Dates { of_day: Some(column), .. } | Stamps::OfDay { column, .. } if *column == at => {
                Some(dates::OF_DAY)
            }
            _ => None,
        }
    }

    /// Reads the row's date, once however often the row is taken.
    pub fn read(&mut self, row: &ByteRecord) {
        match self {
            Stamps::Dates { column, of_day, dates, now_s } => {
                let date = text(row, *column);
                *now_s = dates.nearest_s(
                    of_day.map_or(Stamp::Whole(date), |of_day| Stamp::InTwo(date, text(row, of_day))),
                );
            }
            Stamps::OfDay { column, dates, now_s } => {
                *now_s = dates.nearest_s(Stamp::OfDay(text(row, *column)));
            }
            Stamps::Rows | Stamps::Numbers { .. } => {}
        }
    }

    /// The instant of a row, s; NaN where its stamp cannot be read.
    pub fn now_s(&self, row: &ByteRecord, rows: u64, number: impl Fn(&str) -> Option<f64>) -> f64 {
        match self {
            Stamps::Rows => rows as f64,
            Stamps::Numbers { column, factor } => {
                number(text(row, *column)).map_or(f64::NAN, |stamp| stamp * factor.unwrap_or(1.0))
            }
            Stamps::Dates { now_s, .. } | Stamps::OfDay { now_s, .. } => *now_s,
        }
    }

    /// What stands in a row in the place of a stamp.
    pub fn said(&self, row: &ByteRecord) -> String {
        match self {
            Stamps::Rows => String::new(),
            Stamps::Dates { column, of_day: Some(of_day), .. } => {
                format!("{} {}", text(row, *column), text(row, *of_day))
            }
            Stamps::Numbers { column, .. } | Stamps::Dates { column, .. } | Stamps::OfDay { column, .. } => {
                text(row, *column).to_owned()
            }
        }
    }

    pub fn into_dates(self) -> Option<Dates> {
        match self {
            Stamps::Dates { dates, .. } | Stamps::OfDay { dates, .. } => Some(*dates),
            Stamps::Rows | Stamps::Numbers { .. } => None,
        }
    }
}

fn text(row: &ByteRecord, at: usize) -> &str {
    row.get(at).and_then(|cell| std::str::from_utf8(cell).ok()).unwrap_or_default().trim()
}
