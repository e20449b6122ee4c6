//! Do torque, shaft speed and measured thrust agree? Each may be anything by itself; water ties them together. In bollard
//! pull torque and thrust grow with the square of the shaft speed, and their ratio is nearly the same in any inflow.
//! What a stream, a crash stop, the shaft's inertia and the water's can do to that is left room for:
//!
//! - a shaft that is far too slow for its torque, for longer than inertia explains, is blocked or fouled, or told in a
//!   wrong unit;
//! - a thrust that is far from what torque and speed both say is reversed, in a wrong unit, or does not move at all.
//!
//! Where the rig has no propeller, or the drive tells no current, nothing is said.

use kort_thruster::parameters::{Parameter, Parameters};
use kort_thruster::rig::Rig;

use crate::settings::Limits;

/// Tip speed that no thruster of this family is meant to pass, m/s.
const TIP_M_S: f64 = 60.0;
/// Share of its own slipstream at full drive, standing still, at which water can flow to a thruster: at the whole of it
/// the thruster would push no more, and nothing that it drives goes so fast.
const INFLOW_SHARE: f64 = 0.7;

/// Torque at a shaft speed as a multiple of the bollard one: fouled blades take twice that, and the rig may state half as
/// much again wrongly. A stream athwart is counted apart.
const FOULED: f64 = 3.0;
/// And of what the fastest stream holds the shaft with: water that the shaft has set moving itself comes on top of it, and 1.4 times
/// as fast is twice the torque.
const STREAM: f64 = 2.0;
/// Friction as a share of the largest torque: a sound thruster loses less.
const FRICTION: f64 = 0.1;
/// Inertia, of shaft or water, as a multiple of the stated one.
const INERTIA: f64 = 3.0;
/// Shortest time for which a shaft must be too slow, s: twice `checks.frozen_s`, which tells one that stands.
const SLOW_S: f64 = 1.0;
/// Slower than this a shaft turns neither way, rad/s.
const CREEP_RAD_S: f64 = 1.0;

/// Thrust that may be missing, or too much, as a factor. A duct or a hull takes a third, a fouled blade as much, both
/// coefficients are known to a quarter: all at once are 2.7. A kilogram-force and a pound-force are 9.8 and 4.4 N.
const DOUBT: f64 = 3.0;
/// Share of the bollard torque at a shaft speed above which water is pushed: profile drag alone takes a third of it, where the
/// propeller is towed so fast that it pushes nothing.
const PUSHES: f64 = 0.7;
/// Share of the largest thrust below which a cell's zero may be off.
const SMALL: f64 = 0.1;
/// Shortest time for which a thrust must contradict, s: weighing amplifiers average over a second.
const DENIED_S: f64 = 2.0;
/// A cell that shows nothing for so long says nothing about what it showed before, s.
const GAP_S: f64 = 0.5;

/// What the water around a thruster does, by the rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Water {
    /// Thrust over shaft speed squared in bollard pull, N s^2.
    pub thrust_n_s2: f64,
    /// Torque likewise, N m s^2.
    pub torque_n_m_s2: f64,
    /// Largest steady shaft speed, rad/s.
    pub speed_full_rad_s: f64,
    /// Largest torque of the motor, N m; infinite where there is no propeller: then nothing is said.
    pub torque_full_n_m: f64,
    /// Fastest stream, m/s.
    pub inflow_m_s: f64,
    /// Mass of water a metre of the stream through the disc, kg/m.
    pub flux_kg_m: f64,
    /// Torque with which that stream holds a shaft that stands, N m.
    pub held_n_m: f64,
    /// Friction over shaft speed, N m s.
    pub viscous_nm_s: f64,
    /// Inertia of all that turns, kg m^2.
    pub inertia_kg_m2: f64,
    /// Time in which shaft and water follow at full speed, s; at lower ones in proportion longer.
    pub settle_s: f64,
}

