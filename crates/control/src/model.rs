//! What a controller knows of its thruster: the rig at its stated values, as plain numbers, with
//! the maps, slopes, inverses and time constants that the laws and observers are designed from.
//!
//! Every gain in this crate follows from these numbers by a bandwidth rule, so that one set of
//! options serves a 1 kW test stand and a 76 mm thruster alike.

use kort_thruster::blade::{self, Blade, BladeLoad, BladeRow, Inflow};
use kort_thruster::effects::Scale;
use kort_thruster::rig::{AmplifierKind, Rig};
use thiserror::Error;

use crate::known::{self, FoilCurve, FrictionCurve};

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

/// Rotational flow of the wake (docs/theory.md, after Bachmayer, Whitcomb & Grosenbaugh 2000).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Swirl {
    /// Drag coefficient of the swirl, `dbr`.
    pub drag: f64,
    /// Ratio of the swirling water's inertia to the duct's water, `gr`.
    pub inertia: f64,
}

/// Thrust and torque with their slopes at one working point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Slopes {
    /// Thrust, N.
    pub thrust_n: f64,
    /// Torque, N m.
    pub torque_n_m: f64,
    /// dT/dut, N s/m.
    pub thrust_by_tangential: f64,
    /// dT/dvp, N s/m.
    pub thrust_by_axial: f64,
    /// dQ/dut, N s.
    pub torque_by_tangential: f64,
    /// dQ/dvp, N s.
    pub torque_by_axial: f64,
}

/// Static map of the bollard steady state: thrust and torque over shaft speed squared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StaticMap {
    /// `T / Om|Om|`, N s^2.
    pub thrust_n_s2: f64,
    /// `Q / Om|Om|`, N m s^2.
    pub torque_n_m_s2: f64,
    /// `vp / Om`, m.
    pub flow_m: f64,
    /// The three turning astern as multiples of those ahead: 1 unless the rig is known to differ.
    pub astern: [f64; 3],
}

impl StaticMap {
    /// A multiple of one side: of thrust (0), torque (1) or flow (2), by the sign of thrust or speed.
    fn side(&self, of: usize, sign: f64) -> f64 {
        if sign < 0.0 { self.astern[of] } else { 1.0 }
    }

    /// Torque of the blades at a shaft speed in still water, N m.
    pub fn torque_n_m(&self, speed_rad_s: f64) -> f64 {
        self.torque_n_m_s2 * self.side(1, speed_rad_s) * speed_rad_s * speed_rad_s.abs()
    }

    /// Axial flow at a shaft speed in still water, m/s.
    pub fn flow_m_s(&self, speed_rad_s: f64) -> f64 {
        self.flow_m * self.side(2, speed_rad_s) * speed_rad_s
    }

    /// Shaft speed that gives a thrust in still water, rad/s.
    pub fn speed_rad_s(&self, thrust_n: f64) -> f64 {
        (thrust_n.abs() / (self.thrust_n_s2 * self.side(0, thrust_n))).sqrt().copysign(thrust_n)
    }

    /// Thrust that a shaft speed gives in still water, N.
    pub fn thrust_n(&self, speed_rad_s: f64) -> f64 {
        self.thrust_n_s2 * self.side(0, speed_rad_s) * speed_rad_s * speed_rad_s.abs()
    }

