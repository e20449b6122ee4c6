//! From what a scenario commands to what the drive takes.

use kort_thruster::parameters::{Parameter, Parameters};
use kort_thruster::rig::{AmplifierKind, Rig};

use crate::{Command, ScenarioError};

/// From a command's value to the drive's.
pub(super) struct DriveMap {
    command: Command,
    kind: AmplifierKind,
    /// Drive command at share 1.
    full: f64,
    torque_constant_nm_a: f64,
    resistance_ohm: f64,
    thrust_n_s2: f64,
    torque_nm_s2: f64,
}

impl DriveMap {
    pub(super) fn new(command: Command, rig: &Rig, p: &Parameters) -> Result<Self, ScenarioError> {
        let kind = rig.amplifier.kind;
        let fail = |why: &str, hint: &str| {
            Err(ScenarioError::Command { command: command.name(), why: why.into(), hint: hint.into() })
        };
        let own = match kind {
            AmplifierKind::Current => Command::CurrentCmdA,
            AmplifierKind::Voltage => Command::VoltageCmdV,
            AmplifierKind::Speed => Command::SpeedCmdRadS,
        };
        let (ct, cq) = if rig.propeller.is_some() { p.bollard_coefficients() } else { (0.0, 0.0) };
        let mut map = Self {
            command,
            kind,
            full: f64::NAN,
            torque_constant_nm_a: p.get(Parameter::TorqueConstantNmA),
            resistance_ohm: p.get(Parameter::WindingResistanceOhm),
            thrust_n_s2: ct,
            torque_nm_s2: cq,
        };
        match command {
            Command::CurrentCmdA | Command::VoltageCmdV | Command::SpeedCmdRadS if command != own => {
                return fail(
                    &format!("its drive takes {}", own.name()),
                    "command = \"share\" fits any drive",
                );
            }
            Command::TorqueCmdNM if kind != AmplifierKind::Current => {
                return fail(
                    "a torque needs amplifier.kind = \"current\"",
                    "command = \"share\" fits any drive",
                );
            }
            Command::DutyCmd if kind != AmplifierKind::Voltage => {
                return fail(
                    "a duty needs amplifier.kind = \"voltage\"",
                    "command = \"share\" fits any drive",
                );
            }
            Command::ThrustCmdN if ct <= 0.0 => {
                return fail("it has no propeller that gives thrust", "command it by torque or current");
            }
            Command::DutyCmd | Command::Share => {
                map.full = match rig.amplifier.largest_command(map.torque_constant_nm_a) {
                    Ok(full) => full,
                    Err(key) => {
                        return fail(
                            &format!("its largest command is not stated ({key})"),
                            &format!("state {key}, or give the values as {}", own.name()),
                        );
                    }
                };
            }
            _ => {}
        }
        Ok(map)
    }

    /// The drive's command for a value of the scenario's.
    pub(super) fn to_drive(&self, value: f64) -> f64 {
        match self.command {
            Command::CurrentCmdA | Command::VoltageCmdV | Command::SpeedCmdRadS => value,
            Command::DutyCmd | Command::Share => value * self.full,
            Command::TorqueCmdNM => value / self.torque_constant_nm_a,
            Command::ThrustCmdN => {
                let speed = value.signum() * (value.abs() / self.thrust_n_s2).sqrt();
                let current = self.torque_nm_s2 * speed * speed.abs() / self.torque_constant_nm_a;
                match self.kind {
                    AmplifierKind::Current => current,
                    AmplifierKind::Voltage => {
                        self.resistance_ohm * current + self.torque_constant_nm_a * speed
                    }
                    AmplifierKind::Speed => speed,
                }
            }
        }
    }
}
