//! Where inside a log interval did each step of the command happen?
//!
//! Commands change on control ticks, the log samples more slowly: a step lies anywhere in the interval
//! before the row that first shows it. Each takes the tick at which the hypothesis fits the rows after it
//! best; a wrong tick would look like a lag or a delay.

use std::sync::Arc;

use kort_thruster::effects::Path;
use rayon::prelude::*;

use crate::data::{Channel, Driving, Prepared};
use crate::fit::Fit;
use crate::hypothesis::{Edges, Free, Hypothesis, Inputs, Target};
use crate::simulate::Problem;

/// Rows after an edge that decide where it was.
const WINDOW_ROWS: usize = 12;
/// Places tried for a step that fell into a gap of the log.
const MOST_PLACES: usize = 24;
/// Places about its own that are tried for a step that was placed before; its own comes first, and stays where it does
/// as well.
const NEAR: [isize; 7] = [0, -1, 1, -2, 2, -4, 4];
/// By how much less a step must cost between two ticks, in squares of noise: two standard deviations.
const PARTED: f64 = 4.0;
/// Least noise of a channel over its full scale: rounding of a log.
const LEAST: f64 = 1e-4;

/// Which places are tried for the command's steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reach {
    /// All of them.
    All,
    /// Those about where a step is, where there are many.
    Near,
}

impl Problem<'_> {
    /// The command with its steps where they suit a fit best: of all their places, or of those about where they are.
    /// None if that is where they are.
    pub fn place_edges(&self, fit: &Fit, reach: Reach) -> Option<Inputs> {
        let movable =
            |r: &Prepared| r.driving != Driving::Speed && r.edges.iter().any(|row| r.ticks_before(*row) > 1);
        let places = self.recordings.iter().filter(|r| movable(r)).map(Prepared::places).max()?;
        let noises = self.noises(fit);
        let before = &fit.hypothesis.inputs.edges;
        // All edges are moved together, each over its own places.
        let tried: Vec<Edges> = if reach == Reach::All || places <= NEAR.len() {
            let at = |place| self.recordings.iter().map(|r| r.edges_at(place)).collect();
            (0..places).map(at).collect()
        } else {
            let about = |by: &isize| {
                self.recordings.iter().zip(before).map(|(r, edges)| r.edges_moved(edges, *by)).collect()
            };
            NEAR.iter().map(about).collect()
        };
        let costs: Vec<Vec<Vec<f64>>> = tried
            .par_iter()
            .map(|edges| {
                let inputs = Arc::new(Inputs::new(&self.recordings, edges.clone()));
                let residual = self.residual(&Hypothesis { inputs, ..fit.hypothesis.clone() }, &fit.values);
                let of = |(r, one): (usize, &Prepared)| edge_costs(one, &residual[r], &noises[r]);
                self.recordings.iter().enumerate().map(of).collect()
            })
            .collect();
        let mut edges = before.clone();
        for (r, _) in self.recordings.iter().enumerate().filter(|(_, r)| movable(r)) {
            for (e, ticks) in edges[r].iter_mut().enumerate() {
                let places: Vec<(f64, f64)> =
                    tried.iter().zip(&costs).map(|(at, costs)| (at[r][e], costs[r][e])).collect();
                *ticks = best_place(&places).unwrap_or(*ticks);
            }
        }
        (edges != *before).then(|| Inputs::new(&self.recordings, edges))
    }

    /// A fit's hypothesis with every step of the command a tick earlier or later, and its drive's delay as much longer or
    /// shorter, or every sensor read as much later or earlier where it has none; none where no step can move so.
    pub fn a_tick_off(&self, fit: &Fit, earlier: bool) -> Option<Hypothesis> {
        let before = &fit.hypothesis.inputs.edges;
        let mut edges = before.clone();
        for (r, recording) in self.recordings.iter().enumerate().filter(|(_, r)| r.driving != Driving::Speed)
        {
            for (row, ticks) in recording.edges.iter().zip(&mut edges[r]) {
                let moved = if earlier { *ticks + 1.0 } else { *ticks - 1.0 };
                *ticks = moved.clamp(0.0, recording.ticks_before(*row) as f64 - 1.0);
            }
        }
        if edges == *before {
            return None;
        }
        let tick_s = self.scale.tick_s * if earlier { 1.0 } else { -1.0 };
        let mut hypothesis =
            Hypothesis { inputs: Arc::new(Inputs::new(&self.recordings, edges)), ..fit.resume() };
        let delay = delay_of(&hypothesis);
        let makes_up = |free: &Free| match delay {
            Some(effect) => matches!(free.target, Target::Effect(i, _) if i == effect),
            None => matches!(free.target, Target::Sampling { .. }),
        };
        for (free, start) in hypothesis.free.iter().zip(&mut hypothesis.start) {
            if makes_up(free) {
                *start = (*start + tick_s).clamp(free.low, free.high);
            }
        }
        Some(hypothesis)
    }

    /// Noise of each channel.
    fn noises(&self, fit: &Fit) -> Vec<Vec<Persistent>> {
        let residual = self.residual(&fit.hypothesis, &fit.values);
        self.recordings
            .iter()
            .zip(&residual)
            .map(|(r, left)| r.channels.iter().zip(left).map(|(c, left)| Persistent::of(c, left)).collect())
            .collect()
    }
}

