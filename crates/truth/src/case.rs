//! A case: recording, rig file, sealed answer.

use crate::answer::{Answer, CaseKind, HiddenEffect, Nuisance};
use crate::dice::Dice;
use crate::families::{self, Family};
use crate::grammar;
use crate::log;
use crate::machine::Scale;
use crate::noises::{self, Noise};
use crate::physics::Physics;
use crate::plan::{Plan, Selection, draw};
use crate::refit;
use crate::run::Bench;
use crate::sizing::{BaseColumns, Experiment, Hidden, Trial};
use crate::statement::{Claim, Quantity, Recorded, claims, rig_toml};

/// A case of the blind proof.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// The recording as a CSV file.
    pub recording_csv: String,
    /// The rig file.
    pub rig_toml: String,
    /// The answer; nothing of it stands in the two files.
    pub answer: Answer,
}

/// Draws that are tried until a re-fit leaves enough of every effect.
const ATTEMPTS: usize = 4;
/// Share of an effect's size that a re-fit within tolerances must leave.
const LEFT: f64 = 0.3;
/// Share of a nameless term that no effect of the catalogue may take.
const NAMELESS: f64 = 0.5;

/// A case before it is recorded.
struct Setup {
    plan: Plan,
    trial: Trial,
    claims: Vec<Claim>,
    full: Scale,
    hidden: Hidden,
    effects: Vec<HiddenEffect>,
}

/// Builds a case; the same kind, seed and selection give the same bytes.
///
/// An effect that the stated tolerances would let a re-fit absorb is no question to ask: such draws
/// are replaced, a few times at most, by ones that state closer what they must.
pub fn case(kind: CaseKind, seed: u64, selection: &Selection) -> Case {
    // Kind and seed together name the stream.
    let mut dice = Dice::new(seed, 200 + kind as u64);
    let mut attempt = 0;
    loop {
        let setup = prepare(kind, seed, selection, attempt, &mut dice);
        let fair = setup.effects.iter().all(|effect| {
            effect.visible_after_refit > LEFT * effect.share_of_full_scale
                && effect.share_of_full_scale > 0.5 * effect.wanted
        });
        attempt += 1;
        if fair || attempt >= ATTEMPTS {
            // Effects that do no harm alone may make a loop run away together: another draw then.
            if let Some(case) = record(kind, seed, selection, setup, &mut dice) {
                return case;
            }
        }
    }
}

fn prepare(kind: CaseKind, seed: u64, selection: &Selection, attempt: usize, dice: &mut Dice) -> Setup {
    let mut plan = draw(kind, seed, selection, dice);
    let mut close: Vec<Quantity> =
        plan.wanted.iter().flat_map(|wanted| wanted.family.anchors).copied().collect();
    if kind == CaseKind::Confounded || (attempt > 0 && kind != CaseKind::Clean) {
        close.extend([Quantity::Lift, Quantity::Flux, Quantity::TorqueConstant]);
        plan.log.columns.torque |= plan.machine.wet() && attempt > 0;
    }
    if kind == CaseKind::Confounded || attempt > 1 {
        close = Quantity::of(&plan.machine);
    }
    let trial = plan.trial(dice);
    let claims = claims(&plan.machine, &close, dice);
    let experiment = Experiment::new(&plan.machine, &trial, plan.log);
    let full = experiment.full;
    let base = if kind == CaseKind::Clean { None } else { Some(experiment.base_columns(&claims)) };
    let (mut hidden, mut effects) = (Hidden::new(), Vec::new());
    for wanted in &plan.wanted {
        let mut one = vec![shape(kind, wanted.family, wanted.form, &plan, &experiment, dice)];
        let share = if wanted.family.sized {
            experiment.size(&mut one, wanted.share)
        } else {
            one[0].set(1.0);
            experiment.share(&mut one)
        };
        let visible = base.as_ref().map_or(0.0, |base| experiment.visible(&mut one, base).0);
        effects.push(HiddenEffect {
            effect: wanted.family.id.to_owned(),
            form: wanted.family.forms[wanted.form].to_owned(),
            same_physics: wanted.family.same_physics.to_vec(),
            same_sets: wanted.family.same_sets.iter().map(|set| set.to_vec()).collect(),
            path: wanted.family.path.name(),
            wanted: if wanted.family.sized { wanted.share } else { share.0 },
            share_of_full_scale: share.0,
            channel: share.1,
            visible_after_refit: visible,
        });
        hidden.append(&mut one);
    }
    if let (Some(wanted), Some(base)) = (plan.outside, &base) {
        let (term, effect) = nameless(&plan, &experiment, base, wanted, dice);
        hidden.push(term);
        effects.push(effect);
    }
    Setup { plan, trial, claims, full, hidden, effects }
}

