//! What does a torque tell that was recorded on a dry shaft?
//!
//! On a dynamometer a transducer between motor and load measures what the load takes: without it nothing about the motor
//! can be told. Other logs call the drive's own estimate of its torque the same. Both are tried on the baseline, the
//! transducer's with either sign, and the likeliest stays.

use kort_thruster::rig::{Load, Rig};

use super::columns::varies;
use super::fill::{filled, linear};
use super::{Driving, Prepared, Series};

/// Signs of a transducer: as the columns have it, positive where the load brakes a shaft that turns ahead, and turned.
pub const SIGNS: [f64; 2] = [1.0, -1.0];

impl Prepared {
    /// Whether a recorded torque is the load of its shaft.
    pub fn is_loaded(&self) -> bool {
        self.stimulus.ticks.iter().any(|tick| tick.load_n_m != (0.0, 0.0))
    }

    /// Lays the recorded torque on the shaft as its load.
    fn with_load(&self, torque_n_m: &[f64], sign: f64) -> Self {
        let mut loaded = self.clone();
        let torque = filled(torque_n_m);
        let mut row = 0;
        for tick in &mut loaded.stimulus.ticks {
            while row + 2 < self.time_s.len() && self.time_s[row + 1] <= tick.time_s + 0.02 * self.tick_s {
                row += 1;
            }
            let at = |t: f64| sign * linear(&self.time_s, &torque, row, t);
            tick.load_n_m = (at(tick.time_s), at(tick.time_s + self.tick_s));
        }
        loaded
    }
}

/// The recordings with their measured torques as loads, where every one has them and the rig knows of no other load.
pub fn loaded(recordings: &[Prepared], series: &[Series], rig: &Rig, sign: f64) -> Option<Vec<Prepared>> {
    let dry = rig.propeller.is_none() && matches!(rig.load, Load::None);
    if !dry || recordings.iter().any(|r| r.driving == Driving::Speed) {
        return None;
    }
    let each = recordings.iter().zip(series).map(|(recording, one)| {
        let torque = one.column("torque_n_m").filter(|torque| varies(torque))?;
        Some(recording.with_load(torque, sign))
    });
    each.collect()
}

/// What was taken for true.
pub fn words(sign: f64) -> String {
    let turned = if sign < 0.0 {
        ", its sign turned: positive is asked to brake a shaft that turns ahead"
    } else {
        ""
    };
    format!(
        "torque_n_m is taken for what a load takes from the shaft, measured between the two{turned}; a motor without that load fits worse. Leave the column out if it is the drive's own estimate"
    )
}
