//! A case: a recording, the rig file stated for it, and the sealed answer.

use crate::calibrate::{Channels, Experiment, FINE_STEPS};
use crate::chain::TICK_S;
use crate::dynamics::Scale;
use crate::effects::{Effect, Shape, Stated};
use crate::hidden::{Hidden, Unknown};
use crate::noise::Noise;
use crate::programme::{Programme, commands};
use crate::rig::{self, Class, RigFile};
use crate::stand::{ROWS_PER_FLOW, Rows, Stand};
use crate::thruster::Thruster;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha12Rng;
use serde::Serialize;
use std::fmt::Write;

/// What a case hides.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CaseKind {
    /// One effect.
    Single,
    /// Nothing.
    Clean,
    /// Two effects.
    Pair,
    /// One effect under an excitation that cannot part it from its rivals.
    Confounded,
    /// Physics outside the catalogue.
    Outside,
}

impl CaseKind {
    /// All kinds.
    pub const ALL: [CaseKind; 5] =
        [CaseKind::Single, CaseKind::Clean, CaseKind::Pair, CaseKind::Confounded, CaseKind::Outside];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            CaseKind::Single => "single",
            CaseKind::Clean => "clean",
            CaseKind::Pair => "pair",
            CaseKind::Confounded => "confounded",
            CaseKind::Outside => "outside",
        }
    }
}

/// Choices that override the draw.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Selection {
    /// Effect id for a single case.
    pub effect: Option<String>,
    /// Share of full scale.
    pub strength: Option<f64>,
    /// Distributed blade sections (true), one lumped section (false), or drawn.
    pub distributed: Option<bool>,
}

/// One hidden effect in the answer.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HiddenEffect {
    /// Catalogue id.
    pub effect: &'static str,
    /// Ids that name the same physics.
    pub same_physics: Vec<&'static str>,
    /// Path on which it acts.
    pub path: &'static str,
    /// Share of full scale that was wanted.
    pub wanted: f64,
    /// Root-mean-square change on its best channel over full scale, as made.
    pub share_of_full_scale: f64,
    /// That channel.
    pub channel: &'static str,
    /// What is left of it after a re-fit of the base parameters within tolerances.
    pub visible_after_refit: f64,
}

/// The sealed answer.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Answer {
    /// What the case hides.
    pub kind: CaseKind,
    /// Seed of the case.
    pub seed: u64,
    /// Thruster class.
    pub class: &'static str,
    /// Blade sections of the truth.
    pub sections: usize,
    /// Excitation, in words.
    pub programme: String,
    /// Hidden effects; for physics outside the catalogue the id is no catalogue id.
    pub effects: Vec<HiddenEffect>,
    /// Ids that this excitation cannot part, the hidden one among them.
    pub confounded: Vec<&'static str>,
}

impl Answer {
    /// Short name for folders.
    pub fn label(&self) -> String {
        let ids: Vec<&str> = self.effects.iter().map(|effect| effect.effect).collect();
        if ids.is_empty() { "none".to_owned() } else { ids.join("+") }
    }
}

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

/// Plan of a case before it is run.
struct Plan {
    class: Class,
    programme: Programme,
    channels: Channels,
    anchors: Vec<Stated>,
    hidden: Vec<(Effect, Shape, f64)>,
    unknown: Option<(Unknown, f64, f64)>,
    confounded: Vec<Effect>,
    distributed: bool,
}

/// Rigs and programmes that are tried until a re-fit leaves enough of the effect.
const ATTEMPTS: usize = 4;
/// Share of an effect's size that a re-fit within tolerances must leave.
const LEFT: f64 = 0.3;

/// Shape of a force sensor with a wrong gain, without bias or play.
const GAIN_ALONE: Shape = [0.9, -2.0 / 3.0, 1.0, 0.0, 0.0, 0.0];

/// A case before its recording.
struct Setup {
    plan: Plan,
    thruster: Thruster,
    command_a: Vec<f64>,
    rig: RigFile,
    hidden: Hidden,
    effects: Vec<HiddenEffect>,
    scale: Scale,
}

