//! The drive's command inverted: dead band, command curve, a supply that sags, whatever stands between command
//! and what the drive gives.
//!
//! The effects are asked as they act once settled (their lags and delays belong to the observer's prediction,
//! [`super::design`]). What they give rises with the command, so the command is found by a few steps of
//! correction, and by bisection where these do not arrive: a bounded number of calls, whatever the effects.

use kort_thruster::effects::Effect;
use kort_thruster::plant::{Drive, Tick};
use kort_thruster::rig::{AmplifierKind, Rig};

use super::{SETTLED_S, built};
use crate::model::ControlModel;

/// Steps of correction before bisection.
const STEPS: u32 = 4;
/// Halvings of the bracket.
const HALVINGS: u32 = 32;
/// Share of the largest command within which what is wanted counts as zero: noise about zero must not jump from
/// one side of a dead band to the other.
const ZERO: f64 = 0.004;
/// How near to what is wanted a command must come, share of the largest.
const NEAR: f64 = 1e-5;

/// What the drive can give now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reach {
    /// Voltage at its end of the winding, V.
    pub supply_v: f64,
    /// Winding resistance, ohm.
    pub resistance_ohm: f64,
    /// Largest current, A.
    pub current_a: f64,
}

/// Where the drive works now.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OperatingPoint {
    /// Supply, V; the rig's nominal one where none is measured.
    pub supply_v: Option<f64>,
    /// Motor current, A.
    pub current_a: f64,
    /// Shaft speed, rad/s.
    pub shaft_speed_rad_s: f64,
}

/// The effects between command and amplifier.
pub(super) struct DriveChain {
    effects: Vec<Box<dyn Effect>>,
    kind: AmplifierKind,
    torque_constant_nm_a: f64,
    resistance_ohm: f64,
    nominal_supply_v: Option<f64>,
    current_limit_a: f64,
    /// Largest command.
    most: f64,
}

impl DriveChain {
    pub(super) fn new(rig: &Rig, model: &ControlModel) -> Self {
        let all = built(rig, SETTLED_S);
        let kind = rig.amplifier.kind;
        let supply = rig.amplifier.supply_v;
        Self {
            effects: all.into_iter().filter(|(_, e)| e.hooks().drive).map(|(_, e)| e).collect(),
            kind,
            torque_constant_nm_a: rig.motor.torque_constant_nm_a.value,
            resistance_ohm: rig.motor.winding_resistance_ohm.map_or(0.0, |r| r.value),
            nominal_supply_v: supply,
            current_limit_a: rig.amplifier.current_limit_a,
            most: match kind {
                AmplifierKind::Current => model.current_limit_a,
                AmplifierKind::Voltage => {
                    supply.unwrap_or(model.torque_constant_nm_a * model.speed_max_rad_s)
                }
                AmplifierKind::Speed => 1.2 * model.speed_max_rad_s,
            },
        }
    }

    pub(super) fn is_idle(&self) -> bool {
        self.effects.is_empty()
    }

    /// What becomes of a command.
    pub(super) fn pass(&mut self, command: f64, at: OperatingPoint) -> Drive {
        let mut drive = Drive {
            command,
            current_limit_a: self.current_limit_a,
            time_constant_s: 0.0,
            supply_v: self.supply_v(at),
            resistance_ohm: self.resistance_ohm,
            back_emf_v: self.torque_constant_nm_a * at.shaft_speed_rad_s,
            freewheels: 0.0,
            shaft_speed_rad_s: at.shaft_speed_rad_s,
            current_a: at.current_a,
            voltage_limited: false,
        };
        for effect in &mut self.effects {
            effect.drive(&Tick::default(), &mut drive);
        }
        drive
    }

    fn supply_v(&self, at: OperatingPoint) -> f64 {
        at.supply_v.or(self.nominal_supply_v).unwrap_or(f64::INFINITY)
    }

    pub(super) fn reach(&mut self, at: OperatingPoint) -> Reach {
        let stated = self.supply_v(at);
        // A voltage drive gives what its largest command becomes; a current drive what its bus lets it.
        let full = if self.kind == AmplifierKind::Voltage && stated.is_finite() { stated } else { 0.0 };
        let drive = self.pass(full, at);
        let supply_v = if full > 0.0 { drive.command.abs().min(full) } else { drive.supply_v };
        Reach { supply_v, resistance_ohm: drive.resistance_ohm, current_a: drive.current_limit_a }
    }

    /// The command for what is wanted; the largest command where that is not enough.
    pub(super) fn command(&mut self, wanted: f64, at: OperatingPoint) -> f64 {
        let most = self.most;
        let zero = ZERO * most;
        if wanted.abs() < zero {
            // Straight through zero, from where either side begins to give something.
            let side = self.command_beyond(zero.copysign(wanted), at);
            return side * (wanted.abs() / zero);
        }
        self.command_beyond(wanted, at)
    }

    fn command_beyond(&mut self, wanted: f64, at: OperatingPoint) -> f64 {
        let most = self.most;
        let mut gives = |command: f64| self.pass(command, at).command;
        let mut command = wanted.clamp(-most, most);
        for _ in 0..STEPS {
            let error = wanted - gives(command);
            if error.abs() < NEAR * most {
                return command;
            }
            command = (command + error).clamp(-most, most);
        }
        let (mut low, mut high) = (-most, most);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if gives(middle) < wanted { low = middle } else { high = middle }
        }
        if wanted > 0.0 { high } else { low }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::tests::STAND;

    const AT_REST: OperatingPoint = OperatingPoint { supply_v: None, current_a: 0.0, shaft_speed_rad_s: 0.0 };

    fn chain(effects: &str) -> DriveChain {
        let rig = Rig::from_toml(&format!("{STAND}{effects}")).unwrap();
        let model = ControlModel::from_rig(&rig, 0.002).unwrap();
        DriveChain::new(&rig, &model)
    }

    #[test]
    fn a_command_is_found_that_gives_what_is_wanted() {
        let band = "[[effects]]\neffect = \"command_dead_band\"\nhalf_width = 0.5\n";
        let curve = "[[effects]]\neffect = \"command_curve\"\nsecond_degree_share = 0.2\nthird_degree_share = 0.1\nfull_command = 9\n";
        for effects in [band.to_owned(), curve.to_owned(), format!("{band}{curve}")] {
            let mut chain = chain(&effects);
            for wanted in [-8.0, -2.0, -0.3, -0.05, 0.05, 0.5, 3.0, 7.0] {
                let command = chain.command(wanted, AT_REST);
                let gives = chain.pass(command, AT_REST).command;
                assert!((gives - wanted).abs() < 1e-3, "{effects}: {wanted} by {command} gives {gives}");
            }
            assert_eq!(chain.command(0.0, AT_REST), 0.0);
        }
    }

    #[test]
    fn what_is_out_of_reach_gets_all_there_is() {
        let mut chain = chain("[[effects]]\neffect = \"command_dead_band\"\nhalf_width = 2\n");
        assert!((chain.command(8.9, AT_REST) - 9.0).abs() < 1e-6);
    }
}
