//! What a session may do to this thruster.

use kort_thruster::parameters::{Parameter, Parameters};
use kort_thruster::rig::{AmplifierKind, Rig};

/// Bounds of a session, and the little that it must believe of the shaft to begin small.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plan {
    /// How the drive is commanded.
    pub kind: AmplifierKind,
    /// Largest drive that the servo lets through, in the unit of the drive.
    pub drive_max: f64,
    /// Share of it that the session goes up to, above 0 to 1.
    pub share: f64,
    /// Shaft speed from which the servo takes drive away, rad/s.
    pub speed_max_rad_s: f64,
    /// Servo period, s.
    pub period_s: f64,
    /// Stated inertia of what turns, kg m^2: how long a first pulse may last.
    pub inertia_kg_m2: f64,
    /// Stated torque at standstill over the drive, N m per unit; NaN for a drive with a speed loop of its own.
    pub torque_per_drive: f64,
    /// Stated time constant with which the drive follows its command, s.
    pub lag_s: f64,
    /// Torque constant, N m/A.
    pub torque_constant_nm_a: f64,
    /// Least change of the shaft angle that is motion and not the encoder's last digit, rad.
    pub angle_step_rad: f64,
}

/// An encoder that states nothing is taken to be no coarser than this, rad.
const ANGLE_STEP_RAD: f64 = 0.01;

impl Plan {
    /// From what is stated of the rig, and what the servo enforces.
    pub fn new(rig: &Rig, drive_max: f64, speed_max_rad_s: f64, period_s: f64, share: f64) -> Self {
        let p = Parameters::stated(rig);
        let kt = p.get(Parameter::TorqueConstantNmA);
        let torque_per_drive = match rig.amplifier.kind {
            AmplifierKind::Current => kt,
            AmplifierKind::Voltage => match rig.motor.winding_resistance_ohm {
                Some(ohm) => kt / ohm.value,
                None => kt * rig.amplifier.current_limit_a / drive_max,
            },
            AmplifierKind::Speed => f64::NAN,
        };
        Self {
            kind: rig.amplifier.kind,
            drive_max,
            share,
            speed_max_rad_s,
            period_s,
            inertia_kg_m2: p.get(Parameter::InertiaKgM2),
            torque_per_drive,
            lag_s: p.get(Parameter::TimeConstantS),
            torque_constant_nm_a: kt,
            angle_step_rad: rig
                .sensors
                .encoder_counts_per_rev
                .map_or(ANGLE_STEP_RAD, |n| (4.0 * std::f64::consts::TAU / n).max(1e-4)),
        }
    }

    /// How long a pulse of this drive, and one of its opposite after it, may each last so that a free shaft of the
    /// stated inertia turns this far, s.
    pub fn pulse_s(&self, drive: f64, angle_rad: f64) -> f64 {
        let drive = drive.abs();
        let lasts = match self.kind {
            AmplifierKind::Speed => angle_rad / drive,
            _ => (angle_rad * self.inertia_kg_m2 / (self.torque_per_drive * drive)).sqrt(),
        };
        lasts.clamp(2.0 * self.period_s, 0.5)
    }

    /// As [`Self::pulse_s`], for a pulse whose opposite follows at once and lasts this share of it: a speed loop with a
    /// lag hardly follows a short pulse, and an opposite as long would bring the shaft back to where it was, slowly. Its
    /// way is the drive times the difference of the two, whatever the lag.
    pub fn pulse_at_once_s(&self, drive: f64, angle_rad: f64) -> f64 {
        match self.kind {
            AmplifierKind::Speed => {
                // From t^2/(t + lag), within 3 % of the way until it stands.
                let free_s = angle_rad / drive.abs();
                let lasts = 0.5 * (free_s + (free_s * (free_s + 4.0 * self.lag_s)).sqrt());
                lasts.clamp(2.0 * self.period_s, 0.5)
            }
            _ => self.pulse_s(drive, angle_rad),
        }
    }

    /// That share, above 0 to 1, after which a shaft stands.
    pub fn opposite(&self, lasts_s: f64) -> f64 {
        match self.kind {
            AmplifierKind::Speed => self.lag_s / (lasts_s + self.lag_s),
            _ => 1.0,
        }
    }

    /// Drive that takes a shaft speed away within about 0.15 s, for a shaft that turns as it is commanded
    /// (`side` 1) or the other way round (-1).
    pub fn brake(&self, side: f64, speed_rad_s: f64, most: f64) -> f64 {
        match self.kind {
            AmplifierKind::Speed => 0.0,
            _ => {
                (-side * speed_rad_s * self.inertia_kg_m2 / (0.15 * self.torque_per_drive)).clamp(-most, most)
            }
        }
    }
}
