//! Terms that bend to anything, one for each place where physics may be missing: the alternative of last
//! resort. They have no form of their own, so they pay for all their numbers, and win only where no set of
//! named effects comes near. What they show is said as a table of numbers, not as a law. None bends where an effect of
//! the catalogue does: a curve of the command is `command_curve`, a course of the inflow is `ambient_flow_unsteady`.

use kort_thruster::both;
use kort_thruster::effects::{
    Available, Context, Descriptor, Effect, Hooks, Path, Spec, angle_known, commanded, free_shaft, one_start,
    thrust_measured, turns_round, wet,
};
use kort_thruster::plant::{Balance, Drive, Local, Sensed, Tick};
use kort_thruster::real::Real;
use kort_thruster::rig::Rig;

use crate::load_steps;
use crate::nameless::nameless;

/// Every term.
pub const TERMS: &[&Descriptor] = &[
    &SHAFT_OVER_SPEED,
    &SHAFT_OVER_FLOW,
    &SHAFT_OVER_ANGLE,
    &SHAFT_OVER_TIME,
    &load_steps::LOAD_STEPS,
    &DRIVE_OVER_TIME,
    &BLADE_OVER_SPEED,
    &BLADE_OVER_FLOW,
    &FLOW_OVER_FLOW,
    &SENSOR_OVER_THRUST,
    &SENSOR_OVER_TIME,
    &crate::column::SHAFT,
    &crate::column::BLADE,
    &crate::column::SENSOR,
];

/// Whether an effect is one of these.
pub fn is_term(id: &str) -> bool {
    id.starts_with("unknown_")
}

/// Points of a piecewise linear curve.
const POINTS: usize = 8;
const NAMES: [&str; POINTS] = ["at_1", "at_2", "at_3", "at_4", "at_5", "at_6", "at_7", "at_8"];

/// Where the points of a curve over a range lie.
fn over([from, to]: [f64; 2]) -> [f64; POINTS] {
    std::array::from_fn(|k| from + (to - from) * k as f64 / (POINTS - 1) as f64)
}

/// A straight piece between points; held beyond the ends.
fn curve<T: Real>(values: &[T], points: &[f64; POINTS], at: T) -> T {
    let last = POINTS - 1;
    if at.re() <= points[0] {
        return values[0];
    }
    if at.re() >= points[last] {
        return values[last];
    }
    let k = (0..last).find(|k| at.re() < points[k + 1]).unwrap_or(last - 1);
    let part = (at - points[k]) / (points[k + 1] - points[k]);
    values[k] + (values[k + 1] - values[k]) * part
}

/// Heights of a curve, each about as large as `size` may be, then the range it is laid over.
fn heights(unit: &'static str, size: f64, [from, to]: [f64; 2]) -> Vec<Spec> {
    let mut specs: Vec<Spec> = NAMES
        .iter()
        .map(|name| Spec::strength(name, unit, 0.2 * size, -20.0 * size, 20.0 * size).sigma(size))
        .collect();
    specs.push(Spec::held("from", "1", from, from, from));
    specs.push(Spec::held("to", "1", to, to, to));
    specs
}

/// What a term acts on.
#[derive(Clone, Copy)]
enum Place {
    ShaftOverSpeed,
    ShaftOverFlow,
    ShaftOverAngle,
    ShaftOverTime,
    DriveOverTime,
    BladeOverSpeed,
    BladeOverFlow,
    FlowOverFlow,
    SensorOverThrust,
    SensorOverTime,
}

struct Term<T> {
    place: Place,
    values: Vec<T>,
    points: [f64; POINTS],
}

impl<T: Real> Term<T> {
    fn boxed(place: Place, values: &[T]) -> Box<dyn Effect<T>> {
        let points = over([values[POINTS].re(), values[POINTS + 1].re()]);
        Box::new(Self { place, values: values[..POINTS].to_vec(), points })
    }

    fn at(&self, x: T) -> T {
        curve(&self.values, &self.points, x)
    }
}

impl<T: Real> Effect<T> for Term<T> {
    fn hooks(&self) -> Hooks {
        match self.place {
            Place::DriveOverTime => Hooks::DRIVE,
            Place::SensorOverThrust | Place::SensorOverTime => Hooks::SENSE,
            _ => Hooks::BALANCE,
        }
    }

