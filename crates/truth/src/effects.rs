//! The effects that a case may hide, by their catalogue ids, each with one strength.

use crate::dynamics::Scale;
use crate::hidden::{Hidden, SkewChannel};
use crate::thruster::Thruster;
use rand::Rng;
use serde::Serialize;
use std::f64::consts::TAU;

/// Hidden effects of the catalogue.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs)]
pub enum Effect {
    CoulombFriction,
    ViscousFriction,
    WindageDrag,
    EntrainedWaterInertia,
    RotorInertiaError,
    AmplifierLag,
    TransportDelay,
    CurrentSaturation,
    TorqueConstantSaturation,
    ThermalDriftKt,
    VoltageLimitBackemf,
    SupplySag,
    TorqueRippleCogging,
    CommandDeadBand,
    AmbientAxialFlow,
    AmbientFlowUnsteady,
    TankRecirculation,
    DuctLoss,
    CrossFlow,
    InertiaAddedMassError,
    RotationalFlow,
    NonsinusoidalLiftDrag,
    BladeStall,
    ForwardReverseAsymmetry,
    UnsteadyLiftLag,
    Ventilation,
    AirIngestion,
    Cavitation,
    WaterDensity,
    ThrustBiasGainHysteresis,
    ThrustSensorLag,
    StandResonance,
    FlowmeterOffsetLagLocation,
    EncoderFilterLag,
    EncoderEccentricity,
    TorqueChannelBias,
    ClockSkew,
}

/// Random numbers in 0..1 that fix everything about an effect but its strength.
pub type Shape = [f64; 6];

/// Quantities of the rig file that a case may state closely.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Stated {
    Lift,
    Drag,
    Flux,
    AddedMass,
    Inertia,
    TorqueConstant,
}

impl Effect {
    /// All effects.
    pub const ALL: [Effect; 37] = [
        Effect::CoulombFriction,
        Effect::ViscousFriction,
        Effect::WindageDrag,
        Effect::EntrainedWaterInertia,
        Effect::RotorInertiaError,
        Effect::AmplifierLag,
        Effect::TransportDelay,
        Effect::CurrentSaturation,
        Effect::TorqueConstantSaturation,
        Effect::ThermalDriftKt,
        Effect::VoltageLimitBackemf,
        Effect::SupplySag,
        Effect::TorqueRippleCogging,
        Effect::CommandDeadBand,
        Effect::AmbientAxialFlow,
        Effect::AmbientFlowUnsteady,
        Effect::TankRecirculation,
        Effect::DuctLoss,
        Effect::CrossFlow,
        Effect::InertiaAddedMassError,
        Effect::RotationalFlow,
        Effect::NonsinusoidalLiftDrag,
        Effect::BladeStall,
        Effect::ForwardReverseAsymmetry,
        Effect::UnsteadyLiftLag,
        Effect::Ventilation,
        Effect::AirIngestion,
        Effect::Cavitation,
        Effect::WaterDensity,
        Effect::ThrustBiasGainHysteresis,
        Effect::ThrustSensorLag,
        Effect::StandResonance,
        Effect::FlowmeterOffsetLagLocation,
        Effect::EncoderFilterLag,
        Effect::EncoderEccentricity,
        Effect::TorqueChannelBias,
        Effect::ClockSkew,
    ];

