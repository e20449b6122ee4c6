//! One run of a machine: closed loop, drive, shaft, water, sensors.
//!
//! Motion is integrated by Heun's method in steps of a fraction of a millisecond. Dry friction is
//! no torque but a brake: it holds the shaft at rest up to its breakaway, and never turns it round.

use crate::controller::Controller;
use crate::machine::{DriveKind, Machine, Scale};
use crate::physics::{Drive, Link, Now, Physics, Reading, Shaft, Water};
use crate::sensors::Chain;

/// What drives a run.
#[derive(Clone, Copy, Debug)]
pub enum Driver<'a> {
    /// A command a tick, A or V.
    Command(&'a [f64]),
    /// Motor current a tick, A: imposed, whatever the drive does.
    Current(&'a [f64]),
    /// A set-point a tick, and the loop that follows it.
    Loop(&'a [f64], &'a Controller),
}

impl Driver<'_> {
    fn ticks(&self) -> usize {
        match self {
            Driver::Command(list) | Driver::Current(list) | Driver::Loop(list, _) => list.len(),
        }
    }
}

/// What a run leaves: a value a tick.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trace {
    /// Command that begins at the tick, A or V.
    pub command: Vec<f64>,
    /// What the sensors show before it acts.
    pub readings: Vec<Reading>,
    /// True shaft speed, rad/s.
    pub speed_rad_s: Vec<f64>,
    /// True motor torque, N m.
    pub torque_n_m: Vec<f64>,
    /// The machine ran away: what follows is not there.
    pub broken: bool,
}

const ANGLE: usize = 0;
const SPEED: usize = 1;
const FLOW: usize = 2;
const CURRENT: usize = 3;
const TWIST: usize = 4;
const FAR: usize = 5;
type State = [f64; 6];

/// Rates of the state, without dry friction.
struct Rates {
    of: State,
    shaft: Shaft,
    inertia_kg_m2: f64,
    motor_n_m: f64,
    thrust_n: f64,
    torque_n_m: f64,
}

/// A machine with what is at work in it.
pub struct Bench<'a> {
    /// The machine.
    pub machine: &'a Machine,
    /// Scales of hidden terms.
    pub full: Scale,
    /// Largest step, s.
    pub step_s: f64,
    /// Encoder counts and converter steps are on.
    pub quantise: bool,
}