    fn drive(&mut self, tick: &Tick, drive: &mut Drive<T>) {
        drive.command *= self.at(T::from(tick.time_s)) + 1.0;
    }

    fn balance(&self, at: &Local<T>, _: &[T], balance: &mut Balance<T>, _: &mut [T]) {
        let (speed, flow, time) = (at.shaft_speed_rad_s, at.axial_m_s, T::from(at.time_s));
        match self.place {
            Place::ShaftOverSpeed => balance.shaft_torque_n_m += self.at(speed),
            Place::ShaftOverFlow => balance.shaft_torque_n_m += self.at(flow),
            Place::ShaftOverAngle => balance.shaft_torque_n_m += self.at(at.shaft_angle_rad),
            Place::ShaftOverTime => balance.shaft_torque_n_m += self.at(time),
            Place::BladeOverSpeed => balance.thrust_n += self.at(speed),
            Place::BladeOverFlow => balance.thrust_n += self.at(flow),
            Place::FlowOverFlow => balance.momentum_n += self.at(flow),
            _ => {}
        }
    }

    fn sense(&mut self, tick: &Tick, sensed: &mut Sensed<T>) {
        sensed.thrust_n += match self.place {
            Place::SensorOverTime => self.at(T::from(tick.time_s)),
            _ => self.at(sensed.thrust_n),
        };
    }
}

macro_rules! term {
    ($const:ident, $id:literal, $path:ident, $equation:literal, $needs:expr, $parameters:expr, $place:ident) => {
        pub(crate) const $const: Descriptor = nameless! {
            id: $id,
            path: Path::$path,
            what: "a term that bends to anything",
            equation: $equation,
            parameters: $parameters,
            starts: one_start,
            needs: $needs,
            build: both!(|values, _: &Context<_>| Term::boxed(Place::$place, values)),
        };
    };
}

/// Needs water with an axial flow of its own.
pub(crate) fn flow_seen(rig: &Rig, available: &Available) -> Result<(), &'static str> {
    wet(rig, available)?;
    if available.axial_flow_modelled { Ok(()) } else { Err("the baseline has no axial flow") }
}

/// Needs a free shaft that swings: where it makes no whole turn, a weight, a spring or a cable may hang on it.
fn swings(rig: &Rig, available: &Available) -> Result<(), &'static str> {
    free_shaft(rig, available)?;
    angle_known(rig, available)?;
    match turns_round(rig, available) {
        Ok(()) => Err("the shaft turns round, and what comes again with its angle is torque_ripple_cogging"),
        Err(_) => Ok(()),
    }
}

fn shaft_and_flow(rig: &Rig, available: &Available) -> Result<(), &'static str> {
    free_shaft(rig, available)?;
    flow_seen(rig, available)
}