/// Which of a hypothesis's effects lets the command come late.
pub fn delay_of(hypothesis: &Hypothesis) -> Option<usize> {
    hypothesis.effects.iter().position(|m| m.effect.shifts_time && m.effect.path == Path::Drive)
}

/// Noise that keeps a share of itself from one sample to the next: what a set without the right physics leaves lasts,
/// and must not pass for a step that came early or late.
struct Persistent {
    /// Share of a sample's error that the next one repeats.
    kept: f64,
    /// Usual size of what is new, in the channel's unit.
    new: f64,
}

impl Persistent {
    fn of(channel: &Channel, left: &[f64]) -> Self {
        let power: f64 = left.iter().map(|e| e * e).sum();
        let product: f64 = left.windows(2).map(|w| w[0] * w[1]).sum();
        let kept = if power > 0.0 { (product / power).clamp(0.0, 1.0) } else { 0.0 };
        let mut new: Vec<f64> = left.windows(2).map(|w| (w[1] - kept * w[0]).abs()).collect();
        new.sort_by(f64::total_cmp);
        // Of normal noise the median is 0.67 standard deviations; few samples about a misplaced step do not raise it.
        let median = new.get(new.len() / 2).copied().unwrap_or(0.0) / 0.67;
        Self { kept, new: median.max(LEAST * channel.full_scale) }
    }

    /// Squared error that is new at a sample, in noise.
    fn cost(&self, left: &[f64], k: usize) -> f64 {
        let before = if k == 0 { 0.0 } else { left[k - 1] };
        ((left[k] - self.kept * before) / self.new).powi(2)
    }
}

impl Prepared {
    /// Control ticks between a row and the one before it; in a pause nothing can be placed.
    pub(crate) fn ticks_before(&self, row: usize) -> usize {
        if self.after_pause(row) {
            return 1;
        }
        ((self.time_s[row] - self.time_s[row - 1]) / self.tick_s).round().max(1.0) as usize
    }

    /// Places that are tried for a step: every tick of a log interval, as many in a gap.
    fn places(&self) -> usize {
        let longest = self.edges.iter().map(|row| self.ticks_before(*row)).max().unwrap_or(1);
        longest.min(self.ticks_per_row.max(MOST_PLACES))
    }

    /// Ticks before its row at which a step lies in one of its places.
    fn edge_at(&self, edge: usize, place: usize) -> f64 {
        let (ticks, places) = (self.ticks_before(self.edges[edge]), self.places());
        let place = place.min(places - 1);
        let ticks =
            if ticks <= places { place.min(ticks - 1) } else { place * (ticks - 1) / (places - 1).max(1) };
        ticks as f64
    }

