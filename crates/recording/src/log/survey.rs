//! What is in a log: topics, fields, units, rates, gaps, and the column map that would bring it in.

use std::io::{BufReader, Read};

use serde::Serialize;

use super::names;
use super::propose::propose;
use super::{Field, Log, Topic, steps};
use crate::error::RecordingError;
use crate::formats;

/// What is in a log.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Survey {
    /// `kort.columns/1`.
    pub schema: &'static str,
    /// The file.
    pub file: String,
    /// Its format, for people.
    pub format: &'static str,
    /// What its stamps count from.
    pub clock: &'static str,
    /// From the first to the last stamp of its longest topic, s, where the clock begins anew within the stretch that is
    /// read; none if there are no stamps.
    pub duration_s: Option<f64>,
    /// How often the clock begins anew.
    pub resets: usize,
    /// Kinds of messages; a table has one, without a name.
    pub topics: Vec<TopicSurvey>,
    /// What a user should know.
    pub notes: Vec<String>,
    /// What was lost while reading.
    pub losses: Vec<String>,
    /// How to bring it in.
    pub proposal: Proposal,
}

/// One kind of message.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TopicSurvey {
    /// Name, with the instance in brackets where the format has several.
    pub name: String,
    /// How many.
    pub messages: usize,
    /// How many of them are read: those of the longest stretch where the clock begins anew.
    pub messages_read: usize,
    /// First stamp, s, of the stretch that is read if the clock begins anew.
    pub from_s: Option<f64>,
    /// Last stamp of it, s.
    pub to_s: Option<f64>,
    /// Usual rate there, Hz.
    pub rate_hz: Option<f64>,
    /// Stretches without a message there.
    pub gaps: usize,
    /// The longest of them.
    pub longest_gap: Option<GapSurvey>,
    /// Its fields.
    pub fields: Vec<FieldSurvey>,
}

/// A stretch without a message.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GapSurvey {
    /// Last stamp before it, s.
    pub from_s: f64,
    /// First stamp after it, s.
    pub to_s: f64,
}

/// One field.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FieldSurvey {
    /// What a column map writes as its `source`.
    pub source: String,
    /// Its unit, if the format or its name says one.
    pub unit: Option<String>,
    /// `format`, or `name`: then it is what the name claims.
    pub unit_from: Option<&'static str>,
    /// Numbers in it.
    pub samples: u64,
    /// Texts in it.
    pub texts: u64,
    /// Least number.
    pub min: Option<f64>,
    /// Greatest number.
    pub max: Option<f64>,
    /// The column that the proposed map makes of it.
    pub column: Option<String>,
}

/// How a log comes in.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Proposal {
    /// No map is needed.
    pub native: bool,
    /// Shipped maps that fit, as they stand behind `--columns`.
    pub shipped: Vec<String>,
    /// What stands in those for what only the user knows.
    pub examples: Vec<Example>,
    /// Those of them that give no measured response, for `kort convert`: there is nothing to compare a model with.
    pub without_response: Vec<String>,
    /// Commands and responses of those that never change in this log; such maps stand last.
    pub still: Vec<Still>,
    /// Where no shipped map fits: those that some of the log would come in by, and what they lack.
    pub incomplete: Vec<Incomplete>,
    /// A column map as TOML, made from names and units; to be checked by a person. None if nothing in the log looks
    /// like a column of kort.
    pub map: Option<String>,
    /// Where there is none: sources that have the name of a signal of a thruster, and one number throughout.
    pub unchanging: Vec<String>,
}

/// A value of a shipped map that is nothing but an example: the user must give another, or confirm it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Example {
    /// The map, as it stands behind `--columns`.
    pub map: String,
    /// What it asks for.
    pub key: String,
    /// The example.
    pub value: String,
    /// In words.
    pub meaning: String,
}

/// What a shipped map takes, and never changes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Still {
    /// The map, as it stands behind `--columns`.
    pub map: String,
    /// Our column.
    pub column: String,
    /// What it is made of.
    pub source: String,
    /// What that is throughout, as the log has it.
    pub value: f64,
}

