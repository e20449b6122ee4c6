//! A belt, a long shaft or a magnetic coupling between motor and load.

use super::memory::EncoderAhead;
use super::{Context, Descriptor, Effect, Hooks, Path, Scale, Sensing, Spec, free_shaft};
use crate::blade::{Inflow, REFERENCE_RADIUS};
use crate::parameters::Parameter as P;
use crate::plant::{Balance, Drive, Local, Sensed, Tick};
use crate::real::Real;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "flexible_coupling",
    path: Path::Shaft,
    what: "a belt, a long shaft or a magnetic coupling twists between motor and load: two inertias on a spring",
    equation: "with d = q1 - q2 of motor and load: d'' + 2 z wn d' + wn^2 d = (tm - tf)/I1 - tl/I2, wn^2 = 1/(k Ir), I1 = (1 - s) I, \
               I2 = s I, Ir = s (1 - s) I; the encoder shows the motor's q1 or the load's q2, with which the blades turn; k [rad/(N m)], \
               s, z [1]",
    signature: "speed rings at a fixed frequency after steps of torque: at the motor resonance and antiresonance in its spectrum; at the \
                load, which rings the other way, it is late too",
    confused_with: &["stand_resonance", "gear_backlash", "amplifier_lag", "encoder_filter_lag"],
    separated_by: "a chirp at two amplitudes (play depends on amplitude, a spring does not); a tap on the load",
    reference: "Ellis & Lorenz 2000 (IEEE IAS, resonant load control); a measured belt drive: 3.2 Hz, damping 0.15",
    commonness: 0.7,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[],
    parameters,
    starts: |scale| {
        // A ring shows a fit the way only from near its frequency.
        let rings = (0..16).map(|k| compliance(scale, 1.2 * 1.25_f64.powi(k))).filter(|k| *k <= most(scale));
        rings.flat_map(|k| [0.0, 1.0].map(|at_load| vec![k, 0.5, 0.1, at_load])).collect()
    },
    needs: free_shaft,
    build: both!(|values, context| {
        Box::new(Coupling::new(
            values[0],
            values[1],
            values[2],
            values[3],
            context.parameters.get(P::InertiaKgM2),
            context,
        ))
    }),
};

/// Compliance of a coupling between two halves of the stated inertia that swing at `hz`.
fn compliance(scale: &Scale, hz: f64) -> f64 {
    1.0 / (0.25 * scale.inertia_kg_m2 * (std::f64::consts::TAU * hz).powi(2))
}

/// The softest coupling: it swings at 0.3 Hz, or twists by a turn under the drive's largest torque.
fn most(scale: &Scale) -> f64 {
    compliance(scale, 0.3).min(std::f64::consts::TAU / scale.torque_n_m)
}

fn parameters(scale: &Scale) -> Vec<Spec> {
    let most = most(scale);
    let within = |hz: f64| compliance(scale, hz).min(0.5 * most);
    vec![
        Spec::strength("compliance_rad_nm", "rad/(N m)", within(12.0), 0.0, most).sigma(within(5.0)),
        Spec::shape("load_inertia_share", "1", 0.5, 0.03, 0.97).sigma(0.25),
        Spec::shape("damping_ratio", "1", 0.1, 0.01, 1.0).sigma(0.15),
        Spec::held("encoder_at_load", "1", 0.0, 0.0, 1.0),
    ]
}

/// Twist between motor and load, in the two states twist and its rate; the shaft's state is the speed of both
/// together. It vanishes with the compliance, whatever the rest.
pub(crate) struct Coupling<T> {
    /// Square of the natural frequency, no higher than a tick can follow, 1/s^2.
    stiffness_1_s2: T,
    damping_1_s: T,
    /// Twist under a unit of accelerating difference, s^2.
    give_s2: T,
    share: T,
    /// How far the encoder turns ahead of both together, as a share of the twist: the load's share where it sits on the motor, less
    /// one where it sits on the load.
    encoder_share: T,
    lever_m: T,
    inertia_kg_m2: T,
    torque_constant_nm_a: T,
    twist_rad: T,
    relative_rad_s: T,
    encoder: EncoderAhead<T>,
}

