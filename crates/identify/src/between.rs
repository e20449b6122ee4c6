//! What does that which drives do between its samples?
//!
//! A log that is slower than the drive's control tells what was commanded, or what flowed, at its rows only. Where
//! this changes smoothly, or in steps that find their tick, nothing is lost; in a closed loop that answers its
//! sensor's noise, or kicks at a change of its set-point between two rows, much is. No hypothesis is held to account
//! for what that does: two courses are simulated that the samples allow alike, and the mean square of their
//! difference is part of the noise floor. So is that of a third, where what drives was measured, see [`crate::misread`].

use std::sync::Arc;

use kort_thruster::plant::Driven;

use crate::data::{Driving, Prepared};
use crate::hypothesis::{Hypothesis, Inputs};
use crate::simulate::Problem;

/// Draws from 0 to 1 that fill it evenly and beat with nothing: multiples of the golden section, less the whole ones.
pub fn evenly(k: usize) -> f64 {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    (k as f64 * GOLDEN).fract()
}

/// Share of the change from a sample to the next that the samples about it do not foretell: none where they lie on a
/// parabola, all in noise and at a jump. By eight times what the two parabolas through three of them differ midway.
fn unforetold(time_s: &[f64], values: &[f64], row: usize) -> f64 {
    // At the ends as in the interval beside.
    let from = row.clamp(1, values.len() - 3);
    let rise = |a: usize, b: usize| (values[b] - values[a]) / (time_s[b] - time_s[a]);
    let before = (rise(from, from + 1) - rise(from - 1, from)) / (time_s[from + 1] - time_s[from - 1]);
    let after = (rise(from + 1, from + 2) - rise(from, from + 1)) / (time_s[from + 2] - time_s[from]);
    let bent = 2.0 * (after - before) * (time_s[from + 1] - time_s[from]).powi(2);
    if bent == 0.0 { 0.0 } else { (bent / (values[from + 1] - values[from])).abs().min(1.0) }
}

impl Problem<'_> {
    /// What the response owes to how that which drives runs between its samples, which nobody recorded, and to what its
    /// sensor misreads: mean square by band of the difference that another course makes which the samples allow as well.
    pub(crate) fn doubt_of_drivers(&self) -> Option<Vec<f64>> {
        let inputs = Inputs::new(&self.recordings, self.recordings.iter().map(Prepared::halfway).collect());
        let stated = || Hypothesis {
            effects: Vec::new(),
            free: Vec::new(),
            start: Vec::new(),
            inputs: Arc::new(inputs.clone()),
        };
        let at = self.doubted_at.clone().unwrap_or_else(stated);
        let lines = |problem: &Problem, inputs: Inputs| {
            problem.residual_lines(&Hypothesis { inputs: Arc::new(inputs), ..at.clone() }, &at.start)
        };
        let straight = lines(self, inputs.clone());
        let difference_of = |course: fn(&mut Prepared, &mut [f64])| {
            let (mut other, mut inputs) = (self.clone(), inputs.clone());
            for (recording, commands) in other.recordings.iter_mut().zip(&mut inputs.commands) {
                course(recording, commands);
            }
            self.spectrum.powers(&(&straight - lines(&other, inputs)))
        };
        let mut powers = difference_of(Prepared::drive_otherwise);
        if self.recordings.iter().any(Prepared::is_driven_by_a_sensor) {
            let misread = difference_of(Prepared::misread);
            powers.iter_mut().zip(misread).for_each(|(power, misread)| *power += misread);
        }
        if powers.iter().any(|power| !power.is_finite()) {
            return None;
        }
        // No more than the signal is in doubt.
        let signals = self.spectrum.bands.iter().map(|band| band.signal);
        Some(powers.into_iter().zip(signals).map(|(power, signal)| power.min(signal)).collect())
    }
}

impl Prepared {
    /// Ticks before its row at which each step lies halfway between rows.
    fn halfway(&self) -> Vec<f64> {
        self.edges.iter().map(|row| (self.ticks_before(*row) / 2) as f64).collect()
    }

