//! Ticks about which nothing jumps or moves fast: simulated there at half the cost or less.
//!
//! Most of a recording is settled or settling. Which ticks those are is read off one simulation with
//! the stated coefficients and kept for every later one: a choice made anew in each simulation would
//! jump with the parameters, which their derivatives do not show.

use kort_thruster::models::ModelName;
use kort_thruster::parameters::Parameters;
use kort_thruster::plant::{Course, Plant, Tick};
use kort_thruster::rig::Rig;

use crate::data::Prepared;

/// Change of curvature over a tick, as a share of the largest state, below which a tick is smooth.
const CURVES: f64 = 1e-4;
/// The same for the bow of the current within a tick.
const BOWS: f64 = 1e-4;

/// Share of a disturbance that may die within a tick for it to be calm. A look ahead stays stable to 0.55;
/// a fit may move masses and inertia.
const DIES: f64 = 0.15;

impl Prepared {
    /// Marks the smooth ticks of the stimulus.
    pub fn mark_smooth(&mut self, model: ModelName, rig: &Rig, stated: &Parameters) {
        let mut plant = Plant::new(model, rig, stated, &[], self.tick_s);
        let [speed, flow, current, angle] = self.start;
        plant.start(self.time_s[0], speed, flow, current, angle);
        let (mut course, mut lasting) = (vec![[speed, flow, current]], Vec::new());
        let commands = self.commands(&vec![0; self.edges.len()]);
        let mut leaps = self.leaps.iter().peekable();
        for (i, (tick, command)) in self.stimulus.ticks.iter().zip(&commands).enumerate() {
            if let Some(leap) = leaps.next_if(|leap| leap.tick == i) {
                plant.leap(tick.time_s, leap);
            }
            plant.step(&Tick { command: *command, ..*tick });
            let truth = plant.truth();
            course.push([truth.shaft_speed_rad_s, truth.axial_m_s, truth.current_a]);
            lasting.push(plant.fastest_decay_1_s() * self.tick_s < DIES);
        }
        let smooth = smooth(&course, self.ticks_per_row + 2);
        for ((tick, smooth), lasting) in self.stimulus.ticks.iter_mut().zip(smooth).zip(lasting) {
            tick.course = match (smooth, lasting) {
                (false, _) => Course::Any,
                (true, false) => Course::Smooth,
                (true, true) => Course::Calm,
            };
        }
    }
}

/// Which ticks of a course (shaft speed, axial flow, current at every tick's start and the last one's end)
/// are smooth, with nothing but smooth ticks within `reach` before and after: the command's jumps may yet
/// be moved within a log interval.
fn smooth(course: &[[f64; 3]], reach: usize) -> Vec<bool> {
    let ticks = course.len().saturating_sub(1);
    let top = |k: usize| course.iter().fold(1e-9_f64, |m, x| m.max(x[k].abs()));
    let tops = [top(0), top(1), top(2)];
    let curves = |n: usize, k: usize| {
        let at = |back: usize| course[n + 1 - back][k];
        (at(0) - 3.0 * at(1) + 3.0 * at(2) - at(3)).abs() / tops[k]
    };
    let bows = |n: usize| (course[n + 1][2] - 2.0 * course[n][2] + course[n - 1][2]).abs() / (8.0 * tops[2]);
    let calm: Vec<bool> = (0..ticks)
        .map(|n| n >= 2 && curves(n, 0) < CURVES && curves(n, 1) < CURVES && bows(n) < BOWS)
        .collect();
    (0..ticks).map(|n| (n.saturating_sub(reach)..(n + reach + 1).min(ticks)).all(|m| calm[m])).collect()
}

#[cfg(test)]
mod tests {
    use kort_thruster::models::ModelName;
    use kort_thruster::parameters::Parameters;
    use kort_thruster::plant::Course;
    use kort_thruster::rig::Rig;

    use super::smooth;
    use crate::data::{Prepared, Series};

    /// Of the settled second half of a step, the share of ticks that are calm.
    fn calm(rig: &str, command_a: f64) -> f64 {
        let rig = Rig::from_toml(rig).expect("a rig");
        let rows = 2000;
        let series = Series {
            name: "step".into(),
            time_s: (0..rows).map(|k| 0.01 * f64::from(k)).collect(),
            columns: vec![
                ("current_cmd_a".into(), (0..rows).map(|k| if k < 100 { 0.0 } else { command_a }).collect()),
                ("thrust_n".into(), (0..rows).map(|k| f64::from(k % 7)).collect()),
            ],
        };
        let mut prepared = Prepared::new(&series, &rig, false).expect("a recording");
        prepared.mark_smooth(ModelName::Model2, &rig, &Parameters::stated(&rig));
        let settled = &prepared.stimulus.ticks[prepared.stimulus.ticks.len() / 2..];
        assert!(settled.iter().all(|t| t.course != Course::Any), "settled");
        settled.iter().filter(|t| t.course == Course::Calm).count() as f64 / settled.len() as f64
    }

    /// The axial flow through a short duct settles within a few ticks: a look ahead taken for the end would
    /// swing up there.
    #[test]
    fn no_tick_is_calm_where_a_disturbance_dies_at_once() {
        let large = include_str!("../../../config/thrusters/whitcomb-yoerger-1999.toml");
        assert!(calm(large, 6.0) > 0.99);
        let short = large.replace("duct_length_m = ", "duct_length_m = 0.015 # ");
        assert!(short != large);
        assert!(calm(&short, 6.0) < 0.01);
    }

    #[test]
    fn a_jump_is_not_smooth_and_what_has_settled_is() {
        // The current steps at tick 50; shaft speed follows within 20 ticks.
        let course: Vec<[f64; 3]> = (0..400)
            .map(|n| {
                let since = f64::from(n - 50).max(0.0);
                [50.0 * (1.0 - (-since / 20.0).exp()), 0.0, if n > 50 { 6.0 } else { 0.0 }]
            })
            .collect();
        let smooth = smooth(&course, 7);
        assert_eq!(smooth.len(), 399);
        assert!(smooth[20..40].iter().all(|s| *s), "at rest");
        assert!(smooth[44..58].iter().all(|s| !s), "about the jump");
        assert!(smooth[350..].iter().all(|s| *s), "settled");
    }
}