impl Bench<'_> {
    /// Runs from rest.
    pub fn run(&self, driver: Driver, physics: &mut [Box<dyn Physics>]) -> Trace {
        let tick_s = self.machine.sensors.tick_s;
        let steps = (tick_s / self.step_s - 1e-9).ceil().max(1.0) as usize;
        let step_s = tick_s / steps as f64;
        physics.iter_mut().for_each(|each| each.rest());
        let mut chain = Chain::new(self.machine, self.quantise);
        let mut control = crate::controller::State::default();
        let ticks = driver.ticks();
        let mut trace = Trace::default();
        trace.command.reserve(ticks);
        trace.readings.reserve(ticks);
        let mut state: State = [0.0; 6];
        let mut last = Last::default();
        for tick in 0..ticks {
            let time_s = tick as f64 * tick_s;
            let given = trace.command.last().copied().unwrap_or(0.0);
            let now = self.now(&state, time_s, given, &last);
            let reading = chain.read(&now, self.supply_v(&now, physics), physics);
            let (command, imposed) = match driver {
                Driver::Command(list) => (list[tick], None),
                Driver::Current(list) => (0.0, Some(list[tick])),
                Driver::Loop(list, controller) => {
                    (controller.update(&mut control, list[tick], &reading, self.machine, tick_s), None)
                }
            };
            trace.command.push(command);
            trace.readings.push(reading);
            trace.speed_rad_s.push(state[SPEED]);
            trace.torque_n_m.push(last.motor_n_m);
            for step in 0..steps {
                let at_s = time_s + step as f64 * step_s;
                let now = self.now(&state, at_s, command, &last);
                let asked = self.asked(&now, &trace.command, physics, step_s);
                let next = self.step(&state, &now, asked, imposed, step_s, physics, &mut last);
                let now = self.now(&next, at_s + step_s, command, &last);
                let mut force = last.thrust_n;
                for each in physics.iter_mut() {
                    each.stand(&now, &mut force, step_s);
                    each.advance(&now, step_s);
                }
                chain.follow(force, last.torque_n_m, step_s);
                state = next;
            }
            // Far beyond its scales, or no number at all: no machine does that.
            let beyond =
                state[SPEED].abs() > 20.0 * self.full.speed_rad_s || state.iter().any(|x| !x.is_finite());
            if beyond && self.full.speed_rad_s > 1.0 {
                trace.broken = true;
                break;
            }
        }
        trace
    }

    fn now<'b>(&'b self, x: &State, time_s: f64, command: f64, last: &Last) -> Now<'b> {
        Now {
            machine: self.machine,
            full: &self.full,
            time_s,
            command,
            current_a: x[CURRENT],
            angle_rad: x[ANGLE],
            twist_rad: x[TWIST],
            speed_rad_s: x[SPEED],
            flow_m_s: x[FLOW],
            motor_torque_n_m: last.motor_n_m,
            thrust_n: last.thrust_n,
            blade_torque_n_m: last.torque_n_m,
            acceleration_rad_s2: last.acceleration_rad_s2,
        }
    }

    /// What the drive is asked for now: the command of some time ago, as effects change it.
    fn asked(&self, now: &Now, given: &[f64], physics: &mut [Box<dyn Physics>], step_s: f64) -> f64 {
        let late: f64 = physics.iter().map(|each| each.lateness_s(now)).sum();
        let issued = ((now.time_s - late) / self.machine.sensors.tick_s + 1e-6).floor();
        let asked = if issued < 0.0 { 0.0 } else { given[(issued as usize).min(given.len() - 1)] };
        physics.iter_mut().fold(asked, |asked, each| each.command(asked, now, step_s))
    }

    /// Supply at the drive, V: a little droop, and what effects take.
    fn supply_v(&self, now: &Now, physics: &[Box<dyn Physics>]) -> f64 {
        let drive = self.drive(now, now.command, physics);
        let droop = 0.004 * now.current_a.abs() / self.machine.current_limit_a;
        self.machine.supply_v * (drive.supply_ratio - droop)
    }

    fn drive(&self, now: &Now, asked: f64, physics: &[Box<dyn Physics>]) -> Drive {
        let machine = self.machine;
        let mut drive = Drive {
            target: asked,
            lag_s: machine.drive_lag_s,
            current_limit_a: machine.current_limit_a,
            voltage_limit_v: f64::INFINITY,
            supply_ratio: 1.0,
            torque_gain: 1.0,
            braking: 1.0,
        };
        physics.iter().for_each(|each| each.drive(now, &mut drive));
        drive
    }

    /// Current toward which the drive moves, A.
    fn wanted_current(&self, now: &Now, drive: &Drive) -> f64 {
        let machine = self.machine;
        let emf = machine.torque_constant_nm_a * now.speed_rad_s;
        let wanted = match machine.drive {
            DriveKind::Current => drive.target.clamp(-drive.current_limit_a, drive.current_limit_a),
            DriveKind::Voltage => {
                let applied = drive.target * drive.supply_ratio;
                let driven = (applied - emf) / machine.winding_resistance_ohm;
                // Against the voltage that is on, or at none, current is the back-EMF's own.
                let current = if driven * applied > 0.0 { driven } else { driven * drive.braking };
                current.clamp(-drive.current_limit_a, drive.current_limit_a)
            }
        };
        let room = drive.voltage_limit_v;
        let least = (-room - emf) / machine.winding_resistance_ohm;
        wanted.clamp(least, least.max((room - emf) / machine.winding_resistance_ohm))
    }

    fn rates(
        &self,
        now: &Now,
        x: &State,
        asked: f64,
        imposed: Option<f64>,
        physics: &[Box<dyn Physics>],
    ) -> Rates {
        let machine = self.machine;
        let drive = self.drive(now, asked, physics);
        let mut of: State = [0.0; 6];
        let current = imposed.unwrap_or(x[CURRENT]);
        if imposed.is_none() {
            of[CURRENT] = (self.wanted_current(now, &drive) - x[CURRENT]) / drive.lag_s.max(1e-4);
        }
        let motor_n_m = machine.torque_constant_nm_a * drive.torque_gain * current;
        let mut shaft = Shaft { torque_n_m: machine.viscous_nm_s * x[SPEED], ..Shaft::default() };
        physics.iter().for_each(|each| each.shaft(now, &mut shaft));

        // The far side of an elastic link carries the load.
        let twisted = physics.iter().find_map(|each| each.link(now, x[TWIST], x[SPEED] - x[FAR]));
        let load_speed = if twisted.is_some() { x[FAR] } else { x[SPEED] };
        let (thrust_n, torque_n_m) = self.blades(now, load_speed, physics, &mut of);
        let load_angle = if twisted.is_some() { x[ANGLE] - x[TWIST] } else { x[ANGLE] };
        let torque_n_m = torque_n_m + machine.load.torque_n_m(load_angle, load_speed);
        let inertia = machine.inertia_kg_m2 + shaft.inertia_kg_m2;
        let near = inertia * (1.0 - twisted.map_or(0.0, |link| link.far_share));
        let load = match twisted {
            Some(Link { far_share, torque_n_m: link }) => {
                of[TWIST] = x[SPEED] - x[FAR];
                of[FAR] = (link - torque_n_m) / (inertia * far_share);
                link
            }
            None => torque_n_m,
        };
        of[ANGLE] = x[SPEED];
        of[SPEED] = (motor_n_m - load - shaft.torque_n_m) / near;
        Rates { of, shaft, inertia_kg_m2: near, motor_n_m, thrust_n, torque_n_m }
    }

    /// Thrust and torque of the blades, and the rate of the axial flow.
    fn blades(&self, now: &Now, speed: f64, physics: &[Box<dyn Physics>], of: &mut State) -> (f64, f64) {
        let Some(blades) = &self.machine.blades else { return (0.0, 0.0) };
        let mut water =
            Water { ambient_m_s: 0.0, flux_gain: 1.0, mass_gain: 1.0, swirl_m_s: 0.0, force_n: 0.0 };
        physics.iter().for_each(|each| each.water(now, &mut water));
        let flow = now.flow_m_s;
        let bend = |inflow: &crate::blades::Inflow, lift: &mut f64, drag: &mut f64| {
            physics
                .iter()
                .filter(|each| each.bends_polar())
                .for_each(|each| each.polar(now, inflow, lift, drag));
        };
        let bent = physics.iter().any(|each| each.bends_polar());
        let polar: Option<crate::blades::Polar> = if bent { Some(&bend) } else { None };
        let force = blades.force(speed, flow, water.swirl_m_s, polar);
        let (mut thrust_n, mut torque_n_m) = (force.thrust_n, force.torque_n_m);
        physics.iter().for_each(|each| each.forces(now, &mut thrust_n, &mut torque_n_m));
        let flux = blades.flux_coefficient * water.flux_gain * blades.density_kg_m3 * blades.area_m2();
        let mass = blades.added_mass_kg() * water.mass_gain;
        of[FLOW] = (thrust_n + water.force_n - flux * (flow - water.ambient_m_s) * flow.abs()) / mass;
        (thrust_n, torque_n_m)
    }

    /// One step by Heun's method.
    #[allow(clippy::too_many_arguments)] // the whole of what a step depends on
    fn step(
        &self,
        x: &State,
        now: &Now,
        asked: f64,
        imposed: Option<f64>,
        step_s: f64,
        physics: &[Box<dyn Physics>],
        last: &mut Last,
    ) -> State {
        let first = self.rates(now, x, asked, imposed, physics);
        let mut guess = *x;
        guess.iter_mut().zip(&first.of).for_each(|(value, rate)| *value += step_s * rate);
        guess[SPEED] = slide(x[SPEED], first.of[SPEED], &first.shaft, first.inertia_kg_m2, step_s);
        let then = self.now(&guess, now.time_s + step_s, now.command, last);
        let second = self.rates(&then, &guess, asked, imposed, physics);
        let mut next = *x;
        for ((value, a), b) in next.iter_mut().zip(&first.of).zip(&second.of) {
            *value += 0.5 * step_s * (a + b);
        }
        let acceleration = 0.5 * (first.of[SPEED] + second.of[SPEED]);
        next[SPEED] = slide(x[SPEED], acceleration, &first.shaft, first.inertia_kg_m2, step_s);
        // What stands does not turn.
        if next[SPEED] == 0.0 && x[SPEED] == 0.0 {
            next[ANGLE] = x[ANGLE];
        }
        if let Some(current) = imposed {
            next[CURRENT] = current;
        }
        *last = Last {
            motor_n_m: 0.5 * (first.motor_n_m + second.motor_n_m),
            thrust_n: second.thrust_n,
            torque_n_m: second.torque_n_m,
            acceleration_rad_s2: (next[SPEED] - x[SPEED]) / step_s,
        };
        next
    }
}

