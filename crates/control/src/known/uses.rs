//! What each known effect is used for, found by the same probing that uses it: `kort explain EFFECT`.

use kort_thruster::effects::{Descriptor, Effect, Path, Spec};
use kort_thruster::plant::{Sensed, Tick};
use kort_thruster::rig::{AmplifierKind, KnownEffect, Quantity, Rig};

use super::building::Building;
use super::built;
use super::drive::{DriveChain, OperatingPoint};
use super::motion::{Motion, follows_angle};
use crate::model::{ControlModel, ModelError};

/// A place where a known effect is used, whatever the law.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Use {
    /// Friction over shaft speed.
    Friction,
    /// Inertia of the shaft.
    Inertia,
    /// Accelerated water and its outflow.
    Water,
    /// Lift and drag.
    Blades,
    /// Lift that builds up.
    Building,
    /// Swirl of the wake.
    Swirl,
    /// Force on the stand beyond the blades'.
    Stand,
    /// Ambient flow.
    Ambient,
    /// Lag of the drive.
    Lag,
    /// Dead time of the drive.
    Delay,
    /// Limits of current and voltage.
    Limits,
    /// Command.
    Command,
    /// Torque by the current or the load.
    Torque,
    /// Torque by the shaft's angle.
    Angle,
    /// A slow state.
    Slow,
    /// Sensors.
    Sensors,
}

impl Use {
    /// How it is used and by which laws and observers, in words.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Friction => {
                "friction over shaft speed: every law adds it to the torque it asks for, every observer takes it from the shaft's"
            }
            Self::Inertia => {
                "inertia: the speed loop's gain in every law that has one, the led shaft of the model inversions, every observer"
            }
            Self::Water => {
                "accelerated water and outflow: the static map of every law, the flow that model2_inversion, model3_inversion and look_ahead reckon with, every observer"
            }
            Self::Blades => {
                "lift and drag over the angle of attack, ahead and astern: the static map of every law, the inversion of those that invert a model, every observer"
            }
            Self::Building => {
                "lift that builds up: followed along the estimate, every observer predicts thrust, torque and flow by what has built up; laws aim at the whole of it"
            }
            Self::Swirl => {
                "swirl: a state of every observer, with which model2_inversion, model3_inversion, rotational_flow_inversion and look_ahead meet the blades"
            }
            Self::Stand => {
                "force beside the blades: every law asks the blades for what makes the whole; taken off the measured thrust before the observer sees it"
            }
            Self::Ambient => {
                "ambient flow: what every observer expects before it sees any, and with it every law that leans on the flow"
            }
            Self::Lag => {
                "lag of the drive: inverted within the drive's limits by model2_inversion, trimmed_model2_inversion and rotational_flow_inversion, predicted by look_ahead and by the observers where the current is not measured, in the speed loop's crossover of every law"
            }
            Self::Delay => {
                "dead time: commands are kept and reach the observer's motor as late; the laws aim at the flow after it; the speed loop's crossover allows for it"
            }
            Self::Limits => {
                "limits: every law is held to the current and voltage that there then are, and its integrators know"
            }
            Self::Command => "command: what any law asks for is turned into the command that gives it",
            Self::Torque => {
                "torque of a current: what any law asks for is turned into the current that gives it; the observer sees the torque it gave"
            }
            Self::Angle => {
                "torque over the shaft's angle: cancelled in the current under any law, where the angle is measured"
            }
            Self::Slow => {
                "a slow state: followed from estimate and current, what it does now goes into torque, friction or ambient flow"
            }
            Self::Sensors => {
                "sensors: what it adds to them is taken off before any observer or law sees the measurement"
            }
        }
    }
}

/// What a known effect is used for; `left` says why nothing reaches it, and where its doing then goes.
#[derive(Clone, Debug, PartialEq)]
pub struct Usage {
    /// Its identifier.
    pub effect: &'static str,
    /// Where it is used.
    pub uses: Vec<Use>,
    /// Why it is not; beside `uses` where drive or values decide, as over the catalogue.
    pub left: Option<&'static str>,
}

impl Usage {
    /// What it is used for, or why not, in words: the same of a rig and of the catalogue.
    pub fn words(&self) -> String {
        let uses = self.uses.iter().map(|u| u.words()).collect::<Vec<_>>().join("; ");
        match self.left {
            Some(why) if self.uses.is_empty() => format!("NOT USED: {why}"),
            Some(why) => format!("{uses}; with another drive or at other values NOT USED: {why}"),
            None => uses,
        }
    }
}

/// Those of a rig's known effects that no law and no observer uses, with why: whoever puts a rig to use names them.
/// Empty where no controller can be designed for the rig at all, which is refused in other words.
pub fn left_out(rig: &Rig, period_s: f64) -> Vec<(&'static str, &'static str)> {
    let known = of_rig(rig, period_s).unwrap_or_default().into_iter().zip(&rig.effects);
    known.filter_map(|(usage, known)| Some((usage.effect, known.idle().or(usage.left)?))).collect()
}

