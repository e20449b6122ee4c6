//! Play between motor gear and propeller shaft.

use super::{Context, Descriptor, Effect, Hooks, Path, Scale, Spec, geared};
use crate::blade::{Inflow, REFERENCE_RADIUS};
use crate::parameters::Parameter as P;
use crate::plant::{Balance, Drive, Local, Sensed, Tick};
use crate::real::Real;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "gear_backlash",
    path: Path::Drive,
    what: "play in the gear: when torque reverses the motor crosses the gap alone, then strikes the other flank",
    equation: "torque between the flanks, by I: c = (1 - f) Om' - tl/I; where it turns round they part: x'' = c/(f (1 - f)) until x \
               has crossed b, where the blow stops it; motor Om + (1 - f) x', load Om - f x'; b [rad], f motor's share of the \
               inertia I [1], tl load's torque [N m]",
    signature: "lost motion, then a blow, at each reversal of torque; a limit cycle about zero under a speed loop",
    confused_with: &["coulomb_friction", "transport_delay", "command_dead_band"],
    separated_by: "an encoder on the load side; slow reversals of torque",
    reference: "Nordin & Gutman 2002 (Automatica 38:1633); inelastic contact in place of a stiff tooth spring, dry friction on \
                the motor's side",
    commonness: 0.7,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    forms: &[],
    parameters,
    starts: |_| [0.003, 0.02, 0.3, 0.9].iter().map(|play| vec![*play, 0.4]).collect(),
    needs: geared,
    build: both!(build),
};

/// Play of a degree or two at a gear's output is tens of degrees at a motor that turns many times as often; which of
/// the two sides a rig's numbers belong to is the owner's choice. A load much lighter than a fifth of the whole, free for
/// more than a radian, would be stopped by the water within a tick, which steps of a tick do not follow.
fn parameters(_: &Scale) -> Vec<Spec> {
    vec![
        Spec::strength("backlash_rad", "rad", 0.1, 0.0, 1.0).sigma(0.15),
        Spec::shape("motor_inertia_share", "1", 0.4, 0.1, 0.8).sigma(0.2),
    ]
}

fn build<T: Real>(values: &[T], context: &Context<T>) -> Box<dyn Effect<T>> {
    Box::new(GearBacklash {
        gap_rad: values[0],
        motor_share: values[1],
        lever_m: context.parameters.get(P::RadiusM) * REFERENCE_RADIUS,
        torque_constant_nm_a: context.parameters.get(P::TorqueConstantNmA),
        tick_s: context.tick_s,
        before: None,
        side: 0.0,
        apart_rad: T::ZERO,
        relative_rad_s: T::ZERO,
        shown_rad_s: T::ZERO,
        turned_rad: T::ZERO,
    })
}

/// The shaft's state is the speed of motor and load together, which a blow between them does not change. Here is
/// how the motor moves against the load.
struct GearBacklash<T> {
    gap_rad: T,
    motor_share: T,
    lever_m: T,
    torque_constant_nm_a: T,
    tick_s: f64,
    /// Shaft speed and own state at the end of the last tick.
    before: Option<(T, T)>,
    /// Flank in contact, or the one that was left: the sign of the torque it carries; 0 before the first torque.
    side: f64,
    /// Way from that flank.
    apart_rad: T,
    /// Speed of the motor against the load, ahead positive.
    relative_rad_s: T,
    /// Its mean over the last tick: within a tick of a blow this says when it fell.
    shown_rad_s: T,
    /// Angle of the motor against the load since the start.
    turned_rad: T,
}

impl<T: Real> GearBacklash<T> {
    /// Moves on by a tick in which the free flanks would drift apart at this acceleration, rad/s^2.
    fn advance(&mut self, acceleration: T) {
        if self.side == 0.0 {
            self.side = if acceleration.re() == 0.0 { 0.0 } else { acceleration.re().signum() };
        }
        let dt = self.tick_s;
        self.shown_rad_s = T::ZERO;
        let pressed = acceleration * self.side >= 0.0;
        if self.apart_rad <= 0.0 && pressed {
            return;
        }
        let was = self.apart_rad;
        let away = -self.relative_rad_s * self.side - acceleration * (0.5 * dt * self.side);
        let now = was + away * dt;
        let arrived = if now >= self.gap_rad { Some(self.gap_rad) } else { None };
        let arrived = arrived.or(if now <= 0.0 { Some(T::ZERO) } else { None });
        self.apart_rad = arrived.unwrap_or(now);
        self.relative_rad_s =
            if arrived.is_some() { T::ZERO } else { self.relative_rad_s + acceleration * dt };
        let moved = (self.apart_rad - was) * -self.side;
        self.shown_rad_s = moved / dt;
        self.turned_rad += moved;
        if now >= self.gap_rad {
            self.side = -self.side;
            self.apart_rad = T::ZERO;
        }
    }
}

impl<T: Real> Effect<T> for GearBacklash<T> {
    /// The load's own torque over the whole inertia, summed over time, rad/s.
    fn states(&self) -> usize {
        1
    }

    fn hooks(&self) -> Hooks {
        Hooks { drive: true, inflow: true, balance: true, sense: true, ..Hooks::NONE }
    }

    /// The back-EMF is of the motor's own speed.
    fn drive(&mut self, _: &Tick, drive: &mut Drive<T>) {
        drive.back_emf_v += self.torque_constant_nm_a * (T::ONE - self.motor_share) * self.relative_rad_s;
    }

    /// The blades turn with the load.
    fn inflow(&self, _: &Local<T>, _: &[T], inflow: &mut Inflow<T>) {
        inflow.tangential_m_s += self.lever_m * self.motor_share * self.relative_rad_s;
    }

    fn balance(&self, _: &Local<T>, _: &[T], balance: &mut Balance<T>, rates: &mut [T]) {
        rates[0] = (balance.load_torque_n_m - balance.blade_torque_n_m) / balance.inertia_kg_m2;
    }

    fn arrive(&mut self, at: &Local<T>, own: &[T]) {
        let now = (at.shaft_speed_rad_s, own[0]);
        let Some((speed, sum)) = self.before.replace(now) else { return };
        let load_share = T::ONE - self.motor_share;
        let between = load_share * (now.0 - speed) - (now.1 - sum);
        self.advance(between / (self.motor_share * load_share * self.tick_s));
    }

    /// The encoder sits on the motor.
    fn sense(&mut self, _: &Tick, sensed: &mut Sensed<T>) {
        sensed.shaft_speed_rad_s += (T::ONE - self.motor_share) * self.shown_rad_s;
        sensed.shaft_angle_rad += (T::ONE - self.motor_share) * self.turned_rad;
    }
}
