//! Rotational flow of the wake: what it does to the model where a rig is run with it.

use kort_thruster::blade;

use super::ControlModel;

/// Rotational flow of the wake (docs/theory.md, after Bachmayer, Whitcomb & Grosenbaugh 2000).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Swirl {
    /// Drag coefficient of the swirl, `dbr`.
    pub drag: f64,
    /// Ratio of the swirling water's inertia to the duct's water, `gr`.
    pub inertia: f64,
}

impl ControlModel {
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
}
