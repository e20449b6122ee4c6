//! Responses of hypotheses to the recorded inputs, and their derivatives.
//!
//! The derivative is exact: the plant runs on numbers that carry it along, several free numbers a
//! simulation; those that act at different times share one.

use kort_thruster::dual::{Dual, LANES};
use kort_thruster::effects::{Descriptor, Scale, Stretch};
use kort_thruster::models::ModelName;
use kort_thruster::parameters::Parameters;
use kort_thruster::plant::{Plant, Sensed};
use kort_thruster::real::Real;
use kort_thruster::rig::Rig;
use nalgebra::DVector;
use rayon::prelude::*;

use crate::averages::Averages;
use crate::data::{Prepared, Response, rates};
use crate::hypothesis::{Hypothesis, Member, Target};
use crate::noise::{Criterion, Floor};
use crate::sampling::{Delays, Instant};
use crate::shared_lanes::{groups, last_acting};
use crate::spectrum::Spectrum;

/// Samples of all channels: `[recording][channel][sample]`.
pub type Stack = Vec<Vec<Vec<f64>>>;

/// Everything that stays the same while hypotheses are compared.
#[derive(Clone)]
pub struct Problem<'a> {
    /// Baseline model.
    pub model: ModelName,
    /// The stated rig.
    pub rig: &'a Rig,
    /// Stated parameters.
    pub stated: Parameters,
    /// Recordings.
    pub recordings: Vec<Prepared>,
    /// Rows left out of every comparison (flagged data, run-in), by recording.
    pub masked: Vec<Vec<bool>>,
    /// Sizes in use.
    pub scale: Scale,
    /// The criterion's constants.
    pub criterion: Criterion,
    /// Frequencies of the samples in use.
    pub spectrum: Spectrum,
    /// Noise floor of any hypothesis.
    pub floor: Floor,
    /// Where the doubt of what drives between its samples is looked at: a hypothesis at its start; where none is, the stated rig.
    pub doubted_at: Option<Hypothesis>,
}

impl<'a> Problem<'a> {
    /// Recordings to compare with a model.
    pub fn new(
        model: ModelName,
        rig: &'a Rig,
        recordings: Vec<Prepared>,
        masked: Vec<Vec<bool>>,
        criterion: Criterion,
    ) -> Self {
        let spectrum = Spectrum::new(&recordings, &masked);
        let floor = Floor::of_signal(&spectrum.bands, &criterion);
        let scale = crate::data::scale(&recordings, rig);
        let stated = Parameters::stated(rig);
        Self { model, rig, stated, recordings, masked, scale, criterion, spectrum, floor, doubted_at: None }
            .doubted()
    }

    /// The problem, with what it owes to how that which drives runs as part of its floor.
    fn doubted(mut self) -> Self {
        self.floor = Floor::of_signal(&self.spectrum.bands, &self.criterion);
        if let Some(doubt) = self.doubt_of_drivers() {
            self.floor = self.floor.with_doubt(&doubt);
        }
        self
    }

    /// The problem with its doubt looked at where this hypothesis starts: of a rig that is stated roughly, or whose
    /// friction is not stated, the simulation may be far from what was recorded, and more at the mercy of its input.
    pub fn doubted_at(mut self, hypothesis: &Hypothesis) -> Self {
        self.doubted_at = Some(hypothesis.clone());
        self.doubted()
    }

    /// The recordings, each once, though it be two experiments.
    pub fn recorded(&self) -> impl Iterator<Item = &Prepared> {
        self.recordings.iter().filter(|r| !r.second)
    }

    /// The problem without some rows: its training part.
    pub fn without(&self, held: &[Vec<bool>]) -> Self {
        let mut masked = self.masked.clone();
        for (mask, held) in masked.iter_mut().zip(held) {
            mask.iter_mut().zip(held).for_each(|(m, h)| *m |= *h);
        }
        let new = Self::new(self.model, self.rig, self.recordings.clone(), masked, self.criterion);
        let new = Self { scale: self.scale, ..new };
        match &self.doubted_at {
            Some(hypothesis) => new.doubted_at(hypothesis),
            None => new,
        }
    }

