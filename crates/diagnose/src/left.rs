//! How much a set of effects leaves, against noise.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use kort_identify::data::{Prepared, Response};
use kort_identify::fit::Fit;
use kort_identify::hypothesis::Member;
use kort_identify::scores;
use kort_identify::simulate::{Problem, Stack};
use kort_thruster::rig::Rig;

use crate::constants::Constants;
use crate::follows::follows;

/// Noise variance from sample to sample, by channel.
type Noise = BTreeMap<&'static str, f64>;

/// Squared error above the noise over full scale, all channels.
pub fn excess(problem: &Problem, residual: &Stack, floor: &Noise) -> f64 {
    let full = scores::full_scales(problem);
    scores::sums(problem, residual, |r, row| !problem.masked[r][row])
        .into_iter()
        .map(|(name, (sum, n))| {
            let noise = floor.get(name).copied().unwrap_or(0.0);
            (sum / n.max(1) as f64 - noise).max(0.0) / full[name].powi(2)
        })
        .sum()
}

/// More error than noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rest {
    /// The channel on which it is largest against what may be.
    pub channel: &'static str,
    /// Root mean square over full scale.
    pub size: f64,
    /// Over what may be.
    pub ratio: f64,
    /// Whether every other channel, and there is one, fits.
    pub alone: bool,
}

/// What a fit leaves that is no noise: either it follows what the machine does by more than our equations may err, or
/// it is larger than sensors of this kind err and what drives is in doubt.
pub fn more_than_noise(problem: &Problem, fit: &Fit, residual: &Stack, floor: &Noise) -> Option<Rest> {
    let may_err = problem.spectrum.variances(&fit.floor.levels());
    let following = follows(problem, fit, residual);
    let lasting = lasting(problem, residual);
    let doubt = problem.spectrum.variances(fit.floor.doubt());
    let mut all = Vec::new();
    for (r, recording) in problem.recordings.iter().enumerate() {
        for (c, channel) in recording.channels.iter().enumerate() {
            let rest = |size: f64, may: f64| Rest {
                channel: channel.response.name(),
                size: size / channel.full_scale,
                ratio: size / may.max(1e-300),
                alone: false,
            };
            all.push(rest(following[r][c], may_err[r][c].sqrt()));
            let noise = floor.get(channel.response.name()).copied().unwrap_or(0.0);
            let beyond = (lasting[r][c] - noise).max(0.0).sqrt();
            let practical = practical(channel.response) * channel.full_scale;
            let sensor = practical.hypot(resolution(problem.rig, recording, channel.response));
            all.push(rest(beyond, sensor.hypot(doubt[r][c].sqrt())));
        }
    }
    let most = *all.iter().filter(|rest| rest.ratio > 1.0).max_by(|a, b| a.ratio.total_cmp(&b.ratio))?;
    let mut others = all.iter().filter(|rest| rest.channel != most.channel).peekable();
    Some(Rest { alone: others.peek().is_some() && others.all(|rest| rest.ratio <= 1.0), ..most })
}

/// Share of a mean square from which on its mean is most of it.
const MOSTLY: f64 = 0.5;

/// What is more than noise, in words: when, how large, and whether it is one number all the time, as a sensor whose zero is
/// off leaves, which is one fact and too few for a name.
pub fn told(problem: &Problem, rest: Rest, residual: &Stack, regime: &str) -> String {
    let (mut sum, mut squares, mut n) = (0.0, 0.0, 0.0);
    for (r, recording) in problem.recordings.iter().enumerate() {
        for (channel, errors) in recording.channels.iter().zip(&residual[r]) {
            let in_use = |row: &usize| channel.response.name() == rest.channel && !problem.masked[r][*row];
            for (_, error) in channel.rows.iter().zip(errors).filter(|(row, _)| in_use(row)) {
                let error = error / channel.full_scale;
                (sum, squares, n) = (sum + error, squares + error * error, n + 1.0);
            }
        }
    }
    let constant = if sum * sum > MOSTLY * squares * n {
        let mean = 100.0 * sum / f64::max(n, 1.0);
        format!(", most of it one number: measured less simulated is {mean:+.1} % in the mean")
    } else {
        String::new()
    };
    format!("{regime} ({:.1} % of full scale that is no noise{constant})", 100.0 * rest.size)
}

/// Whether a fit leaves more than noise.
pub fn leaves_more(problem: &Problem, fit: &Fit) -> bool {
    let more = |fit: &Fit| {
        let residual = problem.residual(&fit.hypothesis, &fit.values);
        more_than_noise(problem, fit, &residual, &scores::noise_floor(problem, &residual)).is_some()
    };
    more(fit) && more(&at_its_best(problem, fit))
}

/// Steps of a fit that is taken further.
const STEPS: usize = 10;

