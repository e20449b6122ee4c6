//! Checks of a scenario's values: each message names the key, the value and what is allowed.

use crate::scenario::{Lie, Scenario, Segment};

impl Scenario {
    /// Whether every value is one that can be meant.
    pub(crate) fn check(&self) -> Result<(), String> {
        let within = |key: &str, value: f64, low: f64, high: f64, hint: &str| {
            if value >= low && value <= high {
                Ok(())
            } else {
                Err(format!("`{key}` = {value} is outside what is allowed: {low} to {high}\nhint: {hint}"))
            }
        };
        within("duration_s", self.duration_s, 1.0, 31.0 * 86_400.0, "seconds: 3600 for an hour")?;
        within("settle_s", self.settle_s, 0.0, 0.9 * self.duration_s, "shorter than the run")?;
        within("control_rate_hz", self.control_rate_hz, 50.0, 10_000.0, "1000 is usual")?;
        within("seeds", f64::from(self.seeds), 1.0, 1000.0, "4 gives a first interval")?;
        within("aim_of_plain", self.aim_of_plain, 0.01, 10.0, "0.5 for half the plain law's thrust error")?;
        within("truth.spread", self.truth.spread, 0.0, 0.5, "0.05 for five percent")?;
        within("noise.thrust", self.noise.thrust, 0.0, 1.0, "share of the largest thrust")?;
        within("noise.flow", self.noise.flow, 0.0, 2.0, "share of the flow")?;
        within("noise.current", self.noise.current, 0.0, 1.0, "share of the current limit")?;
        if self.against_true_parameters
            && let Some(last) = self.truth.change.iter().map(|c| c.at_s).reduce(f64::max)
        {
            let hint = "what is scored must come after the last [[truth.change]], with time to adapt";
            within("settle_s", self.settle_s, last, 0.9 * self.duration_s, hint)?;
        }
        if self.controllers.is_empty() {
            return Err(
                "`controllers` is empty\nhint: controllers = [\"velocity_servo\", \"model2_inversion\"]"
                    .into(),
            );
        }
        if self.references.is_empty() {
            return Err("there is no [[reference]]\nhint: [[reference]] with kind = \"steps\", levels = [0.5, -0.5], hold_s = 3".into());
        }
        for segment in &self.references {
            segment.check(&within)?;
        }
        for (name, factor) in
            self.truth.factors.iter().chain(self.truth.change.iter().flat_map(|c| &c.factors))
        {
            within(
                &format!("truth factor of {}", name.name()),
                *factor,
                0.05,
                20.0,
                "a factor: 1.3 for 30 % more",
            )?;
        }
        let ambient = &self.ambient;
        within("ambient.mean_m_s", ambient.mean_m_s, -5.0, 5.0, "m/s, positive feeds the propeller ahead")?;
        within("ambient.wave_std_m_s", ambient.wave_std_m_s, 0.0, 5.0, "m/s")?;
        if ambient.wave_std_m_s > 0.0 {
            within("ambient.wave_period_s", ambient.wave_period_s, 0.5, 60.0, "seconds: 8 for a sea")?;
        }
        if ambient.wander_std_m_s > 0.0 {
            within("ambient.wander_time_s", ambient.wander_time_s, 0.1, 1e6, "seconds")?;
        }
        for (time_s, speed_m_s) in &ambient.program {
            within("time in ambient.program", *time_s, 0.0, 31.0 * 86_400.0, "seconds, then m/s: [10, 0.5]")?;
            within("speed in ambient.program", *speed_m_s, -5.0, 5.0, "seconds, then m/s: [10, 0.5]")?;
        }
        if ambient.program.windows(2).any(|w| w[1].0 <= w[0].0) {
            return Err(
                "`ambient.program` has times that do not increase\nhint: [[0, 0.0], [10, 0.5], [20, 0.0]]"
                    .into(),
            );
        }
        if let Some(depth) = &self.depth {
            within("depth.mean_m", depth.mean_m, 0.0, 11_000.0, "metres below the surface")?;
            within("depth.wave_std_m", depth.wave_std_m, 0.0, 20.0, "metres")?;
            if depth.wave_std_m > 0.0 {
                within(
                    "ambient.wave_period_s",
                    ambient.wave_period_s,
                    0.5,
                    60.0,
                    "the surface moves with it",
                )?;
            }
        }
        if let Some(hidden) = &self.hidden {
            hidden.check()?;
        }
        self.check_events(&within)
    }