    /// All steps so many places further from their rows.
    fn edges_moved(&self, before: &[f64], by: isize) -> Vec<f64> {
        let places = self.places();
        let moved = |(edge, ticks): (usize, &f64)| {
            let last = self.ticks_before(self.edges[edge]).min(places) - 1;
            let off = |place: &usize| (self.edge_at(edge, *place) - ticks).abs();
            let now = (0..=last).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or(0);
            // A step between two places keeps its part of a tick.
            let part = ticks - self.edge_at(edge, now);
            let (first, end) = (0.0, self.edge_at(edge, last));
            match now.checked_add_signed(by) {
                None => first,
                Some(to) if to > last => end,
                Some(to) => (self.edge_at(edge, to) + part).clamp(first, end),
            }
        };
        before.iter().enumerate().map(moved).collect()
    }

    /// All steps in one of their places.
    fn edges_at(&self, place: usize) -> Vec<f64> {
        (0..self.edges.len()).map(|edge| self.edge_at(edge, place)).collect()
    }
}

/// The place of a step that costs least, of those that were tried with their costs, the first of equals: between them
/// where a parabola through it and its neighbours is [`PARTED`] lower. Commands need not come with the control's ticks,
/// and a bus does not take equally long for each.
fn best_place(tried: &[(f64, f64)]) -> Option<f64> {
    let (best, least) = tried.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1))?;
    let beside = |after: bool| {
        let there = tried.iter().filter(|(at, _)| if after { *at > best } else { *at < best });
        there.min_by(|a, b| (a.0 - best).abs().total_cmp(&(b.0 - best).abs()))
    };
    let (Some(before), Some(after)) = (beside(false), beside(true)) else { return Some(best) };
    let slope = |there: &(f64, f64)| (there.1 - least) / (there.0 - best);
    // The parabola's value is `least + about * x + bend * x^2` at a distance `x`.
    let bend = (slope(after) - slope(before)) / (after.0 - before.0);
    let about = slope(after) - bend * (after.0 - best);
    let lower = 0.25 * about * about / bend;
    Some(if lower > PARTED { best - 0.5 * about / bend } else { best })
}

fn edge_costs(recording: &Prepared, residual: &[Vec<f64>], noises: &[Persistent]) -> Vec<f64> {
    let mut costs = vec![0.0; recording.edges.len()];
    for (c, channel) in recording.channels.iter().enumerate() {
        for (e, row) in recording.edges.iter().enumerate() {
            let next = recording.edges.get(e + 1).copied().unwrap_or(usize::MAX);
            let end = (row + WINDOW_ROWS).min(next);
            let from = channel.rows.partition_point(|r| r < row);
            let to = channel.rows.partition_point(|r| *r < end);
            costs[e] += (from..to).map(|k| noises[c].cost(&residual[c], k)).sum::<f64>();
        }
    }
    costs
}

#[cfg(test)]
mod tests {
    use kort_thruster::rig::Rig;

    use kort_thruster::models::ModelName;

    use super::{best_place, edge_costs};
    use crate::data::{Prepared, Series};
    use crate::edges::Persistent;
    use crate::noise::Criterion;
    use crate::setup::Setup;

    /// Steps of a command logged at 100 Hz, the second of them just after half a second without rows.
    fn prepared() -> Prepared {
        let rows: Vec<usize> = (0..400).filter(|k| !(150..200).contains(k)).collect();
        let time_s = rows.iter().map(|k| 0.01 * *k as f64).collect();
        let command: Vec<f64> = rows.iter().map(|k| if (50..200).contains(k) { 1.0 } else { -1.0 }).collect();
        let columns = vec![
            ("current_cmd_a".into(), command),
            ("shaft_speed_rad_s".into(), rows.iter().map(|k| (*k as f64).sin()).collect()),
        ];
        let rig = "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 1.0\n";
        let rig = Rig::from_toml(rig).unwrap();
        Prepared::new(&Series { name: "log".into(), time_s, columns }, &rig, false).unwrap()
    }

