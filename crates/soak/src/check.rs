//! Checks of a scenario's values: each message names the key, the value and what is allowed.

use crate::scenario::{CONTROL_RATES_HZ, Channel, LONGEST_S, Lie, Scenario, Segment};

impl Scenario {
    /// All values that cannot be meant.
    pub(crate) fn check(&self) -> Vec<String> {
        let mut wrong = Wrong::default();
        wrong.within("duration_s", self.duration_s, 1.0, LONGEST_S, "seconds: 3600 for an hour");
        // What must lie within the run is told once there is one.
        let run_s = if wrong.said.is_empty() { self.duration_s } else { f64::INFINITY };
        wrong.within("settle_s", self.settle_s, 0.0, 0.9 * run_s, "shorter than the run");
        let (slowest, fastest) = CONTROL_RATES_HZ.into_inner();
        wrong.within("control_rate_hz", self.control_rate_hz, slowest, fastest, "1000 is usual");
        wrong.within("seeds", f64::from(self.seeds), 1.0, 1000.0, "4 gives a first interval");
        wrong.within(
            "aim_of_plain",
            self.aim_of_plain,
            0.01,
            10.0,
            "0.5 for half the plain law's thrust error",
        );
        wrong.within("truth.spread", self.truth.spread, 0.0, 0.5, "0.05 for five percent");
        wrong.within("noise.thrust", self.noise.thrust, 0.0, 1.0, "share of the largest thrust");
        wrong.within("noise.flow", self.noise.flow, 0.0, 2.0, "share of the flow");
        wrong.within("noise.current", self.noise.current, 0.0, 1.0, "share of the current limit");
        if self.against_true_parameters
            && let Some(last) = self.truth.change.iter().map(|c| c.at_s).reduce(f64::max)
        {
            let hint = "what is scored must come after the last [[truth.change]], with time to adapt";
            wrong.within("settle_s", self.settle_s, last, 0.9 * run_s, hint);
        }
        if self.rig == std::path::Path::new("") {
            wrong.say("`rig` = \"\" names no rig\nhint: rig = \"../thrusters/t200.toml\", relative to the scenario's file");
        }
        if self.controllers.is_empty() {
            wrong.say(
                "`controllers` is empty\nhint: controllers = [\"velocity_servo\", \"model2_inversion\"]",
            );
        }
        if self.references.is_empty() {
            wrong.say("`reference` is missing: nothing is asked for\nhint: [[reference]] with kind = \"steps\", levels = [0.5, -0.5], hold_s = 3");
        }
        for (at, segment) in self.references.iter().enumerate() {
            wrong.within_table = format!("reference[{at}].");
            segment.check(&mut wrong);
        }
        wrong.within_table.clear();
        for (name, factor) in
            self.truth.factors.iter().chain(self.truth.change.iter().flat_map(|c| &c.factors))
        {
            wrong.within(
                &format!("truth factor of {}", name.name()),
                *factor,
                0.05,
                20.0,
                "a factor: 1.3 for 30 % more",
            );
        }
        let ambient = &self.ambient;
        wrong.within(
            "ambient.mean_m_s",
            ambient.mean_m_s,
            -5.0,
            5.0,
            "m/s, positive feeds the propeller ahead",
        );
        wrong.within("ambient.wave_std_m_s", ambient.wave_std_m_s, 0.0, 5.0, "m/s");
        if ambient.wave_std_m_s > 0.0 {
            wrong.within("ambient.wave_period_s", ambient.wave_period_s, 0.5, 60.0, "seconds: 8 for a sea");
        }
        if ambient.wander_std_m_s > 0.0 {
            wrong.within("ambient.wander_time_s", ambient.wander_time_s, 0.1, 1e6, "seconds");
        }
        for (time_s, speed_m_s) in &ambient.program {
            wrong.within(
                "time in ambient.program",
                *time_s,
                0.0,
                31.0 * 86_400.0,
                "seconds, then m/s: [10, 0.5]",
            );
            wrong.within("speed in ambient.program", *speed_m_s, -5.0, 5.0, "seconds, then m/s: [10, 0.5]");
        }
        if ambient.program.windows(2).any(|w| w[1].0 <= w[0].0) {
            wrong.say(
                "`ambient.program` has times that do not increase\nhint: [[0, 0.0], [10, 0.5], [20, 0.0]]",
            );
        }
        if let Some(depth) = &self.depth {
            wrong.within("depth.mean_m", depth.mean_m, 0.0, 11_000.0, "metres below the surface");
            wrong.within("depth.wave_std_m", depth.wave_std_m, 0.0, 20.0, "metres");
            if depth.wave_std_m > 0.0 {
                wrong.within(
                    "ambient.wave_period_s",
                    ambient.wave_period_s,
                    0.5,
                    60.0,
                    "the surface moves with it",
                );
            }
        }
        if let Some(hidden) = &self.hidden {
            hidden.check().into_iter().for_each(|words| wrong.say(&words));
        }
        self.check_events(run_s, &mut wrong);
        wrong.said
    }

