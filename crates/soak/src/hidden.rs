//! Effects that are hidden in the plant of a run: which, and how large, is drawn from the seed.
//!
//! A size is what the effect changes: the root mean square change of what is measured (thrust, shaft speed or flow,
//! the largest of them) under the same commands, as a share of its own. So that 5 % of friction and 5 % of a delay
//! are alike in what they do, whatever their units.

use kort_control::ControlModel;
use kort_thruster::effects::{self, Descriptor, Spec};
use kort_thruster::models::ModelName;
use kort_thruster::parameters::Parameters;
use kort_thruster::plant::{Plant, Sensed, Tick};
use kort_thruster::rig::{AmplifierKind, KnownEffect, Quantity, Rig};
use rand::Rng;
use rand::seq::IndexedRandom;
use serde::Deserialize;

use crate::run::stream;
use crate::truth::Hooked;

/// What a scenario hides.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hidden {
    /// Fewest and most effects at once.
    pub count: [u32; 2],
    /// Smallest and largest size, share of what is measured.
    pub size: [f64; 2],
    /// What is drawn from: identifiers of the catalogue.
    pub effects: Vec<String>,
    /// How often the recording that is diagnosed holds a row, Hz.
    #[serde(default = "log_rate")]
    pub log_rate_hz: f64,
}

fn log_rate() -> f64 {
    100.0
}

/// An effect that was drawn.
#[derive(Clone)]
pub struct Drawn {
    /// The effect and its values.
    pub hooked: Hooked,
    /// Its size, share of what is measured.
    pub size: f64,
}

impl Hidden {
    /// All values that cannot be meant, in words that name the key, the value and what is allowed.
    pub fn check(&self) -> Vec<String> {
        let mut wrong = Vec::new();
        let [fewest, most] = self.count;
        if fewest < 1 || most < fewest || most > 8 || most as usize > self.effects.len() {
            wrong.push(format!(
                "`hidden.count` = [{fewest}, {most}] is outside what is allowed: 1 to the {} effects listed, at most 8\nhint: count = [1, 4]",
                self.effects.len()
            ));
        }
        let [least, largest] = self.size;
        if !(least > 0.0 && largest >= least && largest <= 0.5) {
            wrong.push(format!(
                "`hidden.size` = [{least}, {largest}] is outside what is allowed: above 0 to 0.5, in order\nhint: size = [0.03, 0.15]"
            ));
        }
        if !(self.log_rate_hz >= 5.0 && self.log_rate_hz <= 10_000.0) {
            wrong.push(format!(
                "`hidden.log_rate_hz` = {} is outside what is allowed: 5 to 10000\nhint: 100",
                self.log_rate_hz
            ));
        }
        let none = self.effects.iter().filter(|id| effects::find(id).is_none_or(|d| d.nonparametric));
        wrong.extend(none.map(|id| {
            format!(
                "`hidden.effects`: `{id}` is no effect of the catalogue with lasting sizes\nhint: `kort explain` lists it"
            )
        }));
        wrong
    }

    /// The effects of a seed on a rig, with their sizes.
    pub fn draw(&self, rig: &Rig, model: &ControlModel, seed: u64) -> Vec<Drawn> {
        let mut random = stream(seed, 7);
        let count = random.random_range(self.count[0]..=self.count[1]) as usize;
        let fits: Vec<&'static Descriptor> =
            self.effects.iter().filter_map(|id| effects::find(id)).filter(|d| reaches(rig, d)).collect();
        let chosen: Vec<&'static Descriptor> = fits.choose_multiple(&mut random, count).copied().collect();
        let commands = commands(rig, model);
        let before = shown(rig, model, &[], &commands);
        chosen
            .into_iter()
            .filter_map(|descriptor| {
                let wanted =
                    (self.size[0].ln() + (self.size[1] / self.size[0]).ln() * random.random::<f64>()).exp();
                let specs = (descriptor.parameters)(&model.scale(rig, 600.0));
                let toward: Vec<f64> = specs.iter().map(|s| side(s, &mut random)).collect();
                sized(descriptor, &specs, &toward, wanted, |hooked| {
                    change(&before, &shown(rig, model, std::slice::from_ref(hooked), &commands))
                })
            })
            .collect()
    }
}