    /// Torque a thrust costs in still water, N m: (20) of the paper, whatever the level.
    pub fn torque_for_thrust_n_m(&self, thrust_n: f64) -> f64 {
        thrust_n * self.torque_n_m_s2 * self.side(1, thrust_n) / (self.thrust_n_s2 * self.side(0, thrust_n))
    }
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
    /// First-order filter on the measured speed, s.
    pub speed_filter_s: f64,
    /// First-order filter on the measured thrust, s.
    pub thrust_filter_s: f64,
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
        };
        model.refresh();
        model.set_envelope();
        known::design(&mut model, rig);
        model.set_envelope();
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
            winding_resistance_ohm: rig.motor.winding_resistance_ohm.map_or(0.0, |r| r.value),
            inertia_kg_m2: self.inertia_kg_m2,
            tick_s: self.period_s,
            duration_s,
            angle_recorded: true,
        }
    }

    /// Makes all that follows from the blade's coefficients agree with them; call after changing them.
    pub fn refresh(&mut self) {
        self.row = self.blade.row();
        self.pitch = self.blade.pitch_rad.sin_cos();
        self.map = self.solve_static_map();
    }

    /// The same thruster with rotational flow, lift and drag moved so that the static map stays
    /// where the rig states it: the rig's coefficients were identified without swirl.
    ///
    /// Thrust fixes the flow, torque the swirl; both are then linear in the two coefficients. If
    /// no positive pair does it, the coefficients stay and the map moves.
    pub fn with_swirl(mut self, swirl: Swirl) -> Self {
        let (t, q, vp) = (self.map.thrust_n_s2, self.map.torque_n_m_s2, self.map.flow_m);
        let (s, c) = self.blade.pitch_rad.sin_cos();
        let lever = self.blade.lever_m();
        let k = self.blade.density_kg_m3 * self.blade.area_m2();
        let ut = lever - q / (lever * swirl.drag * k * vp);
        let (wn, wc) = (ut * s - vp * c, ut * c + vp * s);
        let scale = k * wn / ut.hypot(vp);
        let (t, q) = (t / scale, q / (scale * lever));
        // t = CL wc ut - CD wn vp, q = CL wc vp + CD wn ut
        let speed2 = ut * ut + vp * vp;
        let lift = (t * ut + q * vp) / (wc * speed2);
        let drag = (q * ut - t * vp) / (wn * speed2);
        if wn > 0.0 && lift > 0.0 && drag >= 0.0 && lift.is_finite() && drag.is_finite() {
            (self.blade.lift_max, self.blade.drag_max) = (lift, drag);
        }
        self.swirl = Some(swirl);
        self.refresh();
        self
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

    /// Steady state in still water, ahead and astern.
    fn solve_static_map(&self) -> StaticMap {
        let ahead = self.solve_side(1.0);
        if self.foil.is_none() && self.flux_astern == 1.0 {
            return ahead;
        }
        let astern = self.solve_side(-1.0);
        StaticMap {
            astern: [
                astern.thrust_n_s2 / ahead.thrust_n_s2,
                astern.torque_n_m_s2 / ahead.torque_n_m_s2,
                astern.flow_m / ahead.flow_m,
            ],
            ..ahead
        }
    }

    /// One side of it. Everything is quadratic in speed, so one ratio `vp / ut` (and
    /// one of swirl) holds at every level; found by bisection between no flow and the pitch angle.
    fn solve_side(&self, side: f64) -> StaticMap {
        let lever = self.blade.lever_m();
        let flux = self.flux_kg_m(side);
        let surplus = |ratio: f64| {
            let swirl = self.steady_swirl(side, side * ratio);
            let load = self.row_load(side - swirl, side * ratio);
            (side * load.thrust_n - flux * ratio * ratio, load)
        };
        let (mut low, mut high) = (0.0, self.blade.pitch_rad.tan());
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if surplus(middle).0 > 0.0 { low = middle } else { high = middle }
        }
        let ratio = 0.5 * (low + high);
        let load = surplus(ratio).1;
        StaticMap {
            thrust_n_s2: (side * load.thrust_n * lever * lever).max(1e-12),
            torque_n_m_s2: (side * load.torque_n_m * lever * lever).max(1e-15),
            flow_m: ratio * lever,
            astern: [1.0; 3],
        }
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

    /// Swirl speed that the blades' torque keeps up, m/s: `Q(ut - us, vp)/re = dbr rho a |vp| us`.
    /// Zero without rotational flow.
    pub fn steady_swirl(&self, tangential_m_s: f64, axial_m_s: f64) -> f64 {
        let Some(law) = self.swirl_law() else { return 0.0 };
        let (mut low, mut high) = (tangential_m_s.min(0.0), tangential_m_s.max(0.0));
        for _ in 0..30 {
            let us = 0.5 * (low + high);
            let q = self.row_load(tangential_m_s - us, axial_m_s).torque_n_m;
            if law.acceleration(q, axial_m_s, us, 0.0) > 0.0 { low = us } else { high = us }
        }
        0.5 * (low + high)
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

    /// Thrust and torque at a shaft speed, flow and swirl.
    pub fn load(&self, speed_rad_s: f64, flow_m_s: f64, swirl_m_s: f64) -> BladeLoad {
        self.row_load(self.row.lever_m * speed_rad_s - swirl_m_s, flow_m_s)
    }

    #[inline]
    fn row_load(&self, tangential_m_s: f64, axial_m_s: f64) -> BladeLoad {
        match &self.foil {
            None => self.row.load(tangential_m_s, axial_m_s),
            Some(curve) => curve.load(&self.row, Inflow { tangential_m_s, axial_m_s }),
        }
    }

    /// Slopes of blades with a curve of their own, by differences.
    #[cold]
    fn differences(&self, ut: f64, vp: f64) -> Slopes {
        let h = 1e-4 * ut.hypot(vp);
        let load = |ut, vp| self.row_load(ut, vp);
        let (now, by_ut, by_vp) =
            (load(ut, vp), [load(ut - h, vp), load(ut + h, vp)], [load(ut, vp - h), load(ut, vp + h)]);
        let thrust = |of: [BladeLoad; 2]| 0.5 * (of[1].thrust_n - of[0].thrust_n) / h;
        let torque = |of: [BladeLoad; 2]| 0.5 * (of[1].torque_n_m - of[0].torque_n_m) / h;
        Slopes {
            thrust_n: now.thrust_n,
            torque_n_m: now.torque_n_m,
            thrust_by_tangential: thrust(by_ut),
            thrust_by_axial: thrust(by_vp),
            torque_by_tangential: torque(by_ut),
            torque_by_axial: torque(by_vp),
        }
    }

    /// Thrust and torque with their slopes, from differentiating the singularity-free form.
    pub fn slopes(&self, inflow: Inflow) -> Slopes {
        let (ut, vp) = (inflow.tangential_m_s, inflow.axial_m_s);
        let v2 = ut * ut + vp * vp;
        if v2 < 1e-18 {
            return Slopes::default();
        }
        if self.foil.is_some() {
            return self.differences(ut, vp);
        }
        // One division: every slope of every tick passes here.
        let by_v = 1.0 / v2.sqrt();
        let (s, c) = self.pitch;
        let (cl, cd) = (self.blade.lift_max, self.blade.drag_max);
        let wn = ut * s - vp * c;
        let wc = ut * c + vp * s;
        let g = wn * by_v;
        let by_v3 = by_v * by_v * by_v;
        let (g_ut, g_vp) = ((s * v2 - wn * ut) * by_v3, (-c * v2 - wn * vp) * by_v3);
        let t = cl * wc * ut - cd * wn * vp;
        let q = cl * wc * vp + cd * wn * ut;
        let (t_ut, t_vp) = (cl * (c * ut + wc) - cd * s * vp, cl * s * ut - cd * (wn - c * vp));
        let (q_ut, q_vp) = (cl * c * vp + cd * (s * ut + wn), cl * (s * vp + wc) - cd * c * ut);
        let k = self.blade.density_kg_m3 * self.blade.area_m2();
        let kq = k * self.blade.lever_m();
        Slopes {
            thrust_n: k * g * t,
            torque_n_m: kq * g * q,
            thrust_by_tangential: k * (g_ut * t + g * t_ut),
            thrust_by_axial: k * (g_vp * t + g * t_vp),
            torque_by_tangential: kq * (g_ut * q + g * q_ut),
            torque_by_axial: kq * (g_vp * q + g * q_vp),
        }
    }

    /// Acceleration of the axial flow, m/s^2: (6a) with thrust and ambient flow.
    pub fn flow_acceleration(&self, thrust_n: f64, flow_m_s: f64, ambient_m_s: f64) -> f64 {
        let flux = self.flux_kg_m(flow_m_s);
        (thrust_n - flux * (flow_m_s - ambient_m_s) * flow_m_s.abs()) / self.added_mass_kg
    }

    /// The swirl law with this model's coefficients; `None` without rotational flow.
    fn swirl_law(&self) -> Option<blade::Swirl> {
        self.swirl.map(|swirl| blade::Swirl {
            share: 1.0,
            mass_kg: self.swirl_mass_kg(swirl),
            flux_kg_m: swirl.drag * self.blade.density_kg_m3 * self.blade.area_m2(),
            lever_m: self.row.lever_m,
        })
    }

    /// Acceleration of the swirl, m/s^2; zero without rotational flow.
    pub fn swirl_acceleration(&self, torque_n_m: f64, flow_m_s: f64, swirl_m_s: f64) -> f64 {
        self.swirl_law().map_or(0.0, |law| law.acceleration(torque_n_m, flow_m_s, swirl_m_s, 0.0))
    }

    /// How fast the axial flow washes the swirl out, 1/s; zero without rotational flow.
    pub fn swirl_decay_per_s(&self, flow_m_s: f64) -> f64 {
        self.swirl_law().map_or(0.0, |law| law.decay_1_s(flow_m_s))
    }

    /// Mass of the swirling water at 0.7 radius, kg: `rho a l gr`.
    pub fn swirl_mass_kg(&self, swirl: Swirl) -> f64 {
        (self.duct_water_kg * swirl.inertia).max(1e-9)
    }

    /// Shaft speed at which the blades give a thrust in a given flow and swirl, rad/s (D4).
    ///
    /// Thrust rises strictly with shaft speed at fixed flow, so a bracket and a safeguarded Newton
    /// step find the one root; `warm_rad_s` is where to start.
    pub fn speed_for_thrust_rad_s(
        &self,
        thrust_n: f64,
        flow_m_s: f64,
        swirl_m_s: f64,
        warm_rad_s: f64,
    ) -> f64 {
        if thrust_n == 0.0 && flow_m_s == 0.0 && swirl_m_s == 0.0 {
            return 0.0;
        }
        let lever = self.blade.lever_m();
        let bound = 1.5 * self.speed_max_rad_s;
        let (mut low, mut high) = (-bound, bound);
        let mut speed = warm_rad_s.clamp(low, high);
        let tolerance = 1e-7 * self.thrust_max_n;
        for _ in 0..40 {
            let s = self.slopes(self.blade.inflow(speed, flow_m_s, swirl_m_s));
            let error = s.thrust_n - thrust_n;
            if error.abs() < tolerance {
                break;
            }
            if error > 0.0 {
                high = speed
            } else {
                low = speed
            }
            let slope = s.thrust_by_tangential * lever;
            let newton = speed - error / slope;
            speed = if slope > 0.0 && newton > low && newton < high { newton } else { 0.5 * (low + high) };
            if high - low < 1e-9 * bound {
                break;
            }
        }
        speed
    }

    /// Rate of the slow (flow) pole per unit of shaft speed, 1/rad: by similarity the poles of the
    /// bollard state grow in proportion to shaft speed. `.0` slow, `.1` fast.
    pub fn poles_per_rad(&self) -> (f64, f64) {
        let v = self.map.flow_m;
        let s = self.slopes(self.blade.inflow(1.0, v, self.steady_swirl(self.blade.lever_m(), v)));
        let lever = self.blade.lever_m();
        let flux = self.flux_coefficient * self.blade.density_kg_m3 * self.blade.area_m2();
        let a = -lever * s.torque_by_tangential / self.inertia_kg_m2;
        let b = -s.torque_by_axial / self.inertia_kg_m2;
        let c = lever * s.thrust_by_tangential / self.added_mass_kg;
        let d = (s.thrust_by_axial - 2.0 * flux * v) / self.added_mass_kg;
        let (half_trace, det) = (0.5 * (a + d), a * d - b * c);
        let root = (half_trace * half_trace - det).max(0.0).sqrt();
        let (slow, fast) = ((half_trace + root).abs(), (half_trace - root).abs());
        (slow.max(1e-6), fast.max(1e-6))
    }

    /// Lags between a torque command and a measured speed besides the shaft itself, s: drive,
    /// speed filter, and one and a half periods of hold and differencing with the drive's dead time.
    pub fn loop_lags_s(&self) -> [f64; 3] {
        [self.amplifier_lag_s, self.speed_filter_s, 1.5 * self.period_s + self.delay_s]
    }

    /// Crossover that a speed loop may have for a phase margin, rad/s, and the gain that gives it,
    /// N m s: the shaft as an integrator, the lags of [`Self::loop_lags_s`] (D2).
    pub fn speed_loop(&self, phase_margin_rad: f64) -> (f64, f64) {
        let [drive, filter, delay] = self.loop_lags_s();
        let allowed = std::f64::consts::FRAC_PI_2 - phase_margin_rad;
        let lag = |w: f64| (w * drive).atan() + (w * filter).atan() + w * delay;
        let (mut low, mut high) = (0.1, 0.2 * std::f64::consts::PI / self.period_s);
        for _ in 0..60 {
            let w = 0.5 * (low + high);
            if lag(w) < allowed { low = w } else { high = w }
        }
        let w = low;
        let loss = (1.0 + (w * drive).powi(2)).sqrt() * (1.0 + (w * filter).powi(2)).sqrt();
        (w, self.inertia_kg_m2 * w * loss)
    }
}

#[cfg(test)]
pub(crate) mod tests;
