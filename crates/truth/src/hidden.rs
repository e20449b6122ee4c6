//! Hidden physics: every number that an effect may set. All zero means nothing is hidden.

/// Parameters of hidden physics in SI units. Torques act on the shaft, against positive rotation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Hidden {
    // shaft
    /// Coulomb friction, N m.
    pub coulomb_nm: f64,
    /// Static over Coulomb friction.
    pub stribeck_ratio: f64,
    /// Stribeck speed, rad/s.
    pub stribeck_speed_rad_s: f64,
    /// Viscous friction, N m s.
    pub viscous_nm_s: f64,
    /// Quadratic disc drag, N m s2.
    pub windage_nm_s2: f64,
    /// Inertia beyond the stated one, kg m2.
    pub extra_inertia_kg_m2: f64,
    /// Torque bias of the current or torque channel, N m.
    pub torque_bias_nm: f64,
    /// Cogging amplitude, N m.
    pub cogging_nm: f64,
    /// Ripple amplitude per motor torque.
    pub ripple_ratio: f64,
    /// Cogging periods in a revolution.
    pub cogging_order: f64,
    /// Cogging phase, rad.
    pub cogging_phase_rad: f64,
    // drive
    /// Amplifier lag beyond the stated one, s.
    pub extra_lag_s: f64,
    /// Dead time of the command, s.
    pub delay_s: f64,
    /// Share of the current limit that is missing.
    pub limit_loss: f64,
    /// Loss of torque constant at the current limit by saturation.
    pub saturation: f64,
    /// Loss of torque constant at full winding temperature.
    pub thermal_loss: f64,
    /// Winding time constant, s.
    pub thermal_time_s: f64,
    /// Voltage available over winding and back-EMF, V (zero: no limit).
    pub voltage_limit_v: f64,
    /// Cable and source resistance, ohm.
    pub source_resistance_ohm: f64,
    /// Command dead band, A.
    pub dead_band_a: f64,
    // flow
    /// Constant ambient flow, m/s.
    pub ambient_m_s: f64,
    /// Amplitude of slow ambient flow, m/s.
    pub wave_m_s: f64,
    /// Frequencies of the slow ambient flow, Hz.
    pub wave_hz: [f64; 3],
    /// Phases of the slow ambient flow, rad.
    pub wave_phase_rad: [f64; 3],
    /// Share of the jet that comes back.
    pub recirculation: f64,
    /// Time of the tank's circulation, s.
    pub recirculation_time_s: f64,
    /// Addition to the flux coefficient by duct loss.
    pub duct_loss: f64,
    /// Transverse flow, m/s, and its coefficient.
    pub cross_flow_m_s: f64,
    /// Coefficient of the cross-flow thrust loss.
    pub cross_flow_loss: f64,
    /// Relative addition to the added mass.
    pub extra_added_mass: f64,
    // blade
    /// Inverse of the swirl damping coefficient (zero: no swirl).
    pub swirl: f64,
    /// Inertia coefficient of the swirling water.
    pub swirl_inertia: f64,
    /// Profile drag coefficient.
    pub profile_drag: f64,
    /// Second harmonic of lift and drag over the angle of attack.
    pub lift_harmonic: f64,
    /// Second harmonic of the drag.
    pub drag_harmonic: f64,
    /// Lift lost in full separation.
    pub stall_loss: f64,
    /// Angle of attack of half separation, rad.
    pub stall_angle_rad: f64,
    /// Chords travelled until separation settles.
    pub stall_chords: f64,
    /// Lift and drag lost in reverse rotation.
    pub reverse_loss: (f64, f64),
    /// Chord for the growth of lift, m (zero: instant lift).
    pub chord_m: f64,
    /// Thrust and torque lost when ventilated.
    pub ventilation_loss: f64,
    /// Shaft speed at which ventilation starts, rad/s (ends at 0.7 of it).
    pub ventilation_speed_rad_s: f64,
    /// Largest air fraction in the water.
    pub air_fraction: f64,
    /// Frequencies with which the air comes and goes, Hz.
    pub air_hz: [f64; 2],
    /// Lift and drag lost by cavitation.
    pub cavitation_loss: f64,
    /// Section speed at 0.7 r at which cavitation starts, m/s.
    pub cavitation_speed_m_s: f64,
    /// Relative error of the stated density.
    pub density_error: f64,
    // sensors
    /// Thrust sensor bias, N.
    pub thrust_bias_n: f64,
    /// Thrust sensor gain error.
    pub thrust_gain: f64,
    /// Half width of the thrust sensor's play, N.
    pub thrust_play_n: f64,
    /// Lag of the thrust sensor beyond the stated filter, s.
    pub thrust_lag_s: f64,
    /// Natural frequency of the stand, Hz, and the share of the force that goes through it.
    pub stand_hz: f64,
    /// Damping ratio of the stand.
    pub stand_damping: f64,
    /// Share of the thrust that the stand's resonance carries.
    pub stand_share: f64,
    /// Flow meter bias, m/s.
    pub flow_bias_m_s: f64,
    /// Flow meter gain error.
    pub flow_gain: f64,
    /// Distance of the flow meter downstream, m.
    pub flow_distance_m: f64,
    /// Lag of the speed filter beyond the stated one, s.
    pub speed_lag_s: f64,
    /// Encoder error amplitude, rad, its order and phase.
    pub encoder_error_rad: f64,
    /// Encoder error periods in a revolution.
    pub encoder_order: f64,
    /// Encoder error phase, rad.
    pub encoder_phase_rad: f64,
    /// Lateness of one channel, s.
    pub skew_s: f64,
    /// Growth of that lateness, s/s.
    pub skew_drift: f64,
    /// Which channel is late.
    pub skew_channel: SkewChannel,
    // outside the catalogue
    /// Physics that no catalogue names.
    pub unknown: Unknown,
    /// Its size, in the unit of the term it scales.
    pub unknown_size: f64,
    /// Its shape number (exponent, period, switching time; see [`Unknown`]).
    pub unknown_shape: f64,
}

