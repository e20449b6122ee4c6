//! What a controller knows of its thruster: the rig at its stated values, as plain numbers, with
//! the maps, slopes, inverses and time constants that the laws and observers are designed from.
//!
//! Every gain in this crate follows from these numbers by a bandwidth rule, so that one set of
//! options serves a 1 kW test stand and a 76 mm thruster alike.

mod bandwidth;
mod blades;
mod static_map;
mod swirl;
mod telling;

use kort_thruster::blade::{Blade, BladeRow};
use kort_thruster::effects::Scale;
use kort_thruster::rig::{AmplifierKind, Rig};
use thiserror::Error;

use crate::known::{self, FoilCurve, FrictionCurve};
pub use blades::{HeldLift, Slopes};
pub use static_map::StaticMap;
pub use swirl::Swirl;

/// Why a controller cannot be designed for a rig.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum ModelError {
    /// A dry shaft has no thrust to control.
    #[error(
        "rig `{rig}`: propeller.kind = \"none\" has no thrust to control, a control law needs a propeller\nhint: describe the propeller under [propeller]"
    )]
    NoPropeller {
        /// Name of the rig.
        rig: String,
    },
    /// The control period is not usable.
    #[error("control period {found_s} s is outside what is allowed: 0.00002 to 0.1\nhint: 0.001 for 1 kHz")]
    Period {
        /// What was asked for, s.
        found_s: f64,
    },
}

/// Tip speed that no thruster of this family is meant to pass, m/s; caps a rig whose drive states
/// neither current limit nor supply.
const TIP_SPEED_MAX_M_S: f64 = 60.0;

/// How late sensors are known to be in the mean beyond their stated filters, s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Late {
    /// Shaft speed.
    pub speed_s: f64,
    /// Thrust.
    pub thrust_s: f64,
    /// Axial flow.
    pub flow_s: f64,
}

/// The thruster as a controller sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControlModel {
    /// Blade row; its lift and drag are what adaptation moves. Call [`Self::refresh`] after.
    pub blade: Blade,
    /// The same with its products formed, for every load of every tick.
    row: BladeRow,
    /// Sine and cosine of the pitch.
    pitch: (f64, f64),
    /// Accelerated water `rho a l gam`, kg.
    pub added_mass_kg: f64,
    /// Water in the duct `rho a l`, kg.
    pub duct_water_kg: f64,
    /// Flux coefficient `dbeta`.
    pub flux_coefficient: f64,
    /// Inertia of motor, shaft and propeller, kg m^2.
    pub inertia_kg_m2: f64,
    /// Torque constant, N m/A; also the back-EMF constant, V s.
    pub torque_constant_nm_a: f64,
    /// Viscous friction, N m s.
    pub viscous_friction_nm_s: f64,
    /// Coulomb friction, N m, that a configuration adds to what the rig is known to have.
    pub coulomb_friction_n_m: f64,
    /// Friction beyond the viscous that the rig is known to have.
    pub known_friction: Option<FrictionCurve>,
    /// What the rig is known to have at its blades beyond the sinusoids of (17).
    pub foil: Option<FoilCurve>,
    /// What the blades' lift lacks at this moment, where it is known to build up: for the observers, who look at this moment.
    pub held_lift: Option<HeldLift>,
    /// Flux coefficient of a flow astern as a multiple of that ahead.
    pub flux_astern: f64,
    /// Force on the stand beyond the blades' thrust, as a share of it: less than zero where a hull takes some.
    pub stand_share: f64,
    /// The same by the square of the axial flow, kg/m: the duct's own thrust.
    pub stand_kg_m: f64,
    /// Ambient flow that the rig is known to stand in, m/s.
    pub ambient_mean_m_s: f64,
    /// Dead time between command and drive, s.
    pub delay_s: f64,
    /// Winding resistance, ohm.
    pub winding_resistance_ohm: Option<f64>,
    /// How the drive is commanded.
    pub amplifier: AmplifierKind,
    /// First-order lag of the drive, s.
    pub amplifier_lag_s: f64,
    /// Fastest change of current, A/s; infinite unless a configuration sets one.
    pub current_rate_a_s: f64,
    /// Largest current, A; finite: a rig that states none gets what its tip speed needs.
    pub current_limit_a: f64,
    /// Nominal supply, V.
    pub supply_v: Option<f64>,
    /// First-order filter on the measured speed, s, with what its sensor is known to be late beyond the stated one.
    pub speed_filter_s: f64,
    /// The same of the measured thrust, s.
    pub thrust_filter_s: f64,
    /// What each sensor is known to be late beyond its stated filter.
    pub late: Late,
    /// Quantum of the measured speed before its filter, rad/s, at the control period.
    pub speed_quantum_rad_s: f64,
    /// Quantum of the measured thrust, N.
    pub thrust_quantum_n: f64,
    /// Full scale of the force sensor, N, where stated.
    pub thrust_full_scale_n: Option<f64>,
    /// Samples a second of the flow meter, Hz, where stated.
    pub flow_rate_hz: Option<f64>,
    /// Rotational flow of the wake; `None` for Model 2.
    pub swirl: Option<Swirl>,
    /// Control period, s.
    pub period_s: f64,
    /// Static map at the current blade coefficients.
    pub map: StaticMap,
    /// Largest steady shaft speed in still water, rad/s.
    pub speed_max_rad_s: f64,
    /// Largest steady thrust in still water, N.
    pub thrust_max_n: f64,
    /// Longest step, s, at which an explicit second-order step of shaft and water stays accurate.
    pub step_max_s: f64,
    /// Thrust that comes with torque of the blades which the model does not explain, N/(N m) = 1/m; 0 where thrust is measured.
    pub thrust_per_torque_1_m: f64,
}

