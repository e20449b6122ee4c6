//! May a pendulum go over its top?
//!
//! Near the top a small difference decides on which side a pendulum comes down, and by which way round: what is then
//! left of a free run says nothing of the physics that is missing. A recorded one that swings below may go over all the
//! same in every simulation of a rig whose friction is not stated. Such a recording is compared with an observer.

use kort_thruster::rig::Load;

use crate::data::{OBSERVER_RAD_S, Prepared};
use crate::hypothesis::Hypothesis;
use crate::simulate::Problem;

/// Angle of a pendulum near its top, rad.
pub const TOP_RAD: f64 = 0.9 * std::f64::consts::PI;

/// Most steps of the baseline's fit.
const STEPS: usize = 24;

/// What an observer beside the baseline's fit leads to.
pub(crate) struct Led {
    /// The recordings, with an observer on each pendulum that goes over its top without one.
    pub recordings: Vec<Prepared>,
    /// Values of the baseline's free numbers.
    pub values: Vec<f64>,
}

impl Problem<'_> {
    /// Fits a pendulum's baseline beside an observer; none where nothing hangs.
    pub(crate) fn led(&self, baseline: &Hypothesis) -> Option<Led> {
        if !matches!(self.rig.load, Load::Pendulum { .. }) {
            return None;
        }
        let mut observed = self.clone();
        observed.recordings.iter_mut().for_each(|r| r.observer_rad_s = OBSERVER_RAD_S);
        let fit = observed.settle_from_stated(baseline, STEPS);
        let mut recordings = self.recordings.clone();
        for (recording, rows) in recordings.iter_mut().zip(&self.rows(&fit.hypothesis, &fit.values)) {
            if !rows.iter().all(|shown| shown.shaft_angle_rad.abs() < TOP_RAD) {
                recording.observer_rad_s = OBSERVER_RAD_S;
            }
        }
        Some(Led { recordings, values: fit.values })
    }
}

#[cfg(test)]
mod tests {
    use kort_thruster::models::ModelName;
    use kort_thruster::rig::Rig;

    use crate::data::Series;
    use crate::noise::Criterion;
    use crate::setup::Setup;

    /// A servo whose gear rubs by so much lifts a pendulum of 0.48 N m by a slow ramp to a torque, keeps it there for
    /// three seconds and gives half.
    fn recorded(top_n_m: f64, friction_n_m: f64) -> Series {
        const KT: f64 = 0.35;
        const OHM: f64 = 3.5;
        let (inertia, weight_n_m, dt) = (0.0064, 0.4805, 1e-4);
        let (mut angle, mut speed) = (0.0_f64, 0.0_f64);
        let mut columns = vec![Vec::new(), Vec::new()];
        for k in 0..90_000 {
            let t = k as f64 * dt;
            let part = if t < 6.0 { (t / 3.0).min(1.0) } else { 0.5 };
            let volt = part * top_n_m * OHM / KT;
            if k % 50 == 0 {
                columns[0].push(volt);
                columns[1].push(angle);
            }
            speed += (KT * (volt - KT * speed) / OHM - weight_n_m * angle.sin()) / inertia * dt;
            let held = friction_n_m / inertia * dt;
            speed = speed.signum() * (speed.abs() - held).max(0.0);
            angle += speed * dt;
        }
        let names = ["voltage_cmd_v", "shaft_angle_rad"];
        Series {
            name: "log".into(),
            time_s: (0..columns[0].len()).map(|k| k as f64 * 50.0 * dt).collect(),
            columns: names.iter().map(|n| (*n).to_string()).zip(columns).collect(),
        }
    }

    /// Whether it is compared with an observer.
    fn kept(top_n_m: f64, friction_n_m: f64) -> bool {
        let rig = "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = { value = 0.0015, tol = 0.1 }\n\
                   torque_constant_nm_a = { value = 0.35, tol = 0.1 }\nwinding_resistance_ohm = { value = 3.5, tol = 0.1 }\n\
                   [amplifier]\nkind = \"voltage\"\nsupply_v = 8\n\
                   [load]\nkind = \"pendulum\"\nmass_kg = 0.49\nlength_m = 0.1\n";
        let rig = Rig::from_toml(rig).unwrap();
        let criterion =
            Criterion { form_error: 0.03, own_form_error: 0.2, facts_a_band: 10.0, timing_s: 0.001 };
        let recorded = [recorded(top_n_m, friction_n_m)];
        let setup = Setup::new(&recorded, &rig, ModelName::Model2, criterion).unwrap();
        setup.problem.recordings[0].observer_rad_s > 0.0
    }

    #[test]
    fn a_pendulum_that_only_its_friction_keeps_below_is_observed() {
        assert!(kept(0.7, 0.3), "without friction it goes over its top");
        assert!(!kept(0.3, 0.05), "its drive cannot lift it there");
    }
}
