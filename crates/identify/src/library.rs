//! Terms without a name: signed and even powers of the states on each path, products, steps at some
//! speed or flow, and loads that switch on at some time. They judge whether a named effect is good enough, and say
//! what is known where none is.

use kort_thruster::both;
use kort_thruster::effects::{Descriptor, Effect, Hooks, Path, Scale, Spec, free_shaft, one_start, wet};
use kort_thruster::plant::{Balance, Drive, Local, Sensed, Tick};
use kort_thruster::real::Real;

/// All terms.
pub const TERMS: &[&Descriptor] = &[
    &SHAFT_ODD,
    &SHAFT_EVEN,
    &SHAFT_FLOW,
    &SHAFT_STEP,
    &SHAFT_SWITCHED,
    &DRIVE_ODD,
    &DRIVE_SWITCHED,
    &BLADE_THRUST_ODD,
    &BLADE_THRUST_EVEN,
    &BLADE_THRUST_FLOW,
    &BLADE_THRUST_STEP,
    &BLADE_TORQUE_ODD,
    &FLOW_ODD,
    &FLOW_EVEN,
    &FLOW_SWITCHED,
    &SENSOR_THRUST,
    &SENSOR_THRUST_SWITCHED,
];

/// Is this a term of the library rather than a named effect?
pub fn is_term(effect: &Descriptor) -> bool {
    effect.id.starts_with("term_")
}

type Act<T> = fn(&Values<T>, &Local<T>, &mut Balance<T>);
type Change<T> = fn(&Values<T>, &Tick, T) -> T;

/// Values of a term: size, reference, exponent or time.
#[derive(Clone, Copy)]
struct Values<T> {
    size: T,
    reference: T,
    shape: T,
}

struct BalanceTerm<T> {
    values: Values<T>,
    act: Act<T>,
}

impl<T: Real> Effect<T> for BalanceTerm<T> {
    fn hooks(&self) -> Hooks {
        Hooks::BALANCE
    }

    fn balance(&self, at: &Local<T>, _: &[T], balance: &mut Balance<T>, _: &mut [T]) {
        (self.act)(&self.values, at, balance);
    }
}

struct DriveTerm<T> {
    values: Values<T>,
    act: Change<T>,
}

impl<T: Real> Effect<T> for DriveTerm<T> {
    fn hooks(&self) -> Hooks {
        Hooks::DRIVE
    }

    fn drive(&mut self, tick: &Tick, drive: &mut Drive<T>) {
        drive.command += (self.act)(&self.values, tick, drive.command);
    }
}

struct ThrustTerm<T> {
    values: Values<T>,
    act: Change<T>,
}

impl<T: Real> Effect<T> for ThrustTerm<T> {
    fn hooks(&self) -> Hooks {
        Hooks::SENSE
    }

    fn sense(&mut self, tick: &Tick, sensed: &mut Sensed<T>) {
        sensed.thrust_n += (self.act)(&self.values, tick, sensed.thrust_n);
    }
}

fn values<T: Real>(v: &[T]) -> Values<T> {
    Values { size: v[0], reference: v[1], shape: v[2] }
}

/// `sgn(x) |x/x0|^p`, smooth at zero.
fn odd<T: Real>(x: T, v: &Values<T>) -> T {
    let u = x / v.reference;
    (u * u + 1e-6).powf(v.shape * 0.5) * (u * 100.0).tanh()
}

/// `sgn(Om) |Om/Om0|^p |vp|`, smooth at zero.
fn odd_in_flow<T: Real>(at: &Local<T>, v: &Values<T>) -> T {
    odd(at.shaft_speed_rad_s, v) * at.axial_m_s.abs()
}

/// `|x/x0|^p`, smooth at zero.
fn even<T: Real>(x: T, v: &Values<T>) -> T {
    let u = x / v.reference;
    (u * u + 1e-6).powf(v.shape * 0.5)
}

/// 0 below, 1 above a threshold (a share of the reference), on either side of zero.
fn above<T: Real>(x: T, v: &Values<T>) -> T {
    let past = ((x / v.reference).abs() - v.shape) / 0.03;
    (past.tanh() + 1.0) * 0.5
}