/// Builds a case; the same kind, seed and selection give the same bytes.
///
/// An effect that the stated tolerances would let a re-fit absorb is no question to ask: such draws
/// are replaced, at most a few times, by ones with a closer rig statement.
pub fn case(kind: CaseKind, seed: u64, selection: &Selection) -> Case {
    // Kind and seed together name the random stream.
    let mut rng = ChaCha12Rng::seed_from_u64(seed);
    rng.set_stream(100 + kind as u64);
    let mut setup = prepare(kind, seed, selection, 0, &mut rng);
    for attempt in 1..ATTEMPTS {
        if setup.effects.iter().all(|effect| effect.visible_after_refit > LEFT * effect.share_of_full_scale) {
            break;
        }
        setup = prepare(kind, seed, selection, attempt, &mut rng);
    }
    let Setup { plan, thruster, command_a, rig, hidden, effects, scale } = setup;
    let noise = draw_noise(scale, command_a.len() as f64 * TICK_S, &thruster, &mut rng);
    let stand = Stand {
        thruster: &thruster,
        hidden: &hidden,
        scale,
        thrust_full_scale_n: plan.class.thrust_full_scale_n(),
        steps_per_tick: FINE_STEPS,
    };
    let rows = stand.record(&command_a, noise, rng.random());
    Case {
        recording_csv: csv(&rows, plan.channels),
        rig_toml: rig.text,
        answer: Answer {
            kind,
            seed,
            class: thruster.class,
            sections: thruster.sections.len(),
            programme: format!("{:?}", plan.programme),
            effects,
            confounded: plan.confounded.iter().map(|rival| rival.id()).collect(),
        },
    }
}

fn prepare(kind: CaseKind, seed: u64, selection: &Selection, attempt: usize, rng: &mut ChaCha12Rng) -> Setup {
    let mut plan = draw(kind, seed, selection, rng);
    let mut thruster = plan.class.specimen(rng);
    if plan.distributed {
        thruster.distribute(rng.random_range(8..=12), 0.6, 0.8);
    }
    let command_a = commands(plan.programme, thruster.current_limit_a, rng);
    if plan.anchors.is_empty() && rng.random::<f64>() < 0.6 {
        plan.anchors = vec![Stated::Lift, Stated::Flux];
    }
    if kind != CaseKind::Confounded && attempt > 0 {
        plan.channels.torque = true;
        plan.anchors.extend([Stated::Lift, Stated::Flux]);
        if attempt > 1 {
            plan.anchors.extend([Stated::Drag, Stated::TorqueConstant, Stated::Inertia, Stated::AddedMass]);
        }
    }
    let name = format!("case-{:07x}", rng.random::<u32>() >> 4);
    let rig = rig::state(&thruster, plan.class, &name, &plan.anchors, plan.channels.torque, rng);
    let experiment = Experiment::new(&thruster, &command_a, plan.channels);
    let scale = experiment.scale;

    let mut hidden = Hidden::default();
    let mut effects = Vec::new();
    for (effect, shape, wanted) in &plan.hidden {
        let alone = |strength: f64| {
            let mut one = Hidden::default();
            effect.set(&mut one, strength, shape, &thruster, &scale);
            one
        };
        let strength = experiment.strength(*wanted, alone);
        effect.set(&mut hidden, strength, shape, &thruster, &scale);
        let names = (effect.id(), effect.same_physics(), effect.path());
        effects.push(described(&experiment, &alone(strength), names, *wanted, &rig.tolerances));
    }
    if let Some((unknown, shape, wanted)) = plan.unknown {
        let unit = if unknown.path() == "blade" { scale.thrust_n } else { scale.torque_n_m };
        let alone = |strength: f64| Hidden {
            unknown,
            unknown_shape: shape,
            unknown_size: strength * unit,
            ..Hidden::default()
        };
        let strength = experiment.strength(wanted, alone);
        hidden = alone(strength);
        effects.push(described(
            &experiment,
            &hidden,
            (unknown.id(), &[], unknown.path()),
            wanted,
            &rig.tolerances,
        ));
    }
    Setup { plan, thruster, command_a, rig, hidden, effects, scale }
}

fn described(
    experiment: &Experiment,
    hidden: &Hidden,
    (effect, same, path): (&'static str, &[&'static str], &'static str),
    wanted: f64,
    tolerances: &[f64; 7],
) -> HiddenEffect {
    let (share_of_full_scale, channel) = experiment.share(hidden);
    HiddenEffect {
        effect,
        same_physics: same.to_vec(),
        path,
        wanted,
        share_of_full_scale,
        channel,
        visible_after_refit: experiment.visible(hidden, tolerances),
    }
}

