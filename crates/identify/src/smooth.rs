//! Ticks about which nothing jumps or moves fast: simulated there at half the cost or less.
//!
//! Most of a recording is settled or settling. Which ticks those are, and how many of them may be passed at
//! once, is read off one simulation with the stated coefficients and kept for every later one: a choice made anew
//! in each simulation would jump with the parameters, which their derivatives do not show.

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
/// The same where the rates at the end are taken anew: predictor and corrector stay stable to 2.4 there.
const DIES_ANEW: f64 = 0.8;
/// Longest step, s: half of the shortest time in which a load is taken to come on.
const LONGEST_S: f64 = 0.01;

impl Prepared {
    /// Marks the smooth ticks of the stimulus.
    pub fn mark_smooth(&mut self, model: ModelName, rig: &Rig, stated: &Parameters) {
        let mut plant =
            Plant::new(model, rig, stated, &[], self.tick_s).with_lag_on_command(self.lag_on_command);
        let [speed, flow, current, angle] = self.start;
        plant.start(self.time_s[0], speed, flow, current, angle);
        let (mut course, mut decay) = (vec![[speed, flow, current]], Vec::new());
        let commands = self.commands(&vec![0.0; self.edges.len()]);
        let mut leaps = self.leaps.iter().peekable();
        for (i, (tick, command)) in self.stimulus.ticks.iter().zip(&commands).enumerate() {
            if let Some(leap) = leaps.next_if(|leap| leap.tick == i) {
                plant.leap(tick.time_s, leap);
            }
            plant.step(&Tick { command: *command, ..*tick });
            let truth = plant.truth();
            course.push([truth.shaft_speed_rad_s, truth.axial_m_s, truth.current_a]);
            decay.push(plant.fastest_decay_1_s(tick.driven) * self.tick_s);
        }
        let smooth = smooth(&course, &self.may_jump(), self.ticks_per_row + 2);
        for ((tick, smooth), decay) in self.stimulus.ticks.iter_mut().zip(&smooth).zip(&decay) {
            tick.course = course_of(*smooth, *decay);
        }
        self.strides = vec![1; decay.len()];
        // Implicit steps are stable however fast a disturbance dies in them; a plant that takes others is told of each tick.
        let implicit = plant.is_stiff();
        if implicit {
            decay.fill(0.0);
        }
        let (mut at, tops) = (0, tops(&course));
        for to in self.looked_at() {
            while at < to {
                let longest = ((LONGEST_S / self.tick_s + 1e-6) as usize).clamp(1, to - at);
                let fits = |count: &usize| passes(&course, tops, &smooth, &decay, at, *count);
                let count = [longest, longest.div_ceil(2)].into_iter().find(fits).unwrap_or(1);
                let fastest = decay[at..at + count].iter().fold(0.0_f64, |m, d| m.max(*d));
                if count > 1 && !implicit {
                    self.stimulus.ticks[at].course = course_of(true, fastest * count as f64);
                }
                self.strides[at] = count;
                at += count;
            }
        }
    }

    /// Ticks in which a step of the command may yet be placed: all those of the rows' interval that it fell into, however
    /// long a gap that is.
    fn may_jump(&self) -> Vec<bool> {
        let mut all = vec![false; self.stimulus.ticks.len()];
        for row in self.edges.iter().filter(|row| !self.after_pause(**row)) {
            let (from, to) = (self.stimulus.logs[row - 1].0, self.stimulus.logs[*row].0);
            all[from.min(to)..to].fill(true);
        }
        all
    }

    /// Ticks at whose beginning somebody looks at the plant, in order: at which a row lies or in which it does, at which a
    /// pause ends, and where the recording ends.
    fn looked_at(&self) -> Vec<usize> {
        let rows = self.stimulus.logs.iter().flat_map(|(tick, part)| {
            let after = if *part > 0.0 { tick + 1 } else { *tick };
            [*tick, after]
        });
        let pauses = self.leaps.iter().map(|leap| leap.tick);
        let mut all: Vec<usize> = rows.chain(pauses).chain([self.stimulus.ticks.len()]).collect();
        all.retain(|tick| *tick <= self.stimulus.ticks.len());
        all.sort_unstable();
        all.dedup();
        all
    }
}

/// What a tick, or several at once, may be taken for, of which so much dies in them.
fn course_of(smooth: bool, dies: f64) -> Course {
    match smooth {
        false => Course::Any,
        true if dies < DIES => Course::Calm,
        true => Course::Smooth,
    }
}