    /// What happens at a time, for a while, again and again.
    fn check_events(&self, within: &Within) -> Result<(), String> {
        let spell = |what: &str, at_s: f64, for_s: f64, every_s: Option<f64>| {
            within(&format!("{what}.at_s"), at_s, 0.0, self.duration_s, "seconds, within duration_s")?;
            within(&format!("{what}.for_s"), for_s, 1e-3, self.duration_s, "seconds")?;
            every_s.map_or(Ok(()), |every_s| {
                let hint = "seconds from one beginning to the next, longer than for_s";
                within(&format!("{what}.every_s"), every_s, for_s, 1e9, hint)
            })
        };
        for change in &self.truth.change {
            within("truth.change.at_s", change.at_s, 0.0, self.duration_s, "seconds, within duration_s")?;
        }
        for sag in &self.supply_sags {
            spell("supply_sag", sag.at_s, sag.for_s, sag.every_s)?;
            within("supply_sag.to", sag.to, 0.0, 1.0, "share of the nominal supply: 0.8")?;
        }
        for fault in &self.sensor_faults {
            spell("sensor_fault", fault.at_s, fault.for_s, fault.every_s)?;
            let (least, most, hint) = match fault.lie {
                Lie::Dropout | Lie::Stuck if fault.size.is_none() => continue,
                Lie::Dropout | Lie::Stuck => {
                    return Err("`sensor_fault.size` means nothing for a dropout or a stuck sensor\nhint: leave it out".into());
                }
                Lie::Bias => (-10.0, 10.0, "what is added, share of full scale: 0.1"),
                Lie::Spikes => {
                    (-10.0, 10.0, "what is added to one reading in twenty, share of full scale: 0.5")
                }
                Lie::Gain => (-10.0, 10.0, "what the value is multiplied by: 1.2"),
            };
            let size = fault.size.ok_or_else(|| {
                format!("`sensor_fault.size` is missing: this lie has a size\nhint: {hint}")
            })?;
            within("sensor_fault.size", size, least, most, hint)?;
        }
        for fault in &self.process_faults {
            spell("process_fault", fault.at_s, fault.for_s, fault.every_s)?;
        }
        Ok(())
    }
}

/// Says what is wrong with a value: name, value, least, most, hint.
type Within = dyn Fn(&str, f64, f64, f64, &str) -> Result<(), String>;

impl Segment {
    fn check(&self, within: &Within) -> Result<(), String> {
        let share = "shares of the largest thrust, -1 to 1";
        match self {
            Self::Steps { levels, hold_s, ramp_s } => {
                if levels.is_empty() {
                    return Err("`levels` of steps is empty\nhint: levels = [0.5, -0.5]".into());
                }
                within("hold_s", *hold_s, 0.01, 1e6, "seconds")?;
                within("ramp_s", *ramp_s, 0.0, *hold_s, "seconds, at most hold_s")?;
                levels.iter().try_for_each(|l| within("levels", *l, -1.0, 1.0, share))
            }
            Self::Sine { amplitude, offset, period_s, for_s } => {
                within("amplitude", *amplitude, 0.0, 1.0, share)?;
                within("offset", *offset, -1.0, 1.0, share)?;
                within("period_s", *period_s, 0.01, 1e6, "seconds")?;
                within("for_s", *for_s, 0.01, 1e7, "seconds")
            }
            Self::Dp { mean, std, time_s, for_s } => {
                within("mean", *mean, -1.0, 1.0, share)?;
                within("std", *std, 0.0, 1.0, share)?;
                within("time_s", *time_s, 0.05, 1e6, "seconds")?;
                within("for_s", *for_s, 0.1, 1e7, "seconds")
            }
            Self::Joystick { amplitude, for_s } => {
                within("amplitude", *amplitude, 0.0, 1.0, share)?;
                within("for_s", *for_s, 0.1, 1e7, "seconds")
            }
            Self::Replay { peak: Some(peak), .. } => within("peak", *peak, 0.0, 1.0, share),
            Self::Replay { column, .. } if !column.ends_with("_n") => Err(format!(
                "`column` = \"{column}\" of a replay is not in newtons and has no `peak`\nhint: peak = 0.8 stretches it to 0.8 of the largest thrust"
            )),
            Self::Replay { .. } => Ok(()),
        }
    }
}
