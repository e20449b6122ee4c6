//! A log of messages, as vehicles and loggers write it: topics with stamps and fields of their own.

pub(crate) mod join;
pub(crate) mod names;
mod nearness;
mod propose;
mod rules;
mod said;
mod shipped;
pub(crate) mod stamps;
mod survey;

use crate::dates::Dates;
pub use survey::{
    Example, FieldSurvey, GapSurvey, Incomplete, Lack, Proposal, Still, Survey, TopicSurvey, survey,
};

/// A stamp that lies further than this behind its topic's newest begins the clock anew, s; less is disorder of the
/// logger.
const RESET_S: f64 = 1.0;

/// What a stamp is that does not come after the newest of its stretch.
pub(crate) enum Back {
    /// Disorder of the logger, or one stamp twice.
    Late,
    /// One stamp was far ahead, and then it goes on as before: that one was damaged, the clock is not.
    NewestDamaged,
    /// The clock began anew: a start, midnight.
    Anew,
}

impl Back {
    /// Judges a stamp by those of the stretch before it.
    pub fn of(stamp_s: f64, stretch_s: &[f64]) -> Self {
        match stretch_s {
            [.., newest] if newest - stamp_s <= RESET_S => Back::Late,
            [.., before, _] if *before < stamp_s => Back::NewestDamaged,
            _ => Back::Anew,
        }
    }
}

/// What the clock's resets cost: only one stretch between them is read.
pub(crate) fn longest_is_read(resets: usize, stretch_s: &[f64], left_out: &str) -> Option<String> {
    let (from, to) = (stretch_s.first()?, stretch_s.last()?);
    (resets > 0).then(|| {
        format!(
            "the clock begins anew {resets} time(s); the longest stretch, {from:.3} to {to:.3} s, is read, and {left_out} outside it are left out"
        )
    })
}

/// What a log holds.
#[derive(Clone, Debug, Default)]
pub(crate) struct Log {
    /// The format, for people.
    pub format: &'static str,
    /// What the stamps count from.
    pub clock: &'static str,
    /// What parts the cells of a table.
    pub delimiter: u8,
    /// Numbers of a table have a decimal comma.
    pub decimal_comma: bool,
    /// Numbers of a table have a comma that may be one for thousands too.
    pub perhaps_decimal_comma: bool,
    /// Names of a table's header that may be those without cells, where all rows are too short.
    pub without_cells: Vec<String>,
    /// Columns of a table on another clock than its stamps'.
    pub other_clocks: Vec<std::ops::Range<usize>>,
    /// What a table's columns lack, by place: cells without a value, or without a number.
    pub lost_in: std::collections::BTreeMap<usize, Vec<String>>,
    /// A table without names: its columns are called by their places.
    pub nameless: bool,
    /// The stamps of a table, if they are dates.
    pub dates: Option<Dates>,
    /// In the order of their first message.
    pub topics: Vec<Topic>,
    /// How often the clock began anew.
    pub resets: usize,
    /// What a user should know.
    pub notes: Vec<String>,
    /// What was lost or skipped while reading.
    pub losses: Vec<String>,
}

/// Messages of one kind, from one instance.
#[derive(Clone, Debug, Default)]
pub(crate) struct Topic {
    /// With its instance in brackets where the format has several; empty for a plain table.
    pub name: String,
    /// One a message, s.
    pub stamps_s: Vec<f64>,
    /// Where each stretch between resets of the clock begins: (stretch, message).
    pub stretches: Vec<(usize, usize)>,
    /// Its fields.
    pub fields: Vec<Field>,
    /// Messages left out since their stamp fell back a little.
    pub stale: u64,
}

/// One field of a topic.
#[derive(Clone, Debug, Default)]
pub(crate) struct Field {
    /// Name within the topic.
    pub name: String,
    /// Unit, as the format says it.
    pub unit: Option<String>,
    /// One a message, NaN where it has no such field, infinite where that holds no finite number; empty if only the
    /// statistics were asked for.
    pub values: Vec<f64>,
    /// Messages with a finite number in it.
    pub samples: u64,
    /// Messages with NaN or infinity in it.
    pub no_numbers: u64,
    /// Messages with a text in it.
    pub texts: u64,
    /// Least and greatest number.
    pub range: Option<(f64, f64)>,
}