impl Water {
    /// Nothing is known, and nothing said.
    pub const UNKNOWN: Self = Self {
        thrust_n_s2: 0.0,
        torque_n_m_s2: 0.0,
        speed_full_rad_s: f64::INFINITY,
        torque_full_n_m: f64::INFINITY,
        inflow_m_s: 0.0,
        flux_kg_m: 0.0,
        held_n_m: 0.0,
        viscous_nm_s: 0.0,
        inertia_kg_m2: 0.0,
        settle_s: 0.0,
    };

    /// Of a rig whose largest current and shaft speed are these, in a stream of `inflow_m_s`, or of a share of the
    /// thruster's own slipstream.
    pub fn of(rig: &Rig, current_a: f64, speed_rad_s: f64, inflow_m_s: Option<f64>) -> Self {
        let speed_full_rad_s = full_speed_rad_s(rig, current_a).min(speed_rad_s);
        if rig.propeller.is_none() {
            return Self { speed_full_rad_s, ..Self::UNKNOWN };
        }
        let p = Parameters::stated(rig);
        let (thrust, torque) = p.bollard_coefficients();
        let density = p.get(Parameter::DensityKgM3);
        let flux_kg_m = density * p.area_m2();
        // T = rho A v^2 / 2 with the slipstream v far behind the disc.
        let slipstream = speed_full_rad_s * (2.0 * thrust / flux_kg_m).sqrt();
        let inflow_m_s = inflow_m_s.unwrap_or(INFLOW_SHARE * slipstream);
        let blade = p.blade();
        let held = |flow: f64| blade.load(blade.inflow(0.0, flow, 0.0)).torque_n_m.abs();
        let thrust_full = thrust * speed_full_rad_s.powi(2);
        let flow = (thrust_full / (p.get(Parameter::FluxCoefficient) * flux_kg_m)).sqrt();
        let shaft_s = p.get(Parameter::InertiaKgM2) / (torque * speed_full_rad_s);
        let water_s = rig.added_mass_kg() * flow / thrust_full;
        Self {
            thrust_n_s2: thrust,
            torque_n_m_s2: torque,
            speed_full_rad_s,
            torque_full_n_m: p.get(Parameter::TorqueConstantNmA) * current_a,
            inflow_m_s,
            flux_kg_m,
            held_n_m: held(inflow_m_s).max(held(-inflow_m_s)),
            viscous_nm_s: p.get(Parameter::ViscousFrictionNmS),
            inertia_kg_m2: p.get(Parameter::InertiaKgM2),
            settle_s: shaft_s + water_s,
        }
    }

    /// Largest steady thrust in bollard pull, N.
    pub fn thrust_full_n(&self) -> f64 {
        self.thrust_n_s2 * self.speed_full_rad_s.powi(2)
    }
}

/// Largest steady shaft speed of a rig with this current, rad/s: where water takes the torque, where the supply ends, and
/// where no propeller is meant to go. Infinite on a dry shaft of unknown supply.
pub fn full_speed_rad_s(rig: &Rig, current_a: f64) -> f64 {
    let constant = rig.motor.torque_constant_nm_a.value;
    let by_supply = rig.amplifier.supply_v.map_or(f64::INFINITY, |supply| supply / constant);
    if rig.propeller.is_none() {
        return by_supply;
    }
    let p = Parameters::stated(rig);
    let by_water = (constant * current_a / p.bollard_coefficients().1).sqrt();
    by_supply.min(by_water).min(TIP_M_S / p.get(Parameter::RadiusM))
}

/// What of it a thruster showed so far.
#[derive(Clone, Copy, Debug)]
pub struct Agreement {
    slow_s: f64,
    slow_nm_s: f64,
    gap_s: f64,
    denied_s: f64,
    /// The same in times that shaft and water take to follow.
    denied_times: f64,
    thrust_n: f64,
    /// What torque and speed said when this reading came first.
    then_n: (f64, f64),
    unmoved_s: f64,
    implausible: bool,
}