    /// What drives, on another course that its samples allow as well: from sample to sample by a jump at an instant
    /// drawn for each interval, as far as the samples about it do not foretell its course. `commands` are those of
    /// the control grid; steps that have a tick of their own stay where they are, their returns not, and a command that is logged
    /// whenever it changes leaves nothing open but the supply that its duty is a share of, where that was read less often: it
    /// may stand from sample to sample.
    fn drive_otherwise(&mut self, commands: &mut [f64]) {
        let logged = self.every_command || self.ticks_per_row < 2;
        let leaves_nothing = logged && matches!(self.driving, Driving::Command(_));
        let values = if self.driving == Driving::Speed { &self.speed_between } else { &self.command };
        let n = values.len();
        let halfway = self.halfway();
        let mut row = 0;
        for (tick, command) in self.stimulus.ticks.iter_mut().zip(commands) {
            while row + 2 < n && self.time_s[row + 1] <= tick.time_s + 0.02 * self.tick_s {
                row += 1;
            }
            let step = self.edges.binary_search(&(row + 1)).ok();
            if let Some(step) = step {
                // From a step on the command stands, or returns.
                let remaining = ((self.time_s[row + 1] - tick.time_s) / self.tick_s).round();
                if remaining <= halfway[step] {
                    *command = self.command[row + 1];
                }
            }
            *command *= self.supply_held.get(row).unwrap_or(&1.0);
            if leaves_nothing || step.is_some() {
                continue;
            }
            let (from, to) = (values[row], values[row + 1]);
            let (start_s, end_s) = (self.time_s[row], self.time_s[row + 1]);
            let u = ((tick.time_s + 0.5 * self.tick_s - start_s) / (end_s - start_s)).clamp(0.0, 1.0);
            let straight = from + (to - from) * u;
            let jumped = if u < evenly(row) { from } else { to };
            let aside = unforetold(&self.time_s, values, row) * (jumped - straight);
            *command += aside;
            let mean = |a: f64, b: f64| 0.5 * (a + b) + aside;
            tick.driven = match tick.driven {
                Driven::Speed(a, b) => Driven::Speed(mean(a, b), mean(a, b)),
                Driven::Power(a, b) => Driven::Power(mean(a, b), mean(a, b)),
                by_command => by_command,
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use kort_thruster::models::ModelName;
    use kort_thruster::rig::Rig;

    use super::unforetold;
    use crate::data::Series;
    use crate::noise::Criterion;
    use crate::setup::Setup;

    const RIG: &str = "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 1.0\n\
                       viscous_friction_nm_s = 0.1\n[amplifier]\nkind = \"current\"\n[sensors]\n";

    #[test]
    fn a_parabola_is_foretold_and_a_jump_is_not() {
        let even: Vec<f64> = (0..8).map(|k| 0.1 * f64::from(k)).collect();
        // Logged when there was time to.
        let uneven = [0.0, 0.018, 0.038, 0.054, 0.088, 0.104, 0.12, 0.13];
        for time_s in [&even[..], &uneven] {
            let parabola: Vec<f64> = time_s.iter().map(|t| 1.0 + 3.0 * t - 50.0 * t * t).collect();
            assert!((0..7).all(|row| unforetold(time_s, &parabola, row) < 1e-9));
            assert_eq!(unforetold(time_s, &[1.0, 1.0, 1.0, 3.0, 3.0, 3.0], 2), 1.0);
            assert_eq!(unforetold(time_s, &[1.0, 1.0, 1.0, 1.0], 1), 0.0, "what holds goes nowhere");
        }
    }

    /// Doubt of the shaft's speed over its full scale, root mean square, of 20 s logged at 100 Hz.
    fn doubt(column: &str, control_rate_hz: f64, of: impl Fn(usize) -> f64) -> f64 {
        let rows = 2000;
        let columns = vec![
            (column.into(), (0..rows).map(&of).collect()),
            ("shaft_speed_rad_s".into(), (0..rows).map(|k| 10.0 * (k as f64 * 0.01).sin()).collect()),
        ];
        let time_s = (0..rows).map(|k| 0.01 * k as f64).collect();
        let rig = Rig::from_toml(&format!("{RIG}control_rate_hz = {control_rate_hz}\n")).unwrap();
        let criterion =
            Criterion { form_error: 0.01, own_form_error: 0.1, facts_a_band: 10.0, timing_s: 0.001 };
        let series = [Series { name: "log".into(), time_s, columns }];
        let problem = Setup::new(&series, &rig, ModelName::Model2, criterion).unwrap().problem;
        let powers = problem.doubt_of_drivers().expect("the simulation holds");
        powers.iter().sum::<f64>().sqrt()
    }

    #[test]
    fn a_supply_read_less_often_than_the_rows_is_in_doubt_between() {
        let duty = |every: usize, dips: f64| {
            let rows = 2000;
            let at = |k: usize| 0.01 * k as f64;
            let steps = |k: usize| if (k / 100).is_multiple_of(2) { 0.8 } else { 0.2 };
            let supply = (0..rows).map(|k| {
                let shown = 16.0 - dips * steps(k);
                if k.is_multiple_of(every) { shown } else { f64::NAN }
            });
            let columns = vec![
                ("duty_cmd".into(), (0..rows).map(steps).collect()),
                ("supply_v".into(), supply.collect()),
                ("shaft_speed_rad_s".into(), (0..rows).map(|k| 10.0 * at(k).sin()).collect()),
            ];
            let rig = RIG.replace("current", "voltage").replace("[sensors]", "supply_v = 16\n[sensors]")
                + "control_rate_hz = 100\n";
            let rig = Rig::from_toml(&rig.replace("[amplifier]", "winding_resistance_ohm = 10\n[amplifier]"))
                .unwrap();
            let series = [Series { name: "log".into(), time_s: (0..rows).map(at).collect(), columns }];
            let criterion =
                Criterion { form_error: 0.01, own_form_error: 0.1, facts_a_band: 10.0, timing_s: 0.001 };
            let problem = Setup::new(&series, &rig, ModelName::Model2, criterion).unwrap().problem;
            problem.doubt_of_drivers().expect("the simulation holds").iter().sum::<f64>().sqrt()
        };
        assert!(duty(30, 4.0) > 1e-3);
        assert!(duty(1, 4.0) < 1e-9, "every row has its own");
        assert!(duty(30, 0.0) < 1e-9, "a stiff supply hides nothing");
    }

    fn rough(k: usize) -> f64 {
        (k as f64 * 0.01).sin() + 0.5 * ((k * k * 7919) as f64 * 0.37).sin()
    }

    #[test]
    fn a_rough_command_logged_slower_than_it_changes_is_in_doubt() {
        assert!(doubt("current_cmd_a", 500.0, rough) > 1e-3);
        assert!(doubt("current_a", 500.0, rough) > 1e-3, "and so is a current");
    }

    #[test]
    fn what_a_sensor_of_that_which_drives_misreads_is_in_doubt() {
        let noisy = |k: usize| (k as f64 * 0.01).sin() + 0.02 * ((k * k * 7919) as f64 * 0.37).sin();
        assert!(doubt("current_a", 100.0, noisy) > 1e-4);
        assert_eq!(doubt("current_cmd_a", 100.0, noisy), 0.0, "a command is what it says");
    }

    #[test]
    fn a_smooth_one_a_stepped_one_and_one_logged_every_tick_are_not() {
        let smooth = |k: usize| (k as f64 * 0.05).sin();
        let stepped = |k: usize| f64::from((k / 150) as u8 % 3) - 1.0;
        let (calm, wild) = (doubt("current_cmd_a", 500.0, smooth), doubt("current_cmd_a", 500.0, rough));
        assert!(calm < 0.003 * wild, "{calm} beside {wild}");
        assert_eq!(doubt("current_cmd_a", 500.0, stepped), 0.0);
        assert_eq!(doubt("current_a", 500.0, stepped), 0.0, "a measured jump finds its tick as well");
        assert_eq!(doubt("current_cmd_a", 100.0, rough), 0.0, "nothing is between the ticks");
    }
}