/// `sgn(x)`
fn sign<T: Real>(x: T) -> T {
    T::from(x.re().signum())
}

/// 0 before, 1 after the time of switching, over a tenth of a second.
fn switched<T: Real>(time_s: f64, v: &Values<T>) -> T {
    (((T::from(time_s) - v.shape) / 0.05).tanh() + 1.0) * 0.5
}

/// A size, the reference it is told by, and a shape.
fn specs(name: &'static str, unit: &'static str, size: f64, reference: f64, shape: Spec) -> Vec<Spec> {
    let reach = 20.0 * size;
    vec![
        Spec::strength(name, unit, size, -reach, reach),
        Spec::shape("reference", "SI", reference, reference, reference),
        shape,
    ]
}

fn power(name: &'static str, unit: &'static str, size: f64, reference: f64) -> Vec<Spec> {
    specs(name, unit, size, reference, Spec::shape("exponent", "1", 0.7, 0.0, 4.0))
}

fn step(name: &'static str, unit: &'static str, size: f64, reference: f64) -> Vec<Spec> {
    specs(name, unit, size, reference, Spec::shape("threshold", "1", 0.5, 0.1, 1.0))
}

fn switch(name: &'static str, unit: &'static str, size: f64, scale: &Scale) -> Vec<Spec> {
    let when = Spec::shape("switch_time_s", "s", 0.5 * scale.duration_s, 0.0, scale.duration_s);
    specs(name, unit, size, scale.shaft_speed_rad_s, when)
}

fn exponents(specs: Vec<Spec>) -> Vec<Vec<f64>> {
    [3.0].into_iter().map(|p| vec![specs[0].start, specs[1].start, p]).collect()
}

fn thresholds(specs: Vec<Spec>) -> Vec<Vec<f64>> {
    [0.3, 0.65, 0.8].into_iter().map(|p| vec![specs[0].start, specs[1].start, p]).collect()
}

fn times(specs: Vec<Spec>, scale: &Scale) -> Vec<Vec<f64>> {
    (1..10)
        .filter(|k| *k != 5)
        .map(|k| vec![specs[0].start, specs[1].start, f64::from(k) / 10.0 * scale.duration_s])
        .collect()
}

macro_rules! term {
    ($const:ident, $id:literal, $path:expr, $equation:literal, $needs:expr, $parameters:expr, $starts:expr, $build:expr) => {
        const $const: Descriptor = Descriptor {
            id: $id,
            path: $path,
            what: "a term without a name",
            equation: $equation,
            signature: "",
            confused_with: &[],
            separated_by: "",
            reference: "",
            parameters: $parameters,
            starts: $starts,
            needs: $needs,
            build: both!($build),
        };
    };
}

mod column;
pub use column::COLUMN_TERMS;

fn boxed<T: Real>(v: &[T], act: Act<T>) -> Box<dyn Effect<T>> {
    Box::new(BalanceTerm { values: values(v), act })
}

fn shaft(s: &Scale) -> Vec<Spec> {
    power("shaft_torque_n_m", "N m", 0.02 * s.torque_n_m, s.shaft_speed_rad_s)
}
fn shaft_step(s: &Scale) -> Vec<Spec> {
    step("shaft_torque_n_m", "N m", 0.02 * s.torque_n_m, s.shaft_speed_rad_s)
}
fn blade_thrust(s: &Scale) -> Vec<Spec> {
    power("thrust_n", "N", 0.02 * s.thrust_n, s.shaft_speed_rad_s)
}
fn blade_thrust_step(s: &Scale) -> Vec<Spec> {
    step("thrust_n", "N", 0.02 * s.thrust_n, s.flow_m_s)
}
fn blade_torque(s: &Scale) -> Vec<Spec> {
    power("blade_torque_n_m", "N m", 0.02 * s.torque_n_m, s.shaft_speed_rad_s)
}
fn flow(s: &Scale) -> Vec<Spec> {
    power("force_on_the_water_n", "N", 0.02 * s.thrust_n, s.flow_m_s)
}
fn command(s: &Scale) -> Vec<Spec> {
    power("command_offset", "A, V or rad/s", 0.02 * s.command, s.command)
}
fn thrust_reading(s: &Scale) -> Vec<Spec> {
    power("thrust_reading_n", "N", 0.02 * s.thrust_n, s.thrust_n)
}
fn shaft_switch(s: &Scale) -> Vec<Spec> {
    switch("load_torque_n_m", "N m", 0.02 * s.torque_n_m, s)
}
fn drive_switch(s: &Scale) -> Vec<Spec> {
    switch("gain_change", "1", 0.02, s)
}
fn flow_switch(s: &Scale) -> Vec<Spec> {
    switch("ambient_step_m_s", "m/s", 0.05 * s.flow_m_s, s)
}
fn thrust_switch(s: &Scale) -> Vec<Spec> {
    switch("thrust_step_n", "N", 0.02 * s.thrust_n, s)
}

