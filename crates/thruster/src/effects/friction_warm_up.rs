//! Friction falls as grease and seals warm.

use super::{Descriptor, Effect, Hooks, Path, Scale, Spec, free_shaft};
use crate::plant::{Balance, Local};
use crate::real::Real;

/// Shaft speed that warms half as fast as a high one, rad/s.
const TURNING_RAD_S: f64 = 0.5;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "friction_warm_up",
    path: Path::Shaft,
    what: "cold grease and stiff seals rub more; as the unit turns they warm and the extra friction fades, so that the same \
           command gives another speed in the next run",
    equation: "I Om' = ... - (tc + kf |Om|) w sgn(Om), tw w' = -w |Om|/(|Om| + 0.5 rad/s), w = 1 at the start of a recording; tc \
               [N m], kf [N m s], tw [s]",
    signature: "shaft speed creeps up over minutes at the same command, and stays up; thrust over speed squared is unchanged; \
                the first run after a rest differs from the next",
    confused_with: &["thermal_drift_kt", "viscous_friction", "coulomb_friction", "supply_sag"],
    separated_by: "a long hold, cold and warm repeats of one run; a motor that warms loses speed instead",
    reference: "Harris & Kotzalas 2006, Essential Concepts of Bearing Technology; one thermal mass, kort's form; measured 10 to \
                15 % between repeats",
    commonness: 1.0,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[&[0, 2], &[1, 2], &[0, 1, 2]],
    parameters,
    starts: |scale| {
        let (torque, viscous) = (0.04 * scale.torque_n_m, 0.04 * scale.torque_n_m / scale.shaft_speed_rad_s);
        [0.1, 0.5, 2.0]
            .iter()
            .map(|k| vec![torque, viscous, (k * scale.duration_s).clamp(2.0, 900.0)])
            .collect()
    },
    needs: free_shaft,
    build: both!(|values, _| {
        Box::new(FrictionWarmUp { dry_n_m: values[0], viscous_nm_s: values[1], warming_s: values[2] })
    }),
};

fn parameters(scale: &Scale) -> Vec<Spec> {
    let torque = scale.torque_n_m;
    let viscous = torque / scale.shaft_speed_rad_s;
    let time = (0.5 * scale.duration_s).clamp(2.0, 300.0);
    vec![
        Spec::strength("cold_dry_n_m", "N m", 0.03 * torque, 0.0, torque).sigma(0.05 * torque),
        Spec::strength("cold_viscous_nm_s", "N m s", 0.03 * viscous, 0.0, viscous).sigma(0.05 * viscous),
        Spec::shape("warming_time_s", "s", time, 1.0, 1000.0).sigma(time),
    ]
}

struct FrictionWarmUp<T> {
    dry_n_m: T,
    viscous_nm_s: T,
    warming_s: T,
}

/// The state is what has warmed, `1 - w`, so that a plant set up at rest starts cold.
impl<T: Real> Effect<T> for FrictionWarmUp<T> {
    fn states(&self) -> usize {
        1
    }

    fn slow(&self) -> bool {
        true
    }

    fn hooks(&self) -> Hooks {
        Hooks::BALANCE
    }

    fn balance(&self, at: &Local<T>, own: &[T], balance: &mut Balance<T>, rates: &mut [T]) {
        let (speed, cold) = (at.shaft_speed_rad_s, T::ONE - own[0]);
        balance.rub(self.dry_n_m * cold, self.dry_n_m * cold);
        balance.shaft_torque_n_m -= self.viscous_nm_s * cold * speed;
        let turning = speed.abs();
        rates[0] = cold * turning / ((turning + TURNING_RAD_S) * self.warming_s);
    }
}