    /// The response of a hypothesis at values of its free numbers.
    pub fn respond(&self, hypothesis: &Hypothesis, values: &[f64]) -> Stack {
        let [stack] = self.stacks(hypothesis, values, |v| [v]);
        stack
    }

    /// Measured less simulated, by sample.
    pub fn residual(&self, hypothesis: &Hypothesis, values: &[f64]) -> Stack {
        let mut stack = self.respond(hypothesis, values);
        self.take_from_measured(&mut stack);
        stack
    }

    /// Measured less these.
    fn take_from_measured(&self, stack: &mut Stack) {
        for (recording, channels) in self.recordings.iter().zip(stack) {
            for (channel, samples) in recording.channels.iter().zip(channels) {
                samples.iter_mut().zip(&channel.values).for_each(|(s, m)| *s = m - *s);
            }
        }
    }

    /// Measured less simulated, by line of the spectrum.
    pub fn residual_lines(&self, hypothesis: &Hypothesis, values: &[f64]) -> DVector<f64> {
        self.spectrum.transform(&self.residual(hypothesis, values))
    }

    /// Simulated rows of all recordings.
    pub fn rows(&self, hypothesis: &Hypothesis, values: &[f64]) -> Vec<Vec<Sensed>> {
        let mut all: Vec<Vec<Sensed>> = vec![Vec::new(); self.recordings.len()];
        self.simulate(hypothesis, values, |r, _, instant| all[r].push(*instant.now));
        all
    }

    /// The members of a hypothesis at values of its free numbers.
    pub fn members(&self, hypothesis: &Hypothesis, values: &[f64]) -> Vec<Member> {
        let (_, effects) = hypothesis.assemble(&self.stated, values);
        hypothesis.effects.iter().cloned().zip(effects).map(|(m, v)| m.at(v)).collect()
    }

    /// Simulates all recordings; what the sensors show goes on by recording and row.
    fn simulate<T: Real>(
        &self,
        hypothesis: &Hypothesis,
        values: &[T],
        mut show: impl FnMut(usize, usize, &Instant<T>),
    ) {
        let (parameters, effects) = hypothesis.assemble(&self.stated, values);
        let hooked: Vec<(&Descriptor, &[T])> =
            hypothesis.effects.iter().map(|m| m.effect).zip(effects.iter().map(Vec::as_slice)).collect();
        for (r, recording) in self.recordings.iter().enumerate() {
            let mut plant = Plant::new(self.model, self.rig, &parameters, &hooked, recording.tick_s)
                .with_control_period(recording.ticks_per_period)
                .with_observer(recording.observer_rad_s)
                .with_lag_on_command(recording.lag_on_command);
            let [speed, flow, current, angle] = recording.start;
            plant.start(recording.time_s[0], speed, flow, current, angle);
            if let Some(command) = recording.before {
                plant.commanded_before(command);
            }
            let averages = Averages::of(&hypothesis.free, values, &recording.channels);
            run(&mut plant, recording, &hypothesis.inputs.commands[r], averages, |row, instant| {
                show(r, row, instant);
            });
        }
    }

    /// Some numbers of every sample of every channel, a stack each.
    fn stacks<T: Real, const K: usize>(
        &self,
        hypothesis: &Hypothesis,
        values: &[T],
        numbers: impl Fn(T) -> [f64; K],
    ) -> [Stack; K] {
        let delays = Delays::of(&hypothesis.free, values);
        self.collect(hypothesis, values, |response, instant| numbers(delays.sampled(response, instant)))
    }