/// Noise as measured on recordings of such stands: shares of each channel's largest value.
fn draw_noise(scale: Scale, duration_s: f64, thruster: &Thruster, rng: &mut impl Rng) -> Noise {
    Noise {
        turbulence_m_s: rng.random_range(0.0055..0.007) * scale.flow_m_s,
        turbulence_time_s: rng.random_range(0.5..0.75),
        thrust_drift_n: 0.002 * scale.thrust_n / duration_s.sqrt(),
        thrust_n: 0.0048 * scale.thrust_n,
        torque_n_m: 0.0081 * scale.torque_n_m,
        flow_m_s: 0.019 * scale.flow_m_s,
        current_a: 0.003 * thruster.current_limit_a,
        supply_v: 0.002 * thruster.supply_v,
    }
}

fn draw(kind: CaseKind, seed: u64, selection: &Selection, rng: &mut impl Rng) -> Plan {
    let class = [Class::Work, Class::Work, Class::Small, Class::Medium][rng.random_range(0..4)];
    let staircase = rng.random::<f64>() < if class == Class::Small { 0.6 } else { 0.25 };
    let mut plan = Plan {
        class,
        programme: if staircase { Programme::Staircase } else { Programme::Full },
        channels: Channels {
            thrust: true,
            torque: rng.random::<f64>() < 0.6,
            flow: true,
            current: true,
            supply: class != Class::Small && rng.random::<f64>() < 0.7,
        },
        anchors: Vec::new(),
        hidden: Vec::new(),
        unknown: None,
        confounded: Vec::new(),
        distributed: selection.distributed.unwrap_or(rng.random::<f64>() < 0.3),
    };
    match kind {
        CaseKind::Clean => {}
        CaseKind::Single => {
            let turn = Effect::ALL[(seed % Effect::ALL.len() as u64) as usize];
            let chosen = selection
                .effect
                .as_deref()
                .and_then(|id| Effect::ALL.into_iter().find(|effect| effect.id() == id));
            let level = [0.012, 0.03, 0.06][(seed % 3) as usize];
            let effect = chosen.unwrap_or(turn);
            plan.anchors = effect.anchors().to_vec();
            plan.hidden.push((effect, Effect::shape(rng), selection.strength.unwrap_or(level)));
        }
        CaseKind::Pair => {
            let first = Effect::ALL[rng.random_range(0..Effect::ALL.len())];
            let second = loop {
                let other = Effect::ALL[rng.random_range(0..Effect::ALL.len())];
                if other.path() != first.path() {
                    break other;
                }
            };
            for effect in [first, second] {
                plan.anchors.extend(effect.anchors());
                let wanted = selection.strength.unwrap_or(rng.random_range(0.025..0.06));
                plan.hidden.push((effect, Effect::shape(rng), wanted));
            }
        }
        CaseKind::Confounded => confound(&mut plan, seed, rng),
        CaseKind::Outside => {
            let unknown = Unknown::ALL[(seed % Unknown::ALL.len() as u64) as usize];
            let shape = match unknown {
                Unknown::SineLoad => rng.random_range(5.0..9.0),
                Unknown::FadingRub => rng.random_range(20.0..90.0),
                Unknown::SwitchedLoad => rng.random_range(0.3..0.7),
                _ => rng.random_range(0.35..0.6),
            };
            plan.unknown = Some((unknown, shape, selection.strength.unwrap_or(rng.random_range(0.03..0.06))));
        }
    }
    plan
}

