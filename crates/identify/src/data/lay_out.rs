//! The recorded inputs on the control grid.

use kort_thruster::plant::{Driven, Tick};
use kort_thruster::rig::Rig;

use super::command::{find_edges, is_stepwise};
use super::counted::counted_angle;
use super::fill::{filled, held, linear};
use super::pauses::leap_to;
use super::{Driving, Prepared, Series};

impl Prepared {
    /// Lays the recorded inputs on the control grid.
    pub(super) fn lay_out(&mut self, series: &Series, rig: &Rig) {
        let t0 = self.time_s[0];
        let end = (self.time_s[self.time_s.len() - 1] - t0) / self.tick_s;
        let count = (end - 1e-6).ceil().max(1.0) as usize;
        let mut pauses = self.pauses().into_iter().peekable();
        let mut passed = 0;
        for (row, t) in self.time_s.iter().enumerate() {
            if let Some(pause) = pauses.next_if(|pause| pause.row == row) {
                passed += pause.to - pause.from;
                let leap = leap_to(series, row, pause.to - passed);
                self.leaps.push(leap);
            }
            let at = (t - t0) / self.tick_s;
            let near = at.round();
            let (tick, part) =
                if (at - near).abs() < 0.02 { (near, 0.0) } else { (at.floor(), at - at.floor()) };
            self.stimulus.logs.push((tick as usize - passed, part));
        }
        let mut pauses = self.pauses().into_iter().peekable();
        let ambient = series.column("ambient_m_s").map(filled);
        let supply = series.column("supply_v").map(filled);
        let recorded_angle = series.column("shaft_angle_rad").map(filled);
        let angle = recorded_angle.clone().or_else(|| counted_angle(series, rig));
        let depth = series.column("depth_m").map(filled);
        let temperature = series.column("temperature_c").map(filled);
        let signed = !crate::checks::is_unsigned_speed(series);
        let measured_speed = series.column("shaft_speed_rad_s").map(filled);
        let enabled = series.column("torque_enable").map(held);
        let speed = (self.driving == Driving::Speed).then(|| self.driving_speed(series, rig));
        let mut ticks = Vec::with_capacity(count);
        let mut row = 0;
        let mut i = 0;
        while i < count {
            if let Some(pause) = pauses.next_if(|pause| pause.from == i) {
                i = pause.to;
            }
            let time_s = t0 + i as f64 * self.tick_s;
            let next_s = time_s + self.tick_s;
            while row + 2 < self.time_s.len() && self.time_s[row + 1] <= time_s + 0.02 * self.tick_s {
                row += 1;
            }
            let at = |column: &[f64], t: f64| linear(&self.time_s, column, row, t);
            ticks.push(Tick {
                time_s,
                driven: match self.driving {
                    Driving::Command(_) => Driven::Command,
                    Driving::Current => Driven::Current(at(&self.command, time_s), at(&self.command, next_s)),
                    Driving::Speed => {
                        let s = speed.as_deref().unwrap_or(&[]);
                        Driven::Speed(at(s, time_s), at(s, next_s))
                    }
                    Driving::Power => Driven::Power(at(&self.command, time_s), at(&self.command, next_s)),
                },
                ambient_m_s: ambient.as_deref().map_or((0.0, 0.0), |a| (at(a, time_s), at(a, next_s))),
                supply_v: supply.as_deref().map(|s| at(s, time_s)),
                shaft_angle_rad: angle.as_deref().map(|a| (at(a, time_s), at(a, next_s))),
                depth_m: depth.as_deref().map(|d| at(d, time_s)),
                temperature_c: temperature.as_deref().map(|d| at(d, time_s)),
                released: enabled.as_deref().is_some_and(|e| e[row] < 0.5),
                observed_angle_rad: recorded_angle.as_deref().map(|a| at(a, next_s)),
                observed_speed_rad_s: measured_speed.as_deref().filter(|_| signed).map(|s| at(s, next_s)),
                observed_size_rad_s: measured_speed.as_deref().filter(|_| !signed).map(|s| at(s, next_s)),
                ..Tick::default()
            });
            i += 1;
        }
        self.stimulus.ticks = ticks;
        self.speed_between = speed.unwrap_or_default();
        if matches!(self.driving, Driving::Command(_) | Driving::Current) {
            self.stepwise = matches!(self.driving, Driving::Command(_)) && is_stepwise(&self.command);
            self.edges = find_edges(&self.command, self.stepwise);
        }
    }
}
