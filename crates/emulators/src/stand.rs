//! The thruster behind an emulated drive, in real time.

use kort_thruster::models::ModelName;
use kort_thruster::parameters::Parameters;
use kort_thruster::plant::{Plant, Tick};
use kort_thruster::rig::{AmplifierKind, Rig};

use crate::bench::Truth;

/// Step of the simulation, s.
const STEP_S: f64 = 1e-3;
/// Most time caught up at once; a machine that stood still longer loses it.
const CATCH_UP_S: f64 = 0.1;

/// A motor with its propeller in still water.
pub struct Stand {
    plant: Plant,
    time_s: f64,
    kind: AmplifierKind,
    supply_v: f64,
    current_limit_a: f64,
}

impl Stand {
    /// At rest; the rig's amplifier says what the drive commands.
    pub fn new(rig: &Rig) -> Self {
        Self {
            plant: Plant::new(ModelName::Model2, rig, &Parameters::stated(rig), &[], STEP_S),
            time_s: 0.0,
            kind: rig.amplifier.kind,
            supply_v: rig.amplifier.supply_v.unwrap_or(48.0),
            current_limit_a: rig.amplifier.current_limit_a,
        }
    }

    /// Turns on to `time_s` under a command in the amplifier's unit; beyond its limit the drive gives its limit.
    pub fn turn_to(&mut self, time_s: f64, command: f64) {
        self.time_s = self.time_s.max(time_s - CATCH_UP_S);
        let command = match self.kind {
            AmplifierKind::Current => command.clamp(-self.current_limit_a, self.current_limit_a),
            AmplifierKind::Voltage => command.clamp(-self.supply_v, self.supply_v),
            AmplifierKind::Speed => command,
        };
        while self.time_s + STEP_S <= time_s {
            self.plant.step(&Tick { time_s: self.time_s, command, ..Tick::default() });
            self.time_s += STEP_S;
        }
    }

    /// What the drive commands.
    pub fn kind(&self) -> AmplifierKind {
        self.kind
    }

    /// Supply, V.
    pub fn supply_v(&self) -> f64 {
        self.supply_v
    }

    /// Motor current, A.
    pub fn current_a(&self) -> f64 {
        self.plant.truth().current_a
    }

    /// Shaft speed, rad/s.
    pub fn shaft_speed_rad_s(&self) -> f64 {
        self.plant.truth().shaft_speed_rad_s
    }

    /// Shaft angle, rad.
    pub fn shaft_angle_rad(&self) -> f64 {
        self.plant.truth().shaft_angle_rad
    }

    /// Shaft angle at an instant since the last step, s, by the speed of that step, rad.
    pub fn shaft_angle_rad_at(&self, time_s: f64) -> f64 {
        let since_s = (time_s - self.time_s).clamp(0.0, STEP_S);
        self.shaft_angle_rad() + self.shaft_speed_rad_s() * since_s
    }

    /// What is true while the power stage is asked for this command, in the amplifier's unit.
    pub fn truth(&self, command: f64) -> Truth {
        let at = self.plant.truth();
        Truth {
            command,
            current_a: at.current_a,
            shaft_speed_rad_s: at.shaft_speed_rad_s,
            thrust_n: at.thrust_n,
        }
    }
}
