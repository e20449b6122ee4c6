//! Does the shaft sensor count the way the motor turns? One that is wired the wrong way round, or loses a phase, turns
//! every loop that uses it into one that runs away; nothing it shows is impossible by itself. It is known by what
//! stands beside it:
//!
//! - a voltage drive by its back-EMF, whatever the load: `Om = (V - R i) / ke`;
//! - any drive that tells its current by the power with which the motor seems to brake: only the water can sustain it,
//!   and a stream gives no more than Betz's share of what flows through the disc; a dry shaft gives back no more than
//!   what turns with it, and what hangs on it, have stored;
//! - a drive with a speed loop by the speed it was told.

use kort_proto::messages::DriveKind;
use kort_thruster::parameters::{Parameter, Parameters};
use kort_thruster::rig::{Load, Rig};

use crate::settings::Limits;
use crate::water::Water;

/// How long back-EMF or told speed may point the other way, s: longer than any drive and shaft take to turn round.
const OPPOSED_S: f64 = 0.5;
/// Share of full drive below which a direction says nothing.
const SMALL: f64 = 0.05;
/// Doubt of the voltage across the winding.
const WINDING_DOUBT: f64 = 0.3;
/// Braking impulse in what the shaft carries by its stated inertia: once stops it, and the inertia may be three times as
/// large as stated.
const STOPS: f64 = 3.0;
/// Fall of the shaft speed by which a shaft is turning round.
const FALLING: f64 = 0.9;

/// Share of the power of a stream that a free disc can take (Betz), and how much more a duct can make of it.
const BETZ: f64 = 16.0 / 27.0;
const DUCTED: f64 = 2.0;

/// Slower than this a sensor may only be noisy, or not quite at zero, on a shaft that does not turn.
const CREEP_RAD_S: f64 = 1.0;
/// Standard gravity, m/s^2.
const GRAVITY_M_S2: f64 = 9.806_65;

/// What the shaft sensor is held against.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shaft {
    /// Inertia of all that turns with it, kg m^2.
    pub inertia_kg_m2: f64,
    /// The most power with which water can turn the shaft, W; infinite where that is not known.
    pub water_w: f64,
    /// The most energy that weight or spring on a dry shaft can give back, J.
    pub stored_j: f64,
    /// For so long the sensor may still show how the shaft turned before, s.
    pub lag_s: f64,
}

impl Shaft {
    /// Of a rig with this largest current, in this water. Water gives what its stream carries; a dry shaft's load only what
    /// was put into it.
    pub fn of(rig: &Rig, current_a: f64, water: &Water) -> Self {
        let p = Parameters::stated(rig);
        let inertia_kg_m2 = p.get(Parameter::InertiaKgM2);
        let lag_s = STOPS * rig.sensors.speed_filter_time_constant_s.unwrap_or(0.0);
        if rig.propeller.is_none() {
            let torque_n_m = p.get(Parameter::TorqueConstantNmA) * current_a;
            return Self { lag_s, ..Self::dry(&rig.load, inertia_kg_m2, torque_n_m) };
        }
        let water_w = DUCTED * BETZ * 0.5 * water.flux_kg_m * water.inflow_m_s.powi(3);
        let water_w = if water_w.is_finite() { water_w } else { f64::INFINITY };
        Self { inertia_kg_m2, water_w, stored_j: 0.0, lag_s }
    }