    /// Catalogue id.
    pub fn id(self) -> &'static str {
        use Effect::*;
        match self {
            CoulombFriction => "coulomb_friction",
            ViscousFriction => "viscous_friction",
            WindageDrag => "windage_drag",
            EntrainedWaterInertia => "entrained_water_inertia",
            RotorInertiaError => "rotor_inertia_error",
            AmplifierLag => "amplifier_lag",
            TransportDelay => "transport_delay",
            CurrentSaturation => "current_saturation",
            TorqueConstantSaturation => "torque_constant_saturation",
            ThermalDriftKt => "thermal_drift_kt",
            VoltageLimitBackemf => "voltage_limit_backemf",
            SupplySag => "supply_sag",
            TorqueRippleCogging => "torque_ripple_cogging",
            CommandDeadBand => "command_dead_band",
            AmbientAxialFlow => "ambient_axial_flow",
            AmbientFlowUnsteady => "ambient_flow_unsteady",
            TankRecirculation => "tank_recirculation",
            DuctLoss => "duct_loss",
            CrossFlow => "cross_flow",
            InertiaAddedMassError => "inertia_added_mass_error",
            RotationalFlow => "rotational_flow",
            NonsinusoidalLiftDrag => "nonsinusoidal_lift_drag",
            BladeStall => "blade_stall",
            ForwardReverseAsymmetry => "forward_reverse_asymmetry",
            UnsteadyLiftLag => "unsteady_lift_lag",
            Ventilation => "ventilation",
            AirIngestion => "air_ingestion",
            Cavitation => "cavitation",
            WaterDensity => "water_density",
            ThrustBiasGainHysteresis => "thrust_bias_gain_hysteresis",
            ThrustSensorLag => "thrust_sensor_lag",
            StandResonance => "stand_resonance",
            FlowmeterOffsetLagLocation => "flowmeter_offset_lag_location",
            EncoderFilterLag => "encoder_filter_lag",
            EncoderEccentricity => "encoder_eccentricity",
            TorqueChannelBias => "torque_channel_bias",
            ClockSkew => "clock_skew",
        }
    }

    /// Path on which it acts, in the report's words.
    pub fn path(self) -> &'static str {
        use Effect::*;
        match self {
            CoulombFriction
            | ViscousFriction
            | WindageDrag
            | EntrainedWaterInertia
            | RotorInertiaError
            | TorqueChannelBias
            | TorqueRippleCogging => "shaft",
            AmplifierLag
            | TransportDelay
            | CurrentSaturation
            | TorqueConstantSaturation
            | ThermalDriftKt
            | VoltageLimitBackemf
            | SupplySag
            | CommandDeadBand => "drive",
            AmbientAxialFlow | AmbientFlowUnsteady | TankRecirculation | DuctLoss | InertiaAddedMassError => {
                "flow"
            }
            CrossFlow
            | RotationalFlow
            | NonsinusoidalLiftDrag
            | BladeStall
            | ForwardReverseAsymmetry
            | UnsteadyLiftLag
            | Ventilation
            | AirIngestion
            | Cavitation
            | WaterDensity => "blade",
            ThrustBiasGainHysteresis
            | ThrustSensorLag
            | StandResonance
            | FlowmeterOffsetLagLocation
            | EncoderFilterLag
            | EncoderEccentricity
            | ClockSkew => "sensor",
        }
    }

    /// Other ids that name the same physics: a report naming one of them is right.
    pub fn same_physics(self) -> &'static [&'static str] {
        match self {
            Effect::EntrainedWaterInertia => &["rotor_inertia_error"],
            Effect::RotorInertiaError => &["entrained_water_inertia"],
            _ => &[],
        }
    }

    /// What the rig must state closely, or a re-fit within tolerances explains the effect away.
    pub fn anchors(self) -> &'static [Stated] {
        match self {
            Effect::EntrainedWaterInertia | Effect::RotorInertiaError => &[Stated::Inertia, Stated::Lift],
            Effect::InertiaAddedMassError => &[Stated::AddedMass, Stated::Lift],
            Effect::DuctLoss => &[Stated::Flux, Stated::Lift],
            Effect::WaterDensity => &[Stated::Lift, Stated::Drag, Stated::Flux, Stated::AddedMass],
            _ => &[],
        }
    }

    /// Sets the effect's numbers for a dimensionless strength (0 is nothing, 1 is far beyond a few percent).
    pub fn set(self, h: &mut Hidden, s: f64, u: &Shape, t: &Thruster, scale: &Scale) {
        use Effect::*;
        let between = |index: usize, low: f64, high: f64| low + (high - low) * u[index];
        let side = |index: usize| if u[index] < 0.5 { -1.0 } else { 1.0 };
        let torque = t.torque_max_n_m();
        let (om, vp, thrust) = (scale.speed_rad_s, scale.flow_m_s, scale.thrust_n);
        match self {
            CoulombFriction => {
                h.coulomb_nm = 0.5 * s * torque;
                h.stribeck_ratio = between(0, 1.0, 1.7);
                h.stribeck_speed_rad_s = between(1, 0.02, 0.09) * om;
            }
            ViscousFriction => h.viscous_nm_s = 0.5 * s * torque / om,
            WindageDrag => h.windage_nm_s2 = 0.5 * s * torque / (om * om),
            EntrainedWaterInertia | RotorInertiaError => h.extra_inertia_kg_m2 = 3.0 * s * t.inertia_kg_m2,
            AmplifierLag => h.extra_lag_s = 0.3 * s,
            TransportDelay => h.delay_s = 0.2 * s,
            CurrentSaturation => h.limit_loss = 0.7 * s,
            TorqueConstantSaturation => h.saturation = s,
            ThermalDriftKt => {
                h.thermal_loss = 0.9 * s;
                h.thermal_time_s = between(0, 20.0, 70.0);
            }
            VoltageLimitBackemf => h.voltage_limit_v = self.full_voltage(t, om) * (1.0 - 0.7 * s),
            SupplySag => {
                h.voltage_limit_v = self.full_voltage(t, om) * 1.02;
                let bus = torque * om / t.supply_v;
                h.source_resistance_ohm = 0.8 * s * h.voltage_limit_v / bus;
            }
            TorqueRippleCogging => {
                h.cogging_order = [4.0, 6.0, 7.0, 12.0, 14.0, 24.0][(u[0] * 5.99) as usize];
                h.cogging_phase_rad = between(1, 0.0, TAU);
                h.cogging_nm = s * torque;
                h.ripple_ratio = between(2, 0.0, 0.6) * s;
            }
            CommandDeadBand => h.dead_band_a = 0.5 * s * t.current_limit_a,
            AmbientAxialFlow => h.ambient_m_s = side(0) * s * vp,
            AmbientFlowUnsteady => {
                h.wave_m_s = 1.5 * s * vp;
                h.wave_hz = [between(0, 0.05, 0.12), between(1, 0.1, 0.2), between(2, 0.18, 0.3)];
                h.wave_phase_rad = [between(3, 0.0, TAU), between(4, 0.0, TAU), between(5, 0.0, TAU)];
            }
            TankRecirculation => {
                h.recirculation = 0.9 * s;
                h.recirculation_time_s = between(0, 2.0, 15.0);
            }
            DuctLoss => h.duct_loss = 4.0 * s,
            CrossFlow => {
                h.cross_flow_m_s = between(0, 0.15, 0.4) * vp;
                h.cross_flow_loss = s;
            }
            InertiaAddedMassError => h.extra_added_mass = 4.0 * s,
            RotationalFlow => {
                h.swirl = 2.0 * s;
                h.swirl_inertia = between(0, 0.2, 1.0).max(0.05 / h.swirl.max(1e-3));
            }
            NonsinusoidalLiftDrag => {
                h.profile_drag = 0.6 * s * t.drag_max;
                h.drag_harmonic = between(0, -0.2, 0.4) * s * t.drag_max;
                h.lift_harmonic = between(1, -0.5, 0.5) * s * t.lift_max;
            }
            BladeStall => {
                h.stall_loss = s;
                h.stall_angle_rad = between(0, 0.2, 0.33);
                h.stall_chords = between(1, 2.0, 10.0);
            }
            ForwardReverseAsymmetry => h.reverse_loss = (0.8 * s, between(0, -0.3, 0.8) * s),
            UnsteadyLiftLag => h.chord_m = 4.0 * s * t.radius_m,
            Ventilation => {
                h.ventilation_loss = s;
                h.ventilation_speed_rad_s = between(0, 0.6, 0.85) * om;
            }
            AirIngestion => {
                h.air_fraction = s;
                h.air_hz = [between(0, 0.05, 0.15), between(1, 0.2, 0.5)];
            }
            Cavitation => {
                h.cavitation_loss = 3.0 * s;
                h.cavitation_speed_m_s = between(0, 0.6, 0.8) * (0.7 * t.radius_m * om).hypot(vp);
            }
            WaterDensity => h.density_error = side(0) * s,
            ThrustBiasGainHysteresis => {
                h.thrust_bias_n = side(0) * s * thrust * between(1, 0.4, 1.0);
                h.thrust_gain = between(2, -1.0, 1.0) * s;
                h.thrust_play_n = between(3, 0.0, 0.5) * s * thrust;
            }
            ThrustSensorLag => h.thrust_lag_s = 0.3 * s,
            StandResonance => {
                h.stand_hz = between(0, 5.0, 30.0);
                h.stand_damping = between(1, 0.01, 0.05);
                h.stand_share = s.min(1.0);
            }
            FlowmeterOffsetLagLocation => {
                h.flow_bias_m_s = side(0) * between(1, 0.2, 1.0) * s * vp;
                h.flow_distance_m = between(2, 0.2, 2.0) * s * vp;
            }
            EncoderFilterLag => h.speed_lag_s = 0.3 * s,
            EncoderEccentricity => {
                h.encoder_order = if u[0] < 0.5 { 1.0 } else { 2.0 };
                h.encoder_phase_rad = between(1, 0.0, TAU);
                h.encoder_error_rad = 0.4 * s;
            }
            TorqueChannelBias => h.torque_bias_nm = side(0) * 0.5 * s * torque,
            ClockSkew => {
                h.skew_channel =
                    [SkewChannel::Thrust, SkewChannel::Speed, SkewChannel::Flow][(u[0] * 2.99) as usize];
                h.skew_s = 0.2 * s;
            }
        }
    }

    /// Voltage needed at the current limit and full speed, V.
    fn full_voltage(self, t: &Thruster, speed_rad_s: f64) -> f64 {
        t.winding_resistance_ohm * t.current_limit_a + t.torque_constant_nm_a * speed_rad_s
    }

    /// A random shape.
    pub fn shape(rng: &mut impl Rng) -> Shape {
        std::array::from_fn(|_| rng.random())
    }
}
