//! Play between motor gear and propeller shaft.

use super::{Context, Descriptor, Effect, Hooks, Path, Scale, Spec, geared};
use crate::parameters::Parameter as P;
use crate::plant::{Balance, Drive, Local, Sensed, Tick};
use crate::real::Real;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "gear_backlash",
    path: Path::Drive,
    what: "play in the gear: when torque reverses the motor crosses the gap alone, then strikes the other flank",
    equation: "in the gap: f I w' = kt im, x' = w, no torque on the propeller; at x = b the motor's momentum f I w passes \
               to the shaft; b [rad], f motor's share of the inertia [1]",
    signature: "lost motion, then a blow, at each reversal of torque; a limit cycle about zero under a speed loop",
    confused_with: &["coulomb_friction", "transport_delay", "command_dead_band"],
    separated_by: "an encoder on the load side; slow reversals of torque",
    reference: "Nordin & Gutman 2002 (Automatica 38:1633); inelastic contact in place of a stiff tooth spring",
    commonness: 0.7,
    shifts_time: false,
    nonparametric: false,
    forms: &[],
    parameters,
    starts: |_| [0.003, 0.03, 0.1, 0.25].iter().map(|play| vec![*play, 0.4]).collect(),
    needs: geared,
    build: both!(build),
};

fn parameters(_: &Scale) -> Vec<Spec> {
    vec![
        Spec::strength("backlash_rad", "rad", 0.01, 0.0, 0.5).sigma(0.03),
        Spec::shape("motor_inertia_share", "1", 0.4, 0.05, 0.95).sigma(0.25),
    ]
}

fn build<T: Real>(values: &[T], context: &Context<T>) -> Box<dyn Effect<T>> {
    Box::new(GearBacklash {
        gap_rad: values[0],
        motor_inertia_kg_m2: values[1] * context.parameters.get(P::InertiaKgM2),
        torque_constant_nm_a: context.parameters.get(P::TorqueConstantNmA),
        tick_s: context.tick_s,
        side: 0.0,
        crossed_rad: T::ZERO,
        relative_rad_s: T::ZERO,
        blow_n_m: T::ZERO,
        later_n_m: T::ZERO,
        passed: T::ONE,
    })
}

struct GearBacklash<T> {
    gap_rad: T,
    motor_inertia_kg_m2: T,
    torque_constant_nm_a: T,
    tick_s: f64,
    /// Flank in contact: the sign of the torque it carries; 0 before the first torque.
    side: f64,
    crossed_rad: T,
    relative_rad_s: T,
    /// Torque of the blow in this tick and what is left of it for the next.
    blow_n_m: T,
    later_n_m: T,
    /// Share of motor torque that reaches the propeller in this tick.
    passed: T,
}

impl<T: Real> Effect<T> for GearBacklash<T> {
    fn hooks(&self) -> Hooks {
        Hooks { drive: true, balance: true, sense: true, ..Hooks::NONE }
    }

    fn drive(&mut self, _: &Tick, drive: &mut Drive<T>) {
        // The back-EMF is of the motor's own speed.
        drive.back_emf_v -= self.torque_constant_nm_a * self.relative_rad_s * self.side;
        let (dt, torque) = (self.tick_s, self.torque_constant_nm_a * drive.current_a);
        (self.blow_n_m, self.later_n_m, self.passed) = (self.later_n_m, T::ZERO, T::ONE);
        if self.side == 0.0 {
            self.side = if torque.re() == 0.0 { 0.0 } else { torque.re().signum() };
        }
        let in_gap = self.crossed_rad > 0.0 || torque * self.side < 0.0;
        if !in_gap {
            return;
        }
        // Counted positive away from the flank that was in contact.
        let push = -torque * self.side / self.motor_inertia_kg_m2;
        let before = self.crossed_rad;
        let left_rad_s = self.relative_rad_s;
        let after = before + (left_rad_s + push * (0.5 * dt)) * dt;
        self.relative_rad_s = left_rad_s + push * dt;
        self.passed = T::ZERO;
        if after >= self.gap_rad {
            // Strikes a part of the way through the tick: that part of the blow falls into the next.
            let part = (self.gap_rad - before) / (after - before);
            let speed_rad_s = left_rad_s + part * dt * push;
            self.side = -self.side;
            let blow = self.motor_inertia_kg_m2 * self.side * speed_rad_s / dt;
            self.blow_n_m += blow * (T::ONE - part);
            self.later_n_m = blow * part;
            self.passed = T::ONE - part;
            (self.crossed_rad, self.relative_rad_s) = (T::ZERO, T::ZERO);
        } else if after <= 0.0 {
            (self.crossed_rad, self.relative_rad_s) = (T::ZERO, T::ZERO);
        } else {
            self.crossed_rad = after;
        }
    }

    fn balance(&self, _: &Local<T>, _: &[T], balance: &mut Balance<T>, _: &mut [T]) {
        balance.motor_torque_n_m = balance.motor_torque_n_m * self.passed + self.blow_n_m;
    }

    /// The encoder sits on the motor.
    fn sense(&mut self, _: &Tick, sensed: &mut Sensed<T>) {
        sensed.shaft_speed_rad_s -= self.relative_rad_s * self.side;
        // Nothing on the flank that carries ahead, all of the play on the other.
        let behind = if self.side < 0.0 { self.gap_rad - self.crossed_rad } else { self.crossed_rad };
        sensed.shaft_angle_rad -= behind;
    }
}