    #[test]
    fn a_step_is_looked_for_on_every_tick_of_its_interval_and_all_over_a_gap() {
        let recording = prepared();
        assert_eq!(recording.edges, [50, 150]);
        let hidden = recording.hidden_between_rows().unwrap();
        assert!(hidden.contains("2 of 2 steps") && hidden.contains("0.260 s"), "{hidden}");
        let places: Vec<Vec<f64>> = (0..recording.places()).map(|p| recording.edges_at(p)).collect();
        let first: Vec<f64> = places.iter().map(|p| p[0]).collect();
        let in_gap: Vec<f64> = places.iter().map(|p| p[1]).collect();
        let ticks = recording.ticks_per_row;
        assert!(first[..ticks].iter().copied().eq((0..ticks).map(|k| k as f64)), "{first:?}");
        assert!(first[ticks..].iter().all(|at| *at == ticks as f64 - 1.0), "{first:?}");
        assert_eq!(in_gap[0], 0.0);
        assert_eq!(in_gap.last(), Some(&(recording.ticks_before(150) as f64 - 1.0)), "{in_gap:?}");
        assert!(in_gap.windows(2).all(|w| w[1] > w[0]) && in_gap.len() <= 24);
    }

    #[test]
    fn a_step_lies_between_two_ticks_where_that_tells() {
        let cost = |deep: f64, at: f64| 7.0 + deep * (at - 2.3).powi(2);
        let tried = |deep| [2.0, 1.0, 3.0, 0.0, 4.0, 4.0].map(|at| (at, cost(deep, at)));
        assert!((best_place(&tried(100.0)).unwrap() - 2.3).abs() < 1e-9);
        assert_eq!(best_place(&tried(10.0)), Some(2.0), "0.9 squares of noise are none");
        assert_eq!(best_place(&[(0.0, 1.0), (1.0, 9.0), (2.0, 30.0)]), Some(0.0), "nothing beside it");
        assert_eq!(best_place(&[(3.0, 1.0), (2.0, 1.0), (4.0, 1.0)]), Some(3.0), "it stays");
        assert_eq!(best_place(&[]), None);
        let recording = prepared();
        let commands = |before: f64| {
            let first = recording.stimulus.logs[50].0;
            recording.commands(&[before, 0.0])[first - 3..first].to_vec()
        };
        assert_eq!((commands(0.0), commands(2.0)), (vec![-1.0; 3], vec![-1.0, 1.0, 1.0]));
        assert_eq!(commands(1.25), [-1.0, -0.5, 1.0]);
        let last = recording.ticks_per_row as f64 - 1.0;
        let moved = |from: f64, by| recording.edges_moved(&[from, 0.0], by)[0];
        assert_eq!((moved(1.25, 1), moved(1.25, 0), moved(1.25, -4)), (2.25, 1.25, 0.0));
        assert_eq!((moved(last - 0.4, 0), moved(last - 0.4, 1)), (last - 0.4, last));
    }