/// What the last step saw.
#[derive(Clone, Copy, Debug, Default)]
struct Last {
    motor_n_m: f64,
    thrust_n: f64,
    torque_n_m: f64,
    acceleration_rad_s2: f64,
}

/// Speed after a step under an acceleration without dry friction, rad/s. Friction brakes a moving
/// shaft to rest at most; a shaft at rest moves where the torque exceeds the breakaway.
fn slide(speed: f64, acceleration: f64, shaft: &Shaft, inertia_kg_m2: f64, step_s: f64) -> f64 {
    let [ahead, astern] = shaft.dry_n_m;
    if ahead <= 0.0 && astern <= 0.0 {
        return speed + step_s * acceleration;
    }
    if speed == 0.0 {
        let way = acceleration.signum();
        let dry = if way > 0.0 { ahead } else { astern };
        let hold = shaft.breakaway_n_m.max(dry);
        if (acceleration * inertia_kg_m2).abs() <= hold {
            return 0.0;
        }
        return way * (acceleration.abs() - dry / inertia_kg_m2).max(0.0) * step_s;
    }
    let way = speed.signum();
    let dry = if way > 0.0 { ahead } else { astern };
    let next = speed + step_s * (acceleration - way * dry / inertia_kg_m2);
    if next * way > 0.0 { next } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dry_friction_holds_brakes_and_breaks_loose() {
        let shaft = Shaft { dry_n_m: [1.0, 2.0], breakaway_n_m: 1.5, ..Shaft::default() };
        assert_eq!(slide(0.0, 1.4, &shaft, 1.0, 0.01), 0.0, "below breakaway");
        assert!((slide(0.0, 2.0, &shaft, 1.0, 0.01) - 0.01).abs() < 1e-12, "1 N m is left");
        assert_eq!(slide(0.0, -1.9, &shaft, 1.0, 0.01), 0.0, "astern it rubs more");
        assert_eq!(slide(0.005, 0.0, &shaft, 1.0, 0.01), 0.0, "it stops, it does not turn round");
        assert!((slide(-1.0, 0.0, &shaft, 1.0, 0.01) + 0.98).abs() < 1e-12);
        assert_eq!(slide(0.0, 3.0, &Shaft::default(), 1.0, 0.01), 0.03, "without friction it is free");
    }
}
