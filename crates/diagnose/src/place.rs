//! Where does something act that has no name? At each place where physics may be missing a cause is set free in time,
//! which takes any course: what is left then tells by which way it comes, since each place shows it in its own
//! proportion on every channel.

use kort_identify::fit::Fit;
use kort_identify::simulate::Problem;
use kort_thruster::both;
use kort_thruster::effects::knots::{self, Knots};
use kort_thruster::effects::{
    Available, Context, Descriptor, Effect, Hooks, Path, Scale, Spec, commanded, flow_measured, free_shaft,
    one_start, speed_measured, thrust_measured, wet,
};
use kort_thruster::plant::{Balance, Drive, Local, Sensed, Tick};
use kort_thruster::real::Real;
use kort_thruster::rig::Rig;
use rayon::prelude::*;

use crate::flexible::flow_seen;
use crate::nameless::nameless;
use crate::probe::{probe, promises};

/// Where a cause may act.
#[derive(Clone, Copy)]
enum Place {
    Command,
    MotorTorque,
    ShaftTorque,
    Blade,
    AmbientFlow,
    Thrust,
    Torque,
    Speed,
    Flow,
}

struct InTime<T> {
    place: Place,
    course: Knots<T>,
}

impl<T: Real> InTime<T> {
    fn boxed(place: Place, values: &[T]) -> Box<dyn Effect<T>> {
        Box::new(Self { place, course: Knots::new(values) })
    }
}

impl<T: Real> Effect<T> for InTime<T> {
    fn hooks(&self) -> Hooks {
        match self.place {
            Place::Command => Hooks::DRIVE,
            Place::Thrust | Place::Torque | Place::Speed | Place::Flow => Hooks::SENSE,
            _ => Hooks::BALANCE,
        }
    }

    fn drive(&mut self, tick: &Tick, drive: &mut Drive<T>) {
        drive.command *= self.course.at(tick.time_s) + 1.0;
    }

    fn balance(&self, at: &Local<T>, _: &[T], balance: &mut Balance<T>, _: &mut [T]) {
        let now = self.course.at(at.time_s);
        match self.place {
            Place::MotorTorque => balance.motor_torque_n_m *= now + 1.0,
            Place::ShaftTorque => balance.shaft_torque_n_m += now,
            Place::Blade => {
                balance.thrust_n *= now + 1.0;
                balance.blade_torque_n_m *= now + 1.0;
            }
            _ => balance.ambient_m_s += now,
        }
    }

    fn sense(&mut self, tick: &Tick, sensed: &mut Sensed<T>) {
        let now = self.course.at(tick.time_s);
        match self.place {
            Place::Thrust => sensed.thrust_n += now,
            Place::Torque => sensed.torque_n_m += now,
            Place::Speed => sensed.shaft_speed_rad_s += now,
            _ => sensed.flow_m_s += now,
        }
    }
}

fn course(scale: &Scale, unit: &'static str, size: f64) -> Vec<Spec> {
    knots::specs(scale, &knots::SHARE, unit, 0.03 * size, (-size, size), 0.1 * size)
}

macro_rules! place {
    ($const:ident, $place:ident, $path:ident, $needs:expr, $parameters:expr) => {
        const $const: Descriptor = nameless! {
            id: concat!("unknown_", stringify!($place)),
            path: Path::$path,
            what: "a cause that is free in time",
            equation: "",
            parameters: $parameters,
            starts: one_start,
            needs: $needs,
            build: both!(|values, _: &Context<_>| InTime::boxed(Place::$place, values)),
        };
    };
}

fn torque_measured(_: &Rig, available: &Available) -> Result<(), &'static str> {
    if available.has("torque_n_m") { Ok(()) } else { Err("torque is not recorded") }
}

place!(COMMAND, Command, Drive, commanded, |s| course(s, "1", 1.0));
place!(MOTOR_TORQUE, MotorTorque, Drive, free_shaft, |s| course(s, "1", 1.0));
place!(SHAFT_TORQUE, ShaftTorque, Shaft, free_shaft, |s| course(s, "N m", s.torque_n_m));
place!(BLADE, Blade, Blade, wet, |s| course(s, "1", 1.0));
place!(AMBIENT_FLOW, AmbientFlow, Flow, flow_seen, |s| course(s, "m/s", s.flow_m_s));
place!(THRUST, Thrust, Sensor, thrust_measured, |s| course(s, "N", s.thrust_n));
place!(TORQUE, Torque, Sensor, torque_measured, |s| course(s, "N m", s.torque_n_m));
place!(SPEED, Speed, Sensor, speed_measured, |s| course(s, "rad/s", s.shaft_speed_rad_s));
place!(FLOW, Flow, Sensor, flow_measured, |s| course(s, "m/s", s.flow_m_s));