    /// Of a motor of this inertia that turns only this load, with this torque at most.
    fn dry(load: &Load, motor_kg_m2: f64, torque_n_m: f64) -> Self {
        let (turns_kg_m2, stored_j) = match load {
            Load::None | Load::Fan { .. } => (0.0, 0.0),
            Load::Pendulum { mass_kg, length_m } => {
                let (mass, length) = (mass_kg.value, length_m.value);
                (mass * length * length, 2.0 * mass * GRAVITY_M_S2 * length)
            }
            // Twisted as far as the motor can hold it.
            Load::TwoMass { inertia_kg_m2, stiffness_nm_rad, .. } => {
                (inertia_kg_m2.value, 0.5 * torque_n_m * torque_n_m / stiffness_nm_rad.value)
            }
            // A weight may run down for as long as the slide is.
            Load::Slide { mass_kg, lead_m_rev, incline_rad } => {
                let lead_m = lead_m_rev.value / std::f64::consts::TAU;
                let stored_j = if incline_rad.value == 0.0 { 0.0 } else { f64::INFINITY };
                (mass_kg.value * lead_m * lead_m, stored_j)
            }
        };
        Self { inertia_kg_m2: motor_kg_m2 + turns_kg_m2, water_w: 0.0, stored_j, lag_s: 0.0 }
    }
}

/// What has been seen of the direction so far.
#[derive(Clone, Copy, Debug, Default)]
pub struct Direction {
    opposed_s: f64,
    impulse_nm_s: f64,
    /// Energy that braking seems to have taken off the shaft, beyond what water could give meanwhile, J.
    braked_j: f64,
    braking_s: f64,
    fastest_rad_s: f64,
    /// Time since the last reading of the speed.
    gap_s: f64,
    reversed: bool,
}

impl Direction {
    /// Looks at a tick: the measured shaft speed (NaN where this tick has no reading) and current (NaN where the drive
    /// tells none) under the drive that acted. True while the sensor cannot be right.
    pub fn is_reversed(&mut self, l: &Limits, speed: f64, current: f64, drive: f64, dt_s: f64) -> bool {
        self.gap_s += dt_s;
        if !speed.is_finite() {
            return self.reversed;
        }
        let dt_s = std::mem::take(&mut self.gap_s);
        let opposed = match l.kind {
            DriveKind::Voltage => back_emf_opposes(l, speed, current, drive),
            DriveKind::Speed => {
                let large = drive.abs().min(speed.abs()) > SMALL * l.drive_max;
                large && drive * speed < 0.0 && self.holds_its_speed(speed)
            }
            DriveKind::Current | DriveKind::Duty => false,
        };
        self.opposed_s = if opposed { self.opposed_s + dt_s } else { 0.0 };
        let brakes = self.brakes_without_end(l, speed, current, dt_s);
        self.reversed = brakes || self.opposed_s > OPPOSED_S;
        self.reversed
    }

    /// A drive that is told to turn round takes speed off the shaft.
    fn holds_its_speed(&mut self, speed: f64) -> bool {
        if self.opposed_s == 0.0 {
            self.fastest_rad_s = speed.abs();
        }
        self.fastest_rad_s = self.fastest_rad_s.max(speed.abs());
        speed.abs() > FALLING * self.fastest_rad_s
    }

    /// The motor seems to brake harder than water can drive, for longer than it takes to stop the shaft, and has taken
    /// off more than what hangs on it can give.
    fn brakes_without_end(&mut self, l: &Limits, speed: f64, current: f64, dt_s: f64) -> bool {
        let (_, torque_constant) = l.winding;
        let torque = torque_constant * current;
        let braking_w = -torque * speed;
        if braking_w.is_nan() || braking_w <= l.shaft.water_w || speed.abs() < CREEP_RAD_S {
            (self.impulse_nm_s, self.braked_j, self.braking_s) = (0.0, 0.0, 0.0);
            if l.kind != DriveKind::Speed {
                self.fastest_rad_s = 0.0;
            }
            return false;
        }
        self.fastest_rad_s = self.fastest_rad_s.max(speed.abs());
        self.braking_s += dt_s;
        if self.braking_s > l.shaft.lag_s {
            // What the water could give for ever does not count.
            self.impulse_nm_s += torque.abs() * dt_s * (1.0 - l.shaft.water_w / braking_w);
            self.braked_j += (braking_w - l.shaft.water_w) * dt_s;
        }
        self.impulse_nm_s > STOPS * l.shaft.inertia_kg_m2 * self.fastest_rad_s
            && self.braked_j > STOPS * l.shaft.stored_j
    }
}