impl Default for Agreement {
    /// Nothing seen yet.
    fn default() -> Self {
        Self {
            slow_s: 0.0,
            slow_nm_s: 0.0,
            gap_s: 0.0,
            denied_s: 0.0,
            denied_times: 0.0,
            thrust_n: f64::NAN,
            then_n: (0.0, 0.0),
            unmoved_s: 0.0,
            implausible: false,
        }
    }
}

impl Agreement {
    /// Is the shaft too slow for this current, at the speed and current that stand now?
    pub fn is_slow(&mut self, l: &Limits, speed: f64, current: f64, dt_s: f64) -> bool {
        let w = &l.water;
        let torque = l.winding.1 * current;
        let taken = FOULED * w.torque_n_m_s2 * speed * speed
            + STREAM * w.held_n_m
            + w.viscous_nm_s * speed.abs()
            + FRICTION * w.torque_full_n_m;
        let excess = torque.abs() - taken;
        let brakes = torque * speed < 0.0 && speed.abs() > CREEP_RAD_S;
        if excess.is_nan() || excess <= 0.0 || brakes {
            (self.slow_s, self.slow_nm_s) = (0.0, 0.0);
            return false;
        }
        self.slow_s += dt_s;
        self.slow_nm_s += excess * dt_s;
        // Nobody takes the excess but inertia: it would have made the shaft as fast as water takes this torque at.
        let fast = (torque.abs() / w.torque_n_m_s2).sqrt();
        self.slow_s > SLOW_S && self.slow_nm_s > INERTIA * w.inertia_kg_m2 * fast
    }

    /// Does the thrust (NaN where this tick has no reading) contradict the speed and current that stand now?
    pub fn is_implausible(&mut self, l: &Limits, speed: f64, current: f64, thrust: f64, dt_s: f64) -> bool {
        self.gap_s += dt_s;
        if self.gap_s > GAP_S {
            *self =
                Self { slow_s: self.slow_s, slow_nm_s: self.slow_nm_s, gap_s: self.gap_s, ..Self::default() };
        }
        if !thrust.is_finite() {
            return self.implausible;
        }
        let dt_s = std::mem::take(&mut self.gap_s).min(GAP_S);
        let w = &l.water;
        let torque = l.winding.1 * current - w.viscous_nm_s * speed;
        let by_speed = w.thrust_n_s2 * speed * speed.abs();
        let by_torque = torque * w.thrust_n_s2 / w.torque_n_m_s2;
        let small = SMALL * w.thrust_full_n();

        let pushes = torque * speed > 0.0 && torque.abs() > PUSHES * w.torque_n_m_s2 * speed * speed;
        let (least, most) = (by_speed.abs().min(by_torque.abs()), by_speed.abs().max(by_torque.abs()));
        let along = thrust * by_speed.signum();
        let denies = pushes && least > small && (along < least / DOUBT || along > most * DOUBT);
        (self.denied_s, self.denied_times) = if denies {
            let times = dt_s * speed.abs() / (w.speed_full_rad_s * w.settle_s);
            (self.denied_s + dt_s, self.denied_times + times)
        } else {
            (0.0, 0.0)
        };

        // One that shows the same to the last digit, while torque and speed both say that it is another by now.
        if thrust != self.thrust_n {
            (self.thrust_n, self.then_n) = (thrust, (by_speed, by_torque));
        }
        let moved = (by_speed - self.then_n.0, by_torque - self.then_n.1);
        let elsewhere = moved.0 * moved.1 > 0.0 && moved.0.abs().min(moved.1.abs()) > small;
        self.unmoved_s = if elsewhere { self.unmoved_s + dt_s } else { 0.0 };

        let denied = self.denied_s > DENIED_S && self.denied_times > INERTIA;
        self.implausible = denied || self.unmoved_s > DENIED_S;
        self.implausible
    }
}

#[cfg(test)]
mod tests;
