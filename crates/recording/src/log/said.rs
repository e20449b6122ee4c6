//! What is said of how a log of messages became rows: rates, gaps, clocks, and what was left out.

use std::collections::BTreeMap;

use super::{Log, Topic, longest_is_read, steps};

/// A topic that begins and ends so much later than the rows is said to.
const SHIFT_S: f64 = 1.0;

/// What the clock's resets cost.
pub(super) fn other_stretches(log: &Log, grid: usize, stretch: usize) -> Option<String> {
    let topic = &log.topics[grid];
    let range = topic.stretch(stretch);
    let left_out = format!("{} messages of `{}`", topic.stamps_s.len() - range.len(), topic.name);
    longest_is_read(log.resets, &topic.stamps_s[range], &left_out)
}

/// Topics that are in the log and not in the map.
pub(super) fn unused(log: &Log, used: &[usize]) -> Vec<String> {
    let mut names: Vec<String> = left(log, used).map(|topic| topic.name.clone()).collect();
    if names.len() > 40 {
        let more = names.len() - 40;
        names.truncate(40);
        names.push(format!("and {more} more"));
    }
    names
}

fn rate(topic: &Topic, stretch: usize) -> String {
    let (step_s, _) = steps(&topic.stamps_s[topic.stretch(stretch)]);
    if step_s > 0.0 {
        format!("`{}` ({:.1} Hz)", topic.name, 1.0 / step_s)
    } else {
        format!("`{}`", topic.name)
    }
}

fn left<'l>(log: &'l Log, used: &'l [usize]) -> impl Iterator<Item = &'l Topic> {
    let topics = log.topics.iter().enumerate();
    topics.filter(|(place, t)| !used.contains(place) && !t.stamps_s.is_empty()).map(|(_, topic)| topic)
}

/// Topics in use beside the one whose messages are the rows.
fn beside(used: &[usize], grid: usize) -> Vec<usize> {
    let mut topics: Vec<usize> = used.iter().copied().filter(|topic| *topic != grid).collect();
    topics.sort_unstable();
    topics.dedup();
    topics
}

/// How several rates became one.
fn rows(log: &Log, used: &[usize], grid: usize, stretch: usize) -> String {
    let others = beside(used, grid);
    let mut text = format!(
        "{}, stamps are {}; the rows are the messages of {}",
        log.format,
        log.clock,
        rate(&log.topics[grid], stretch)
    );
    if !others.is_empty() {
        let names: Vec<String> = others.into_iter().map(|topic| rate(&log.topics[topic], stretch)).collect();
        text += &format!(
            ", beside them {}: a message belongs to the row nearest in time, half a row early or late at most; a command stands there until its next, a measured value in that row alone",
            names.join(", ")
        );
    }
    text
}

/// Gaps in a topic beside the one that makes the rows, whose gaps are those of the recording.
fn silence(topic: &Topic, stretch: usize) -> Option<String> {
    let (_, gaps) = steps(&topic.stamps_s[topic.stretch(stretch)]);
    let longest = gaps.iter().max_by(|a, b| (a.1 - a.0).total_cmp(&(b.1 - b.0)))?;
    let (name, count) = (&topic.name, gaps.len());
    Some(format!("{count} gap(s) in `{name}`, the longest from {:.3} to {:.3} s", longest.0, longest.1))
}

/// A topic that begins and ends as much later than the rows, or earlier, has another clock, or a logger of its own.
fn shifted(topic: &Topic, rows: &Topic, stretch: usize) -> Option<String> {
    let ends = |topic: &Topic| {
        let stamps_s = &topic.stamps_s[topic.stretch(stretch)];
        Some((*stamps_s.first()?, *stamps_s.last()?, steps(stamps_s).0))
    };
    let ((from, to, step_s), (rows_from, rows_to, _)) = (ends(topic)?, ends(rows)?);
    let (begin_s, end_s) = (from - rows_from, to - rows_to);
    let least_s = SHIFT_S.max(3.0 * step_s);
    if begin_s.abs() < least_s || (begin_s - end_s).abs() > least_s {
        return None;
    }
    let word = if begin_s > 0.0 { "later" } else { "earlier" };
    Some(format!(
        "`{}` begins {:.1} s and ends {:.1} s {word} than the rows: if its clock is another, its values stand so far off",
        topic.name,
        begin_s.abs(),
        end_s.abs()
    ))
}

/// Other instances of what the map takes, as a second speed controller beside the first, or the same frame on another bus.
fn kin(log: &Log, used: &[usize]) -> Option<String> {
    let of_bus = |name: &str| name.rsplit(':').next().unwrap_or_default().to_owned();
    let base = |name: &str| of_bus(name).split('[').next().unwrap_or_default().to_owned();
    let mine: Vec<String> = used.iter().map(|place| base(&log.topics[*place].name)).collect();
    let others: Vec<String> = left(log, used)
        .filter(|topic| mine.contains(&base(&topic.name)))
        .map(|topic| format!("`{}`", topic.name))
        .collect();
    (!others.is_empty())
        .then(|| format!("the log also has {}, which the map does not take", others.join(", ")))
}

/// Measured values that no row is near to: in gaps of the rows, or before the first and behind the last of them.
pub(super) fn far(log: &Log, count: &BTreeMap<usize, u64>) -> Vec<String> {
    let left_out = count.iter().filter(|(_, count)| **count > 0);
    left_out
        .map(|(topic, count)| {
            let name = &log.topics[*topic].name;
            format!("{count} message(s) of `{name}` lie further than half a row from every row, as in a gap of the rows, and are left out")
        })
        .collect()
}

/// What a reader should know of how the log became rows.
pub(super) fn notes(log: &Log, used: &[usize], grid: usize, stretch: usize) -> Vec<String> {
    let mut notes = vec![rows(log, used, grid, stretch)];
    for place in beside(used, grid) {
        let topic = &log.topics[place];
        notes.extend(silence(topic, stretch));
        notes.extend(shifted(topic, &log.topics[grid], stretch));
    }
    notes.extend(kin(log, used));
    notes
}