/// Control period that a rig is looked at for where nothing else says one, s.
pub fn period_s(rig: &Rig) -> f64 {
    rig.sensors.control_rate_hz.map_or(1e-3, |rate| 1.0 / rate)
}

/// What a rig's known effects are used for, one by one.
///
/// # Errors
/// [`ModelError`] if no controller can be designed for the rig.
pub fn of_rig(rig: &Rig, period_s: f64) -> Result<Vec<Usage>, ModelError> {
    rig.effects.iter().map(|known| of_one(rig, known, period_s)).collect()
}

/// What an effect of the catalogue would be used for on a current, a voltage and a speed drive: at the sizes where a fit starts
/// where they are used also with each strength alone, and where nothing reaches those with each shape at the ends of its range.
/// All that is ever used, and why nothing is where nothing is.
pub fn of_effect(effect: &'static Descriptor) -> Usage {
    let mut usage = Usage { effect: effect.id, uses: Vec::new(), left: None };
    if effect.nonparametric {
        return Usage { left: Some(NO_LASTING_SIZES), ..usage };
    }
    for text in [
        include_str!("../../../../config/thrusters/whitcomb-yoerger-1999.toml"),
        include_str!("../../../../config/thrusters/t200.toml"),
        include_str!("../../../../config/thrusters/speed-drive.toml"),
    ] {
        let Ok(rig) = Rig::from_toml(text) else { continue };
        let Ok(model) = ControlModel::from_rig(&rig, 1e-3) else { continue };
        let scale = model.scale(&rig, 600.0);
        let specs = (effect.parameters)(&scale);
        // Where every value leaves things as they are (factors of one), another start moves them: it tells nothing of why.
        let start: Vec<f64> = specs.iter().map(|s| s.start).collect();
        let starts: Vec<_> = std::iter::once(start.clone()).chain((effect.starts)(&scale)).collect();
        let mut found = at(effect, &rig, &specs, &starts);
        if found.uses.is_empty() {
            let shapes = specs.iter().enumerate().filter(|(_, spec)| spec.shape);
            let ends = shapes.flat_map(|(place, spec)| [(place, spec.low), (place, spec.high)]);
            let moved = ends.map(|(place, value)| {
                let mut values = start.clone();
                values[place] = value;
                values
            });
            let ends = at(effect, &rig, &specs, &moved.collect::<Vec<_>>());
            // Not at the sizes where a fit starts, and yet at others.
            found.uses = ends.uses;
        } else {
            // Each strength by itself: a rig may state one of them only.
            let last = starts.last().unwrap_or(&start);
            let alone = specs.iter().enumerate().filter(|(place, spec)| !spec.shape && last[*place] != 0.0);
            let alone = alone.map(|(alone, _)| {
                let kept = |place: usize| specs[place].shape || place == alone;
                last.iter().enumerate().map(|(place, v)| if kept(place) { *v } else { 0.0 }).collect()
            });
            found.left = at(effect, &rig, &specs, &alone.collect::<Vec<_>>()).left;
        }
        usage.uses.extend(found.uses);
        usage.left = usage.left.or(found.left);
    }
    usage.uses.sort_unstable();
    usage.uses.dedup();
    usage
}

/// What an effect is used for on a rig at any of these values, and why it is not at the last that nothing reaches.
fn at(effect: &'static Descriptor, rig: &Rig, specs: &[Spec], values: &[Vec<f64>]) -> Usage {
    let mut usage = Usage { effect: effect.id, uses: Vec::new(), left: None };
    for values in values {
        let known = KnownEffect {
            effect: effect.id,
            parameters: specs.iter().zip(values).map(|(s, v)| (s.name, Quantity::exact(*v))).collect(),
        };
        if let Ok(found) = of_one(rig, &known, 1e-3) {
            usage.uses.extend(found.uses);
            usage.left = found.left.or(usage.left);
        }
    }
    usage
}

fn of_one(rig: &Rig, known: &KnownEffect, period_s: f64) -> Result<Usage, ModelError> {
    let with = |effects: Vec<KnownEffect>| Rig { effects, ..rig.clone() };
    let (bare, own) = (with(Vec::new()), with(vec![known.clone()]));
    let (plain, model) = (ControlModel::from_rig(&bare, period_s)?, ControlModel::from_rig(&own, period_s)?);
    let mut uses = designed(&plain, &model);
    uses.extend(driven(&own, &model));
    let effects = built(&own, period_s);
    for (_, effect) in &effects {
        let motion = Motion::new(&own, &model);
        if !motion.is_idle() && rig.amplifier.kind != AmplifierKind::Speed {
            let turned = follows_angle(effect.as_ref(), &model);
            uses.push(if turned {
                Use::Angle
            } else if effect.states() > 0 {
                Use::Slow
            } else {
                Use::Torque
            });
        }
    }
    if !Building::new(&own, &model).is_idle() {
        uses.push(Use::Building);
    }
    if effects.into_iter().any(|(_, mut effect)| shown(effect.as_mut(), &model)) {
        uses.push(Use::Sensors);
    }
    let left = if uses.is_empty() { Some(why(&own)) } else { None };
    Ok(Usage { effect: known.effect, uses, left })
}

