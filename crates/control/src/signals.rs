//! What goes into a controller and what comes out of it.

use kort_thruster::rig::AmplifierKind;

/// One set of measurements. `None` means "not measured now": not fitted, not sampled at this
/// tick, or declared invalid by the sensor checks upstream. A held value may be repeated.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measurement {
    /// Shaft speed after the rig's speed filter, rad/s; positive ahead.
    pub shaft_speed_rad_s: Option<f64>,
    /// Motor current, A; positive current drives the shaft ahead.
    pub current_a: Option<f64>,
    /// Thrust on the force sensor, N; positive ahead.
    pub thrust_n: Option<f64>,
    /// Axial flow through the propeller, m/s; positive in bollard ahead.
    pub flow_m_s: Option<f64>,
    /// Ambient axial flow far ahead, m/s; positive in the same direction as `flow_m_s`.
    pub ambient_m_s: Option<f64>,
    /// Supply voltage, V.
    pub supply_v: Option<f64>,
    /// Shaft angle, rad; only effects that follow it ask for it.
    pub shaft_angle_rad: Option<f64>,
}

impl Measurement {
    /// The same measurements, with whatever is not finite taken as not measured and the rest held
    /// inside `bound` times what the thruster can reach. Keeps a broken sensor from turning
    /// into an overflow inside an observer.
    pub fn sane(self, speed_bound_rad_s: f64, current_bound_a: f64, thrust_bound_n: f64) -> Self {
        let keep = |x: Option<f64>, bound: f64| x.filter(|x| x.is_finite()).map(|x| x.clamp(-bound, bound));
        Self {
            shaft_speed_rad_s: keep(self.shaft_speed_rad_s, speed_bound_rad_s),
            current_a: keep(self.current_a, current_bound_a),
            thrust_n: keep(self.thrust_n, thrust_bound_n),
            flow_m_s: keep(self.flow_m_s, 30.0),
            ambient_m_s: keep(self.ambient_m_s, 15.0),
            supply_v: keep(self.supply_v, 1e5).filter(|v| *v > 0.0),
            shaft_angle_rad: self.shaft_angle_rad.filter(|x| x.is_finite()),
        }
    }
}

/// What is asked of the thruster.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Reference {
    /// No torque; integrators rest, observers go on.
    #[default]
    Off,
    /// Thrust, N; positive ahead.
    Thrust(f64),
    /// Shaft speed, rad/s; positive ahead.
    Speed(f64),
}

/// What the drive is told. Exactly one field drives it, by the rig's amplifier kind; the current
/// is always the one the law asked for after the limits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DriveCommand {
    /// Motor current, A.
    pub current_a: f64,
    /// Voltage for a voltage drive, V: `R i + ke Om`, inside the supply.
    pub voltage_v: Option<f64>,
    /// Speed for a drive that closes a speed loop of its own, rad/s.
    pub speed_rad_s: Option<f64>,
}

impl DriveCommand {
    /// No torque.
    pub fn off(kind: AmplifierKind) -> Self {
        let zero = |of| (kind == of).then_some(0.0);
        Self {
            current_a: 0.0,
            voltage_v: zero(AmplifierKind::Voltage),
            speed_rad_s: zero(AmplifierKind::Speed),
        }
    }
}

/// An estimated value and its standard error, in the value's unit. An infinite standard error
/// means that the observer has no measure of its own doubt, or that the value is not observable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimated {
    /// Best value.
    pub value: f64,
    /// One standard deviation.
    pub std_error: f64,
}

impl Default for Estimated {
    fn default() -> Self {
        Self { value: 0.0, std_error: f64::INFINITY }
    }
}

/// What an observer says of the thruster now.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// Shaft speed without the speed filter's lag, rad/s.
    pub shaft_speed_rad_s: Estimated,
    /// Axial flow through the propeller, m/s.
    pub flow_m_s: Estimated,
    /// Ambient axial flow, m/s.
    pub ambient_m_s: Estimated,
    /// Thrust, N: what the stand or hull feels.
    pub thrust_n: Estimated,
    /// Load torque on the shaft that the model does not explain, N m; positive opposes ahead.
    pub load_torque_n_m: Estimated,
    /// Swirl speed of the water at 0.7 radius, m/s.
    pub swirl_m_s: Estimated,
    /// Torque of the blades by the model, N m; positive opposes ahead.
    pub blade_torque_n_m: f64,
    /// Share by which the blades probably give more thrust than the model says, by what their torque is off.
    pub thrust_surplus: f64,
    /// Measurements rejected by the innovation gate since start.
    pub gated: u64,
}