/// A shipped map that has not all that it needs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Incomplete {
    /// As it stands behind `--columns`.
    pub map: String,
    /// Columns that it would make.
    pub has: Vec<String>,
    /// Columns that it must have, each with the source that is not in the log.
    pub lacks: Vec<Lack>,
}

/// What a shipped map lacks.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Lack {
    /// Our column.
    pub column: String,
    /// What it is made of.
    pub source: String,
}

/// Reads a log and says what is in it; `name` stands in errors.
///
/// # Errors
/// The log cannot be read; the error names the file, the place and what is allowed.
pub fn survey(name: &str, reader: impl Read) -> Result<Survey, RecordingError> {
    let log = formats::log(BufReader::with_capacity(1 << 16, reader), None)
        .map_err(|problem| RecordingError::new(name, problem))?;
    Ok(of(name, &log))
}

fn of(name: &str, log: &Log) -> Survey {
    let (proposal, chosen) = propose(log);
    // Without a map every column is read.
    let taken = |column: &usize| proposal.native || chosen.contains_key(&(0, *column));
    let lost_in = log.lost_in.iter().filter(|(column, _)| taken(column)).flat_map(|(_, lost)| lost);
    let said = |lost: &String| match proposal.native {
        true => format!("{lost}; a recording of kort is refused for it: leave such a cell empty"),
        false => lost.clone(),
    };
    let refused = |lost: &String| match proposal.native && lost.contains("are stamped no later") {
        true => format!("{lost}; a recording of kort is refused for it"),
        false => lost.clone(),
    };
    let losses = log.losses.iter().map(refused).chain(lost_in.map(said)).collect();
    let stretch = log.longest(0..log.topics.len());
    let topics: Vec<TopicSurvey> = log
        .topics
        .iter()
        .enumerate()
        .filter(|(_, topic)| !topic.stamps_s.is_empty() || topic.name.is_empty())
        .map(|(t, topic)| {
            topic_survey(topic, stretch, |f| chosen.get(&(t, f)).map(|name| (*name).to_string()))
        })
        .collect();
    let span = |topic: &TopicSurvey| topic.to_s.zip(topic.from_s).map(|(to, from)| to - from);
    Survey {
        schema: "kort.columns/1",
        file: name.into(),
        format: log.format,
        clock: log.clock,
        duration_s: topics.iter().filter_map(span).max_by(f64::total_cmp),
        resets: log.resets,
        topics,
        notes: log.notes.clone(),
        losses,
        proposal,
    }
}

fn topic_survey(topic: &Topic, stretch: usize, column: impl Fn(usize) -> Option<String>) -> TopicSurvey {
    let read_s = &topic.stamps_s[topic.stretch(stretch)];
    let (step_s, gaps) = steps(read_s);
    let longest = gaps.iter().max_by(|a, b| (a.1 - a.0).total_cmp(&(b.1 - b.0)));
    TopicSurvey {
        name: topic.name.clone(),
        messages: topic.stamps_s.len(),
        messages_read: read_s.len(),
        from_s: read_s.first().copied(),
        to_s: read_s.last().copied(),
        rate_hz: (step_s > 0.0).then(|| 1.0 / step_s),
        gaps: gaps.len(),
        longest_gap: longest.map(|(from_s, to_s)| GapSurvey { from_s: *from_s, to_s: *to_s }),
        fields: topic
            .fields
            .iter()
            .enumerate()
            .map(|(f, field)| field_survey(topic, field, column(f)))
            .collect(),
    }
}

fn field_survey(topic: &Topic, field: &Field, column: Option<String>) -> FieldSurvey {
    let (unit, unit_from) = match (&field.unit, names::unit_in(&field.name)) {
        (Some(unit), _) => (Some(unit.clone()), Some("format")),
        (None, Some(unit)) => (Some(unit.symbol.to_string()), Some("name")),
        (None, None) => (None, None),
    };
    FieldSurvey {
        source: topic.source(field),
        unit,
        unit_from,
        samples: field.samples,
        texts: field.texts,
        min: field.range.map(|range| range.0),
        max: field.range.map(|range| range.1),
        column,
    }
}
