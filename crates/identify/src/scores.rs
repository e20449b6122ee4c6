//! Errors of fits by channel: on rows fitted and rows held out, before and after.

use std::collections::BTreeMap;

use kort_thruster::effects::Scale;
use rand::{Rng, SeedableRng};
use serde::Serialize;

use crate::fit::Fit;
use crate::hypothesis::{Member, Target};
use crate::simulate::{Problem, Stack};

/// A parameter with its uncertainty.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ParameterReport {
    /// Name, unit last.
    pub name: String,
    /// Fitted value.
    pub value: f64,
    /// Unit.
    pub unit: String,
    /// Standard error of the fit, prior included.
    pub std_error: f64,
    /// What the rig description states; none for an effect's value.
    pub stated: Option<f64>,
    /// At the edge of what is allowed: a symptom, not a value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at_bound: Option<bool>,
}

/// Errors of the baseline on one channel, root mean square over full scale.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ChannelReport {
    /// On the rows fitted.
    pub nrmse_train: f64,
    /// On the rows held out.
    pub nrmse_heldout: f64,
    /// What measurement noise alone would give.
    pub noise_floor: f64,
    /// Whether the residual is white.
    pub white: bool,
}

/// Errors before and after on one channel, root mean square over full scale, held-out rows.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BeforeAfter {
    /// Without the effect.
    pub nrmse_before: f64,
    /// With it.
    pub nrmse_after: f64,
}

/// Gain on rows that were not fitted.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HeldOut {
    /// By channel.
    pub channels: BTreeMap<String, BeforeAfter>,
    /// Share of the squared error above the noise floor that goes, on the channel with most of it.
    pub excess_error_removed: f64,
    /// Bootstrap over blocks.
    pub interval_95: [f64; 2],
}

/// Free numbers of a fit for a report: the baseline's, or those of one effect.
pub fn parameters(fit: &Fit, std_errors: &[f64], effect: Option<usize>) -> Vec<ParameterReport> {
    let at_bound = fit.at_bound();
    fit.hypothesis
        .free
        .iter()
        .enumerate()
        .filter(|(_, f)| match (f.target, effect) {
            (Target::Base(_), None) => true,
            (Target::Effect(i, _), Some(wanted)) => i == wanted,
            _ => false,
        })
        .map(|(k, f)| ParameterReport {
            name: f.name.into(),
            value: fit.values[k],
            unit: f.unit.into(),
            std_error: std_errors[k],
            stated: f.stated.then_some(f.mean),
            at_bound: Some(at_bound[k]),
        })
        .chain(effect.into_iter().flat_map(|i| taken_as_given(&fit.hypothesis.effects[i])))
        .collect()
}

/// What a fit has of the model's own parameters and of every effect that is taken to be there.
pub fn all_parameters(fit: &Fit, std_errors: &[f64]) -> Vec<ParameterReport> {
    let effects = (0..fit.hypothesis.effects.len()).map(Some);
    std::iter::once(None).chain(effects).flat_map(|effect| parameters(fit, std_errors, effect)).collect()
}

/// An effect that was fitted with the model.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FittedEffect {
    /// Catalogue identifier.
    pub effect: String,
    /// Where it enters.
    pub path: String,
    /// Equation.
    pub equation: String,
    /// Fitted values.
    pub parameters: Vec<ParameterReport>,
}

/// The effects of a fit with their values.
pub fn fitted_effects(fit: &Fit, std_errors: &[f64]) -> Vec<FittedEffect> {
    let fitted = |(i, member): (usize, &Member)| FittedEffect {
        effect: member.effect.id.into(),
        path: member.effect.path.name().into(),
        equation: member.effect.equation.into(),
        parameters: parameters(fit, std_errors, Some(i)),
    };
    fit.hypothesis.effects.iter().enumerate().map(fitted).collect()
}

/// Values of an effect that are not fitted and without which those that are mean nothing: the order of a ripple, the
/// command at which a curve ends; and that which is there or not.
fn taken_as_given(member: &Member) -> Vec<ParameterReport> {
    let specs = (member.effect.parameters)(&Scale::ANY);
    let belongs = |place: usize| {
        let group = specs[place + 1..].iter().take_while(|s| !(s.held && s.shape)).count();
        group == 0 || (place + 1..=place + group).any(|k| !member.held.contains(&k))
    };
    let switched_on = |place: usize| member.held.contains(&place) && member.values[place] != 0.0;
    (0..specs.len())
        .filter(|j| specs[*j].held && if specs[*j].shape { belongs(*j) } else { switched_on(*j) })
        .map(|j| ParameterReport {
            name: specs[j].name.into(),
            value: member.values[j],
            unit: specs[j].unit.into(),
            std_error: 0.0,
            stated: None,
            at_bound: Some(false),
        })
        .collect()
}

/// Sum of squares and count, by channel name.
pub type Sums = BTreeMap<&'static str, (f64, usize)>;

