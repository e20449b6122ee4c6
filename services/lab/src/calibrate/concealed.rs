//! What a rehearsal conceals: a thruster near its rig, by chance, and what may be wired wrong.

use kort_thruster::effects::{self, Descriptor};
use kort_thruster::parameters::{Parameter, Parameters};
use kort_thruster::rig::Rig;
use rand::{Rng, SeedableRng};

/// What is wrong with a stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// The shaft sensor counts the other way.
    EncoderReversed,
    /// The motor turns the other way.
    MotorReversed,
    /// The shaft sensor shows what it showed at the start.
    DeadSensor,
    /// The shaft does not turn.
    BlockedShaft,
    /// The thrust cell pulls where it should push.
    ThrustReversed,
}

impl Trouble {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::EncoderReversed,
        Self::MotorReversed,
        Self::DeadSensor,
        Self::BlockedShaft,
        Self::ThrustReversed,
    ];

    /// In words.
    pub const fn words(self) -> &'static str {
        match self {
            Self::EncoderReversed => "reversed encoder",
            Self::MotorReversed => "reversed motor",
            Self::DeadSensor => "dead shaft sensor",
            Self::BlockedShaft => "blocked shaft",
            Self::ThrustReversed => "thrust cell with the wrong sign",
        }
    }
}

/// A thruster as it is.
#[derive(Clone, Debug)]
pub struct Concealed {
    /// Its parameters.
    pub parameters: Parameters,
    /// Dry friction ahead and astern, N m, and viscous friction ahead and astern, N m s.
    pub friction: [f64; 4],
    /// Dead time of the drive, s.
    pub delay_s: f64,
    /// The drive's dead band: half width and centre, in the unit of the drive, and what of the half width is given
    /// back beyond it.
    pub band: [f64; 3],
    /// What the thrust cell shows at rest, N.
    pub zero_n: f64,
    /// What the flow meter shows at rest, m/s.
    pub zero_m_s: f64,
    /// What the torque transducer shows at rest, N m.
    pub zero_n_m: f64,
    /// What is wrong with the stand.
    pub trouble: Option<Trouble>,
}

impl Concealed {
    /// By chance, within factors of what the rig states.
    pub fn by_chance(rig: &Rig, drive_max: f64, seed: u64) -> Self {
        let mut dice = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let mut parameters = Parameters::stated(rig);
        let mut factor = |low: f64, high: f64| dice.random_range(low.ln()..high.ln()).exp();
        let mut by = |parameter: Parameter, low: f64, high: f64| {
            let value = parameters.get(parameter) * factor(low, high);
            parameters.set(parameter, value);
        };
        by(Parameter::InertiaKgM2, 0.65, 1.5);
        by(Parameter::TimeConstantS, 0.6, 1.6);
        by(Parameter::LiftMax, 0.8, 1.25);
        by(Parameter::DragMax, 0.8, 1.25);
        by(Parameter::FluxCoefficient, 0.85, 1.15);
        by(Parameter::AddedMassCoefficient, 0.6, 1.5);
        if rig.sensors.torque_transducer {
            by(Parameter::TorqueConstantNmA, 0.85, 1.15);
        }
        let full = kort_scenario::scale(rig, &parameters, drive_max, 1e-3, 60.0);
        let viscous = full.torque_n_m / full.shaft_speed_rad_s;
        let dry = full.torque_n_m * dice.random_range(0.01..0.05);
        let other = dry * dice.random_range(0.7_f64..1.4);
        Self {
            friction: [
                dry,
                other,
                viscous * dice.random_range(0.002..0.03),
                viscous * dice.random_range(0.002..0.03),
            ],
            delay_s: dice.random_range(0.001..0.012),
            band: [drive_max * dice.random_range(0.002..0.03), 0.0, 0.0],
            zero_n: full.thrust_n * dice.random_range(-0.02..0.02),
            zero_m_s: full.flow_m_s * dice.random_range(-0.02..0.02),
            zero_n_m: full.torque_n_m * dice.random_range(-0.01..0.01),
            parameters,
            trouble: None,
        }
    }

    /// The physics beside the model.
    pub fn effects(&self) -> Vec<(&'static Descriptor, &[f64])> {
        let all: [(&str, &[f64]); 3] = [
            ("direction_dependent_friction", &self.friction),
            ("transport_delay", std::slice::from_ref(&self.delay_s)),
            ("command_dead_band", &self.band),
        ];
        all.into_iter().filter_map(|(id, values)| Some((effects::find(id)?, values))).collect()
    }
}
