//! What hidden physics and noise may do to a machine: hooks along the way from command to log.
//!
//! A hook that reads only takes `&self`: it is called more often than once a step. What an effect
//! remembers it moves on in [`Physics::advance`] and in the sensor hooks.

use crate::blades::Inflow;
use crate::machine::{Machine, Scale};

/// Where an effect enters, in the words of the report.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Path {
    /// Between command and motor torque.
    Drive,
    /// The torque balance of the shaft.
    Shaft,
    /// Lift and drag.
    Blade,
    /// The axial flow.
    Flow,
    /// Only what is measured.
    Sensor,
}

impl Path {
    /// All paths.
    pub const ALL: [Path; 5] = [Path::Drive, Path::Shaft, Path::Blade, Path::Flow, Path::Sensor];

    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Path::Drive => "drive",
            Path::Shaft => "shaft",
            Path::Blade => "blade",
            Path::Flow => "flow",
            Path::Sensor => "sensor",
        }
    }
}

/// The machine at an instant.
#[derive(Clone, Copy, Debug)]
pub struct Now<'a> {
    /// The machine.
    pub machine: &'a Machine,
    /// Scales of the run.
    pub full: &'a Scale,
    /// Time, s.
    pub time_s: f64,
    /// Command as it was given, A or V.
    pub command: f64,
    /// Motor current, A.
    pub current_a: f64,
    /// Shaft angle, rad.
    pub angle_rad: f64,
    /// How far it is ahead of what lies beyond an elastic link, rad.
    pub twist_rad: f64,
    /// Shaft speed, rad/s.
    pub speed_rad_s: f64,
    /// Axial flow, m/s.
    pub flow_m_s: f64,
    /// Motor torque a step ago, N m.
    pub motor_torque_n_m: f64,
    /// Thrust a step ago, N.
    pub thrust_n: f64,
    /// Blade torque a step ago, N m.
    pub blade_torque_n_m: f64,
    /// Acceleration of the shaft a step ago, rad/s2.
    pub acceleration_rad_s2: f64,
}

impl Now<'_> {
    /// Shaft speed over its largest.
    pub fn relative_speed(&self) -> f64 {
        self.speed_rad_s / self.full.speed_rad_s
    }

    /// Axial flow over its largest.
    pub fn relative_flow(&self) -> f64 {
        self.flow_m_s / self.full.flow_m_s
    }

    /// Current over its limit.
    pub fn relative_current(&self) -> f64 {
        self.current_a / self.full.current_a
    }

    /// Way of the reference section through the water, m/s.
    pub fn blade_speed_m_s(&self) -> f64 {
        let arm = self.machine.blades.as_ref().map_or(0.0, |blades| blades.arm_m());
        (arm * self.speed_rad_s).hypot(self.flow_m_s)
    }

    /// Chords of 0.25 radius that pass in a second.
    pub fn chords_per_s(&self) -> f64 {
        let radius = self.machine.blades.as_ref().map_or(1.0, |blades| blades.radius_m);
        self.blade_speed_m_s() / (0.25 * radius)
    }
}

/// The drive at an instant.
#[derive(Clone, Copy, Debug)]
pub struct Drive {
    /// Current (A) or voltage (V) asked for.
    pub target: f64,
    /// Lag of the current loop or of the winding, s.
    pub lag_s: f64,
    /// Current limit, A.
    pub current_limit_a: f64,
    /// Voltage limit over winding and back-EMF, V.
    pub voltage_limit_v: f64,
    /// Supply at the drive over the nominal one: a commanded voltage is a share of it.
    pub supply_ratio: f64,
    /// Factor on the torque of the motor.
    pub torque_gain: f64,
    /// Factor on a current that the back-EMF drives against the voltage.
    pub braking: f64,
}

/// The shaft at an instant.
#[derive(Clone, Copy, Debug, Default)]
pub struct Shaft {
    /// Torque against positive rotation that has no jump at rest, N m.
    pub torque_n_m: f64,
    /// Dry friction while turning ahead and astern, N m, positive.
    pub dry_n_m: [f64; 2],
    /// Torque that breaks it loose at rest, N m; at least the dry friction.
    pub breakaway_n_m: f64,
    /// Inertia beyond the machine's, kg m2.
    pub inertia_kg_m2: f64,
}