/// The coupling of a rig's two masses ([`crate::rig::Load::TwoMass`]).
pub(crate) fn of_load<T: Real>(context: &Context<T>) -> Box<dyn Effect<T>> {
    let p = context.parameters;
    let (motor, load) = (p.get(P::InertiaKgM2), p.get(P::LoadInertiaKgM2));
    let (stiffness, both) = (p.get(P::LoadStiffnessNmRad), motor + load);
    // c = 2 z wn Ir with wn = sqrt(k/Ir).
    let damping = p.get(P::LoadDampingNmS) / ((stiffness * motor * load / both).sqrt() * 2.0);
    Box::new(Coupling::new(stiffness.recip(), load / both, damping, T::ZERO, both, context))
}

/// Largest angle of the swing that one tick may take, rad: what the integrator follows.
const SWING_A_TICK_RAD: f64 = 0.4;

impl<T: Real> Coupling<T> {
    /// From compliance, rad/(N m), the load's share of the inertia, the damping ratio, where the encoder sits (0 the motor, 1 the
    /// load) and the inertia of both.
    pub(crate) fn new(
        compliance: T,
        share: T,
        damping: T,
        encoder_at_load: T,
        inertia_kg_m2: T,
        context: &Context<T>,
    ) -> Self {
        let give_s2 = compliance * share * (T::ONE - share) * inertia_kg_m2;
        let most = (SWING_A_TICK_RAD / context.tick_s).powi(2);
        // 1/give where that can be followed, else the most; and a stiff coupling gives next to nothing.
        let stiffness_1_s2 = if give_s2 * most > 1.0 { give_s2.recip() } else { T::from(most) };
        Self {
            stiffness_1_s2,
            damping_1_s: damping * 2.0 * stiffness_1_s2.sqrt(),
            give_s2,
            share,
            encoder_share: share - encoder_at_load,
            lever_m: context.parameters.get(P::RadiusM) * REFERENCE_RADIUS,
            inertia_kg_m2,
            torque_constant_nm_a: context.parameters.get(P::TorqueConstantNmA),
            twist_rad: T::ZERO,
            relative_rad_s: T::ZERO,
            encoder: EncoderAhead::new(context),
        }
    }
}

impl<T: Real> Effect<T> for Coupling<T> {
    fn states(&self) -> usize {
        2
    }

    fn hooks(&self) -> Hooks {
        Hooks { drive: true, inflow: true, balance: true, sense: true, ..Hooks::NONE }
    }

    fn sensing(&self) -> Sensing {
        Sensing::Mounting
    }

    /// A coupling stiffer than a tick can follow lets the load move little by itself.
    fn lightest_share(&self) -> f64 {
        (self.share / (self.give_s2 * self.stiffness_1_s2)).re().min(1.0)
    }

    /// The back-EMF is of the motor's own speed.
    fn drive(&mut self, _: &Tick, drive: &mut Drive<T>) {
        drive.back_emf_v += self.torque_constant_nm_a * self.share * self.relative_rad_s;
    }

    /// The blades turn with the load.
    fn inflow(&self, _: &Local<T>, own: &[T], inflow: &mut Inflow<T>) {
        inflow.tangential_m_s -= self.lever_m * (T::ONE - self.share) * own[1];
    }

    fn balance(&self, _: &Local<T>, own: &[T], balance: &mut Balance<T>, rates: &mut [T]) {
        let motor = balance.motor_torque_n_m + balance.shaft_torque_n_m;
        let load = balance.load_torque_n_m - balance.blade_torque_n_m;
        let apart = (motor / (T::ONE - self.share) - load / self.share) / self.inertia_kg_m2;
        rates[0] = own[1];
        rates[1] = self.stiffness_1_s2 * (self.give_s2 * apart - own[0]) - self.damping_1_s * own[1];
    }

    fn arrive(&mut self, _: &Local<T>, own: &[T]) {
        (self.twist_rad, self.relative_rad_s) = (own[0], own[1]);
    }

    fn sense(&mut self, _: &Tick, sensed: &mut Sensed<T>) {
        let ahead_rad = self.encoder_share * self.twist_rad;
        sensed.shaft_speed_rad_s += self.encoder.step(ahead_rad, self.encoder_share * self.relative_rad_s);
        sensed.shaft_angle_rad += ahead_rad;
    }
}