    /// A motor under steps at control ticks within the log's intervals, whose angle and filtered speed are read half a
    /// tick after their stamp. Placed for sensors read at it, nearly all steps lie a tick off and keep the sensors there.
    #[test]
    fn steps_and_sensors_that_are_a_tick_off_together_find_back() {
        const TICK_S: f64 = 0.002;
        let (every, rows, fine) = (10, 1500, 20);
        let mut seed = 11_u64;
        let mut draw = |n: u64| {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 33) % n
        };
        let mut level = 2.0;
        let mut commands = Vec::new();
        while commands.len() < rows * every {
            level = -level;
            let ticks = 40 + draw(500) as usize;
            commands.extend(std::iter::repeat_n(level, ticks));
        }
        let (inertia, kt, viscous, filter_s) = (0.04, 0.77, 0.21, 0.01);
        let (mut speed, mut angle, mut shown) = (0.0_f64, 0.0_f64, 0.0_f64);
        let mut columns = vec![Vec::new(), Vec::new(), Vec::new()];
        for (tick, command) in commands.iter().take(rows * every).enumerate() {
            for part in 0..fine {
                if tick % every == 0 && part == fine / 2 {
                    let noise = 0.01 * (draw(2000) as f64 / 1000.0 - 1.0);
                    columns[0].push(commands[tick]);
                    columns[1].push(angle);
                    columns[2].push(shown + noise);
                }
                let dt = TICK_S / fine as f64;
                speed += (kt * command - viscous * speed) / inertia * dt;
                angle += speed * dt;
                shown += (speed - shown) / filter_s * dt;
            }
        }
        let names = ["current_cmd_a", "shaft_angle_rad", "shaft_speed_rad_s"];
        let time_s = (0..rows).map(|k| k as f64 * every as f64 * TICK_S).collect();
        let columns = names.iter().map(|n| (*n).to_string()).zip(columns).collect();
        let rig = "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = { value = 0.06, tol = 0.9 }\n\
                   torque_constant_nm_a = { value = 0.6, tol = 0.9 }\n\
                   viscous_friction_nm_s = { value = 0.25, tol = 0.9 }\n\
                   [sensors]\nlog_rate_hz = 50\ncontrol_rate_hz = 500\nspeed_filter_time_constant_s = 0.01\n";
        let rig = Rig::from_toml(rig).unwrap();
        let series = [Series { name: "log".into(), time_s, columns }];
        let criterion =
            Criterion { form_error: 0.005, own_form_error: 0.2, facts_a_band: 10.0, timing_s: 0.001 };
        let Setup { problem, baseline, .. } =
            Setup::new(&series, &rig, ModelName::Model2, criterion).unwrap();
        let found = problem.settle_from_stated(&baseline, 24);
        let changes = (1..rows * every).filter(|k| commands[*k] != commands[k - 1]);
        let truth: Vec<usize> = changes.map(|k| k.div_ceil(every) * every - k).collect();
        let recording = &problem.recordings[0];
        assert_eq!(recording.edges.len(), truth.len());
        let off = found.hypothesis.inputs.edges[0]
            .iter()
            .zip(&truth)
            .filter(|(a, b)| (**a - **b as f64).abs() > 0.5);
        let off = off.count();
        assert!(off * 10 < truth.len(), "{off} of {}", truth.len());
    }

    /// What lasts is the set's error: a step in its place costs least although all about it is off by ten times its
    /// own mark.
    #[test]
    fn an_error_that_lasts_does_not_move_a_step() {
        let recording = prepared();
        let noise = |k: usize| 0.01 * (12.9898 * k as f64).sin();
        let residual = |moved: f64| -> Vec<f64> {
            let answer = |k: usize| if k < 50 { 0.0 } else { moved * (-0.2 * (k as f64 - 50.0)).exp() };
            (0..recording.channels[0].rows.len()).map(|k| 1.0 - answer(k) + noise(k)).collect()
        };
        let noise = Persistent::of(&recording.channels[0], &residual(0.0));
        assert!(noise.kept > 0.95 && noise.new < 0.05, "{} {}", noise.kept, noise.new);
        let cost = |moved| edge_costs(&recording, &[residual(moved)], std::slice::from_ref(&noise))[0];
        assert!(cost(0.0) < cost(0.1) && cost(0.0) < cost(-0.1));
        let lasting = (50..62).map(|k| residual(0.1)[k].powi(2)).sum::<f64>();
        assert!(
            lasting < (50..62).map(|k| residual(0.0)[k].powi(2)).sum(),
            "a mean square would take the step away"
        );
    }
}