term!(
    SHAFT_ODD,
    "term_shaft_odd",
    Path::Shaft,
    "shaft torque -k sgn(Om) |Om/Om0|^p",
    free_shaft,
    shaft,
    |s| exponents(shaft(s)),
    |v, _| { boxed(v, |v, at, b| b.shaft_torque_n_m -= v.size * odd(at.shaft_speed_rad_s, v)) }
);
term!(
    SHAFT_EVEN,
    "term_shaft_even",
    Path::Shaft,
    "shaft torque -k |Om/Om0|^p",
    free_shaft,
    shaft,
    |s| exponents(shaft(s)),
    |v, _| { boxed(v, |v, at, b| b.shaft_torque_n_m -= v.size * even(at.shaft_speed_rad_s, v)) }
);
term!(
    SHAFT_FLOW,
    "term_shaft_flow",
    Path::Shaft,
    "shaft torque -k sgn(Om) |Om/Om0|^p |vp|",
    free_shaft,
    shaft,
    one_start,
    |v, _| { boxed(v, |v, at, b| b.shaft_torque_n_m -= v.size * odd_in_flow(at, v)) }
);
term!(
    SHAFT_STEP,
    "term_shaft_step",
    Path::Shaft,
    "shaft torque -k sgn(Om) where |Om| > p Om0",
    free_shaft,
    shaft_step,
    |s| thresholds(shaft_step(s)),
    |v, _| {
        boxed(v, |v, at, b| {
            let speed = at.shaft_speed_rad_s;
            b.shaft_torque_n_m -= v.size * sign(speed) * above(speed, v);
        })
    }
);
term!(
    SHAFT_SWITCHED,
    "term_shaft_switched",
    Path::Shaft,
    "shaft torque -k tanh(10 Om/Om0) from a time on",
    free_shaft,
    shaft_switch,
    |s| times(shaft_switch(s), s),
    |v, _| {
        boxed(v, |v, at, b| {
            b.shaft_torque_n_m -=
                v.size * switched(at.time_s, v) * (at.shaft_speed_rad_s * 10.0 / v.reference).tanh();
        })
    }
);
term!(
    DRIVE_ODD,
    "term_drive_odd",
    Path::Drive,
    "command + k sgn(u) |u/u0|^p",
    commanded,
    command,
    |s| exponents(command(s)),
    |v, _| { Box::new(DriveTerm { values: values(v), act: |v, _, u| v.size * odd(u, v) }) }
);
term!(
    DRIVE_SWITCHED,
    "term_drive_switched",
    Path::Drive,
    "command (1 + k) from a time on",
    commanded,
    drive_switch,
    |s| times(drive_switch(s), s),
    |v, _| {
        Box::new(DriveTerm { values: values(v), act: |v, tick, u| v.size * u * switched(tick.time_s, v) })
    }
);
term!(
    BLADE_THRUST_ODD,
    "term_blade_thrust_odd",
    Path::Blade,
    "thrust + k sgn(Om) |Om/Om0|^p",
    wet,
    blade_thrust,
    |s| exponents(blade_thrust(s)),
    |v, _| { boxed(v, |v, at, b| b.thrust_n += v.size * odd(at.shaft_speed_rad_s, v)) }
);
term!(
    BLADE_THRUST_EVEN,
    "term_blade_thrust_even",
    Path::Blade,
    "thrust + k |Om/Om0|^p",
    wet,
    blade_thrust,
    |s| exponents(blade_thrust(s)),
    |v, _| { boxed(v, |v, at, b| b.thrust_n += v.size * even(at.shaft_speed_rad_s, v)) }
);
term!(
    BLADE_THRUST_FLOW,
    "term_blade_thrust_flow",
    Path::Blade,
    "thrust + k sgn(Om) |Om/Om0|^p |vp|",
    wet,
    blade_thrust,
    one_start,
    |v, _| { boxed(v, |v, at, b| b.thrust_n += v.size * odd_in_flow(at, v)) }
);
term!(
    BLADE_THRUST_STEP,
    "term_blade_thrust_step",
    Path::Blade,
    "thrust + k sgn(Om) where |vp| > p v0",
    wet,
    blade_thrust_step,
    |s| thresholds(blade_thrust_step(s)),
    |v, _| {
        boxed(v, |v, at, b| b.thrust_n += v.size * sign(at.shaft_speed_rad_s) * above(at.axial_m_s, v))
    }
);
term!(
    BLADE_TORQUE_ODD,
    "term_blade_torque_odd",
    Path::Blade,
    "blade torque + k sgn(Om) |Om/Om0|^p",
    torque_measured,
    blade_torque,
    |s| exponents(blade_torque(s)),
    |v, _| { boxed(v, |v, at, b| b.blade_torque_n_m += v.size * odd(at.shaft_speed_rad_s, v)) }
);
term!(
    FLOW_ODD,
    "term_flow_odd",
    Path::Flow,
    "force on the axial flow -k sgn(vp) |vp/v0|^p",
    wet,
    flow,
    |s| exponents(flow(s)),
    |v, _| { boxed(v, |v, at, b| b.momentum_n -= v.size * odd(at.axial_m_s, v)) }
);
term!(
    FLOW_EVEN,
    "term_flow_even",
    Path::Flow,
    "force on the axial flow -k |vp/v0|^p",
    wet,
    flow,
    |s| exponents(flow(s)),
    |v, _| { boxed(v, |v, at, b| b.momentum_n -= v.size * even(at.axial_m_s, v)) }
);
term!(
    FLOW_SWITCHED,
    "term_flow_switched",
    Path::Flow,
    "ambient flow + k from a time on",
    wet,
    flow_switch,
    |s| times(flow_switch(s), s),
    |v, _| { boxed(v, |v, at, b| b.ambient_m_s += v.size * switched(at.time_s, v)) }
);
term!(
    SENSOR_THRUST,
    "term_sensor_thrust",
    Path::Sensor,
    "thrust reading + k sgn(T) |T/T0|^p",
    thrust_measured,
    thrust_reading,
    |s| exponents(thrust_reading(s)),
    |v, _| { Box::new(ThrustTerm { values: values(v), act: |v, _, t| v.size * odd(t, v) }) }
);
term!(
    SENSOR_THRUST_SWITCHED,
    "term_sensor_thrust_switched",
    Path::Sensor,
    "thrust reading + k from a time on",
    thrust_measured,
    thrust_switch,
    |s| times(thrust_switch(s), s),
    |v, _| {
        Box::new(ThrustTerm { values: values(v), act: |v, tick, _| v.size * switched(tick.time_s, v) })
    }
);

/// Thrust is measured.
pub fn thrust_measured(
    _: &kort_thruster::rig::Rig,
    available: &kort_thruster::effects::Available,
) -> Result<(), &'static str> {
    if available.has("thrust_n") { Ok(()) } else { Err("thrust is not recorded") }
}

/// Without a torque transducer what the blades ask of the shaft cannot be told from any other load on it.
fn torque_measured(
    rig: &kort_thruster::rig::Rig,
    available: &kort_thruster::effects::Available,
) -> Result<(), &'static str> {
    wet(rig, available)?;
    if available.has("torque_n_m") { Ok(()) } else { Err("torque is not recorded") }
}

/// A command drives the model.
pub fn commanded(
    _: &kort_thruster::rig::Rig,
    available: &kort_thruster::effects::Available,
) -> Result<(), &'static str> {
    if available.current_prescribed || available.shaft_prescribed {
        Err("a recorded response drives the model")
    } else {
        Ok(())
    }
}
