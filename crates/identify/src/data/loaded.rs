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

/// The recordings with their measured torques as loads, where the rig knows of no other: one that has none ran without a
/// load, as far as anybody says.
pub fn loaded(recordings: &[Prepared], series: &[Series], rig: &Rig, sign: f64) -> Option<Vec<Prepared>> {
    let dry = rig.propeller.is_none() && matches!(rig.load, Load::None);
    if !dry || recordings.iter().any(|r| r.driving == Driving::Speed) {
        return None;
    }
    let torque =
        |one: &'_ Series| one.column("torque_n_m").filter(|torque| varies(torque)).map(<[f64]>::to_vec);
    let torques: Vec<Option<Vec<f64>>> = series.iter().map(torque).collect();
    torques.iter().any(Option::is_some).then(|| {
        let each = recordings.iter().zip(&torques);
        each.map(|(recording, torque)| match torque {
            Some(torque) => recording.with_load(torque, sign),
            None => recording.clone(),
        })
        .collect()
    })
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_without_the_column_ran_without_a_load() {
        let rig = Rig::from_toml(
            "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 1.0\n\
             [amplifier]\nkind = \"current\"\n[sensors]\n",
        )
        .unwrap();
        let wave = |by: f64| (0..500).map(|k| by * (0.05 * f64::from(k)).sin()).collect::<Vec<f64>>();
        let run = |torque: bool| Series {
            name: "run".into(),
            time_s: (0..500).map(|k| 0.01 * f64::from(k)).collect(),
            columns: [("current_cmd_a", 2.0), ("shaft_speed_rad_s", 20.0), ("torque_n_m", 0.5)]
                .into_iter()
                .filter(|(name, _)| torque || *name != "torque_n_m")
                .map(|(name, by)| (name.to_owned(), wave(by)))
                .collect(),
        };
        let series = [run(true), run(false)];
        let runs: Vec<Prepared> = series.iter().map(|one| Prepared::new(one, &rig, false).unwrap()).collect();
        let with = loaded(&runs, &series, &rig, 1.0).unwrap();
        assert_eq!(with.iter().map(Prepared::is_loaded).collect::<Vec<_>>(), [true, false]);
        assert!(loaded(&runs[1..], &series[1..], &rig, 1.0).is_none(), "nothing was recorded of a load");
    }
}