/// The channel that a skewed clock stamps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SkewChannel {
    /// Thrust.
    #[default]
    Thrust,
    /// Shaft speed and angle.
    Speed,
    /// Axial flow.
    Flow,
}

/// Physics outside the catalogue. `size` and `shape` are [`Hidden::unknown_size`] and
/// [`Hidden::unknown_shape`]; speeds and flows are relative to the largest of the run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Unknown {
    /// Nothing.
    #[default]
    None,
    /// Shaft load `size` times a sine of `shape` times the relative shaft speed.
    SineLoad,
    /// Shaft load `size` times |axial flow| times the sign of rotation.
    FlowLoad,
    /// Thrust term `size` times speed squared times flow.
    CrossThrust,
    /// Friction over several revolutions (period `shape` rad) that fades in a third of the run.
    FadingRub,
    /// A one-sided load from time `shape` on.
    SwitchedLoad,
    /// Thrust step of `size` while the relative flow is above `shape`.
    FlowStep,
    /// Shaft load with the cube of flow past a threshold `shape`, one direction only.
    OneWayBrake,
}

impl Unknown {
    /// All of them but `None`.
    pub const ALL: [Unknown; 7] = [
        Unknown::SineLoad,
        Unknown::FlowLoad,
        Unknown::CrossThrust,
        Unknown::FadingRub,
        Unknown::SwitchedLoad,
        Unknown::FlowStep,
        Unknown::OneWayBrake,
    ];

    /// Name in the sealed answer.
    pub fn id(self) -> &'static str {
        match self {
            Unknown::None => "none",
            Unknown::SineLoad => "sine_of_speed_load",
            Unknown::FlowLoad => "flow_dependent_load",
            Unknown::CrossThrust => "speed_squared_flow_thrust",
            Unknown::FadingRub => "fading_periodic_rub",
            Unknown::SwitchedLoad => "switched_load",
            Unknown::FlowStep => "flow_dependent_thrust_step",
            Unknown::OneWayBrake => "one_way_brake",
        }
    }

    /// Path on which it acts, in the report's words.
    pub fn path(self) -> &'static str {
        match self {
            Unknown::CrossThrust | Unknown::FlowStep => "blade",
            _ => "shaft",
        }
    }
}
