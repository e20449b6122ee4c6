//! The equations that adaptation learns from.
//!
//! Reference: docs/control.md D9. With `W = rho a wn / V`:
//! ```text
//! thrust    T                      = W [wc ut, -wn vp] [CL, CD]
//! torque    kt im - I Om' - Qf     = re W [wc vp,  wn ut] [CL, CD]
//! momentum  T - m vp'              = rho a (vp - va)|vp| dbeta
//! ```
//! Both sides pass `lam/(s + lam)`, so that no derivative is taken: `F[x'] = lam (x - F[x])`. The
//! flow comes from the momentum balance under the *measured* thrust, pulled by the flow meter
//! where there is one: it does not depend on lift and drag, which are being learnt. With a meter the
//! flux coefficient is learnt too, and the balance runs on its newest value: what is left between
//! balance and meter, `m` times the pull, is that coefficient's error (an adaptive observer).
//!
//! Assumes: inertia, torque constant, friction and added mass known; still water unless the ambient
//! flow is measured. Needs measured: shaft speed, current, thrust; a flow meter helps in ambient flow.
//! Fails: an ambient flow that nothing measures is learnt as lift, drag and flux; so is a force sensor's bias.
//!
//! Equations are divided by full thrust and torque, coefficients by their stated values. A
//! windowed Gram matrix of the equations' own directions (scaled to the level of operation) says
//! whether lift and drag are both seen.

use serde::{Deserialize, Serialize};

use super::{AdaptationOptions, COEFFICIENTS, EstimatorInput};
use crate::model::ControlModel;

/// How fast the flow meter pulls the momentum balance, 1/s.
const METER_PULL_PER_S: f64 = 3.0;

/// Why adaptation stands still.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Freeze {
    /// A limit is in force or a measurement was gated.
    Suspect,
    /// The windowed Gram matrix is singular.
    NoExcitation,
    /// Speed or thrust is not measured; torque alone cannot tell a coefficient from inflow.
    NotMeasured,
}

/// One scalar equation `y = phi . ratio`, as a share of full scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Equation {
    /// Left side.
    pub y: f64,
    /// Regressor.
    pub phi: [f64; COEFFICIENTS],
    /// Share of a coefficient's error that shows in the residual: the balance that gives the flow
    /// follows a wrong flux coefficient, and the meter pulls it back only in part.
    pub shows: f64,
    /// Whether it may be learnt from.
    pub valid: bool,
}

impl Default for Equation {
    fn default() -> Self {
        Self { y: 0.0, phi: [0.0; COEFFICIENTS], shows: 1.0, valid: false }
    }
}

impl Equation {
    /// Filters both sides by the same share; `derived` is the part of y that is filtered already.
    fn step(&mut self, held: &mut f64, y: f64, phi: [f64; COEFFICIENTS], share: f64, derived: f64) {
        *held += (y - *held) * share;
        for (state, input) in self.phi.iter_mut().zip(phi) {
            *state += (input - *state) * share;
        }
        self.y = *held - derived;
    }
}

/// Filters and windows.
#[derive(Clone, Copy, Debug)]
pub struct Regression {
    lambda_rad_s: f64,
    window_s: f64,
    every_s: f64,
    since_s: f64,
    suspect_s: f64,
    started: bool,
    flow_m_s: f64,
    /// Estimated thrust behind the force sensor's filter, N.
    felt_n: f64,
    filtered_speed_rad_s: f64,
    filtered_flow_m_s: f64,
    equations: [Equation; 3],
    held: [f64; 3],
    gram: [f64; 3],
    excitation_min: f64,
}

impl Regression {
    /// Filters at rest.
    pub fn new(model: &ControlModel, options: &AdaptationOptions) -> Self {
        let lambda = 0.5 * model.poles_per_rad().0 * model.speed_max_rad_s;
        Self {
            lambda_rad_s: lambda,
            window_s: 12.0 / lambda,
            every_s: (10.0 * model.period_s).max(0.01),
            since_s: 0.0,
            suspect_s: 0.0,
            started: false,
            flow_m_s: 0.0,
            felt_n: 0.0,
            filtered_speed_rad_s: 0.0,
            filtered_flow_m_s: 0.0,
            equations: [Equation::default(); 3],
            held: [0.0; 3],
            gram: [0.0; 3],
            excitation_min: options.excitation_min,
        }
    }

    /// Advances the filters; every hundredth of a second gives the equations or why there are none.
    /// `flux_ratio` is the flux coefficient as learnt so far over the stated one.
    pub fn tick(&mut self, input: &EstimatorInput, flux_ratio: f64) -> Option<Result<[Equation; 3], Freeze>> {
        let (model, dt) = (input.nominal, input.dt_s);
        let Some(speed) = input.measured.shaft_speed_rad_s else { return Some(Err(Freeze::NotMeasured)) };
        let thrust = self.prompt_thrust_n(input);
        // Shaft and water may move already: a filter that starts at rest would see that as acceleration.
        if !std::mem::replace(&mut self.started, true) {
            self.flow_m_s = input.measured.flow_m_s.unwrap_or(input.estimate.flow_m_s.value);
            (self.filtered_speed_rad_s, self.filtered_flow_m_s) = (speed, self.flow_m_s);
        }
        self.advance_flow(input, thrust, flux_ratio);
        self.filter(model, input, speed, thrust);
        // Filters remember a suspect tick for a while, so that it must not be learnt from later.
        self.suspect_s = if input.suspect { 2.0 / self.lambda_rad_s } else { (self.suspect_s - dt).max(0.0) };
        self.since_s += dt;
        if self.since_s < self.every_s {
            return None;
        }
        self.since_s = 0.0;
        self.weigh();
        Some(if thrust.is_none() {
            Err(Freeze::NotMeasured)
        } else if self.suspect_s > 0.0 {
            Err(Freeze::Suspect)
        } else if !self.excited() {
            Err(Freeze::NoExcitation)
        } else {
            Ok(self.equations)
        })
    }

