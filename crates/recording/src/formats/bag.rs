//! A ROS 2 bag in sqlite (`.db3`), by SQLite itself: tables `topics`, `messages` and, from ROS 2 Iron on,
//! `message_definitions`.

use std::collections::{BTreeMap, HashMap};
use std::io::BufRead;

use rusqlite::config::DbConfig;
use rusqlite::{Connection, Row};

use super::cdr::Layout;
use super::ros::{Topic, usual};
use super::stream::whole;
use crate::error::Problem;
use crate::log::{Gather, Log};

/// How a file of SQLite begins.
pub(super) const MAGIC: &[u8] = b"SQLite format 3\0";
const NAME: &str = "ROS 2 bag (sqlite)";
/// Largest bag, bytes: it is held in memory whole.
const BYTES_MAX: u64 = 4 << 30;
/// Where a file's header says that newest changes may stand in a second file, and what says they do not.
const JOURNAL: std::ops::Range<usize> = 18..20;
const NO_WAL: u8 = 1;

/// The messages of every topic that can be read, by their time of receipt.
pub(super) fn log(input: impl BufRead, wanted: Option<&[String]>) -> Result<Log, Problem> {
    let (mut data, torn) = whole(input.take(BYTES_MAX + 1));
    if data.len() as u64 > BYTES_MAX {
        return Err(broken(format!(
            "it has more than {} GiB, which kort does not hold in memory; `ros2 bag convert` with a list of topics makes a smaller one",
            BYTES_MAX >> 30
        )));
    }
    let mut gather = Gather::new(NAME, "times of receipt from the first message on", wanted);
    for byte in data.get_mut(JOURNAL).into_iter().flatten() {
        if *byte != NO_WAL {
            *byte = NO_WAL;
        }
    }
    torn.into_iter().for_each(|why| gather.loss(why));
    if read(&data, &mut gather).map_err(|error| broken(error.to_string()))? {
        return Err(super::ZSTD_MESSAGES);
    }
    let log = gather.finish();
    if log.topics.is_empty() {
        return Err(Problem::NoChannel { found: log.notes.join("; ") });
    }
    Ok(log)
}

fn broken(message: String) -> Problem {
    Problem::Broken { format: NAME, message }
}

/// Hands over every message; true, and none, if they are packed.
fn read(data: &[u8], gather: &mut Gather<'_>) -> rusqlite::Result<bool> {
    let mut bag = Connection::open_in_memory()?;
    bag.deserialize_read_exact("main", data, data.len(), true)?;
    // SQLite's own way to a file that is shorter than its header says: it is read up to where it ends.
    bag.set_db_config(DbConfig::SQLITE_DBCONFIG_WRITABLE_SCHEMA, true)?;
    let mut topics = topics(&bag, gather)?;
    let (mut start_ns, mut read, mut bad) = (None, 0_u64, 0_u64);
    let mut messages = bag.prepare("SELECT topic_id, timestamp, data FROM messages ORDER BY id")?;
    let mut rows = messages.query([])?;
    loop {
        let (topic, stamp_ns, message) = match rows.next().and_then(|row| row.map(message).transpose()) {
            Ok(Some(found)) => found,
            Ok(None) => break,
            // What came before the damage is told.
            Err(error) if read > 0 => {
                gather.loss(format!(
                    "the bag is damaged behind message {read} ({error}); what follows is lost"
                ));
                break;
            }
            Err(error) => return Err(error),
        };
        let Some(topic) = topics.get_mut(&topic) else { continue };
        let start_ns = *start_ns.get_or_insert(stamp_ns);
        let stamp_s = (i128::from(stamp_ns) - i128::from(start_ns)) as f64 * 1e-9;
        if message.starts_with(super::ZSTD) {
            return Ok(true);
        }
        read += 1;
        bad += u64::from(!topic.message(gather, stamp_s, message));
    }
    let by_number: BTreeMap<_, _> = topics.iter().collect();
    for topic in by_number.into_values() {
        gather.losses(topic.losses());
    }
    if bad > 0 {
        gather.loss(format!("{bad} message(s) do not fit their type and were skipped"));
    }
    Ok(false)
}

/// Topic, time of receipt in nanoseconds, and bytes.
fn message<'r>(row: &'r Row<'_>) -> rusqlite::Result<(i64, i64, &'r [u8])> {
    Ok((row.get(0)?, row.get(1)?, row.get_ref(2)?.as_bytes().unwrap_or_default()))
}

/// The topics by their number; those whose messages cannot be read are named.
fn topics(bag: &Connection, gather: &mut Gather<'_>) -> rusqlite::Result<HashMap<i64, Topic>> {
    let mut described: HashMap<String, String> = HashMap::new();
    if bag.table_exists(None, "message_definitions")? {
        let mut all = bag.prepare(
            "SELECT topic_type, encoded_message_definition FROM message_definitions WHERE encoding = 'ros2msg'",
        )?;
        for one in all.query_map([], |row| Ok((row.get(0)?, row.get(1)?)))? {
            let (kind, text): (String, String) = one?;
            described.insert(kind, text);
        }
    }
    let mut all = bag.prepare("SELECT id, name, type, serialization_format FROM topics ORDER BY id")?;
    let named = |row: &Row<'_>| Ok((row.get(0)?, row.get(1)?, row.get(2)?, row.get(3)?));
    let (mut found, mut others) = (HashMap::new(), Vec::new());
    for one in all.query_map([], named)? {
        let (id, name, kind, format): (i64, String, String, String) = one?;
        let layout = match described.get(&kind) {
            _ if format != "cdr" => Err(format!("{format}, not cdr")),
            Some(text) => Layout::parse(&kind, text),
            None => usual(&kind).ok_or_else(|| format!("{kind}, which the bag does not describe")),
        };
        match layout {
            Ok(layout) => {
                found.insert(id, Topic::new(gather, &name, layout));
            }
            Err(why) => others.push(format!("{name} ({why})")),
        }
    }
    if !others.is_empty() {
        gather.note(format!("topics that kort does not read are left out: {}", others.join(", ")));
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bag_with_packed_messages_is_refused_in_words() {
        let bag = Connection::open_in_memory().unwrap();
        bag.execute_batch(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT);
             CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB);
             INSERT INTO topics VALUES(1, '/joint_states', 'sensor_msgs/msg/JointState', 'cdr');
             INSERT INTO messages VALUES(1, 1, 0, x'28b52ffd200000');",
        )
        .unwrap();
        let data = bag.serialize("main").unwrap();
        let refused = log(&data[..], None).unwrap_err();
        assert!(refused.to_string().contains("message by message"), "{refused}");
        assert!(refused.hint().contains("ros2 bag convert"), "{refused}");
    }
}
