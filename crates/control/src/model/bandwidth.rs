//! How fast the thruster is, and how fast a speed loop on it may be.

use super::ControlModel;

impl ControlModel {
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
