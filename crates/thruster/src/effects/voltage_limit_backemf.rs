//! The supply can no longer push the current against the back-EMF.

use super::{Available, Descriptor, Effect, Hooks, Path, Scale, Spec, commanded};
use crate::plant::{Drive, Tick};
use crate::real::Real;
use crate::rig::{AmplifierKind, Rig};

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "voltage_limit_backemf",
    path: Path::Drive,
    what: "back-EMF and winding resistance use up the voltage the drive can give, so current falls off at high speed",
    equation: "|R f im + ke Om| <= (1 - c) Vbus; ke = kt [V s], R [ohm], f, c [1]; Vbus [V] the rig's, or supply_taken_v where \
               it states none: what the largest speed and current of the recordings take",
    signature: "shaft speed is capped near its top and current droops linearly with speed; the cap moves with the \
                supply; thrust over speed squared is unchanged",
    confused_with: &["current_saturation", "supply_sag", "cavitation", "viscous_friction"],
    separated_by: "the supply voltage varied; steps of rising size",
    reference: "Healey et al. 1995 (IEEE JOE 20:354), equations (10)-(12)",
    commonness: 1.0,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[&[0], &[0, 1]],
    parameters,
    starts,
    needs,
    build: both!(|values, _| Box::new(VoltageLimit {
        lost_share: values[0],
        resistance_factor: values[1],
        supply_taken_v: values[2],
    })),
};

/// Back-EMF and resistive drop at the largest speed and current, V.
fn winding_v(scale: &Scale) -> f64 {
    let torque_constant_nm_a = scale.torque_n_m / scale.current_a;
    torque_constant_nm_a * scale.shaft_speed_rad_s + scale.winding_resistance_ohm * scale.current_a
}

/// The same as a share of the supply: about where the limit lies if it binds at all. Bounded, since speed and current need
/// not be largest together. A supply that is not stated is taken for just that.
pub(super) fn winding_share(scale: &Scale) -> f64 {
    if scale.supply_v > 0.0 { (winding_v(scale) / scale.supply_v.max(1e-3)).clamp(0.1, 1.25) } else { 1.0 }
}

/// The supply that stands for one that is not stated, V; nothing where one is.
fn supply_taken_v(scale: &Scale) -> f64 {
    if scale.supply_v > 0.0 { 0.0 } else { winding_v(scale) }
}

/// The start lets the limit bind just below the top of the recording.
fn parameters(scale: &Scale) -> Vec<Spec> {
    vec![
        Spec::strength(
            "lost_voltage_share",
            "1",
            (1.0 - 0.85 * winding_share(scale)).clamp(-0.25, 0.9),
            -0.3,
            0.95,
        )
        .sigma(0.3),
        // Warm copper: a winding is seldom further from what is stated.
        Spec::shape("resistance_factor", "1", 1.0, 0.75, 1.4).sigma(0.15),
        Spec::taken("supply_taken_v", "V", supply_taken_v(scale)),
    ]
}

/// A limit a little too low is far off and one a little too high does nothing: close steps.
fn starts(scale: &Scale) -> Vec<Vec<f64>> {
    [0.6, 0.68, 0.74, 0.79, 0.83, 0.87, 0.9, 0.93, 0.96, 0.99, 1.02, 1.05, 1.08, 1.12, 1.17, 1.25]
        .iter()
        .map(|k| vec![(1.0 - k * winding_share(scale)).clamp(-0.25, 0.9), 1.0, supply_taken_v(scale)])
        .collect()
}

fn needs(rig: &Rig, available: &Available) -> Result<(), &'static str> {
    let by_current = rig.amplifier.kind == AmplifierKind::Current && available.has("shaft_speed_rad_s");
    if rig.amplifier.supply_v.is_some() || !by_current || rig.motor.winding_resistance_ohm.is_none() {
        supply_known(rig, available)?;
    } else {
        commanded(rig, available)?;
    }
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
    supply_taken_v: T,
}

impl<T: Real> Effect<T> for VoltageLimit<T> {
    fn hooks(&self) -> Hooks {
        Hooks::DRIVE
    }

    fn drive(&mut self, _: &Tick, drive: &mut Drive<T>) {
        drive.voltage_limited = true;
        // A rig may state the effect and no supply: nothing runs out then.
        if !drive.supply_v.re().is_finite() && self.supply_taken_v > 0.0 {
            drive.supply_v = self.supply_taken_v;
        }
        drive.supply_v *= T::ONE - self.lost_share;
        drive.resistance_ohm *= self.resistance_factor;
    }
}
