//! What the blades give at a working point, how it changes about it, and the shaft speed for a thrust.

use kort_thruster::blade::{BladeLoad, Inflow};

use super::ControlModel;

/// Lift that builds up as the blades travel: what is missing of the lift coefficient at this moment is `share` of it,
/// less what has built up.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HeldLift {
    /// Share of the quasi-steady lift that does not come at once.
    pub share: f64,
    /// What has built up of it.
    pub built_up: f64,
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

impl ControlModel {
    /// Thrust and torque at a shaft speed, flow and swirl.
    pub fn load(&self, speed_rad_s: f64, flow_m_s: f64, swirl_m_s: f64) -> BladeLoad {
        self.row_load(self.row.lever_m * speed_rad_s - swirl_m_s, flow_m_s)
    }

    #[inline]
    pub(super) fn row_load(&self, tangential_m_s: f64, axial_m_s: f64) -> BladeLoad {
        if self.has_plain_blades() {
            return self.row.load(tangential_m_s, axial_m_s);
        }
        let inflow = Inflow { tangential_m_s, axial_m_s };
        let mut foil = self.row.section(inflow);
        if foil.speed_m_s < 1e-9 {
            return BladeLoad::default();
        }
        if let Some(held) = self.held_lift {
            foil.lift += held.built_up - held.share * foil.lift;
        }
        if let Some(curve) = &self.foil {
            curve.add(&mut foil, inflow);
        }
        self.row.load_of(&foil, inflow)
    }

    /// The same with this much of the lift not built up yet.
    pub fn holding(&self, held: HeldLift) -> Self {
        Self { held_lift: Some(held), ..*self }
    }

    /// Lift and drag are the sinusoids of (17), at once.
    fn has_plain_blades(&self) -> bool {
        self.foil.is_none() && self.held_lift.is_none()
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
        if !self.has_plain_blades() {
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
}
