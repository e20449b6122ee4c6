//! What a live recording holds beside its signals.

use std::collections::BTreeMap;
use std::io::Read;

use mcap::records::Record;
use serde_json::Value;

use super::records;
use super::schemas::{ROWS, STATE};
use crate::error::Problem;

/// Channels of a live recording, by what they are read for.
#[derive(PartialEq, Eq)]
enum Channel {
    Signals,
    States,
}

/// Hands over every state with its time on the rows' axis, s. A file without its end is read as far as it goes.
pub(crate) fn states(input: impl Read, mut take: impl FnMut(f64, &[u8])) -> Result<(), Problem> {
    let (mut schemas, mut channels) = (BTreeMap::new(), BTreeMap::new());
    // The wall time of the rows' zero; the first row stands before the first state.
    let mut origin_ns = None;
    records(input, |record| {
        match record {
            Record::Schema { header, .. } => drop(schemas.insert(header.id, header.name)),
            Record::Channel(channel) => match schemas.get(&channel.schema_id).map(String::as_str) {
                Some(STATE) => drop(channels.insert(channel.id, Channel::States)),
                Some(ROWS) => drop(channels.insert(channel.id, Channel::Signals)),
                _ => {}
            },
            Record::Message { header, data } => match (channels.get(&header.channel_id), origin_ns) {
                (Some(Channel::Signals), None) => {
                    let row: Option<Value> = serde_json::from_slice(&data).ok();
                    let time_s = row.and_then(|row| row.get("time_s")?.as_f64()).unwrap_or(0.0);
                    origin_ns = Some(header.log_time.saturating_sub((time_s.max(0.0) * 1e9).round() as u64));
                }
                (Some(Channel::States), Some(origin_ns)) => {
                    take(header.log_time.saturating_sub(origin_ns) as f64 * 1e-9, &data);
                }
                _ => {}
            },
            _ => {}
        }
        Ok(())
    })
    .map(drop)
}