impl Shaft {
    /// Adds dry friction that is the same both ways.
    pub fn rub(&mut self, moving_n_m: f64, breakaway_n_m: f64) {
        self.dry_n_m[0] += moving_n_m;
        self.dry_n_m[1] += moving_n_m;
        self.breakaway_n_m += breakaway_n_m;
    }
}

/// The water at an instant.
#[derive(Clone, Copy, Debug)]
pub struct Water {
    /// Ambient flow, m/s.
    pub ambient_m_s: f64,
    /// Factor on the momentum flux.
    pub flux_gain: f64,
    /// Factor on the accelerated mass.
    pub mass_gain: f64,
    /// Tangential flow at 0.7 r, m/s.
    pub swirl_m_s: f64,
    /// Force on the water besides the blades', N.
    pub force_n: f64,
}

/// What lies beyond an elastic link, and the torque in the link.
#[derive(Clone, Copy, Debug)]
pub struct Link {
    /// Share of the inertia beyond the link.
    pub far_share: f64,
    /// Torque that the near side gives to the far side, N m.
    pub torque_n_m: f64,
}

/// What the sensors show at a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// Unwrapped shaft angle, rad.
    pub angle_rad: f64,
    /// Shaft speed, rad/s.
    pub speed_rad_s: f64,
    /// Thrust, N.
    pub thrust_n: f64,
    /// Torque, N m.
    pub torque_n_m: f64,
    /// Axial flow, m/s.
    pub flow_m_s: f64,
    /// Motor current, A.
    pub current_a: f64,
    /// Supply, V.
    pub supply_v: f64,
}

/// Hidden physics or noise of one run. Every hook defaults to nothing.
pub trait Physics {
    /// Sets the size: 0 is nothing, 1 far beyond what is ever hidden.
    fn set(&mut self, strength: f64);
    /// The next run begins at rest.
    fn rest(&mut self) {}
    /// Time by which the drive is behind the command, s.
    fn lateness_s(&self, _now: &Now) -> f64 {
        0.0
    }
    /// What the drive makes of the command, once an integration step.
    fn command(&mut self, asked: f64, _now: &Now, _step_s: f64) -> f64 {
        asked
    }
    /// Drive and motor.
    fn drive(&self, _now: &Now, _drive: &mut Drive) {}
    /// Torques on the shaft.
    fn shaft(&self, _now: &Now, _shaft: &mut Shaft) {}
    /// An elastic link between motor and the rest, at a twist (rad) and its rate (rad/s).
    fn link(&self, _now: &Now, _twist_rad: f64, _slip_rad_s: f64) -> Option<Link> {
        None
    }
    /// The water.
    fn water(&self, _now: &Now, _water: &mut Water) {}
    /// Whether [`Self::polar`] is to be called.
    fn bends_polar(&self) -> bool {
        false
    }
    /// Lift and drag coefficient of a station.
    fn polar(&self, _now: &Now, _inflow: &Inflow, _lift: &mut f64, _drag: &mut f64) {}
    /// Thrust and torque of the blades.
    fn forces(&self, _now: &Now, _thrust_n: &mut f64, _torque_n_m: &mut f64) {}
    /// Moves memories on by a step.
    fn advance(&mut self, _now: &Now, _step_s: f64) {}
    /// The force on the stand, once a step, before the force sensor's filter.
    fn stand(&mut self, _now: &Now, _force_n: &mut f64, _step_s: f64) {}
    /// The angle under the encoder, before it is counted, once a tick.
    fn encoder(&mut self, _now: &Now, _angle_rad: &mut f64) {}
    /// What the sensors show, once a tick.
    fn sense(&mut self, _now: &Now, _reading: &mut Reading, _tick_s: f64) {}
    /// Steps must be fine: something passes in a millisecond.
    fn quick(&self) -> bool {
        false
    }
}