/// The shape of an effect; in a confounded case one that its rivals can have.
fn shape(
    kind: CaseKind,
    family: &Family,
    form: usize,
    plan: &Plan,
    experiment: &Experiment,
    dice: &mut Dice,
) -> Box<dyn Physics> {
    let draw = |dice: &mut Dice| (family.draw)(form, &plan.machine, &experiment.full, dice);
    let mut drawn = draw(dice);
    if kind != CaseKind::Confounded {
        return drawn;
    }
    for _ in 0..24 {
        let mut one = vec![drawn];
        one[0].set(0.02);
        let fits = match family.id {
            // Friction opposes the turning, so its rival does.
            "torque_channel_bias" => experiment.turns_slower(&mut one),
            "clock_skew" => experiment.share(&mut one).1 == "thrust_n",
            _ => true,
        };
        drawn = one.remove(0);
        if fits {
            break;
        }
        drawn = draw(dice);
    }
    drawn
}

/// A term that no effect of the catalogue does the work of.
fn nameless(
    plan: &Plan,
    experiment: &Experiment,
    base: &BaseColumns,
    wanted: f64,
    dice: &mut Dice,
) -> (Box<dyn Physics>, HiddenEffect) {
    let columns = plan.log.columns;
    let mut best: Option<(f64, Hidden, HiddenEffect)> = None;
    let mut named: Option<Vec<Vec<f64>>> = None;
    for _ in 0..8 {
        let term = grammar::draw(&plan.machine, &experiment.full, columns.flow, columns.thrust, dice);
        let path = term.path().name();
        let mut one: Hidden = vec![Box::new(term.clone())];
        let share = experiment.size(&mut one, wanted);
        let (visible, rest) = experiment.visible(&mut one, base);
        if share.0 < 0.5 * wanted || visible < LEFT * share.0 {
            continue;
        }
        let named = named.get_or_insert_with(|| actions(plan, experiment, dice));
        let length = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>().sqrt();
        let unnamed = named
            .iter()
            .map(|action| {
                // Alone or with one partner at a time would take long: each alone.
                let share = refit::project(std::slice::from_ref(action), &rest, &[0.0])[0];
                let left: Vec<f64> = rest.iter().zip(action).map(|(r, a)| r - share * a).collect();
                length(&left) / length(&rest).max(1e-30)
            })
            .fold(1.0, f64::min);
        let effect = HiddenEffect {
            effect: format!("outside_{path}"),
            form: term.to_string(),
            same_physics: Vec::new(),
            same_sets: Vec::new(),
            path,
            wanted,
            share_of_full_scale: share.0,
            channel: share.1,
            visible_after_refit: visible,
        };
        if best.as_ref().is_none_or(|(most, ..)| unnamed > *most) {
            best = Some((unnamed, one, effect));
        }
        if best.as_ref().is_some_and(|(most, ..)| *most > NAMELESS) {
            break;
        }
    }
    match best {
        Some((_, mut one, effect)) => (one.remove(0), effect),
        // Nothing in eight draws could be seen: a load that comes on half way.
        None => {
            let term = grammar::switched_load();
            let mut one: Hidden = vec![Box::new(term.clone())];
            let share = experiment.size(&mut one, wanted);
            let effect = HiddenEffect {
                effect: "outside_shaft".to_owned(),
                form: term.to_string(),
                same_physics: Vec::new(),
                same_sets: Vec::new(),
                path: "shaft",
                wanted,
                share_of_full_scale: share.0,
                channel: share.1,
                visible_after_refit: experiment.visible(&mut one, base).0,
            };
            (one.remove(0), effect)
        }
    }
}