const PLACES: &[&Descriptor] =
    &[&COMMAND, &MOTOR_TORQUE, &SHAFT_TORQUE, &BLADE, &AMBIENT_FLOW, &THRUST, &TORQUE, &SPEED, &FLOW];

/// The path on which a cause that is free in time leaves least of what a fit leaves, all its numbers paid. Where none earns
/// its numbers and one channel is off `alone`, what that channel shows is its sensor's: a cause elsewhere would move others too.
pub fn path(problem: &Problem, fit: &Fit, rig: &Rig, offered: &Available, alone: bool) -> Option<Path> {
    let known = problem.about(&fit.lines, &fit.columns, &fit.hypothesis);
    let free = PLACES.par_iter().filter(|place| (place.needs)(rig, offered).is_ok());
    let tried = free.filter_map(|place| {
        let probes = probe(problem, fit, place);
        let best = promises(problem, fit, &known, &probes).into_iter().next()?;
        Some((best.cost, place.path))
    });
    let (cost, path) = tried.min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(if alone && cost >= fit.cost() { Path::Sensor } else { path })
}

#[cfg(test)]
mod tests {
    use kort_identify::data::{Series, available};
    use kort_identify::hypothesis::Member;
    use kort_identify::setup::Setup;
    use kort_thruster::models::ModelName;

    use super::*;
    use crate::constants::Constants;

    /// The path found for a cause at a place that comes and goes in a few seconds.
    fn found(place: &'static Descriptor, size: f64, alone: bool) -> Option<Path> {
        let rig =
            Rig::from_toml(include_str!("../../../config/thrusters/whitcomb-yoerger-1999.toml")).unwrap();
        let rows = 3000;
        let level = |k: usize| ((k / 150) as f64 * 2.4).sin() * 6.0;
        let wave = |k: usize| (k as f64 * 0.01).sin();
        let columns =
            ["current_cmd_a", "shaft_speed_rad_s", "thrust_n", "torque_n_m", "flow_m_s"].map(|name| {
                (
                    name.into(),
                    (0..rows).map(|k| if name == "current_cmd_a" { level(k) } else { wave(k) }).collect(),
                )
            });
        let mut series = Series {
            name: "log".into(),
            time_s: (0..rows).map(|k| 0.01 * k as f64).collect(),
            columns: columns.into(),
        };
        let criterion = Constants::built_in().criterion;
        // What the thruster with the cause shows is the recording.
        let truth = Setup::new(std::slice::from_ref(&series), &rig, ModelName::Model2, criterion).unwrap();
        let whole = Member::new(place, &truth.problem.scale);
        let course = whole.values.iter().enumerate();
        let values = course.map(|(k, v)| if k == 0 { *v } else { size * (0.9 * k as f64).sin() });
        let member = whole.clone().at(values.collect());
        let with = truth.baseline.with(&truth.baseline.start, member, &truth.problem.scale);
        let shown = truth.problem.respond(&with, &with.start);
        for (channel, samples) in truth.problem.recordings[0].channels.iter().zip(&shown[0]) {
            let column = series.columns.iter_mut().find(|c| c.0 == channel.response.name()).unwrap();
            for (k, (row, value)) in channel.rows.iter().zip(samples).enumerate() {
                column.1[*row] = value + 0.002 * channel.full_scale * ((k * k % 17) as f64 / 8.0 - 1.0);
            }
        }
        let series = [series];
        let setup = Setup::new(&series, &rig, ModelName::Model2, criterion).unwrap();
        let fit = setup.problem.settle_from_stated(&setup.baseline, 5);
        let offered = available(ModelName::Model2, &series, &setup.problem.recordings);
        path(&setup.problem, &fit, &rig, &offered, alone)
    }

    #[test]
    fn a_cause_that_is_free_in_time_is_found_on_its_path() {
        assert_eq!(found(&SHAFT_TORQUE, 0.6, false), Some(Path::Shaft));
        assert_eq!(found(&AMBIENT_FLOW, 0.15, false), Some(Path::Flow));
        assert_eq!(found(&BLADE, 0.3, true), Some(Path::Blade));
    }

    #[test]
    fn what_one_channel_shows_and_no_cause_follows_is_its_sensor_s() {
        assert_eq!(found(&SPEED, 0.0, true), Some(Path::Sensor));
    }
}
