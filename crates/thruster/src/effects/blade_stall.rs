//! Flow separates from the blade at a large angle of attack.

use super::{Descriptor, Effect, Hooks, Path, Scale, Spec, wet};
use crate::parameters::Parameter as P;
use crate::plant::{Balance, Foil, Local};
use crate::real::Real;

/// Width of the onset, rad.
const WIDTH_RAD: f64 = 0.03;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "blade_stall",
    path: Path::Blade,
    what: "flow separates from the blades above an angle of attack and lift collapses, with a lag of some chords",
    equation: "CL (1 - k e), n r e' = V [s((|a| - as)/0.03) - e], s logistic; k [1], as [rad], n [radii]",
    signature: "thrust falls short at the onset of large steps and in crash reversals; steady bollard pull is clean unless \
                its angle of attack lies above the stall",
    confused_with: &["nonsinusoidal_lift_drag", "ventilation", "unsteady_lift_lag"],
    separated_by: "reversals at several rates, which sweep the angle of attack",
    reference: "Leishman 2006, Principles of Helicopter Aerodynamics (dynamic stall); kort's form",
    commonness: 0.3,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[],
    parameters,
    starts: |_| vec![vec![0.1, 0.17, 1.0], vec![0.1, 0.28, 1.0], vec![0.1, 0.35, 1.0], vec![0.1, 0.28, 4.0]],
    needs: wet,
    build: both!(|values, context| {
        Box::new(BladeStall {
            loss: values[0],
            stall_rad: values[1],
            lag_m: values[2] * context.parameters.get(P::RadiusM),
            tick_s: context.tick_s,
        })
    }),
};

fn parameters(_: &Scale) -> Vec<Spec> {
    vec![
        Spec::strength("lift_loss", "1", 0.1, 0.0, 0.9).sigma(0.3),
        Spec::shape("stall_angle_rad", "rad", 0.22, 0.08, 0.8).prior(0.28, 0.08),
        Spec::shape("lag_radii", "1", 1.0, 0.1, 10.0).sigma(2.0),
    ]
}

struct BladeStall<T> {
    loss: T,
    stall_rad: T,
    lag_m: T,
    tick_s: f64,
}

impl<T: Real> Effect<T> for BladeStall<T> {
    fn states(&self) -> usize {
        1
    }

    fn hooks(&self) -> Hooks {
        Hooks { foil: true, balance: true, ..Hooks::NONE }
    }

    fn foil(&self, _: &Local<T>, own: &[T], foil: &mut Foil<T>) {
        foil.lift *= T::ONE - self.loss * own[0];
    }

    /// The lag is never shorter than a tick, which the integrator could not follow.
    fn balance(&self, _: &Local<T>, own: &[T], balance: &mut Balance<T>, rates: &mut [T]) {
        let past = (balance.foil.attack_rad().abs() - self.stall_rad) / WIDTH_RAD;
        let speed = balance.foil.speed_m_s;
        rates[0] = speed / (self.lag_m + speed * self.tick_s) * (past.logistic() - own[0]);
    }
}