/// Whether an effect can act on a rig at all.
fn reaches(rig: &Rig, descriptor: &Descriptor) -> bool {
    let electric = ["supply_sag", "voltage_limit_backemf"].contains(&descriptor.id);
    let speed = rig.amplifier.kind == AmplifierKind::Speed;
    let winding = rig.motor.winding_resistance_ohm.is_some() && rig.amplifier.supply_v.is_some();
    !(electric && (!winding || speed))
}

/// Which way a strength goes: either, where both make sense.
fn side(spec: &Spec, random: &mut impl Rng) -> f64 {
    let flips = !spec.shape && spec.low < 0.0 && spec.high > 0.0 && random.random::<bool>();
    if flips { -1.0 } else { 1.0 }
}

/// The values at which an effect has a size; `None` where it hardly shows at any.
fn sized(
    descriptor: &'static Descriptor,
    specs: &[Spec],
    toward: &[f64],
    wanted: f64,
    change: impl Fn(&Hooked) -> f64,
) -> Option<Drawn> {
    let at = |k: f64| -> Hooked {
        let value = |(s, side): (&Spec, &f64)| match (s.held, s.shape) {
            (true, _) => s.start,
            (_, true) => s.mean,
            _ => (k * side * s.start).clamp(s.low, s.high),
        };
        (descriptor, specs.iter().zip(toward).map(value).collect())
    };
    let (mut low, mut high) = (1e-3_f64.ln(), 300.0_f64.ln());
    for _ in 0..14 {
        let middle = 0.5 * (low + high);
        if change(&at(middle.exp())) < wanted { low = middle } else { high = middle }
    }
    let hooked = at(low.exp());
    let size = change(&hooked);
    (size > 0.3 * wanted && size < 2.0 * wanted).then_some(Drawn { hooked, size })
}

/// Commands that an effect is sized under: steps of several sizes both ways.
fn commands(rig: &Rig, model: &ControlModel) -> Vec<f64> {
    let most = match rig.amplifier.kind {
        AmplifierKind::Current => model.current_limit_a,
        AmplifierKind::Voltage => {
            model.supply_v.unwrap_or(model.torque_constant_nm_a * model.speed_max_rad_s)
        }
        AmplifierKind::Speed => model.speed_max_rad_s,
    };
    [0.5, 0.2, -0.35, 0.7, -0.6, 0.12].map(|share| share * most).to_vec()
}

/// What the sensors show under the commands.
fn shown(rig: &Rig, model: &ControlModel, hidden: &[Hooked], commands: &[f64]) -> Vec<Sensed> {
    let effects: Vec<(&Descriptor, &[f64])> = hidden.iter().map(|(d, v)| (*d, v.as_slice())).collect();
    let dt = model.period_s;
    let mut plant = Plant::new(ModelName::Model2, rig, &Parameters::stated(rig), &effects, dt);
    let ticks = (1.5 / dt).round() as usize;
    let mut all = Vec::with_capacity(commands.len() * ticks);
    for command in commands {
        for _ in 0..ticks {
            let time_s = all.len() as f64 * dt;
            plant.step(&Tick {
                time_s,
                command: *command,
                supply_v: rig.amplifier.supply_v,
                ..Tick::default()
            });
            all.push(plant.sensed());
        }
    }
    all
}

/// Largest relative change of thrust, shaft speed or flow.
fn change(before: &[Sensed], after: &[Sensed]) -> f64 {
    let of = |channel: fn(&Sensed) -> f64| {
        let moved: f64 = before.iter().zip(after).map(|(a, b)| (channel(a) - channel(b)).powi(2)).sum();
        let own: f64 = before.iter().map(|a| channel(a).powi(2)).sum();
        (moved / own.max(1e-300)).sqrt()
    };
    of(|s| s.thrust_n).max(of(|s| s.shaft_speed_rad_s)).max(of(|s| s.flow_m_s))
}

/// The rig as it would be stated by someone who knows what is hidden.
pub fn told(rig: &Rig, hidden: &[Drawn]) -> Rig {
    let mut rig = rig.clone();
    for Drawn { hooked: (descriptor, values), .. } in hidden {
        let specs = (descriptor.parameters)(&effects::Scale::ANY);
        rig.effects.retain(|known| known.effect != descriptor.id);
        rig.effects.push(KnownEffect {
            effect: descriptor.id,
            parameters: specs.iter().zip(values).map(|(s, v)| (s.name, Quantity::exact(*v))).collect(),
        });
    }
    rig
}
