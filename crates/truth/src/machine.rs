//! The true machine: motor, drive, shaft, perhaps blades and water, and its sensors.

use crate::blades::Blades;
use crate::load::Load;

/// How the drive is commanded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveKind {
    /// A current loop.
    Current,
    /// A voltage on the winding.
    Voltage,
}

/// What a shaft without blades is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Build {
    /// A propeller on the shaft.
    Propeller,
    /// Motor and inertia on one shaft.
    Direct,
    /// Behind a gear.
    Geared,
    /// Behind a belt.
    Belt,
}

/// The measuring chain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensors {
    /// Control period, s: commands change and the encoder is read on it.
    pub tick_s: f64,
    /// Control ticks in a log interval.
    pub ticks_per_row: usize,
    /// Encoder counts in a revolution.
    pub encoder_counts: f64,
    /// First-order filter on the differenced speed, s.
    pub speed_filter_s: f64,
    /// White noise of a tachometer over the largest speed; zero where the speed comes from the encoder.
    pub tachometer_noise: f64,
    /// Corner of the force filter, Hz.
    pub thrust_filter_hz: f64,
    /// Full scale of the force converter, N.
    pub thrust_full_scale_n: f64,
    /// Bits of the force converter.
    pub thrust_bits: u32,
    /// Corner of the torque filter, Hz.
    pub torque_filter_hz: f64,
    /// Rate of the flow meter, Hz.
    pub flow_rate_hz: f64,
}

/// True parameters of a machine.
#[derive(Clone, Debug, PartialEq)]
pub struct Machine {
    /// Class as the rig file names it.
    pub class: &'static str,
    /// What it is.
    pub build: Build,
    /// Blades, duct and water.
    pub blades: Option<Blades>,
    /// What else hangs on the shaft.
    pub load: Load,
    /// Inertia of all that turns, the load with it, kg m2.
    pub inertia_kg_m2: f64,
    /// Viscous friction that the rig states, N m s.
    pub viscous_nm_s: f64,
    /// Motor torque constant, N m/A.
    pub torque_constant_nm_a: f64,
    /// Winding resistance, ohm.
    pub winding_resistance_ohm: f64,
    /// How it is commanded.
    pub drive: DriveKind,
    /// First-order lag of the current loop or of the winding, s.
    pub drive_lag_s: f64,
    /// Current limit, A.
    pub current_limit_a: f64,
    /// Supply voltage, V.
    pub supply_v: f64,
    /// Periods of cogging in a revolution.
    pub cogging_orders: &'static [f64],
    /// The measuring chain.
    pub sensors: Sensors,
}

impl Machine {
    /// Largest command, A or V.
    pub fn command_limit(&self) -> f64 {
        match self.drive {
            DriveKind::Current => self.current_limit_a,
            DriveKind::Voltage => self.supply_v,
        }
    }

    /// Torque at the current limit or at the stalled supply, N m.
    pub fn torque_limit_n_m(&self) -> f64 {
        let stalled = self.supply_v / self.winding_resistance_ohm;
        match self.drive {
            DriveKind::Current => self.torque_constant_nm_a * self.current_limit_a,
            DriveKind::Voltage => self.torque_constant_nm_a * stalled.min(self.current_limit_a),
        }
    }

    /// There is water.
    pub fn wet(&self) -> bool {
        self.blades.is_some()
    }

    /// Largest step of the integrator while sizes are sought, s.
    pub fn coarse_step_s(&self) -> f64 {
        match (self.drive, self.wet()) {
            (DriveKind::Current, true) => 0.001,
            _ => 0.0005,
        }
    }

    /// Step of the integrator in a recording, s.
    pub fn fine_step_s(&self) -> f64 {
        0.4 * self.coarse_step_s()
    }
}

/// Largest values of a run without hidden physics: scales of hidden terms.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Scale {
    /// Shaft speed, rad/s.
    pub speed_rad_s: f64,
    /// Axial flow, m/s.
    pub flow_m_s: f64,
    /// Thrust, N.
    pub thrust_n: f64,
    /// Torque of the motor, N m.
    pub torque_n_m: f64,
    /// Motor current, A.
    pub current_a: f64,
    /// Command, A or V.
    pub command: f64,
    /// Length of the run, s.
    pub duration_s: f64,
}
