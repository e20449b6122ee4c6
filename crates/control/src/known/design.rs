//! Known effects that are static, or move signals in time: into the model that laws and observers are designed from.
//!
//! Each is probed with the catalogue's own code: at rest for inertia and water, over shaft speed for friction, over
//! the inflow's angle for the blades, by a step of the command for lag and delay. An effect that is none of this
//! leaves no trace here.

use kort_thruster::blade::{BladeRow, Inflow};
use kort_thruster::effects::Effect;
use kort_thruster::models::ModelName;
use kort_thruster::parameters::{Parameter as P, Parameters};
use kort_thruster::plant::{Balance, Drive, Foil, Local, Sensed, Tick};
use kort_thruster::rig::{KnownEffect, Rig};

use super::curves::{FoilCurve, FrictionCurve};
use super::motion::{bare, followed, torque_n_m};
use super::{Built, SETTLED_S, built};
use crate::model::{ControlModel, Late, Swirl};

/// Angles of the shaft that are averaged for what follows it.
const ANGLES: u32 = 48;
/// Steps in which a blade's own states settle, the first of a tick, each twice as long as the one before: a large slow
/// propeller takes seconds for the chords that a small one travels in a tick.
const SETTLING: i32 = 40;
/// How far a state is moved to find how its rate depends on it.
const PROBE: f64 = 1e-4;
/// Most own states of an effect that is probed.
pub(super) const STATES: usize = 24;
/// Longest delay that is looked for, s: of the drive, and of a sensor, whose slowest filter has settled by then.
const LONGEST_S: f64 = 0.25;
const SENSED_S: f64 = 5.0;
/// How much a blade's coefficients may change with speed and still count as a function of the angle alone.
const SAME: f64 = 0.02;

/// Puts what is known into the model.
pub(crate) fn design(model: &mut ControlModel, rig: &Rig) {
    if rig.effects.is_empty() {
        return;
    }
    let effects = built(rig, model.period_s);
    amended(model, rig, &effects);
    water(model, &effects);
    blades(model, &effects);
    model.known_friction = friction(model, &effects);
    drive(model, rig, &effects);
    sensors(model, rig);
    rig.effects.iter().for_each(|known| swirl(model, known));
}

/// Other values of the stated parameters.
fn amended(model: &mut ControlModel, rig: &Rig, effects: &[Built]) {
    let stated = Parameters::stated(rig);
    let (mut name, mut p) = (ModelName::Model2, stated);
    effects.iter().for_each(|(_, e)| e.amend(&mut name, &mut p));
    let ratio = |parameter: P| p.get(parameter) / stated.get(parameter);
    model.blade.lift_max *= ratio(P::LiftMax);
    model.blade.drag_max *= ratio(P::DragMax);
    model.blade.pitch_rad *= ratio(P::PitchRad);
    model.flux_coefficient *= ratio(P::FluxCoefficient);
    model.added_mass_kg *= ratio(P::AddedMassCoefficient);
    model.refresh();
}

/// The balance with all effects that can be followed, at a state.
fn balance_at(model: &ControlModel, effects: &[Built], at: &Local) -> Balance {
    let mut balance = bare(model, at);
    let mut rates = [0.0; STATES];
    for (_, e) in effects.iter().filter(|(_, e)| followed(e.as_ref())) {
        e.balance(at, &[0.0; STATES][..e.states()], &mut balance, &mut rates[..e.states()]);
    }
    balance
}

/// Inertia, accelerated water, outflow either way, and what the stand feels beside the blades.
fn water(model: &mut ControlModel, effects: &[Built]) {
    let at = |axial_m_s: f64, thrust_n: f64| {
        balance_at(model, effects, &Local { axial_m_s, thrust_n, ..Local::default() })
    };
    let (rest, ahead, astern) = (at(0.0, 0.0), at(1.0, 0.0), at(-1.0, 0.0));
    let flux = |b: &Balance, sign: f64| b.flux_kg_m - sign * (b.momentum_n - rest.momentum_n);
    let stated = model.flux_coefficient * model.blade.density_kg_m3 * model.blade.area_m2();
    let (flux_ahead, flux_astern) = (flux(&ahead, 1.0), flux(&astern, -1.0));
    let stand_kg_m = ahead.stand_n - rest.stand_n;
    let thrust = at(0.0, 1.0);
    model.inertia_kg_m2 = rest.inertia_kg_m2;
    model.stand_kg_m = stand_kg_m;
    model.stand_share = thrust.stand_n - rest.stand_n;
    // The density enters through the blades; flux and mass then keep their coefficients.
    let density = density_ratio(model, effects);
    model.duct_water_kg *= density;
    model.blade.density_kg_m3 *= density;
    model.added_mass_kg = ahead.added_mass_kg;
    model.flux_coefficient *= flux_ahead / (stated * density);
    model.flux_astern = flux_astern / flux_ahead;
    model.ambient_mean_m_s = rest.ambient_m_s;
}