/// Whether so many ticks from one on may be passed at once: as smooth as each of them, with as many before.
fn passes(
    course: &[[f64; 3]],
    tops: [f64; 3],
    smooth: &[bool],
    decay: &[f64],
    from: usize,
    count: usize,
) -> bool {
    let to = from + count;
    let dies = decay[from..to].iter().fold(0.0_f64, |m, d| m.max(*d)) * count as f64;
    if count < 2 || from < 2 * count || dies > DIES_ANEW || !smooth[from - count..to].iter().all(|s| *s) {
        return false;
    }
    let thinned: Vec<[f64; 3]> = (0..4).map(|k| course[from + count * k - 2 * count]).collect();
    is_smooth(&thinned, 2, tops)
}

/// Which ticks of a course (shaft speed, axial flow, current at every tick's start and the last one's end)
/// are smooth, with nothing but smooth ticks, and none in which the command may jump, within `reach` before and after.
fn smooth(course: &[[f64; 3]], may_jump: &[bool], reach: usize) -> Vec<bool> {
    let ticks = course.len().saturating_sub(1);
    let tops = tops(course);
    let calm: Vec<bool> = (0..ticks).map(|n| n >= 2 && !may_jump[n] && is_smooth(course, n, tops)).collect();
    (0..ticks).map(|n| (n.saturating_sub(reach)..(n + reach + 1).min(ticks)).all(|m| calm[m])).collect()
}

/// Largest sizes of a course.
fn tops(course: &[[f64; 3]]) -> [f64; 3] {
    [0, 1, 2].map(|k| course.iter().fold(1e-9_f64, |m, x| m.max(x[k].abs())))
}

/// Whether the step from one instant of a course to the next is smooth, which two steps before tell.
fn is_smooth(course: &[[f64; 3]], n: usize, tops: [f64; 3]) -> bool {
    let curves = |k: usize| {
        let at = |back: usize| course[n + 1 - back][k];
        (at(0) - 3.0 * at(1) + 3.0 * at(2) - at(3)).abs() / tops[k]
    };
    let bows = (course[n + 1][2] - 2.0 * course[n][2] + course[n - 1][2]).abs() / (8.0 * tops[2]);
    curves(0) < CURVES && curves(1) < CURVES && bows < BOWS
}

#[cfg(test)]
mod tests {
    use kort_thruster::models::ModelName;
    use kort_thruster::parameters::Parameters;
    use kort_thruster::plant::Course;
    use kort_thruster::rig::Rig;

    use super::smooth;
    use crate::data::{Prepared, Series};

    /// A step of the command.
    fn prepared(rig: &str, command_a: f64) -> Prepared {
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
        prepared
    }

    /// Of the settled second half of a step, the share of ticks that are calm.
    fn calm(rig: &str, command_a: f64) -> f64 {
        let prepared = prepared(rig, command_a);
        // One that several are passed from is taken for what they are together.
        let ticks = prepared.stimulus.ticks.iter().zip(&prepared.strides);
        let settled: Vec<Course> = ticks
            .skip(prepared.strides.len() / 2)
            .filter_map(|(tick, count)| (*count == 1).then_some(tick.course))
            .collect();
        assert!(settled.iter().all(|course| *course != Course::Any), "settled");
        settled.iter().filter(|course| **course == Course::Calm).count() as f64 / settled.len() as f64
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
    fn what_has_settled_is_passed_from_row_to_row_and_no_row_is_passed_over() {
        let large = include_str!("../../../config/thrusters/whitcomb-yoerger-1999.toml");
        let prepared = prepared(large, 6.0);
        let (mut at, mut ends) = (0, std::collections::BTreeSet::new());
        while at < prepared.strides.len() {
            at += prepared.strides[at];
            ends.insert(at);
        }
        assert_eq!(at, prepared.stimulus.ticks.len());
        assert!(prepared.stimulus.logs.iter().all(|(tick, _)| *tick == 0 || ends.contains(tick)));
        let settled = prepared.strides.len() / 2;
        assert_eq!(prepared.strides[settled..].iter().max(), Some(&5), "10 ms of 2 ms ticks");
        assert!(ends.iter().filter(|end| **end > settled).count() < prepared.strides.len() / 8);
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
        let smooth = smooth(&course, &vec![false; 399], 7);
        assert_eq!(smooth.len(), 399);
        assert!(smooth[20..40].iter().all(|s| *s), "at rest");
        assert!(smooth[44..58].iter().all(|s| !s), "about the jump");
        assert!(smooth[350..].iter().all(|s| *s), "settled");
    }
}