    /// The measured thrust with what its filter still hides, as the observer expects it, N: the equations know no filter.
    fn prompt_thrust_n(&mut self, input: &EstimatorInput) -> Option<f64> {
        let expected = input.estimate.thrust_n.value;
        self.felt_n += (expected - self.felt_n) * input.dt_s / (input.nominal.thrust_filter_s + input.dt_s);
        input.measured.thrust_n.map(|thrust| thrust + expected - self.felt_n)
    }

    fn advance_flow(&mut self, input: &EstimatorInput, thrust: Option<f64>, flux_ratio: f64) {
        let (model, dt) = (input.nominal, input.dt_s);
        let Some(thrust) = thrust else {
            self.flow_m_s = input.estimate.flow_m_s.value;
            return;
        };
        let ambient = input.measured.ambient_m_s.unwrap_or(0.0);
        let flux = flux_ratio * model.flux_coefficient * model.blade.density_kg_m3 * model.blade.area_m2();
        let rate = (thrust - flux * (self.flow_m_s - ambient) * self.flow_m_s.abs()) / model.added_mass_kg;
        let decay = 2.0 * flux * self.flow_m_s.abs() / model.added_mass_kg;
        let pull = input.measured.flow_m_s.map_or(0.0, |f| METER_PULL_PER_S * (f - self.flow_m_s));
        self.flow_m_s += dt * (rate + pull) / (1.0 + dt * decay);
        self.equations[2].shows = METER_PULL_PER_S / (METER_PULL_PER_S + decay);
        let bound = 3.0 * model.map.flow_m * model.speed_max_rad_s + 4.0;
        self.flow_m_s = self.flow_m_s.clamp(-bound, bound);
    }

    fn filter(&mut self, model: &ControlModel, input: &EstimatorInput, speed: f64, thrust: Option<f64>) {
        let share = input.dt_s * self.lambda_rad_s / (1.0 + input.dt_s * self.lambda_rad_s);
        let flow = self.flow_m_s;
        let inflow = model.blade.inflow(speed, flow, 0.0);
        let (ut, vp, v) = (inflow.tangential_m_s, inflow.axial_m_s, inflow.speed_m_s().max(1e-6));
        let (s, c) = model.blade.pitch_rad.sin_cos();
        let (wn, wc) = (ut * s - vp * c, ut * c + vp * s);
        let density_area = model.blade.density_kg_m3 * model.blade.area_m2();
        let w = density_area * wn / v;
        let (lift, drag) = (model.blade.lift_max, model.blade.drag_max);
        let thrust_scale = 1.0 / model.thrust_max_n;
        let torque_scale = 1.0 / (model.map.torque_n_m_s2 * model.speed_max_rad_s.powi(2));
        let wt = w * thrust_scale;
        let wq = w * model.blade.lever_m() * torque_scale;

        let motor = model.torque_constant_nm_a * input.current_a - model.friction_n_m(speed);
        let acceleration = self.lambda_rad_s * (speed - self.filtered_speed_rad_s);
        self.filtered_speed_rad_s += (speed - self.filtered_speed_rad_s) * share;
        let flow_acceleration = self.lambda_rad_s * (flow - self.filtered_flow_m_s);
        self.filtered_flow_m_s += (flow - self.filtered_flow_m_s) * share;

        let ambient = input.measured.ambient_m_s.unwrap_or(0.0);
        // Each: what of y is still to be filtered, phi, and whether it is measured.
        let rows = [
            (
                thrust.unwrap_or(0.0) * thrust_scale,
                [wt * wc * ut * lift, -wt * wn * vp * drag, 0.0],
                thrust.is_some(),
            ),
            (motor * torque_scale, [wq * wc * vp * lift, wq * wn * ut * drag, 0.0], true),
            (
                thrust.unwrap_or(0.0) * thrust_scale,
                [
                    0.0,
                    0.0,
                    density_area * (flow - ambient) * flow.abs() * model.flux_coefficient * thrust_scale,
                ],
                thrust.is_some() && input.measured.flow_m_s.is_some(),
            ),
        ];
        // F[x'] = lam (x - F[x]) comes out filtered.
        let derived = [
            0.0,
            model.inertia_kg_m2 * acceleration * torque_scale,
            model.added_mass_kg * flow_acceleration * thrust_scale,
        ];
        for (i, (y, phi, valid)) in rows.into_iter().enumerate() {
            self.equations[i].step(&mut self.held[i], y, phi, share, derived[i]);
            self.equations[i].valid = valid;
        }
    }

    fn weigh(&mut self) {
        let keep = 1.0 - (self.every_s / self.window_s).min(1.0);
        let mut fresh = [0.0; 3];
        for e in self.equations[..2].iter().filter(|e| e.valid) {
            let [a, b, _] = e.phi;
            // Directions count, not levels, down to a tenth of full load.
            let scale = 1.0 / (a * a + b * b).max(1e-3);
            fresh[0] += a * a * scale;
            fresh[1] += a * b * scale;
            fresh[2] += b * b * scale;
        }
        for (g, f) in self.gram.iter_mut().zip(fresh) {
            *g = keep * *g + (1.0 - keep) * f;
        }
    }

    fn excited(&self) -> bool {
        let [a, b, c] = self.gram;
        let half = 0.5 * (a + c);
        let root = (0.25 * (a - c) * (a - c) + b * b).sqrt();
        let (least, most) = (half - root, half + root);
        least > self.excitation_min && most < 1e4 * least
    }
}