    /// Some numbers of every channel at every instant where it has a sample, a stack each.
    fn collect<T: Real, const K: usize>(
        &self,
        hypothesis: &Hypothesis,
        values: &[T],
        numbers: impl Fn(Response, &Instant<T>) -> [f64; K],
    ) -> [Stack; K] {
        let room = |r: &Prepared| r.channels.iter().map(|c| Vec::with_capacity(c.rows.len())).collect();
        let mut stacks: [Stack; K] = std::array::from_fn(|_| self.recordings.iter().map(room).collect());
        self.simulate(hypothesis, values, |r, row, instant| {
            for (c, channel) in self.recordings[r].channels.iter().enumerate() {
                // Samples come in order of their rows; a row may have none.
                if channel.rows.get(stacks[0][r][c].len()) == Some(&row) {
                    let all = numbers(channel.response, instant);
                    stacks.iter_mut().zip(all).for_each(|(stack, one)| stack[r][c].push(one));
                }
            }
        });
        for (r, recording) in self.recordings.iter().enumerate() {
            for (c, channel) in recording.channels.iter().enumerate() {
                if channel.response == Response::ShaftAngle {
                    stacks.iter_mut().for_each(|s| rates(&mut s[r][c], &channel.rows, &recording.time_s));
                }
            }
        }
        stacks
    }

    /// Derivatives of the response by some of the free numbers, as lines of the spectrum.
    pub fn derivatives(
        &self,
        hypothesis: &Hypothesis,
        values: &[f64],
        wanted: &[usize],
    ) -> Vec<(usize, DVector<f64>)> {
        let always = Stretch { from_s: 0.0, length_s: 0.0, period_s: 0.0 };
        let (shifts, wanted): (Vec<usize>, Vec<usize>) = wanted.iter().partition(|k| {
            matches!(hypothesis.free[**k].target, Target::Sampling { .. } | Target::Averaging { .. })
        });
        let (some, all): (Vec<usize>, Vec<usize>) =
            wanted.iter().partition(|k| hypothesis.free[**k].acts.is_some());
        let tasks: Vec<Vec<(usize, Stretch)>> = all
            .into_iter()
            .map(|k| vec![(k, always)])
            .chain(groups(some.iter().filter_map(|k| Some((*k, hypothesis.free[*k].acts?))).collect()))
            .collect();
        tasks
            .par_chunks(LANES)
            .flat_map_iter(|groups| self.lanes(hypothesis, values, groups))
            .map(|(k, stack)| (k, self.spectrum.transform(&stack)))
            .chain(self.by_sampling(hypothesis, values, &shifts))
            .collect()
    }

    /// Derivatives by the instants of sampling and by how long the mean is taken: one plain simulation tells them.
    fn by_sampling(
        &self,
        hypothesis: &Hypothesis,
        values: &[f64],
        shifts: &[usize],
    ) -> Vec<(usize, DVector<f64>)> {
        if shifts.is_empty() {
            return Vec::new();
        }
        let [by_delay, by_window] =
            self.collect(hypothesis, values, |response, instant| instant.changes(response));
        let only = |of: &Stack, response| {
            let mut stack = of.clone();
            for (recording, channels) in self.recordings.iter().zip(&mut stack) {
                for (channel, samples) in recording.channels.iter().zip(channels) {
                    if channel.response != response {
                        samples.fill(0.0);
                    }
                }
            }
            self.spectrum.transform(&stack)
        };
        let each = shifts.iter().filter_map(|k| match hypothesis.free[*k].target {
            Target::Sampling { response } => Some((*k, only(&by_delay, response))),
            Target::Averaging { response } => Some((*k, only(&by_window, response))),
            _ => None,
        });
        each.collect()
    }

    /// The residual and its derivatives by up to four free numbers, as lines, by one simulation.
    pub fn residual_with_derivatives(
        &self,
        hypothesis: &Hypothesis,
        values: &[f64],
        wanted: &[usize],
    ) -> (DVector<f64>, Vec<DVector<f64>>) {
        let mut moved: Vec<Dual> = values.iter().map(|v| Dual::from(*v)).collect();
        for (lane, k) in wanted.iter().enumerate() {
            moved[*k] = Dual::parameter(values[*k], lane);
        }
        let [mut stack, a, b, c, d] = self.stacks(hypothesis, &moved, |v: Dual| {
            let [a, b, c, d] = v.slopes();
            [v.value, a, b, c, d]
        });
        self.take_from_measured(&mut stack);
        let columns = [a, b, c, d].iter().take(wanted.len()).map(|s| self.spectrum.transform(s)).collect();
        (self.spectrum.transform(&stack), columns)
    }

