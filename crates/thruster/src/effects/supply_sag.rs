//! The supply sags under the thruster's own load.

use super::memory::FirstOrder;
use super::voltage_limit_backemf::{self, winding_share};
use super::{Available, Descriptor, Effect, Hooks, Path, Scale, Spec};
use crate::plant::{Drive, Tick};
use crate::real::Real;
use crate::rig::Rig;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "supply_sag",
    path: Path::Drive,
    what: "the bus voltage falls under load through the resistance of cable and battery, and recovers with a lag",
    equation: "Vbus = f V0 - lag(Rs Ibus), Ibus = |im| |R im + ke Om|/V0; Rs [ohm], lag [s], f [1] for a supply not as stated. A voltage drive's output \
               falls in proportion; a current drive meets its voltage limit sooner",
    signature: "on a voltage drive thrust grows more slowly than command; on a current drive only the top is capped; \
                other loads on the bus show through; thrust over speed squared is unchanged",
    confused_with: &["voltage_limit_backemf", "command_curve", "thermal_drift_kt", "viscous_friction"],
    separated_by: "the recorded bus voltage; the supply voltage varied",
    reference: "Ohm's law with the power balance of the drive; kort's form",
    commonness: 1.5,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[&[0], &[0, 2], &[0, 1], &[0, 1, 2]],
    parameters,
    starts,
    needs,
    build: both!(|values, context| {
        Box::new(SupplySag {
            source_ohm: values[0],
            recovery_s: values[1],
            supply_factor: values[2],
            voltage_drive: context.rig.amplifier.kind == crate::rig::AmplifierKind::Voltage,
            tick_s: context.tick_s,
            sag: FirstOrder::new(),
        })
    }),
};

/// The source resistance that would take the whole supply at full power.
fn source_ohm(scale: &Scale) -> f64 {
    let bus_a = scale.torque_n_m * scale.shaft_speed_rad_s / scale.supply_v.max(1e-3);
    scale.supply_v.max(1e-3) / bus_a
}

/// The start lets a current drive meet its voltage limit just below the top of the recording.
fn parameters(scale: &Scale) -> Vec<Spec> {
    let full = source_ohm(scale);
    let share = (1.0 - 0.85 * winding_share(scale)).clamp(0.02, 0.6);
    vec![
        Spec::strength("source_resistance_ohm", "ohm", share * full, 0.0, 2.0 * full).sigma(0.15 * full),
        Spec::shape("recovery_s", "s", 0.01, 0.0, 20.0).sigma(1.0),
        // In doubt as the voltage that a limit leaves is: it is one quantity under two names.
        Spec::shape("supply_factor", "1", 1.0, 0.05, 1.3).sigma(0.3),
    ]
}

/// Supplies as stated with more and less sag, at once and after a while, and others that fall short of what the winding takes at the
/// top of the recording by about as much, with little and much of it through sag.
fn starts(scale: &Scale) -> Vec<Vec<f64>> {
    let full = source_ohm(scale);
    let stated = [0.03, 0.08, 0.14, 0.2, 0.28, 0.4].iter().map(|share| vec![share * full, 0.01, 1.0]);
    // From a bus that gives way at once a fit creeps towards one that takes a while.
    let late = [0.08, 0.2].iter().map(|share| vec![share * full, 0.2, 1.0]);
    let winding = winding_share(scale);
    let back_emf_v = scale.torque_n_m * scale.shaft_speed_rad_s / scale.current_a;
    let electric_over_shaft_power = winding * scale.supply_v / back_emf_v.max(1e-3);
    let binding = [0.02, 0.06, 0.12].into_iter().flat_map(move |share| {
        let lost = share * electric_over_shaft_power;
        [0.85, 0.91, 0.95, 0.98, 1.01, 1.05]
            .map(|k| vec![share * full, 0.01, (k * winding + lost).clamp(0.1, 1.25)])
    });
    stated.chain(late).chain(binding).collect()
}

/// A recorded supply that loses less than this share at the largest load is no sagging one.
const LEAST_SHARE: f64 = 0.02;

fn needs(rig: &Rig, available: &Available) -> Result<(), &'static str> {
    voltage_limit_backemf::supply_known(rig, available)?;
    if rig.amplifier.kind == crate::rig::AmplifierKind::Voltage
        && available.has("duty_cmd")
        && available.has("supply_v")
    {
        return Err("the recorded supply is in the drive's voltage already: duty times supply");
    }
    if available.supply_sag_share.is_some_and(|share| share < LEAST_SHARE) {
        Err("the recorded supply hardly falls under load")
    } else {
        Ok(())
    }
}

/// Whether the recorded supply falls so far that it brings the voltage limit with it.
pub(super) fn recorded(available: &Available) -> bool {
    available.supply_sag_share.is_some_and(|share| share > 2.0 * LEAST_SHARE)
}

/// Least bus voltage that a power is divided by, V.
const LEAST_V: f64 = 1e-3;

struct SupplySag<T> {
    source_ohm: T,
    recovery_s: T,
    supply_factor: T,
    voltage_drive: bool,
    tick_s: f64,
    sag: FirstOrder<T>,
}

impl<T: Real> Effect<T> for SupplySag<T> {
    fn hooks(&self) -> Hooks {
        Hooks::DRIVE
    }

    fn drive(&mut self, _: &Tick, drive: &mut Drive<T>) {
        // A log that begins before its volt meter does says 0.
        drive.supply_v = (drive.supply_v * self.supply_factor).max(T::from(LEAST_V));
        let winding_v = drive.resistance_ohm * drive.current_a + drive.back_emf_v;
        // Bus and winding exchange power; a braking drive does not lift the bus here.
        let bus_a = (drive.current_a * winding_v).max(T::ZERO) / drive.supply_v;
        let lost_v = self.sag.step(self.source_ohm * bus_a, self.recovery_s, self.tick_s);
        let left = (lost_v / drive.supply_v + 1.0).recip();
        drive.supply_v *= left;
        if self.voltage_drive {
            drive.command *= left;
        } else {
            drive.voltage_limited = true;
        }
    }
}