/// Do back-EMF and sensor point in opposite directions, both beyond doubt?
fn back_emf_opposes(l: &Limits, speed: f64, current: f64, volts: f64) -> bool {
    let (resistance, ke) = l.winding;
    let drop = resistance * current;
    let emf = volts - drop;
    let sure = emf.abs() > WINDING_DOUBT * drop.abs() + SMALL * l.drive_max;
    sure && (ke * speed).abs() > SMALL * l.drive_max && emf * speed < 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::guard::tests::limits;

    fn trips_after(l: Limits, speed: f64, current: f64, drive: f64) -> Option<u32> {
        let mut direction = Direction::default();
        (1..5000).find(|_| direction.is_reversed(&l, speed, current, drive, 1e-3))
    }

    #[test]
    fn a_back_emf_against_the_sensor_trips_and_one_with_it_does_not() {
        let l = Limits { kind: DriveKind::Voltage, drive_max: 100.0, winding: (1.0, 1.2), ..limits() };
        // 60 V less 6 A through 1 ohm: 45 rad/s.
        assert_eq!(trips_after(l, 45.0, 6.0, 60.0), None);
        assert!(trips_after(l, -45.0, 6.0, 60.0).is_some_and(|ticks| ticks <= 502));
        // Nearly all of the voltage is lost in the winding: its sign is not known.
        assert_eq!(trips_after(l, -10.0, 9.0, 10.0), None);
        let unknown = Limits { winding: (f64::NAN, 1.2), ..l };
        assert_eq!(trips_after(unknown, -45.0, f64::NAN, 60.0), None);
    }

    #[test]
    fn braking_beyond_what_water_gives_trips_once_the_shaft_should_have_stopped() {
        let shaft = Shaft { inertia_kg_m2: 0.01, water_w: 100.0, stored_j: 0.0, lag_s: 0.0 };
        let l = Limits { shaft, winding: (f64::NAN, 1.0), ..limits() };
        // 9 N m against 50 rad/s are 450 W: 350 of them nobody gives. 3 x 0.01 x 50 / 9 x 450 / 350 = 0.214 s.
        assert!(trips_after(l, -50.0, 9.0, 9.0).is_some_and(|ticks| (210..220).contains(&ticks)));
        assert_eq!(trips_after(l, 50.0, 9.0, 9.0), None, "it drives");
        assert_eq!(trips_after(l, -50.0, 1.9, 1.9), None, "a stream may turn it so");
        assert_eq!(trips_after(limits(), -50.0, 9.0, 9.0), None, "nothing is known of the water");
    }

    #[test]
    fn a_shaft_against_the_speed_it_was_told_trips_unless_it_turns_round() {
        let l = Limits { kind: DriveKind::Speed, drive_max: 100.0, ..limits() };
        assert!(trips_after(l, -60.0, f64::NAN, 60.0).is_some_and(|ticks| ticks <= 502));
        assert_eq!(trips_after(l, 60.0, f64::NAN, 60.0), None);
        let mut direction = Direction::default();
        for tick in 0..3000 {
            let speed = -60.0 + 0.04 * f64::from(tick);
            assert!(!direction.is_reversed(&l, speed, f64::NAN, 60.0, 1e-3), "at {speed} rad/s");
        }
        // A drive on a wire shows a speed on every fifth tick only.
        let mut direction = Direction::default();
        let seldom = |tick: u32| if tick.is_multiple_of(5) { -60.0 } else { f64::NAN };
        let tripped = (1..5000).find(|tick| direction.is_reversed(&l, seldom(*tick), f64::NAN, 60.0, 1e-3));
        assert!(tripped.is_some_and(|tick| tick <= 510), "{tripped:?}");
    }
}