impl ControlModel {
    /// The model a rig states, for a control period.
    ///
    /// # Errors
    /// [`ModelError`] if the rig has no propeller or the period is out of range.
    pub fn from_rig(rig: &Rig, period_s: f64) -> Result<Self, ModelError> {
        if !(2e-5..=0.1).contains(&period_s) {
            return Err(ModelError::Period { found_s: period_s });
        }
        let blade = rig.blade().ok_or_else(|| ModelError::NoPropeller { rig: rig.name.clone() })?;
        let s = &rig.sensors;
        let counts = s.encoder_counts_per_rev.unwrap_or(65_536.0);
        let mut model = Self {
            blade,
            row: blade.row(),
            pitch: blade.pitch_rad.sin_cos(),
            added_mass_kg: rig.added_mass_kg(),
            duct_water_kg: rig.added_mass_kg() / rig.flow.added_mass_coefficient.value,
            flux_coefficient: rig.flow.flux_coefficient.value,
            inertia_kg_m2: rig.motor.inertia_kg_m2.value,
            torque_constant_nm_a: rig.motor.torque_constant_nm_a.value,
            viscous_friction_nm_s: rig.motor.viscous_friction_nm_s.map_or(0.0, |q| q.value),
            coulomb_friction_n_m: 0.0,
            known_friction: None,
            foil: None,
            held_lift: None,
            flux_astern: 1.0,
            stand_share: 0.0,
            stand_kg_m: 0.0,
            ambient_mean_m_s: 0.0,
            delay_s: 0.0,
            winding_resistance_ohm: rig.motor.winding_resistance_ohm.map(|q| q.value),
            amplifier: rig.amplifier.kind,
            amplifier_lag_s: rig.amplifier.time_constant_s.value,
            current_rate_a_s: f64::INFINITY,
            current_limit_a: rig.amplifier.current_limit_a,
            supply_v: rig.amplifier.supply_v,
            speed_filter_s: s.speed_filter_time_constant_s.unwrap_or(0.0),
            thrust_filter_s: s.thrust_filter_hz.map_or(0.0, |f| 1.0 / (std::f64::consts::TAU * f)),
            late: Late::default(),
            speed_quantum_rad_s: std::f64::consts::TAU / (counts * period_s),
            thrust_quantum_n: match (s.thrust_full_scale_n, s.thrust_bits) {
                (Some(scale), Some(bits)) => 2.0 * scale / 2f64.powi(bits as i32),
                _ => 0.0,
            },
            thrust_full_scale_n: s.thrust_full_scale_n,
            flow_rate_hz: s.flow_rate_hz,
            swirl: None,
            period_s,
            map: StaticMap { thrust_n_s2: 1.0, torque_n_m_s2: 1.0, flow_m: 0.0, astern: [1.0; 3] },
            speed_max_rad_s: 0.0,
            thrust_max_n: 0.0,
            step_max_s: 1e-3,
            thrust_per_torque_1_m: 0.0,
        };
        model.refresh();
        model.set_envelope();
        known::design(&mut model, rig);
        model.set_envelope();
        model.thrust_per_torque_1_m = model.thrust_told_by_torque(rig);
        Ok(model)
    }

    /// The rig's sizes in use, from which effects take theirs.
    pub fn scale(&self, rig: &Rig, duration_s: f64) -> Scale {
        Scale {
            shaft_speed_rad_s: self.speed_max_rad_s,
            torque_n_m: self.torque_constant_nm_a * self.current_limit_a,
            thrust_n: self.thrust_max_n,
            flow_m_s: self.map.flow_m * self.speed_max_rad_s,
            current_a: self.current_limit_a,
            command: match self.amplifier {
                AmplifierKind::Current => self.current_limit_a,
                AmplifierKind::Voltage => {
                    self.supply_v.unwrap_or(self.torque_constant_nm_a * self.speed_max_rad_s)
                }
                AmplifierKind::Speed => self.speed_max_rad_s,
            },
            supply_v: self.supply_v.unwrap_or(0.0),
            current_limit_a: rig.amplifier.current_limit_a,
            winding_resistance_ohm: rig.motor.winding_resistance_ohm.map_or(0.0, |r| r.value),
            inertia_kg_m2: self.inertia_kg_m2,
            tick_s: self.period_s,
            duration_s,
            clock_s: [0.0, duration_s],
            angle_known: true,
            turned_rad: f64::INFINITY,
            angle_rad: [0.0; 2],
            reverses: true,
        }
    }