term!(
    SHAFT_OVER_SPEED,
    "unknown_shaft_over_speed",
    Shaft,
    "shaft torque [N m] over shaft_speed_rad_s",
    free_shaft,
    |s| heights("N m", 0.1 * s.torque_n_m, s.both_ways(s.shaft_speed_rad_s)),
    ShaftOverSpeed
);
term!(
    SHAFT_OVER_FLOW,
    "unknown_shaft_over_flow",
    Shaft,
    "shaft torque [N m] over flow_m_s",
    shaft_and_flow,
    |s| heights("N m", 0.1 * s.torque_n_m, s.both_ways(s.flow_m_s)),
    ShaftOverFlow
);
term!(
    SHAFT_OVER_ANGLE,
    "unknown_shaft_over_angle",
    Shaft,
    "shaft torque [N m] over shaft_angle_rad",
    swings,
    // What hangs on a shaft that swings is what its motor was chosen to carry.
    |s| heights("N m", 0.5 * s.torque_n_m, s.angle_rad),
    ShaftOverAngle
);
term!(
    SHAFT_OVER_TIME,
    "unknown_shaft_over_time",
    Shaft,
    "shaft torque [N m] over time_s",
    free_shaft,
    |s| heights("N m", 0.1 * s.torque_n_m, s.clock_s),
    ShaftOverTime
);
term!(
    DRIVE_OVER_TIME,
    "unknown_drive_over_time",
    Drive,
    "relative addition to the command over time_s",
    commanded,
    |s| heights("1", 0.1, s.clock_s),
    DriveOverTime
);
term!(
    BLADE_OVER_SPEED,
    "unknown_blade_over_speed",
    Blade,
    "thrust [N] over shaft_speed_rad_s",
    wet,
    |s| heights("N", 0.1 * s.thrust_n, s.both_ways(s.shaft_speed_rad_s)),
    BladeOverSpeed
);
term!(
    BLADE_OVER_FLOW,
    "unknown_blade_over_flow",
    Blade,
    "thrust [N] over flow_m_s",
    flow_seen,
    |s| heights("N", 0.1 * s.thrust_n, s.both_ways(s.flow_m_s)),
    BladeOverFlow
);
term!(
    FLOW_OVER_FLOW,
    "unknown_flow_over_flow",
    Flow,
    "force on the axial flow [N] over flow_m_s",
    flow_seen,
    |s| heights("N", 0.1 * s.thrust_n, s.both_ways(s.flow_m_s)),
    FlowOverFlow
);
term!(
    SENSOR_OVER_THRUST,
    "unknown_sensor_over_thrust",
    Sensor,
    "addition to the thrust reading [N] over thrust_n",
    thrust_measured,
    |s| heights("N", 0.1 * s.thrust_n, s.both_ways(s.thrust_n)),
    SensorOverThrust
);
term!(
    SENSOR_OVER_TIME,
    "unknown_sensor_over_time",
    Sensor,
    "addition to the thrust reading [N] over time_s",
    thrust_measured,
    |s| heights("N", 0.1 * s.thrust_n, s.clock_s),
    SensorOverTime
);

/// A term's numbers as words: variable and height of every point, or size and instant of a step.
pub fn expression(term: &Descriptor, values: &[f64]) -> String {
    if term.id == load_steps::LOAD_STEPS.id {
        return load_steps::expression(values);
    }
    if let Some(words) = crate::column::expression(term, values) {
        return words;
    }
    let points = over([values[POINTS], values[POINTS + 1]]);
    let heights = &values[..POINTS];
    let most = heights.iter().fold(0.0_f64, |most, height| most.max(height.abs()));
    // Three digits of the largest height.
    let digits = (2.0 - most.max(1e-300).log10().floor()).clamp(0.0, 12.0) as usize;
    let pairs: Vec<String> =
        points.iter().zip(heights).map(|(x, y)| format!("{y:+.digits$} at {x:.3}")).collect();
    format!("straight between {}", pairs.join(", "))
}

/// What a term enters, and over what.
pub fn enters(term: &Descriptor) -> (&'static str, &'static str) {
    term.equation.split_once(" over ").unwrap_or((term.equation, "time_s"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_goes_through_its_points_and_is_held_beyond_them() {
        let values: Vec<f64> = (0..POINTS).map(|k| k as f64).collect();
        let points = over([-7.0, 7.0]);
        assert_eq!(curve(&values, &points, -9.0), 0.0);
        assert_eq!(curve(&values, &points, 9.0), 7.0);
        assert!((curve(&values, &points, 0.0) - 3.5).abs() < 1e-12);
    }

    #[test]
    fn what_hangs_on_a_shaft_is_looked_for_where_it_swings() {
        let rig = Rig::from_toml(
            "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 1.0\n",
        )
        .unwrap();
        let turned = |turned_rad| {
            let columns = vec![kort_thruster::effects::ANGLE_KNOWN.into()];
            Available { columns, turned_rad, ..Available::default() }
        };
        assert!(swings(&rig, &turned(Some(1.2))).is_ok());
        assert!(swings(&rig, &turned(Some(40.0))).is_err(), "it turns round");
        assert!(swings(&rig, &Available::default()).is_err(), "nobody knows where it stands");
    }

    #[test]
    fn every_term_is_listed_once_and_named_as_one() {
        let mut ids: Vec<&str> = TERMS.iter().map(|t| t.id).collect();
        ids.sort_unstable();
        ids.dedup();
        assert_eq!(ids.len(), TERMS.len());
        assert!(ids.iter().all(|id| is_term(id)));
    }
}
