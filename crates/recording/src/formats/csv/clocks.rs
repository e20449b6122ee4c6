//! A table in which channels have stamps of their own, each beside its values: `Time_1, Speed, Time_2, Thrust`.

use std::ops::Range;

use csv::ByteRecord;

use super::stamps::Stamps;
use super::text;
use crate::log::names::symbol;
use crate::log::stamps::{is_time, time_factor};

/// Two clocks that agree to this share of what they told are one.
const ALIKE: f64 = 0.01;

/// The further columns of stamps of a table.
#[derive(Clone, Default)]
pub(super) struct Clocks {
    others: Vec<Other>,
    columns: usize,
}

#[derive(Clone)]
struct Other {
    column: usize,
    /// To seconds.
    factor: f64,
    /// The log says the units of this clock and of the stamps.
    said: bool,
    /// No clock runs back.
    runs_back: bool,
    /// Both clocks in the first and the newest row that has both.
    span: Option<[[f64; 2]; 2]>,
}

impl Clocks {
    /// The columns that have a number in the first row, the name of a stamp and values between themselves and the stamps before.
    pub fn of(
        names: &[String],
        unit: impl Fn(usize) -> Option<String>,
        stamps: &Stamps,
        row: &ByteRecord,
    ) -> Self {
        let Stamps::Numbers { column: first, factor: of_stamps } = stamps else { return Self::default() };
        let number = |at: usize| row.get(at).is_some_and(|cell| super::opening::is_number(text(cell).trim()));
        let is_stamp = |at: &usize| is_time(&names[*at]) && number(*at);
        let others = (first + 1..names.len()).filter(is_stamp).filter(|at| !is_time(&names[at - 1]));
        let factor = |at: usize| {
            let said = unit(at).and_then(|unit| symbol(&unit)).filter(|unit| unit.si == "s");
            said.map(|unit| unit.factor).or_else(|| time_factor(&names[at]))
        };
        let others = others.map(|column| {
            let (factor, said) = (factor(column).unwrap_or(1.0), factor(column).and(*of_stamps).is_some());
            Other { column, factor, said, runs_back: false, span: None }
        });
        Self { others: others.collect(), columns: names.len() }
    }

    /// Takes a row with its stamp.
    pub fn take(&mut self, row: &ByteRecord, stamp_s: f64, number: impl Fn(&str) -> Option<f64>) {
        for other in &mut self.others {
            let Some(stamp) = row.get(other.column).and_then(|cell| number(text(cell).trim())) else {
                continue;
            };
            let now = [stamp_s, stamp * other.factor];
            other.runs_back |= other.span.is_some_and(|[_, newest]| now[1] < newest[1]);
            other.span = Some([other.span.map_or(now, |[first, _]| first), now]);
        }
    }

    /// Columns that are stamped by another clock, each from its stamps on.
    pub fn others(&self) -> Vec<Range<usize>> {
        let ends = self.others.iter().skip(1).map(|other| other.column).chain([self.columns]);
        let ranges = self.others.iter().zip(ends).filter(|(other, _)| other.differs());
        ranges.map(|(other, end)| other.column..end).collect()
    }

    /// What a user should know.
    pub fn notes(&self, names: &[String]) -> Vec<String> {
        let said = |range: Range<usize>| {
            format!(
                "`{}` is the clock of {}, and another than that of the rows: one column map reads one clock, and none of these is proposed; save them as a file of their own",
                names[range.start],
                names[range.start + 1..range.end]
                    .iter()
                    .map(|name| format!("`{name}`"))
                    .collect::<Vec<_>>()
                    .join(", "),
            )
        };
        self.others().into_iter().map(said).collect()
    }
}

impl Other {
    /// Whether it told another time than the stamps did, whatever its unit where that is not said.
    fn differs(&self) -> bool {
        let Some([first, newest]) = self.span else { return false };
        let [stamps_s, own_s] = [0, 1].map(|clock| newest[clock] - first[clock]);
        let units: &[f64] =
            if self.said { &[1.0] } else { &[1.0, 1e-3, 1e3, 1e-6, 1e6, 1e-9, 1e9, 60.0, 1.0 / 60.0] };
        !self.runs_back
            && stamps_s > 0.0
            && own_s > 0.0
            && units.iter().all(|unit| (own_s * unit - stamps_s).abs() > ALIKE * stamps_s)
    }
}
