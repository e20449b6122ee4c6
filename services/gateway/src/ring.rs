//! The last minutes of a thruster, always at hand and bounded: what a diagnosis is made of when nobody recorded.
//!
//! A thread of its own keeps them: the bus hands rows over and never waits, and whoever takes a copy keeps nobody.

use std::collections::VecDeque;
use std::io;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

use kort_proto::messages::{ControllerState, Telemetry};
use kort_proto::signals::Signals;
use tokio::sync::oneshot;

use crate::estimates::{Estimates, KeptEstimates};
use crate::settings::DiagnosisLimits;
use crate::thin::Thin;

/// Rows that may wait: some seconds.
const QUEUE: usize = 2048;
/// So often estimates are kept, ns: as often as recordings keep them.
const ESTIMATES_EVERY_NS: u64 = 100_000_000;

/// A row: the servo's time on CLOCK_MONOTONIC, ns, and every signal.
pub type Row = (u64, Signals);

/// A row as it is kept, in two thirds of the room. Seven digits are more than any sensor has, but for the angle, which grows with every turn.
#[derive(Clone, Copy)]
struct Kept {
    time_ns: u64,
    shaft_angle_rad: f64,
    values: [f32; Signals::COUNT],
}

impl Kept {
    fn new((time_ns, signals): &Row) -> Self {
        let values = signals.values().map(|value| value as f32);
        Self { time_ns: *time_ns, shaft_angle_rad: signals.shaft_angle_rad, values }
    }

    fn row(&self) -> Row {
        let signals = Signals::from_values(self.values.map(f64::from));
        (self.time_ns, Signals { shaft_angle_rad: self.shaft_angle_rad, ..signals })
    }
}

/// What the ring's thread is given.
enum Item {
    Row(Row),
    /// What the controller says, at the servo's time.
    State(Box<(u64, ControllerState)>),
    /// The rows of the last so many ns, please.
    Take(u64, oneshot::Sender<Vec<Row>>),
    /// The estimates of the last so many ns, so many a second, please.
    Estimates(u64, f64, oneshot::Sender<Estimates>),
}

/// The bus's end.
#[derive(Debug)]
pub struct Feed {
    thin: Thin,
    items: SyncSender<Item>,
    /// When estimates were last handed over, on the servo's clock.
    believed_ns: u64,
}

/// The end of whoever wants a copy.
#[derive(Clone, Debug)]
pub struct Ring {
    items: SyncSender<Item>,
}

/// Begins to keep a thruster's last minutes.
///
/// # Errors
/// The thread cannot be started.
pub fn start(limits: &DiagnosisLimits) -> io::Result<(Feed, Ring)> {
    let (items, inbox) = sync_channel(QUEUE);
    let (rows, span_ns) = (limits.ring_rows(), (limits.ring_time_s * 1e9) as u64);
    std::thread::Builder::new().name("ring".into()).spawn(move || keep(&inbox, rows, span_ns))?;
    Ok((Feed { thin: Thin::new(limits.ring_rate_hz), items: items.clone(), believed_ns: 0 }, Ring { items }))
}

impl Feed {
    /// What the controller says, at the servo's time; never waits.
    pub fn believe(&mut self, time_ns: u64, state: &ControllerState) {
        // An earlier time is another servo's clock.
        if time_ns < self.believed_ns || time_ns - self.believed_ns >= ESTIMATES_EVERY_NS {
            self.believed_ns = time_ns;
            let _ = self.items.try_send(Item::State(Box::new((time_ns, *state))));
        }
    }

    /// A sample of the servo; never waits.
    pub fn take(&mut self, telemetry: &Telemetry) {
        if let Some(row) = self.thin.take(telemetry.time_ns, &telemetry.signals) {
            let _ = self.items.try_send(Item::Row((telemetry.time_ns, row)));
        }
    }
}

impl Ring {
    /// A copy of the last so many seconds, oldest first; what there is, if that is less.
    pub async fn last(&self, time_s: f64) -> Vec<Row> {
        let (answer, rows) = oneshot::channel();
        match self.items.try_send(Item::Take((time_s * 1e9) as u64, answer)) {
            Ok(()) => rows.await.unwrap_or_default(),
            Err(_) => Vec::new(),
        }
    }

    /// The estimates of the last so many seconds, so many a second at most.
    pub async fn estimates(&self, time_s: f64, hz: f64) -> Estimates {
        let (answer, estimates) = oneshot::channel();
        match self.items.try_send(Item::Estimates((time_s * 1e9) as u64, hz, answer)) {
            Ok(()) => estimates.await.unwrap_or_default(),
            Err(_) => Estimates::default(),
        }
    }
}

fn keep(inbox: &Receiver<Item>, most: usize, span_ns: u64) {
    let mut rows: VecDeque<Kept> = VecDeque::with_capacity(most);
    let mut estimates = KeptEstimates::default();
    while let Ok(item) = inbox.recv() {
        match item {
            Item::Row(row) => {
                // A servo on another clock than the one before: what was kept has no place beside it.
                if rows.back().is_some_and(|last| row.0 <= last.time_ns) {
                    rows.clear();
                }
                while rows.len() >= most || rows.front().is_some_and(|first| row.0 - first.time_ns > span_ns)
                {
                    rows.pop_front();
                }
                rows.push_back(Kept::new(&row));
            }
            Item::State(state) => estimates.take(state.0, &state.1, span_ns),
            Item::Estimates(time_ns, hz, answer) => {
                let from_ns = rows.back().map_or(0, |last| last.time_ns.saturating_sub(time_ns));
                let _ = answer.send(estimates.since(from_ns, hz));
            }
            Item::Take(time_ns, answer) => {
                let from_ns = rows.back().map_or(0, |last| last.time_ns.saturating_sub(time_ns));
                let first = rows.partition_point(|kept| kept.time_ns < from_ns);
                let _ = answer.send(rows.range(first..).map(Kept::row).collect());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kept_row_is_the_row_but_for_what_no_sensor_sees() {
        let told = Signals { shaft_angle_rad: 123_456_789.012_3, current_a: 3.217_9, ..Signals::UNKNOWN };
        let (time_ns, signals) = Kept::new(&(7, told)).row();
        assert_eq!((time_ns, signals.shaft_angle_rad), (7, told.shaft_angle_rad));
        assert!((signals.current_a - told.current_a).abs() < 1e-6 && signals.thrust_n.is_nan());
        assert!(size_of::<Kept>() * 3 < size_of::<Row>() * 2, "{}", size_of::<Kept>());
    }

    #[tokio::test]
    async fn the_last_minutes_are_kept_and_no_more() {
        let limits = DiagnosisLimits { ring_time_s: 10.0, ring_rate_hz: 10.0, ..DiagnosisLimits::default() };
        let (mut feed, ring) = start(&limits).unwrap();
        assert!(ring.last(5.0).await.is_empty());
        let mut feed_from = |seconds: std::ops::Range<u64>| {
            for ms in (seconds.start * 1000..seconds.end * 1000).step_by(50) {
                feed.take(&Telemetry { time_ns: ms * 1_000_000, ..Telemetry::default() });
            }
        };
        feed_from(100..130);
        let rows = ring.last(5.0).await;
        assert_eq!((rows.len(), rows[0].0 / 1_000_000), (51, 124_900));
        assert_eq!(ring.last(1e6).await.len(), 100, "bounded");
        // A gap stays one: rows older than the span are gone.
        feed_from(200..202);
        assert_eq!(ring.last(1e6).await.len(), 20);
        // The machine was started anew.
        feed_from(1..2);
        assert_eq!(ring.last(1e6).await.len(), 10);
    }
}