    /// Derivatives by one simulation: a lane a group of numbers that do not meet in time.
    fn lanes(
        &self,
        hypothesis: &Hypothesis,
        values: &[f64],
        groups: &[Vec<(usize, Stretch)>],
    ) -> Vec<(usize, Stack)> {
        let mut moved: Vec<Dual> = values.iter().map(|v| Dual::from(*v)).collect();
        for (lane, group) in groups.iter().enumerate() {
            for (k, _) in group {
                moved[*k] = Dual::parameter(values[*k], lane);
            }
        }
        let changes = self.stacks(hypothesis, &moved, Dual::slopes);
        let one = |(group, change): (&Vec<(usize, Stretch)>, Stack)| {
            group.iter().map(|(k, _)| *k).zip(self.shares(change, group)).collect::<Vec<_>>()
        };
        groups.iter().zip(changes).flat_map(one).collect()
    }

    /// Splits the change that a group made together: each sample to the member that acted last.
    fn shares(&self, change: Stack, group: &[(usize, Stretch)]) -> Vec<Stack> {
        if group.len() == 1 {
            return vec![change];
        }
        let nothing: Stack = change.iter().map(|r| r.iter().map(|c| vec![0.0; c.len()]).collect()).collect();
        let mut shares = vec![nothing; group.len()];
        for (r, recording) in self.recordings.iter().enumerate() {
            for (c, channel) in recording.channels.iter().enumerate() {
                for (i, row) in channel.rows.iter().enumerate() {
                    let owner = last_acting(group, recording.time_s[*row]);
                    shares[owner][r][c][i] = change[r][c][i];
                }
            }
        }
        shares
    }
}

/// Steps the plant through a recording's ticks under these commands and shows every log instant.
fn run<T: Real>(
    plant: &mut Plant<T>,
    recording: &Prepared,
    commands: &[f64],
    mut averages: Averages<T>,
    mut show: impl FnMut(usize, &Instant<T>),
) {
    let (stimulus, time_s, tick_s) = (&recording.stimulus, &recording.time_s, recording.tick_s);
    let mut next = stimulus.logs.iter().enumerate().peekable();
    let mut before = plant.sensed();
    let every_period = recording.ticks_per_row <= recording.ticks_per_period;
    let mut log =
        |row: usize, now: &Sensed<T>, step: (&Sensed<T>, &Sensed<T>), step_s: f64, averages: &Averages<T>| {
            show(row, &Instant { time_s: time_s[row], now, step, step_s, every_period, averages });
        };
    let collects = !averages.is_empty();
    averages.push(time_s[0], &before);
    // An instant on the grid shows the state before that tick's command acts.
    while let Some((row, _)) = next.next_if(|(_, (tick, part))| *tick == 0 && *part == 0.0) {
        log(row, &before, (&before, &before), tick_s, &averages);
    }
    let mut leaps = recording.leaps.iter().peekable();
    let mut i = 0;
    while i < stimulus.ticks.len() {
        if let Some(leap) = leaps.next_if(|leap| leap.tick == i) {
            plant.leap(stimulus.ticks[i].time_s, leap);
        }
        let Some((_, (at, part))) = next.peek() else { break };
        let count = recording.strides.get(i).copied().unwrap_or(1);
        let end = i + count;
        let shows = *at == i && *part > 0.0 || *at == end && *part == 0.0;
        if shows {
            before = plant.sensed();
        }
        plant.stride(&stimulus.ticks[i..end], Some(&commands[i..end]));
        let span_s = tick_s * count as f64;
        if collects {
            averages.push(stimulus.ticks[i].time_s + span_s, &plant.sensed());
        }
        if shows {
            let after = plant.sensed();
            while let Some((row, (_, part))) =
                next.next_if(|(_, (at, part))| *at == i && *part > 0.0 || *at == end && *part == 0.0)
            {
                let now = if *part > 0.0 { before.between(&after, *part) } else { after };
                log(row, &now, (&before, &after), span_s, &averages);
            }
        }
        i = end;
    }
    // Instants past the last tick see the last state.
    let end = plant.sensed();
    for (row, _) in next {
        log(row, &end, (&end, &end), tick_s, &averages);
    }
}
