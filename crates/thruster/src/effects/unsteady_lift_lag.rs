//! Lift builds up over some chords of travel (Wagner).

use super::{Context, Descriptor, Effect, Hooks, Path, Scale, Spec, wet};
use crate::parameters::Parameter as P;
use crate::plant::{Balance, Foil, Local};
use crate::real::Real;

/// Wagner's function: phi(s) = 1 - sum A exp(-b s), s in half chords.
const WAGNER: [(f64, f64); 2] = [(0.165, 0.0455), (0.335, 0.3)];

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "unsteady_lift_lag",
    path: Path::Blade,
    what: "circulation, and with it lift, builds up only as the blade travels some chords (Wagner's function)",
    equation: "CL = w - g sum Ai (w - yi), yi' = bi (2V/c)(w - yi), w the quasi-steady CL; A 0.165, 0.335, \
               b 0.0455, 0.3; c [radii], g = 1 a flat plate",
    signature: "thrust and torque lag fast changes by a time that shrinks with speed; the gain of thrust at high frequency is low",
    confused_with: &["thrust_sensor_lag", "inertia_added_mass_error", "rotational_flow", "blade_stall"],
    separated_by: "a chirp at two mean speeds (a sensor's lag stays the same in seconds)",
    reference: "Wagner 1925; R. T. Jones 1940 (NACA TR 681)",
    commonness: 0.5,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[&[0], &[0, 1]],
    parameters,
    starts: |_| vec![vec![0.5, 0.2], vec![0.5, 1.5]],
    needs: wet,
    build: both!(build),
};

fn parameters(_: &Scale) -> Vec<Spec> {
    vec![
        Spec::strength("wagner_share", "1", 0.5, 0.0, 1.9).sigma(0.7),
        Spec::shape("chord_radii", "1", 0.5, 0.05, 5.0).sigma(0.4),
    ]
}

fn build<T: Real>(values: &[T], context: &Context<T>) -> Box<dyn Effect<T>> {
    let p = context.parameters;
    Box::new(UnsteadyLift {
        share: values[0],
        per_m: (values[1] * p.get(P::RadiusM)).recip() * 2.0,
        lift_max: p.get(P::LiftMax),
        tick_s: context.tick_s,
    })
}

struct UnsteadyLift<T> {
    share: T,
    per_m: T,
    lift_max: T,
    tick_s: f64,
}

/// Which end of the chord leads, going over smoothly where the flow turns round: circulation
/// keeps its sense when the lift coefficient's axes turn over.
fn leading<T: Real>(foil: &Foil<T>) -> T {
    (foil.chordwise_m_s * 8.0 / foil.speed_m_s).tanh()
}

impl<T: Real> Effect<T> for UnsteadyLift<T> {
    fn states(&self) -> usize {
        WAGNER.len()
    }

    fn hooks(&self) -> Hooks {
        Hooks { foil: true, balance: true, ..Hooks::NONE }
    }

    fn foil(&self, _: &Local<T>, own: &[T], foil: &mut Foil<T>) {
        let side = leading(foil);
        let now = side * self.lift_max * foil.sin_2a;
        let missing: T = WAGNER.iter().zip(own).map(|((a, _), y)| (now - *y) * *a).sum();
        foil.lift -= self.share * side * missing;
    }

    /// No lag is shorter than a tick, which the integrator could not follow.
    fn balance(&self, _: &Local<T>, own: &[T], balance: &mut Balance<T>, rates: &mut [T]) {
        let foil = &balance.foil;
        if foil.speed_m_s == 0.0 {
            return;
        }
        let now = leading(foil) * self.lift_max * foil.sin_2a;
        for (i, (_, b)) in WAGNER.iter().enumerate() {
            let rate = self.per_m * *b * foil.speed_m_s;
            rates[i] = rate / (rate * self.tick_s + 1.0) * (now - own[i]);
        }
    }
}