/// Excitation and channels under which two named effects give the same recording.
fn confound(plan: &mut Plan, seed: u64, rng: &mut impl Rng) {
    let families: [&[Effect]; 5] = [
        &[Effect::CoulombFriction, Effect::TorqueChannelBias],
        &[Effect::TransportDelay, Effect::AmplifierLag],
        &[Effect::EntrainedWaterInertia, Effect::RotorInertiaError],
        &[Effect::ThrustBiasGainHysteresis, Effect::WaterDensity],
        &[Effect::ThrustSensorLag, Effect::ClockSkew],
    ];
    let family = (seed % families.len() as u64) as usize;
    let rivals = families[family];
    let mut shape = Effect::shape(rng);
    let mut wanted = rng.random_range(0.02..0.04);
    plan.distributed = false;
    match family {
        0 => {
            plan.programme = Programme::OneSided;
            shape[0] = 0.0;
            plan.anchors = vec![Stated::Lift, Stated::Flux, Stated::TorqueConstant];
        }
        1 => {
            plan.programme = Programme::SlowRamps;
            plan.channels.current = false;
            wanted = rng.random_range(0.004..0.006);
        }
        2 => {
            plan.channels.thrust = rng.random::<bool>();
            plan.anchors = vec![Stated::Lift, Stated::Flux, Stated::Inertia, Stated::AddedMass];
        }
        3 => {
            // Gain alone: a bias or play would give the sensor away.
            plan.channels.torque = false;
            plan.anchors = vec![Stated::Lift, Stated::Drag, Stated::Flux, Stated::AddedMass];
        }
        _ => {
            plan.programme = Programme::SlowRamps;
            shape[0] = 0.0;
            wanted = rng.random_range(0.008..0.012);
        }
    }
    let hidden = rivals[rng.random_range(0..rivals.len())];
    if hidden == Effect::TorqueChannelBias {
        // Friction opposes the rotation, so its rival does.
        shape[0] = 0.0;
    }
    if hidden == Effect::ThrustBiasGainHysteresis {
        shape = GAIN_ALONE;
        shape[2] = if rng.random::<bool>() { 1.0 } else { 0.0 };
    }
    plan.hidden.push((hidden, shape, wanted));
    plan.confounded = rivals.to_vec();
}

fn csv(rows: &Rows, channels: Channels) -> String {
    let mut text = String::from("time_s,current_cmd_a");
    for (wanted, name) in [
        (channels.current, "current_a"),
        (true, "shaft_angle_rad,shaft_speed_rad_s"),
        (channels.thrust, "thrust_n"),
        (channels.torque, "torque_n_m"),
        (channels.flow, "flow_m_s"),
        (channels.supply, "supply_v"),
    ] {
        if wanted {
            text.push(',');
            text.push_str(name);
        }
    }
    text.push('\n');
    for row in 0..rows.command_a.len() {
        let _ = write!(text, "{:.3},{:.5}", row as f64 * 0.01, rows.command_a[row]);
        if channels.current {
            let _ = write!(text, ",{:.4}", rows.current_a[row]);
        }
        let _ = write!(text, ",{:.6},{:.5}", rows.angle_rad[row], rows.speed_rad_s[row]);
        if channels.thrust {
            let _ = write!(text, ",{:.4}", rows.thrust_n[row]);
        }
        if channels.torque {
            let _ = write!(text, ",{:.5}", rows.torque_n_m[row]);
        }
        if channels.flow {
            text.push(',');
            if row % ROWS_PER_FLOW == 0 {
                let _ = write!(text, "{:.4}", rows.flow_m_s[row]);
            }
        }
        if channels.supply {
            let _ = write!(text, ",{:.3}", rows.supply_v[row]);
        }
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A confounded case claims that nobody can part its rivals: the best of the other rival and a re-fit
    /// within tolerances must come within the noise of what is hidden.
    #[test]
    fn rivals_of_a_confounded_case_cannot_be_told_apart() {
        for seed in 5..10 {
            let kind = CaseKind::Confounded;
            let mut rng = ChaCha12Rng::seed_from_u64(seed);
            let setup = prepare(kind, seed, &Selection::default(), 0, &mut rng);
            let Setup { plan, thruster, command_a, rig, hidden, scale, .. } = &setup;
            let experiment = Experiment::new(thruster, command_a, plan.channels);
            let (truth, mut shape, wanted) = plan.hidden[0];
            for rival in plan.confounded.iter().filter(|rival| **rival != truth) {
                if *rival == Effect::ThrustBiasGainHysteresis {
                    shape = GAIN_ALONE;
                }
                let alone = |strength: f64| {
                    let mut one = Hidden::default();
                    rival.set(&mut one, strength, &shape, thruster, scale);
                    one
                };
                let strength = experiment.strength(wanted, alone);
                // Only a density may be off either way.
                let left = if *rival == Effect::WaterDensity {
                    let tried = [1.0, -1.0]
                        .map(|sign| experiment.apart(hidden, alone, sign * strength, &rig.tolerances));
                    tried[0].min(tried[1])
                } else {
                    experiment.apart(hidden, |s| alone(s.max(0.0)), strength, &rig.tolerances)
                };
                assert!(left < 40.0, "seed {seed}: {} for {}: {left}", rival.id(), truth.id());
            }
        }
    }
}