impl Log {
    /// The stretch between resets of the clock in which these topics have the most messages, the first of several.
    pub fn longest(&self, topics: impl Iterator<Item = usize> + Clone) -> usize {
        let count =
            |stretch: usize| -> usize { topics.clone().map(|t| self.topics[t].stretch(stretch).len()).sum() };
        (0..=self.resets).rev().max_by_key(|stretch| count(*stretch)).unwrap_or(0)
    }
}

impl Topic {
    /// The name by which a column map calls a field.
    pub fn source(&self, field: &Field) -> String {
        if self.name.is_empty() { field.name.clone() } else { format!("{}.{}", self.name, field.name) }
    }

    fn drop_newest(&mut self) {
        self.stamps_s.pop();
        for field in &mut self.fields {
            field.values.pop();
        }
        self.stale += 1;
    }

    /// Messages of a stretch.
    pub fn stretch(&self, wanted: usize) -> std::ops::Range<usize> {
        let at = self.stretches.iter().position(|(stretch, _)| *stretch == wanted);
        at.map_or(0..0, |at| {
            let end = self.stretches.get(at + 1).map_or(self.stamps_s.len(), |next| next.1);
            self.stretches[at].1..end
        })
    }
}

/// Two names of one thing: `battery_status.voltage_v` is `battery_status[0].voltage_v`.
pub(crate) fn same_source(a: &str, b: &str) -> bool {
    fn parts(name: &str) -> (&str, &str) {
        let (topic, field) = name.split_once('.').unwrap_or((name, ""));
        (topic.strip_suffix("[0]").unwrap_or(topic), field)
    }
    parts(a) == parts(b)
}

/// Takes a log's messages as a decoder finds them.
#[derive(Clone)]
pub(crate) struct Gather<'w> {
    log: Log,
    wanted: Option<&'w [String]>,
    stretch: usize,
    /// The message under way is left out.
    skip: bool,
}

impl<'w> Gather<'w> {
    /// Keeps the values of these sources; `None` keeps none, but the statistics of all.
    pub fn new(format: &'static str, clock: &'static str, wanted: Option<&'w [String]>) -> Self {
        let log = Log { format, clock, ..Log::default() };
        Self { log, wanted, stretch: 0, skip: false }
    }

    /// Begins a topic.
    pub fn topic(&mut self, name: impl Into<String>) -> usize {
        self.log.topics.push(Topic { name: name.into(), ..Topic::default() });
        self.log.topics.len() - 1
    }

    /// Adds a field to a topic.
    pub fn field(&mut self, topic: usize, name: impl Into<String>, unit: Option<String>) -> usize {
        let of = &mut self.log.topics[topic];
        of.fields.push(Field { name: name.into(), unit, ..Field::default() });
        let place = of.fields.len() - 1;
        if self.keeps(topic, place) {
            let of = &mut self.log.topics[topic];
            // A list with places never has a capacity of zero: that tells kept fields from others.
            of.fields[place].values = Vec::with_capacity(64);
            of.fields[place].values.resize(of.stamps_s.len(), f64::NAN);
        }
        place
    }

    fn keeps(&self, topic: usize, field: usize) -> bool {
        let of = &self.log.topics[topic];
        let source = of.source(&of.fields[field]);
        self.wanted.is_some_and(|wanted| wanted.iter().any(|one| same_source(one, &source)))
    }

    /// Whether the field's numbers, or its statistics, are taken.
    pub fn takes(&self, topic: usize, field: usize) -> bool {
        self.wanted.is_none() || self.keeps(topic, field)
    }

    /// What parts the cells of a table.
    pub fn delimiter(&mut self, delimiter: u8) {
        self.log.delimiter = delimiter;
    }

    /// Numbers of a table have a decimal comma.
    pub fn decimal_comma(&mut self) {
        self.log.decimal_comma = true;
    }

    /// A table has no names: its columns are called by their places.
    pub fn nameless(&mut self) {
        self.log.nameless = true;
    }