/// A fit of effects taken as far as they go: while sets are compared what explains a mismatch is excused for a share of
/// it, within which numbers lie where their priors have them; that is for the odds and no part of what is left. The
/// fit itself where that leaves no less.
pub fn at_its_best(problem: &Problem, fit: &Fit) -> Fit {
    if fit.hypothesis.effects.is_empty() {
        return fit.clone();
    }
    let mut further = problem.fit(&fit.resume(), &fit.columns, &problem.floor, STEPS);
    let squares = |fit: &Fit| fit.lines.norm_squared();
    if !further.lines.iter().all(|v| v.is_finite()) || squares(&further) >= squares(fit) {
        return fit.clone();
    }
    further.floor = fit.floor.clone();
    problem.finish(further)
}

/// Effects of a fit that do less, on every channel, than our equations may err by, each with what it does at most over
/// full scale: such a name would be one for the error of an equation.
pub fn negligible(problem: &Problem, fit: &Fit, actions: &[Vec<f64>]) -> Vec<(&'static str, f64)> {
    let signals = signals(problem);
    let small = |(member, action): (&Member, &Vec<f64>)| {
        let acts = problem.spectrum.variances(action);
        within_form_error(problem, &acts, &signals).then(|| (member.effect.id, largest(problem, action)))
    };
    sized(problem, fit, actions).filter_map(small).collect()
}

/// Whether an action, as powers of the spectrum's bands, does less on every channel than our equations may err by.
pub fn is_negligible(problem: &Problem, action: &[f64]) -> bool {
    within_form_error(problem, &problem.spectrum.variances(action), &signals(problem))
}

/// What an action does at most on any channel, over full scale.
pub fn largest(problem: &Problem, action: &[f64]) -> f64 {
    let acts = problem.spectrum.variances(action);
    let full = problem.recordings.iter().flat_map(|r| &r.channels).map(|c| c.full_scale);
    acts.iter().flatten().zip(full).map(|(v, full)| v.sqrt() / full).fold(0.0, f64::max)
}

fn signals(problem: &Problem) -> Vec<Vec<f64>> {
    let signal: Vec<f64> = problem.spectrum.bands.iter().map(|band| band.signal).collect();
    problem.spectrum.variances(&signal)
}

/// The form error alone: doubts of stamps and of what runs between samples are no error of an equation.
fn within_form_error(problem: &Problem, acts: &[Vec<f64>], signals: &[Vec<f64>]) -> bool {
    let share = problem.criterion.form_error.powi(2);
    acts.iter().flatten().zip(signals.iter().flatten()).all(|(acts, signal)| *acts < share * signal)
}

/// Effects of a fit that have a size, with what they do.
fn sized<'a>(
    problem: &'a Problem,
    fit: &'a Fit,
    actions: &'a [Vec<f64>],
) -> impl Iterator<Item = (&'a Member, &'a Vec<f64>)> {
    fit.hypothesis.effects.iter().zip(actions).filter(|(member, _)| member.has_size(&problem.scale))
}

/// Share of what an effect does that is the same all the time, from which on it is steady.
const STEADY: f64 = 0.9;

/// Effects of a fit that only shift each channel.
pub fn steady(problem: &Problem, fit: &Fit, actions: &[Vec<f64>]) -> Vec<&'static str> {
    let bands = &problem.spectrum.bands;
    // The first band of each channel is its constant.
    let first = |b: usize| b == 0 || !bands[b - 1].continues;
    let shifts = |action: &Vec<f64>| {
        let power = |b: usize| action[b] * bands[b].lines.len() as f64;
        let whole: f64 = (0..bands.len()).map(power).sum();
        (0..bands.len()).filter(|b| first(*b)).map(power).sum::<f64>() > STEADY * whole
    };
    sized(problem, fit, actions)
        .filter(|(_, action)| shifts(action))
        .map(|(member, _)| member.effect.id)
        .collect()
}

/// Largest error of good sensors over their full scale, beyond the noise from one sample to the next.
fn practical(response: Response) -> f64 {
    let constants = Constants::built_in().remainder;
    if response == Response::Flow { constants.practical_flow } else { constants.practical }
}

/// Error of a speed from an encoder's counts, rad/s: counts are off by a uniform rounding each, differenced over an
/// interval and smoothed by the stated filter.
fn resolution(rig: &Rig, recording: &Prepared, response: Response) -> f64 {
    let Some(counts) = rig.sensors.encoder_counts_per_rev else { return 0.0 };
    let rounding_rad = TAU / counts / 12.0_f64.sqrt();
    match response {
        Response::ShaftSpeed => {
            let filter_s = rig.sensors.speed_filter_time_constant_s.unwrap_or(0.0);
            let share = if filter_s > 0.0 { 1.0 - (-recording.tick_s / filter_s).exp() } else { 1.0 };
            rounding_rad / recording.tick_s * share * (2.0 / (2.0 - share)).sqrt()
        }
        Response::ShaftAngle => {
            let row_s = recording.duration_s() / (recording.time_s.len() - 1) as f64;
            rounding_rad / row_s * 2.0_f64.sqrt()
        }
        _ => 0.0,
    }
}