    /// Makes all that follows from the blade's coefficients agree with them; call after changing them.
    pub fn refresh(&mut self) {
        self.row = self.blade.row();
        self.pitch = self.blade.pitch_rad.sin_cos();
        self.map = self.solve_static_map();
    }

    fn set_envelope(&mut self) {
        let tip = TIP_SPEED_MAX_M_S / self.blade.radius_m;
        if !self.current_limit_a.is_finite() {
            self.current_limit_a = self.map.torque_n_m_s2 * tip * tip / self.torque_constant_nm_a;
        }
        let by_current = (self.torque_constant_nm_a * self.current_limit_a / self.map.torque_n_m_s2).sqrt();
        // Where the supply runs out: ke Om + R i(Om) = V, with i = Q / kt.
        let by_voltage = self.supply_v.map_or(f64::INFINITY, |supply| {
            let r = self.winding_resistance_ohm.unwrap_or(0.0);
            let quadratic = r * self.map.torque_n_m_s2 / self.torque_constant_nm_a;
            let linear = self.torque_constant_nm_a;
            if quadratic > 0.0 {
                (-linear + (linear * linear + 4.0 * quadratic * supply).sqrt()) / (2.0 * quadratic)
            } else {
                supply / linear
            }
        });
        self.speed_max_rad_s = tip.min(by_current).min(by_voltage);
        self.thrust_max_n = self.map.thrust_n(self.speed_max_rad_s);
        let (_, fast) = self.poles_per_rad();
        self.step_max_s = (0.4 / (fast * self.speed_max_rad_s)).min(2.5e-3);
    }

    /// Outflow of momentum `dbeta rho a` for the sign of a flow, kg/m.
    pub fn flux_kg_m(&self, flow_m_s: f64) -> f64 {
        let side = if flow_m_s < 0.0 { self.flux_astern } else { 1.0 };
        side * self.flux_coefficient * self.blade.density_kg_m3 * self.blade.area_m2()
    }

    /// Thrust of the blades that makes the stand feel a thrust in an axial flow, N.
    pub fn blade_thrust_n(&self, net_n: f64, flow_m_s: f64) -> f64 {
        (net_n - self.stand_kg_m * flow_m_s * flow_m_s.abs()) / (1.0 + self.stand_share)
    }

    /// What the stand feels of the blades' thrust in an axial flow, N.
    pub fn net_thrust_n(&self, blade_n: f64, flow_m_s: f64) -> f64 {
        blade_n * (1.0 + self.stand_share) + self.stand_kg_m * flow_m_s * flow_m_s.abs()
    }

    /// Friction torque at a shaft speed, N m; the sign is smoothed over half a percent of top speed.
    pub fn friction_n_m(&self, speed_rad_s: f64) -> f64 {
        let viscous = self.viscous_friction_nm_s * speed_rad_s;
        if self.coulomb_friction_n_m == 0.0 && self.known_friction.is_none() {
            return viscous;
        }
        viscous + self.coulomb_friction_n_m * self.turning(speed_rad_s) + self.known_friction_n_m(speed_rad_s)
    }

    /// Friction beyond the viscous that the rig is known to have, N m.
    pub fn known_friction_n_m(&self, speed_rad_s: f64) -> f64 {
        self.known_friction.map_or(0.0, |curve| curve.at_n_m(speed_rad_s, self.turning(speed_rad_s)))
    }

    /// The sign of a shaft speed, smoothed over half a percent of top speed.
    pub fn turning(&self, speed_rad_s: f64) -> f64 {
        speed_rad_s / (speed_rad_s.abs() + 0.005 * self.speed_max_rad_s)
    }

    /// Which way the shaft turns, -1 to 1: smoothed over a hundredth of top speed.
    pub fn sense(&self, speed_rad_s: f64) -> f64 {
        speed_rad_s / (speed_rad_s.abs() + 0.01 * self.speed_max_rad_s)
    }

    /// Shaft speed squared with its sign, as a share of top speed's: how the blades' torque grows.
    pub fn square(&self, speed_rad_s: f64) -> f64 {
        speed_rad_s * speed_rad_s.abs() / (self.speed_max_rad_s * self.speed_max_rad_s)
    }

    /// Acceleration of the axial flow, m/s^2: (6a) with thrust and ambient flow.
    pub fn flow_acceleration(&self, thrust_n: f64, flow_m_s: f64, ambient_m_s: f64) -> f64 {
        let flux = self.flux_kg_m(flow_m_s);
        (thrust_n - flux * (flow_m_s - ambient_m_s) * flow_m_s.abs()) / self.added_mass_kg
    }
}

#[cfg(test)]
pub(crate) mod tests;
