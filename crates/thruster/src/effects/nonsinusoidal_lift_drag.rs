//! Lift and drag are not plain sinusoids of the angle of attack.

use super::{Descriptor, Effect, Hooks, Path, Scale, Spec, one_start, wet};
use crate::plant::{Foil, Local};
use crate::real::Real;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "nonsinusoidal_lift_drag",
    path: Path::Blade,
    what: "lift and drag against angle of attack have a profile drag and higher harmonics beyond the model's sinusoids",
    equation: "CD = cd0 + CDmax (1 - cos 2a) + c4 (1 - cos 4a); CL = CLmax sin 2a + b4 sin 4a; all [1]",
    signature: "nothing in steady bollard pull after a refit (one angle of attack); thrust overshoots after a torque step \
                and is off at other advance",
    confused_with: &["rotational_flow", "blade_stall", "inertia_added_mass_error", "windage_drag"],
    separated_by: "steps of shaft speed, towed runs: whatever sweeps the angle of attack",
    reference: "Bachmayer, Whitcomb, Grosenbaugh 2000 (IEEE JOE 25:146); the harmonics are kort's form",
    commonness: 1.0,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[&[0], &[1], &[2], &[0, 1], &[0, 2], &[1, 2], &[0, 1, 2]],
    parameters,
    starts: one_start,
    needs: wet,
    build: both!(|values, _| Box::new(NonsinusoidalLiftDrag {
        profile_drag: values[0],
        drag_4: values[1],
        lift_4: values[2]
    })),
};

/// Bounded where the blade would begin to pull energy out of still water.
fn parameters(_: &Scale) -> Vec<Spec> {
    vec![
        Spec::strength("profile_drag", "1", 0.01, -0.02, 0.5).sigma(0.04),
        Spec::strength("drag_harmonic", "1", 0.02, -0.25, 1.0).sigma(0.06),
        Spec::strength("lift_harmonic", "1", 0.01, -0.25, 1.0).sigma(0.05),
    ]
}

struct NonsinusoidalLiftDrag<T> {
    profile_drag: T,
    drag_4: T,
    lift_4: T,
}

impl<T: Real> Effect<T> for NonsinusoidalLiftDrag<T> {
    fn hooks(&self) -> Hooks {
        Hooks::FOIL
    }

    /// sin 4a = 2 sin 2a cos 2a; 1 - cos 4a = 2 sin^2 2a.
    fn foil(&self, _: &Local<T>, _: &[T], foil: &mut Foil<T>) {
        let (sin, cos) = (foil.sin_2a, T::ONE - foil.one_minus_cos_2a);
        foil.drag += self.profile_drag + self.drag_4 * 2.0 * sin * sin;
        foil.lift += self.lift_4 * 2.0 * sin * cos;
    }
}