/// Pieces of a recording a second.
const PIECES_A_SECOND: f64 = 4.0;
/// Share of the pieces that count where a log's rows are uneven: a step of the command that was lost between two rows
/// shows in few.
const USUAL: f64 = 0.9;
/// Ratio of long to short intervals, nine tenths of all between them, from which on rows are uneven.
const UNEVEN: f64 = 1.5;

/// Mean square of a residual, by recording and channel; of an uneven log without the worst tenth of its pieces.
fn lasting(problem: &Problem, residual: &Stack) -> Vec<Vec<f64>> {
    let of = |r: usize, c: usize| {
        let recording = &problem.recordings[r];
        let mut pieces: BTreeMap<i64, (f64, usize)> = BTreeMap::new();
        for (row, error) in recording.channels[c].rows.iter().zip(&residual[r][c]) {
            if !problem.masked[r][*row] {
                let piece = pieces.entry((recording.time_s[*row] * PIECES_A_SECOND) as i64).or_default();
                *piece = (piece.0 + error * error, piece.1 + 1);
            }
        }
        let mut pieces: Vec<(f64, usize)> = pieces.into_values().collect();
        if is_uneven(&recording.time_s) {
            pieces.sort_by(|a, b| (a.0 / a.1 as f64).total_cmp(&(b.0 / b.1 as f64)));
            pieces.truncate((USUAL * pieces.len() as f64).ceil() as usize);
        }
        let (sum, n) = pieces.iter().fold((0.0, 0), |(s, n), piece| (s + piece.0, n + piece.1));
        sum / n.max(1) as f64
    };
    (0..residual.len()).map(|r| (0..residual[r].len()).map(|c| of(r, c)).collect()).collect()
}

/// Whether intervals from row to row differ much.
fn is_uneven(time_s: &[f64]) -> bool {
    let mut steps: Vec<f64> = time_s.windows(2).map(|w| w[1] - w[0]).collect();
    steps.sort_by(f64::total_cmp);
    let at = |share: f64| steps.get((share * steps.len() as f64) as usize).copied().unwrap_or(0.0);
    at(0.95) > UNEVEN * at(0.05)
}

#[cfg(test)]
mod tests {
    use kort_identify::scores::noise_floor;

    use super::{is_uneven, more_than_noise, told};
    use crate::stand;

    /// Whether an error of the shaft's speed, in hundredths of its full scale of 30 rad/s, is more than noise.
    fn more(error: impl Fn(f64, f64, f64) -> f64) -> bool {
        stand::left(
            |speed, time, noise| 0.3 * error(speed, time, noise),
            |problem, fit, residual| {
                more_than_noise(problem, fit, residual, &noise_floor(problem, residual)).is_some()
            },
        )
    }

    #[test]
    fn noise_of_any_size_is_noise() {
        assert!(!more(|_, _, noise| 0.2 * noise));
        assert!(!more(|_, _, noise| 6.0 * noise));
    }

    #[test]
    fn what_follows_the_speed_is_none_however_much_noise_is_about() {
        assert!(more(|speed, _, noise| 1.5 * (2.0 * speed).sin() + 4.0 * noise));
        assert!(
            !more(|speed, _, noise| 0.1 * (2.0 * speed).sin() + 4.0 * noise),
            "less than our equations may err"
        );
    }

    #[test]
    fn what_follows_nothing_counts_from_a_practical_size_on() {
        assert!(more(|_, time, noise| 6.0 * (0.7 * time).sin() + 0.2 * noise));
        assert!(!more(|_, time, noise| 1.0 * (0.7 * time).sin() + 0.2 * noise));
    }

    #[test]
    fn what_is_one_number_all_the_time_is_said() {
        let words = |error: fn(f64, f64, f64) -> f64| {
            stand::left(error, |problem, fit, residual| {
                let rest = more_than_noise(problem, fit, residual, &noise_floor(problem, residual));
                told(problem, rest.unwrap(), residual, "throughout")
            })
        };
        let offset = words(|_, _, noise| 1.5 + 0.1 * noise);
        assert!(offset.contains("one number") && offset.contains("+5.0 %"), "{offset}");
        let wave = words(|_, time, _| 1.8 * (0.7 * time).sin());
        assert!(wave.starts_with("throughout (") && !wave.contains("one number"), "{wave}");
    }

    #[test]
    fn rows_are_uneven_where_most_intervals_differ() {
        let even: Vec<f64> =
            (0..400).filter(|k| !(150..200).contains(k)).map(|k| 0.01 * f64::from(k)).collect();
        let uneven: Vec<f64> = (0..400).map(|k| 0.01 * (f64::from(k) + 0.4 * f64::from(k % 2))).collect();
        assert!(!is_uneven(&even), "a gap is no uneven log");
        assert!(is_uneven(&uneven));
    }
}