/// Sums of squared residuals over rows that `pick` takes.
pub fn sums(problem: &Problem, residual: &Stack, pick: impl Fn(usize, usize) -> bool) -> Sums {
    let mut out = Sums::new();
    for (r, recording) in problem.recordings.iter().enumerate() {
        for (c, channel) in recording.channels.iter().enumerate() {
            let entry = out.entry(channel.response.name()).or_insert((0.0, 0));
            for (row, value) in channel.rows.iter().zip(&residual[r][c]) {
                if pick(r, *row) {
                    entry.0 += value * value;
                    entry.1 += 1;
                }
            }
        }
    }
    out
}

/// Full scale of each channel over all recordings.
pub fn full_scales(problem: &Problem) -> BTreeMap<&'static str, f64> {
    let mut out = BTreeMap::new();
    for channel in problem.recordings.iter().flat_map(|r| &r.channels) {
        let full = out.entry(channel.response.name()).or_insert(0.0_f64);
        *full = full.max(channel.full_scale);
    }
    out
}

/// Noise variance of each channel from second differences of the residual, away from edges: what
/// no smooth model could explain.
pub fn noise_floor(problem: &Problem, residual: &Stack) -> BTreeMap<&'static str, f64> {
    let mut out: BTreeMap<&'static str, (f64, usize)> = BTreeMap::new();
    for (r, recording) in problem.recordings.iter().enumerate() {
        let mut near = vec![false; recording.time_s.len()];
        for edge in &recording.edges {
            let to = (edge + 15).min(near.len());
            near[edge.saturating_sub(1)..to].fill(true);
        }
        for (c, channel) in recording.channels.iter().enumerate() {
            let entry = out.entry(channel.response.name()).or_insert((0.0, 0));
            for (rows, e) in channel.rows.windows(3).zip(residual[r][c].windows(3)) {
                if rows.iter().any(|row| near[*row] || problem.masked[r][*row]) {
                    continue;
                }
                entry.0 += (e[0] - 2.0 * e[1] + e[2]).powi(2) / 6.0;
                entry.1 += 1;
            }
        }
    }
    out.into_iter().map(|(name, (sum, n))| (name, if n > 20 { sum / n as f64 } else { 0.0 })).collect()
}

/// Errors of the baseline for the report: fitted rows, held-out rows, floor, whiteness.
pub fn channels(
    problem: &Problem,
    held: &[Vec<bool>],
    train: &Stack,
    full_fit: &Stack,
    floor: &BTreeMap<&'static str, f64>,
) -> BTreeMap<String, ChannelReport> {
    let usable = |r: usize, row: usize| !problem.masked[r][row];
    let inside = sums(problem, train, |r, row| usable(r, row) && !held[r][row]);
    let outside = sums(problem, train, |r, row| usable(r, row) && held[r][row]);
    let full = full_scales(problem);
    let nrmse = |(sum, n): (f64, usize), full: f64| (sum / n.max(1) as f64).sqrt() / full;
    inside
        .iter()
        .map(|(name, sum)| {
            let scale = full[name];
            let report = ChannelReport {
                nrmse_train: nrmse(*sum, scale),
                nrmse_heldout: nrmse(outside[name], scale),
                noise_floor: floor.get(name).copied().unwrap_or(0.0).sqrt() / scale,
                white: is_white(problem, full_fit, name),
            };
            ((*name).to_string(), report)
        })
        .collect()
}

/// Least share of a channel's square that what is told must make, to tell anything.
const TOLD: f64 = 0.1;

/// Whether a fit of this residual follows any channel more than nothing that moves does.
pub fn predicts(problem: &Problem, residual: &Stack) -> bool {
    let on = |r: usize, c: usize| {
        let channel = &problem.recordings[r].channels[c];
        let rows = channel.rows.iter().enumerate();
        let picks = rows.filter(|(_, row)| !problem.masked[r][**row]);
        let (error, signal) = picks.fold((0.0, 0.0), |(error, signal), (k, _)| {
            (error + residual[r][c][k].powi(2), signal + channel.values[k].powi(2))
        });
        error < (1.0 - TOLD) * signal
    };
    (0..residual.len()).any(|r| (0..residual[r].len()).any(|c| on(r, c)))
}

/// First five autocorrelations of a channel's residual within three standard errors.
fn is_white(problem: &Problem, residual: &Stack, name: &str) -> bool {
    for (r, recording) in problem.recordings.iter().enumerate() {
        for (c, channel) in recording.channels.iter().enumerate() {
            if channel.response.name() != name {
                continue;
            }
            let e = &residual[r][c];
            let power: f64 = e.iter().map(|v| v * v).sum();
            for lag in 1..=5.min(e.len() - 1) {
                let product: f64 = e.iter().zip(&e[lag..]).map(|(a, b)| a * b).sum();
                if (product / power.max(1e-300)).abs() > 3.5 / (e.len() as f64).sqrt() {
                    return false;
                }
            }
        }
    }
    true
}