/// What the model was designed with.
fn designed(plain: &ControlModel, model: &ControlModel) -> Vec<Use> {
    let density = plain.blade.density_kg_m3 != model.blade.density_kg_m3;
    let changed = [
        (Use::Friction, model.known_friction.is_some()),
        (Use::Inertia, plain.inertia_kg_m2 != model.inertia_kg_m2),
        (
            Use::Water,
            density
                || plain.added_mass_kg != model.added_mass_kg
                || plain.flux_coefficient != model.flux_coefficient
                || model.flux_astern != 1.0,
        ),
        (Use::Blades, density || model.foil.is_some() || plain.blade.lift_max != model.blade.lift_max),
        (Use::Swirl, model.swirl.is_some()),
        (Use::Stand, model.stand_share != 0.0 || model.stand_kg_m != 0.0),
        (Use::Ambient, model.ambient_mean_m_s != 0.0),
        (Use::Lag, plain.amplifier_lag_s != model.amplifier_lag_s),
        (Use::Delay, model.delay_s > 0.0),
        (
            Use::Limits,
            plain.current_limit_a != model.current_limit_a
                || plain.supply_v != model.supply_v
                || plain.winding_resistance_ohm != model.winding_resistance_ohm,
        ),
    ];
    changed.into_iter().filter(|(_, yes)| *yes).map(|(what, _)| what).collect()
}

/// What becomes of commands and supply under load.
fn driven(rig: &Rig, model: &ControlModel) -> Vec<Use> {
    let mut chain = DriveChain::new(rig, model);
    if chain.is_idle() {
        return Vec::new();
    }
    let loaded = OperatingPoint {
        supply_v: None,
        current_a: 0.6 * model.current_limit_a,
        shaft_speed_rad_s: 0.6 * model.speed_max_rad_s,
    };
    let most = model.supply_v.unwrap_or(model.current_limit_a);
    let bends = [-0.7, -0.02, 0.02, 0.4, 0.9]
        .iter()
        .any(|share| (chain.pass(share * most, loaded).command - share * most).abs() > 1e-9 * most);
    let idle = chain.pass(0.0, OperatingPoint::default()).supply_v;
    let sags = chain.pass(0.0, loaded).supply_v < idle * (1.0 - 1e-9);
    [(Use::Command, bends), (Use::Limits, sags)]
        .into_iter()
        .filter(|(_, yes)| *yes)
        .map(|(what, _)| what)
        .collect()
}

/// Whether sensors show something else than what is.
fn shown(effect: &mut dyn Effect, model: &ControlModel) -> bool {
    effect.hooks().sense
        && (0..400).any(|k| {
            let share = f64::from(k) / 200.0 - 1.0;
            let expected = Sensed {
                current_a: share * model.current_limit_a,
                shaft_angle_rad: 0.3 * f64::from(k),
                shaft_speed_rad_s: share * model.speed_max_rad_s,
                true_speed_rad_s: share * model.speed_max_rad_s,
                thrust_n: share * model.thrust_max_n,
                true_thrust_n: share * model.thrust_max_n,
                flow_m_s: share,
                ..Sensed::default()
            };
            let mut shows = expected;
            effect.sense(&Tick::default(), &mut shows);
            let off = |a: f64, b: f64| (a - b).abs() > 1e-9 * (1.0 + a.abs());
            off(shows.shaft_speed_rad_s, expected.shaft_speed_rad_s)
                || off(shows.thrust_n, expected.thrust_n)
                || off(shows.flow_m_s, expected.flow_m_s)
                || off(shows.current_a, expected.current_a)
        })
}

/// Why nothing reaches one that changes freely with time, whatever use its value of any moment would have.
const NO_LASTING_SIZES: &str = "it changes freely with time and has no lasting sizes: a rig cannot state it; what it does is left to the observer's ambient flow and unexplained load";

/// Why nothing reaches an effect.
fn why(rig: &Rig) -> &'static str {
    let effects = built(rig, 1e-3);
    let Some((descriptor, effect)) = effects.first() else { return "the rig states none" };
    let hooks = effect.hooks();
    if descriptor.nonparametric {
        NO_LASTING_SIZES
    } else if effect.states() > 0 && !effect.slow() {
        "it has states of its own that no observer carries: what it does to the shaft is left to the observer's unexplained load, what it does to the water to its ambient flow"
    } else if hooks.foil {
        "it depends on depth or on the speed itself, which a table over the angle of attack does not hold: what it does is left to the observer's unexplained load and ambient flow, and to the force sensor"
    } else if hooks == kort_thruster::effects::Hooks::NONE && descriptor.path == Path::Flow {
        "at these values it states what every law and observer reckons with already: the flow is a state of its own"
    } else if hooks == kort_thruster::effects::Hooks::NONE {
        "it is a property of the log, not of the thruster: a running controller meets gaps as values that are not measured"
    } else {
        "it acts only now and then, or with a signal that the controller does not have: what it does is left to the observer's unexplained load and ambient flow"
    }
}

#[cfg(test)]
mod tests;