    /// What happens at a time, for a while, again and again.
    fn check_events(&self, run_s: f64, wrong: &mut Wrong) {
        for (at, change) in self.truth.change.iter().enumerate() {
            wrong.within(
                &format!("truth.change[{at}].at_s"),
                change.at_s,
                0.0,
                run_s,
                "seconds, within duration_s",
            );
        }
        for (at, sag) in self.supply_sags.iter().enumerate() {
            wrong.spell(&format!("supply_sag[{at}]"), run_s, (sag.at_s, sag.for_s, sag.every_s));
            wrong.within(
                &format!("supply_sag[{at}].to"),
                sag.to,
                0.0,
                1.0,
                "share of the nominal supply: 0.8",
            );
        }
        for (at, fault) in self.sensor_faults.iter().enumerate() {
            let what = format!("sensor_fault[{at}]");
            let fitted = match fault.channel {
                Channel::ShaftSpeedRadS => None,
                Channel::CurrentA => Some(("current_a", "current", self.sensors.current)),
                Channel::ThrustN => Some(("thrust_n", "thrust", self.sensors.thrust)),
                Channel::FlowMS => Some(("flow_m_s", "flow", self.sensors.flow)),
            };
            if let Some((channel, key, false)) = fitted {
                wrong.say(&format!(
                    "`{what}.channel` = \"{channel}\", but `sensors.{key}` = false: what is not fitted cannot fail\nhint: take the fault away, or fit the sensor"
                ));
            }
            wrong.spell(&what, run_s, (fault.at_s, fault.for_s, fault.every_s));
            let hint = match fault.lie {
                Lie::Dropout | Lie::Stuck if fault.size.is_none() => continue,
                Lie::Dropout | Lie::Stuck => {
                    wrong.say(&format!(
                        "`{what}.size` means nothing for a dropout or a stuck sensor\nhint: leave it out"
                    ));
                    continue;
                }
                Lie::Bias => "what is added, share of full scale: 0.1",
                Lie::Spikes => "what is added to one reading in twenty, share of full scale: 0.5",
                Lie::Gain => "what the value is multiplied by: 1.2",
            };
            match fault.size {
                Some(size) => wrong.within(&format!("{what}.size"), size, -10.0, 10.0, hint),
                None => wrong.say(&format!("`{what}.size` is missing: this lie has a size\nhint: {hint}")),
            }
        }
        for (at, fault) in self.process_faults.iter().enumerate() {
            wrong.spell(&format!("process_fault[{at}]"), run_s, (fault.at_s, fault.for_s, fault.every_s));
        }
    }
}

/// What is wrong with a scenario's values.
#[derive(Default)]
struct Wrong {
    said: Vec<String>,
    /// Stands before each key.
    within_table: String,
}

impl Wrong {
    fn say(&mut self, words: &str) {
        self.said.push(words.to_owned());
    }

    fn within(&mut self, key: &str, value: f64, low: f64, high: f64, hint: &str) {
        if !(value >= low && value <= high) {
            let table = &self.within_table;
            self.say(&format!(
                "`{table}{key}` = {value} is outside what is allowed: {low} to {high}\nhint: {hint}"
            ));
        }
    }

    /// From when, for how long, and after what time again.
    fn spell(&mut self, what: &str, run_s: f64, (at_s, for_s, every_s): (f64, f64, Option<f64>)) {
        self.within(&format!("{what}.at_s"), at_s, 0.0, run_s, "seconds, within duration_s");
        self.within(&format!("{what}.for_s"), for_s, 1e-3, run_s, "seconds");
        if let Some(every_s) = every_s {
            let hint = "seconds from one beginning to the next, longer than for_s";
            self.within(&format!("{what}.every_s"), every_s, for_s, 1e9, hint);
        }
    }
}

impl Segment {
    fn check(&self, wrong: &mut Wrong) {
        let share = "shares of the largest thrust, -1 to 1";
        match self {
            Self::Steps { levels, hold_s, ramp_s } => {
                if levels.is_empty() {
                    let table = &wrong.within_table;
                    wrong.say(&format!("`{table}levels` is empty\nhint: levels = [0.5, -0.5]"));
                }
                wrong.within("hold_s", *hold_s, 0.01, 1e6, "seconds");
                // A hold that cannot be meant is no bound.
                let longest = if *hold_s > 0.0 { *hold_s } else { 1e6 };
                wrong.within("ramp_s", *ramp_s, 0.0, longest, "seconds, at most hold_s");
                levels.iter().for_each(|l| wrong.within("levels", *l, -1.0, 1.0, share));
            }
            Self::Sine { amplitude, offset, period_s, for_s } => {
                wrong.within("amplitude", *amplitude, 0.0, 1.0, share);
                wrong.within("offset", *offset, -1.0, 1.0, share);
                wrong.within("period_s", *period_s, 0.01, 1e6, "seconds");
                wrong.within("for_s", *for_s, 0.01, 1e7, "seconds");
            }
            Self::Dp { mean, std, time_s, for_s } => {
                wrong.within("mean", *mean, -1.0, 1.0, share);
                wrong.within("std", *std, 0.0, 1.0, share);
                wrong.within("time_s", *time_s, 0.05, 1e6, "seconds");
                wrong.within("for_s", *for_s, 0.1, 1e7, "seconds");
            }
            Self::Joystick { amplitude, for_s } => {
                wrong.within("amplitude", *amplitude, 0.0, 1.0, share);
                wrong.within("for_s", *for_s, 0.1, 1e7, "seconds");
            }
            Self::Replay { peak: Some(peak), .. } => wrong.within("peak", *peak, 0.0, 1.0, share),
            Self::Replay { column, .. } if !column.ends_with("_n") => wrong.say(&format!(
                "`{}column` = \"{column}\" of a replay is not in newtons and has no `peak`\nhint: peak = 0.8 stretches it to 0.8 of the largest thrust",
                wrong.within_table
            )),
            Self::Replay { .. } => {}
        }
    }
}
