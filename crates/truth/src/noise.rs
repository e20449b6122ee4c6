//! Disturbances of a run: ambient turbulence, force drift, white sensor noise.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha12Rng;
use rand_distr::StandardNormal;

/// Standard deviations in SI units. Speed has no noise but its quantisation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Noise {
    /// Ambient turbulence (an Ornstein-Uhlenbeck process), m/s.
    pub turbulence_m_s: f64,
    /// Its correlation time, s.
    pub turbulence_time_s: f64,
    /// Random walk of the force zero, N per square root of a second.
    pub thrust_drift_n: f64,
    /// White noise of the force before its converter, N.
    pub thrust_n: f64,
    /// White noise of the torque, N m.
    pub torque_n_m: f64,
    /// White noise of the flow meter, m/s.
    pub flow_m_s: f64,
    /// White noise of the current, A.
    pub current_a: f64,
    /// White noise of the supply voltage, V.
    pub supply_v: f64,
}

/// Running disturbances; the same seed gives the same turbulence whatever the plant does.
pub struct Disturbance {
    noise: Noise,
    inflow: ChaCha12Rng,
    sensors: ChaCha12Rng,
    /// Ambient turbulence now, m/s.
    pub turbulence_m_s: f64,
    /// Zero of the force sensor now, N.
    pub thrust_zero_n: f64,
}

impl Disturbance {
    /// Starts all streams of `seed`.
    pub fn new(noise: Noise, seed: u64) -> Self {
        let mut inflow = ChaCha12Rng::seed_from_u64(seed);
        inflow.set_stream(1);
        let mut sensors = ChaCha12Rng::seed_from_u64(seed);
        sensors.set_stream(2);
        let start: f64 = inflow.sample(StandardNormal);
        Disturbance {
            noise,
            inflow,
            sensors,
            turbulence_m_s: start * noise.turbulence_m_s,
            thrust_zero_n: 0.0,
        }
    }

    /// Advances turbulence and drift by one control tick of `tick_s`.
    pub fn tick(&mut self, tick_s: f64) {
        let keep = (-tick_s / self.noise.turbulence_time_s.max(tick_s)).exp();
        let kick: f64 = self.inflow.sample(StandardNormal);
        self.turbulence_m_s =
            keep * self.turbulence_m_s + kick * self.noise.turbulence_m_s * (1.0 - keep * keep).sqrt();
        let walk: f64 = self.inflow.sample(StandardNormal);
        self.thrust_zero_n += walk * self.noise.thrust_drift_n * tick_s.sqrt();
    }

    /// One white sample of a channel.
    pub fn white(&mut self, pick: impl Fn(&Noise) -> f64) -> f64 {
        let draw: f64 = self.sensors.sample(StandardNormal);
        draw * pick(&self.noise)
    }
}
