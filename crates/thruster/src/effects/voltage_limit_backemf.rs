//! The supply can no longer push the current against the back-EMF.

use super::{Available, Descriptor, Effect, Hooks, Path, Scale, Spec, commanded};
use crate::plant::{Drive, Tick};
use crate::real::Real;
use crate::rig::Rig;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "voltage_limit_backemf",
    path: Path::Drive,
    what: "back-EMF and winding resistance use up the voltage the drive can give, so current falls off at high speed",
    equation: "|R f im + ke Om| <= (1 - c) Vbus; ke = kt [V s], R [ohm], f, c [1]",
    signature: "shaft speed is capped near its top and current droops linearly with speed; the cap moves with the \
                supply; thrust over speed squared is unchanged",
    confused_with: &["current_saturation", "supply_sag", "cavitation", "viscous_friction"],
    separated_by: "the supply voltage varied; steps of rising size",
    reference: "Healey et al. 1995 (IEEE JOE 20:354), equations (10)-(12)",
    parameters,
    starts,
    needs,
    build: both!(|values, _| Box::new(VoltageLimit { lost_share: values[0], resistance_factor: values[1] })),
};

/// Back-EMF at the largest speed as a share of the supply; bounded, since both are only stated.
pub(super) fn emf_share(scale: &Scale) -> f64 {
    let torque_constant_nm_a = scale.torque_n_m / scale.current_a;
    (torque_constant_nm_a * scale.shaft_speed_rad_s / scale.supply_v.max(1e-3)).clamp(0.1, 0.9)
}

/// The start lets the limit bind just below the top of the recording.
fn parameters(scale: &Scale) -> Vec<Spec> {
    vec![
        Spec::strength(
            "lost_voltage_share",
            "1",
            (1.0 - 1.2 * emf_share(scale)).clamp(-0.2, 0.9),
            -0.3,
            0.95,
        ),
        // Warm copper: a winding is seldom further from what is stated.
        Spec::shape("resistance_factor", "1", 1.0, 0.75, 1.4),
    ]
}

/// A limit a little too low is far off and one a little too high does nothing: close steps.
fn starts(scale: &Scale) -> Vec<Vec<f64>> {
    [0.88, 0.94, 1.0, 1.03, 1.06, 1.09, 1.12, 1.15, 1.18, 1.22, 1.26, 1.3, 1.35, 1.4, 1.5, 1.7]
        .iter()
        .map(|k| vec![(1.0 - k * emf_share(scale)).clamp(-0.2, 0.9), 1.0])
        .collect()
}

fn needs(rig: &Rig, available: &Available) -> Result<(), &'static str> {
    supply_known(rig, available)?;
    if super::supply_sag::recorded(available) {
        Err("the recorded supply falls under load and brings the limit with it: supply_sag stands for both")
    } else {
        Ok(())
    }
}

/// Needs a command, and a supply and a winding to set against each other.
pub(super) fn supply_known(rig: &Rig, available: &Available) -> Result<(), &'static str> {
    commanded(rig, available)?;
    if rig.amplifier.supply_v.is_none() {
        Err("the rig states no supply voltage")
    } else if rig.motor.winding_resistance_ohm.is_none() {
        Err("the rig states no winding resistance, so the back-EMF cannot be set against the supply")
    } else {
        Ok(())
    }
}

struct VoltageLimit<T> {
    lost_share: T,
    resistance_factor: T,
}

impl<T: Real> Effect<T> for VoltageLimit<T> {
    fn hooks(&self) -> Hooks {
        Hooks::DRIVE
    }

    fn drive(&mut self, _: &Tick, drive: &mut Drive<T>) {
        drive.voltage_limited = true;
        drive.supply_v *= T::ONE - self.lost_share;
        drive.resistance_ohm *= self.resistance_factor;
    }
}