    /// The message under way has no stamp: it is left out, which the decoder tells.
    pub fn unstamped(&mut self) {
        self.skip = true;
    }

    /// A unit that the format tells late.
    pub fn unit(&mut self, topic: usize, field: usize, unit: String) {
        if let Some(field) = self.log.topics[topic].fields.get_mut(field) {
            field.unit = Some(unit);
        }
    }

    /// Begins a message; [`Gather::set`] fills it.
    pub fn message(&mut self, topic: usize, stamp_s: f64) {
        let of = &mut self.log.topics[topic];
        self.skip = !stamp_s.is_finite();
        let here = of.stretches.last().is_some_and(|(stretch, _)| *stretch == self.stretch);
        if here && of.stamps_s.last().is_some_and(|newest| stamp_s <= *newest) {
            let begins = of.stretches.last().map_or(0, |(_, begins)| *begins);
            match Back::of(stamp_s, &of.stamps_s[begins..]) {
                Back::Late => self.skip = true,
                Back::NewestDamaged => of.drop_newest(),
                Back::Anew => {
                    self.stretch += 1;
                    self.log.resets += 1;
                }
            }
        }
        if self.skip {
            of.stale += 1;
            return;
        }
        if of.stretches.last().is_none_or(|(stretch, _)| *stretch != self.stretch) {
            of.stretches.push((self.stretch, of.stamps_s.len()));
        }
        of.stamps_s.push(stamp_s);
        for field in of.fields.iter_mut().filter(|f| f.values.capacity() > 0) {
            field.values.push(f64::NAN);
        }
    }

    /// A number of the message under way.
    pub fn set(&mut self, topic: usize, field: usize, value: f64) {
        if self.skip {
            return;
        }
        let field = &mut self.log.topics[topic].fields[field];
        if let Some(last) = field.values.last_mut() {
            *last = if value.is_finite() { value } else { f64::INFINITY };
        }
        if !value.is_finite() {
            field.no_numbers += 1;
            return;
        }
        field.samples += 1;
        field.range = Some(match field.range {
            Some((low, high)) => (low.min(value), high.max(value)),
            None => (value, value),
        });
    }

    /// A text of the message under way.
    pub fn text(&mut self, topic: usize, field: usize) {
        if !self.skip {
            self.log.topics[topic].fields[field].texts += 1;
        }
    }

    /// What a user should know.
    pub fn note(&mut self, note: String) {
        self.log.notes.push(note);
    }

    /// What was lost.
    pub fn loss(&mut self, loss: String) {
        self.log.losses.push(loss);
    }

    /// More of that.
    pub fn losses(&mut self, losses: impl IntoIterator<Item = String>) {
        self.log.losses.extend(losses);
    }

    /// Whether any message came.
    pub fn is_empty(&self) -> bool {
        self.log.topics.iter().all(|topic| topic.stamps_s.is_empty())
    }

    /// The log.
    pub fn finish(mut self) -> Log {
        let stale: u64 = self.log.topics.iter().map(|topic| topic.stale).sum();
        if stale > 0 {
            self.log.losses.push(format!(
                "{stale} message(s) are stamped no later than the one before of their kind, or far off it, and are skipped"
            ));
        }
        self.log
    }
}

/// Usual step of stamps, and stretches without a message: more than five times as long as nine in ten steps, as in a
/// recording.
pub(crate) fn steps(stamps_s: &[f64]) -> (f64, Vec<(f64, f64)>) {
    let forward = || stamps_s.windows(2).filter(|w| w[1] > w[0]);
    let mut steps: Vec<f64> = forward().map(|w| w[1] - w[0]).collect();
    if steps.is_empty() {
        return (f64::NAN, Vec::new());
    }
    steps.sort_by(f64::total_cmp);
    let at = |part: f64| steps[((steps.len() - 1) as f64 * part) as usize];
    let limit = 5.0 * at(0.9);
    (at(0.5), forward().filter(|w| w[1] - w[0] > limit).map(|w| (w[0], w[1])).collect())
}

#[cfg(test)]
mod tests;