/// Gain of `after` over `before` on held-out rows, both fitted without them.
pub fn held_out(
    problem: &Problem,
    held: &[Vec<bool>],
    before: &Stack,
    after: &Stack,
    floor: &BTreeMap<&'static str, f64>,
    seed: u64,
) -> HeldOut {
    let pick = |r: usize, row: usize| held[r][row] && !problem.masked[r][row];
    let (b, a) = (sums(problem, before, pick), sums(problem, after, pick));
    let full = full_scales(problem);
    let rms = |(sum, n): (f64, usize)| (sum / n.max(1) as f64).sqrt();
    // The channel where most goes, against its noise.
    let height = |name: &str| {
        let noise = floor.get(name).copied().unwrap_or(0.0).max(1e-12 * full[name] * full[name]);
        (b[name].0 - a[name].0) / (noise * (b[name].1.max(1) as f64).sqrt())
    };
    let best = b.keys().copied().max_by(|x, y| height(x).total_cmp(&height(y)));
    let (removed, interval_95) = best.map_or((0.0, [0.0, 0.0]), |name| {
        let noise = floor.get(name).copied().unwrap_or(0.0);
        let pieces = pieces(problem, held, before, after, name);
        let share = |list: &[usize]| {
            let (mut sb, mut sa, mut n) = (0.0, 0.0, 0.0);
            for i in list {
                sb += pieces[*i].0;
                sa += pieces[*i].1;
                n += pieces[*i].2;
            }
            let excess = (sb - noise * n).max(1e-12 * sb.max(1e-300));
            ((sb - sa) / excess).clamp(-1.0, 1.0)
        };
        let everything: Vec<usize> = (0..pieces.len()).collect();
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let mut draws: Vec<f64> = (0..400)
            .map(|_| {
                let list: Vec<usize> = (0..pieces.len()).map(|_| rng.random_range(0..pieces.len())).collect();
                share(&list)
            })
            .collect();
        draws.sort_by(f64::total_cmp);
        (share(&everything), [draws[9], draws[389]])
    });
    HeldOut {
        channels: b
            .iter()
            .map(|(name, sum)| {
                let pair = BeforeAfter {
                    nrmse_before: rms(*sum) / full[name],
                    nrmse_after: rms(a[name]) / full[name],
                };
                ((*name).to_string(), pair)
            })
            .collect(),
        excess_error_removed: removed,
        interval_95,
    }
}

/// Squared errors before and after, and counts, in one-second pieces of the held-out rows.
fn pieces(
    problem: &Problem,
    held: &[Vec<bool>],
    before: &Stack,
    after: &Stack,
    name: &str,
) -> Vec<(f64, f64, f64)> {
    let mut out: BTreeMap<(usize, i64), (f64, f64, f64)> = BTreeMap::new();
    for (r, recording) in problem.recordings.iter().enumerate() {
        for (c, channel) in recording.channels.iter().enumerate() {
            if channel.response.name() != name {
                continue;
            }
            for (i, row) in channel.rows.iter().enumerate() {
                if !held[r][*row] || problem.masked[r][*row] {
                    continue;
                }
                let piece = out.entry((r, recording.time_s[*row].floor() as i64)).or_insert((0.0, 0.0, 0.0));
                piece.0 += before[r][c][i].powi(2);
                piece.1 += after[r][c][i].powi(2);
                piece.2 += 1.0;
            }
        }
    }
    out.into_values().collect()
}

#[cfg(test)]
mod tests {
    use kort_thruster::models::ModelName;
    use kort_thruster::rig::Rig;

    use super::*;
    use crate::data::Series;
    use crate::noise::Criterion;
    use crate::setup::Setup;

    #[test]
    fn a_shaft_that_is_taken_to_stand_tells_nothing_of_one_that_moves_and_a_level_is_told_by_its_mean() {
        let rig = "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 0.1\n";
        let rig = Rig::from_toml(rig).unwrap();
        let criterion =
            Criterion { form_error: 0.005, own_form_error: 0.2, facts_a_band: 10.0, timing_s: 0.001 };
        let tells = |speed: fn(usize) -> f64, left: fn(f64) -> f64| {
            let series = Series {
                name: "log".into(),
                time_s: (0..400).map(|k| 0.01 * k as f64).collect(),
                columns: vec![
                    ("current_cmd_a".into(), (0..400).map(|k| (0.1 * k as f64).sin()).collect()),
                    ("shaft_speed_rad_s".into(), (0..400).map(speed).collect()),
                ],
            };
            let problem = Setup::new(&[series], &rig, ModelName::Model2, criterion).unwrap().problem;
            let of = |channel: &crate::data::Channel| channel.values.iter().map(|v| left(*v)).collect();
            let residual: Stack =
                problem.recordings.iter().map(|r| r.channels.iter().map(of).collect()).collect();
            predicts(&problem, &residual)
        };
        let noise = |k: usize| 10.0 * (k as f64 * k as f64 * 0.7).sin();
        let level = |k: usize| 40.0 + 0.1 * (k as f64 * k as f64 * 0.7).sin();
        assert!(!tells(noise, |v| v), "at rest");
        assert!(!tells(noise, |v| 0.97 * v), "hardly more than at rest");
        assert!(tells(noise, |v| 0.5 * v));
        assert!(tells(level, |v| v - 40.0), "what is left of a level is noise");
    }
}
