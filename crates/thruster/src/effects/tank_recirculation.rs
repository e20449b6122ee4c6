//! In a tank the jet comes back to the inlet.

use super::{Descriptor, Effect, Hooks, Path, Scale, Spec};
use crate::plant::{Balance, Local};
use crate::real::Real;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "tank_recirculation",
    path: Path::Flow,
    what: "in a tank the jet returns to the inlet after a while, and the water is no longer still",
    equation: "tr va' = kr vp - va, added to the ambient flow; kr [1], tr [s]",
    signature: "thrust at a given speed falls over seconds to minutes after a step; a restart from still water differs \
                from one in stirred water",
    confused_with: &["ambient_axial_flow", "ambient_flow_unsteady", "thermal_drift_kt"],
    separated_by: "long holds, with waits for still water between; thermal drift leaves thrust over speed squared alone",
    reference: "equation (6a), from (4); the first-order return is kort's form",
    commonness: 0.7,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[],
    parameters,
    starts: |_| vec![vec![0.05, 2.0], vec![0.05, 4.0], vec![0.05, 20.0], vec![0.05, 50.0]],
    needs: super::ambient_axial_flow::needs,
    build: both!(|values, _| Box::new(TankRecirculation { share: values[0], return_s: values[1] })),
};

fn parameters(_: &Scale) -> Vec<Spec> {
    vec![
        Spec::strength("returned_share", "1", 0.05, 0.0, 0.8).sigma(0.1),
        Spec::shape("return_time_s", "s", 10.0, 0.5, 300.0).sigma(20.0),
    ]
}

struct TankRecirculation<T> {
    share: T,
    return_s: T,
}

impl<T: Real> Effect<T> for TankRecirculation<T> {
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
        balance.ambient_m_s += own[0];
        rates[0] = (self.share * at.axial_m_s - own[0]) / self.return_s;
    }
}
