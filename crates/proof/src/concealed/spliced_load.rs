//! The load of another run of the same rig is spliced in: where its driver exceeds its mean, so much more
//! is recorded here, while the shaft answers as it did.

use super::columns::{between, cells, driver, full_scale, held};
use super::{Change, Expected, Made};

/// Share of full scale.
const SHARE: f64 = 0.25;

/// The change.
pub const CHANGE: Change = Change {
    name: "spliced_load",
    make: |recording, other| {
        let name = driver(recording).filter(|name| *name != "duty_cmd")?;
        let load = held(other.column(name)?);
        if load.len() < 2 || held(recording.column(name)?) == load {
            return None;
        }
        let (time_s, start) = (recording.time_s.clone(), *recording.time_s.first()?);
        let begin = *other.time_s.first()?;
        let span = other.time_s.last()? - begin;
        let mean = load.iter().sum::<f64>() / load.len() as f64;
        let apart: Vec<f64> = load.iter().map(|value| value - mean).collect();
        let cells = cells(recording, name)?;
        let scale = SHARE * full_scale(cells) / full_scale(&apart).max(1e-12);
        for (cell, time) in cells.iter_mut().zip(time_s) {
            *cell += scale * between(&other.time_s, &apart, begin + (time - start) % span);
        }
        Some(Made {
            what: format!("{name} with {:.0} % of another run's load in it", 100.0 * SHARE),
            expects: Expected::Nameless(&["shaft", "drive"], &[]),
        })
    },
};