/// A section of the plain row in an inflow, and what the effects make of it once their states have settled.
pub(super) fn sections(
    model: &ControlModel,
    row: &BladeRow,
    effects: &[Built],
    angle: f64,
    speed_m_s: f64,
) -> (Foil, Foil) {
    let (sin, cos) = angle.sin_cos();
    let plain = row.section(Inflow { tangential_m_s: speed_m_s * cos, axial_m_s: speed_m_s * sin });
    let at = Local {
        shaft_speed_rad_s: speed_m_s * cos / row.lever_m,
        axial_m_s: speed_m_s * sin,
        ..Local::default()
    };
    let mut foil = plain;
    for (_, e) in effects.iter().filter(|(_, e)| e.hooks().foil) {
        let n = e.states();
        let own = settled(e.as_ref(), model, &at, plain);
        e.foil(&at, &own[..n], &mut foil);
    }
    (plain, foil)
}

/// An effect's own states where nothing moves any more, each step implicit in its own state.
pub(super) fn settled(effect: &dyn Effect, model: &ControlModel, at: &Local, plain: Foil) -> [f64; STATES] {
    let (n, mut own) = (effect.states(), [0.0; STATES]);
    if n == 0 {
        return own;
    }
    let rates = |own: &[f64; STATES]| {
        let (mut rates, mut now) = ([0.0; STATES], plain);
        effect.foil(at, &own[..n], &mut now);
        let mut balance = Balance { foil: now, ..bare(model, at) };
        effect.balance(at, &own[..n], &mut balance, &mut rates[..n]);
        rates
    };
    for step in 0..SETTLING {
        let h = model.period_s * f64::from(step).exp2();
        let before = rates(&own);
        let mut next = own;
        for k in 0..n {
            let mut beside = own;
            beside[k] += PROBE;
            let slope = (rates(&beside)[k] - before[k]) / PROBE;
            let moved = h * before[k] / (1.0 - h * slope.min(0.0));
            // What feeds on itself is followed, not thrown.
            next[k] += if slope < 0.0 { moved } else { moved.clamp(-PROBE.sqrt(), PROBE.sqrt()) };
        }
        own = next;
    }
    own
}

fn density_ratio(model: &ControlModel, effects: &[Built]) -> f64 {
    let row = model.blade.row();
    let (plain, foil) = sections(model, &row, effects, 0.2, 0.5 * model.speed_max_rad_s * row.lever_m);
    foil.density_kg_m3 / plain.density_kg_m3
}

/// Lift and drag over the inflow's angle, where they are a function of it alone.
fn blades(model: &mut ControlModel, effects: &[Built]) {
    let row = model.blade.row();
    let top = model.speed_max_rad_s * row.lever_m;
    let added = |effects: &[Built], angle: f64, speed: f64| {
        let (plain, foil) = sections(model, &row, effects, angle, speed);
        (foil.lift - plain.lift, foil.drag - plain.drag)
    };
    // What changes with the speed as well (cavitation) is no function of the angle.
    let (steady, _): (Vec<_>, Vec<_>) = built_like(effects).into_iter().partition(|of| {
        let one = std::slice::from_ref(*of);
        let scale = model.blade.lift_max;
        [0.15, 0.25, -0.2, 2.9].iter().all(|angle| {
            let (slow, fast) = (added(one, *angle, 0.4 * top), added(one, *angle, top));
            (slow.0 - fast.0).abs() < SAME * scale && (slow.1 - fast.1).abs() < SAME * scale
        })
    });
    let curve = FoilCurve::of(|angle| {
        steady
            .iter()
            .map(|of| added(std::slice::from_ref(*of), angle, 0.7 * top))
            .fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1))
    });
    model.foil = curve;
    model.refresh();
}

fn built_like(effects: &[Built]) -> Vec<&Built> {
    effects.iter().filter(|(_, e)| e.hooks().foil).collect()
}

/// What opposes the shaft beside the blades, over its speed; of what follows the angle, the mean.
fn friction(model: &ControlModel, effects: &[Built]) -> Option<FrictionCurve> {
    FrictionCurve::of(1.5 * model.speed_max_rad_s, |speed| {
        let turned = |k: u32| {
            let angle = std::f64::consts::TAU * f64::from(k) / f64::from(ANGLES);
            let at = Local { shaft_speed_rad_s: speed, shaft_angle_rad: angle, ..Local::default() };
            -torque_n_m(&balance_at(model, effects, &at), speed.signum())
        };
        let mean = (0..ANGLES).map(turned).sum::<f64>() / f64::from(ANGLES);
        if mean.abs() < 1e-12 * model.torque_constant_nm_a * model.current_limit_a { 0.0 } else { mean }
    })
}