/// What each effect of the catalogue that the machine may have does, in its first form.
fn actions(plan: &Plan, experiment: &Experiment, dice: &mut Dice) -> Vec<Vec<f64>> {
    families::ALL
        .iter()
        .filter(|family| (family.fits)(&plan.machine) && family.sized)
        .map(|family| {
            let mut one = vec![(family.draw)(0, &plan.machine, &experiment.full, dice)];
            one[0].set(0.03);
            experiment.action(&mut one)
        })
        .collect()
}

/// Runs the machine with all that is hidden and noisy, and writes it down; none if it runs away.
fn record(kind: CaseKind, seed: u64, selection: &Selection, setup: Setup, dice: &mut Dice) -> Option<Case> {
    let Setup { plan, trial, claims, full, mut hidden, effects } = setup;
    let (mut noises, mut spoils, mut nuisances) = (Vec::new(), Vec::new(), Vec::new());
    for noise in noises::ALL {
        let drawn = dice.chance(noise.share) && (noise.fits)(&plan.machine);
        if !drawn || selection.without_noise.iter().any(|name| name == noise.name) {
            continue;
        }
        match (noise.draw)(&plan.machine, &full, dice) {
            Noise::Physical(physics) => noises.push(physics),
            Noise::Logged(spoil) => spoils.push(spoil),
        }
        nuisances.push(Nuisance { noise: noise.name, names: noise.names.to_vec() });
    }
    hidden.append(&mut noises);
    let bench = Bench { machine: &plan.machine, full, step_s: plan.machine.fine_step_s(), quantise: true };
    let trace = bench.run(trial.driver(), &mut hidden);
    if trace.broken {
        return None;
    }
    let setpoint = trial.controller.as_ref().map(|law| (law.column(), trial.asked.as_slice()));
    let mut table = log::table(&plan.machine, &trace, setpoint, &plan.log, dice);
    for spoil in &mut spoils {
        spoil.spoil(&mut table, dice);
    }
    let name = format!("case-{:07x}", dice.number() >> 36);
    let recorded =
        Recorded { torque: plan.log.columns.torque, irregular: plan.log.stamps == log::Stamps::Uneven };
    Some(Case {
        recording_csv: table.csv(),
        rig_toml: rig_toml(&plan.machine, &name, &claims, recorded),
        answer: Answer {
            kind,
            seed,
            class: plan.machine.class,
            dry: !plan.machine.wet(),
            sections: plan.machine.blades.as_ref().map_or(0, |blades| blades.sections.len()),
            excitation: format!("{:?}", plan.excitation),
            closed_loop: setpoint.map(|(column, _)| column),
            stamps: format!("{:?}", plan.log.stamps),
            noises: nuisances,
            effects,
            confounded: plan.confounded,
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A confounded case claims that nobody can part its rivals: each of them, together with a re-fit
    /// within tolerances, must come within the noise of what is hidden.
    #[test]
    fn rivals_of_a_confounded_case_cannot_be_told_apart() {
        for seed in 5..10 {
            let kind = CaseKind::Confounded;
            let mut dice = Dice::new(seed, 200 + kind as u64);
            let mut setup = prepare(kind, seed, &Selection::default(), 0, &mut dice);
            let experiment = Experiment::new(&setup.plan.machine, &setup.trial, setup.plan.log);
            let base = experiment.base_columns(&setup.claims);
            let wanted = setup.plan.wanted[0].share;
            for rival in setup.plan.confounded.iter().filter(|id| **id != setup.plan.wanted[0].family.id) {
                let family = families::find(rival).unwrap();
                let mut one = vec![shape(kind, family, 0, &setup.plan, &experiment, &mut dice)];
                experiment.size(&mut one, wanted);
                let left = experiment.apart(&mut setup.hidden, &mut one, &base);
                let seen = energy(&experiment.action(&mut setup.hidden));
                assert!(left < 60.0, "seed {seed}: {rival} leaves {left} of {seen} squared sigma");
            }
        }
    }

    fn energy(values: &[f64]) -> f64 {
        values.iter().map(|value| value * value).sum()
    }
}