/// Lag, delay and limits of the drive.
fn drive(model: &mut ControlModel, rig: &Rig, effects: &[Built]) {
    let mut settled = built(rig, SETTLED_S);
    let stated_v = rig.amplifier.supply_v.unwrap_or(f64::INFINITY);
    let mut idle = Drive {
        command: 0.0,
        current_limit_a: model.current_limit_a,
        time_constant_s: model.amplifier_lag_s,
        supply_v: stated_v,
        resistance_ohm: model.winding_resistance_ohm.unwrap_or(0.0),
        ..empty()
    };
    for (_, e) in settled.iter_mut().filter(|(_, e)| e.hooks().drive) {
        e.drive(&Tick::default(), &mut idle);
    }
    model.amplifier_lag_s = idle.time_constant_s;
    model.current_limit_a = idle.current_limit_a;
    if idle.voltage_limited {
        model.supply_v = model.supply_v.map(|v| v * idle.supply_v / stated_v);
        model.winding_resistance_ohm = model.winding_resistance_ohm.map(|_| idle.resistance_ohm);
    }
    // What shifts the command in time is a delay; what rounds it, ahead of the amplifier, one more lag.
    for ((d, e), (_, mut fresh)) in effects.iter().zip(built(rig, model.period_s)) {
        if e.hooks().drive {
            let late_s = command_late_s(fresh.as_mut(), model);
            if d.shifts_time { model.delay_s += late_s } else { model.amplifier_lag_s += late_s }
        }
    }
}

/// How late an effect that is fresh lets a step of the command arrive in the mean, s.
pub fn command_late_s(effect: &mut dyn Effect, model: &ControlModel) -> f64 {
    mean_delay_s(model.period_s, LONGEST_S, |step| {
        let command = step * 0.5 * model.current_limit_a;
        let mut drive = Drive { command, current_limit_a: model.current_limit_a, ..empty() };
        effect.drive(&Tick::default(), &mut drive);
        drive.command
    })
}

/// What sensors are late beyond their stated filters: observers and loops then have it in theirs.
fn sensors(model: &mut ControlModel, rig: &Rig) {
    type Channel = fn(&mut Sensed) -> &mut f64;
    let channels: [(f64, Channel); 3] = [
        (model.speed_max_rad_s, |sensed| &mut sensed.shaft_speed_rad_s),
        (model.thrust_max_n, |sensed| &mut sensed.thrust_n),
        (1.0, |sensed| &mut sensed.flow_m_s),
    ];
    let [speed_s, thrust_s, flow_s] = channels.map(|(full, channel)| {
        let sensing = built(rig, model.period_s).into_iter().filter(|(_, e)| e.hooks().sense);
        let late = sensing.map(|(_, mut effect)| {
            mean_delay_s(model.period_s, SENSED_S, |step| {
                let mut sensed = Sensed::default();
                *channel(&mut sensed) = 0.5 * full * step;
                effect.sense(&Tick::default(), &mut sensed);
                *channel(&mut sensed)
            })
        });
        late.sum::<f64>()
    });
    model.late = Late { speed_s, thrust_s, flow_s };
    model.speed_filter_s += speed_s;
    model.thrust_filter_s += thrust_s;
}

/// How late a step from 0 to 1 arrives in the mean, s.
fn mean_delay_s(period_s: f64, longest_s: f64, mut passed: impl FnMut(f64) -> f64) -> f64 {
    let before = passed(0.0);
    let ticks = (longest_s / period_s).ceil() as u32;
    let arrived: Vec<f64> = (0..ticks).map(|_| passed(1.0) - before).collect();
    let whole = arrived.last().copied().unwrap_or(0.0);
    if whole == 0.0 {
        return 0.0;
    }
    let missing: f64 = arrived.iter().map(|now| 1.0 - now / whole).sum();
    (missing * period_s).max(0.0)
}

fn empty() -> Drive {
    Drive {
        command: 0.0,
        current_limit_a: f64::INFINITY,
        time_constant_s: 0.0,
        supply_v: f64::INFINITY,
        resistance_ohm: 0.0,
        back_emf_v: 0.0,
        freewheels: 0.0,
        shaft_speed_rad_s: 0.0,
        current_a: 0.0,
        voltage_limited: false,
    }
}

/// Rotational flow is the observers' own state.
fn swirl(model: &mut ControlModel, known: &KnownEffect) {
    if known.effect == "rotational_flow" && known.value("swirl_yield") > 0.0 {
        let drag = 1.0 / known.value("swirl_yield");
        model.swirl = Some(Swirl { drag, inertia: drag * known.value("swirl_lag_ratio") });
        model.refresh();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use kort_thruster::effects;
    use kort_thruster::rig::Quantity;

    /// A tunnel of 10 kW needs more than a second for the chords that settle its lift.
    #[test]
    fn lift_that_only_lags_is_whole_on_a_large_propeller_too() {
        let text = include_str!("../../../../config/thrusters/tunnel-10kw.toml");
        let mut rig = Rig::from_toml(text).unwrap();
        let plain = ControlModel::from_rig(&rig, 1e-3).unwrap();
        rig.effects = vec![KnownEffect {
            effect: effects::find("unsteady_lift_lag").unwrap().id,
            parameters: vec![("wagner_share", Quantity::exact(1.0)), ("chord_radii", Quantity::exact(1.5))],
        }];
        let model = ControlModel::from_rig(&rig, 1e-3).unwrap();
        let (stated, found) = (plain.map.thrust_n(20.0), model.map.thrust_n(20.0));
        assert!((found / stated - 1.0).abs() < 1e-6, "{found} {stated}");
    }
}
