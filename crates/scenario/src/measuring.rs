//! What the stand's instruments make of a sensed value: noise, converter, and slow flow meter.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use kort_thruster::effects::Scale;
use kort_thruster::plant::Sensed;
use kort_thruster::rig::Sensors;

/// Usual standard deviations as shares of the largest value in use: a Hall current sensor, a
/// strain-gauge load cell and torque transducer, an acoustic flow meter in a jet, a battery monitor.
const CURRENT: f64 = 0.002;
const THRUST: f64 = 0.001;
const TORQUE: f64 = 0.003;
const FLOW: f64 = 0.01;
const SUPPLY: f64 = 0.002;

/// The instruments. Filters and the encoder are the plant's part; noise and converters are here.
pub struct Measuring {
    random: ChaCha8Rng,
    noise: f64,
    scale: Scale,
    thrust_full_scale_n: Option<f64>,
    thrust_quantum_n: Option<f64>,
    flow_period_s: Option<f64>,
    next_flow_s: f64,
    /// What nothing measures.
    without_thrust: bool,
    without_flow: bool,
}

impl Measuring {
    /// Instruments of a rig; `noise` is a factor on the usual noise.
    pub fn new(sensors: &Sensors, scale: Scale, noise: f64, seed: u64) -> Self {
        let quantum = sensors
            .thrust_full_scale_n
            .zip(sensors.thrust_bits)
            .map(|(full, bits)| 2.0 * full / 2.0_f64.powi(bits.min(52) as i32));
        Self {
            random: ChaCha8Rng::seed_from_u64(seed),
            noise,
            scale,
            thrust_full_scale_n: sensors.thrust_full_scale_n,
            thrust_quantum_n: quantum,
            flow_period_s: sensors.flow_rate_hz.map(|hz| 1.0 / hz),
            next_flow_s: 0.0,
            without_thrust: !sensors.thrust_sensor,
            without_flow: !sensors.flow_meter,
        }
    }

    /// What is logged of `sensed` at `time_s`; flow is NaN between the flow meter's samples, and what the rig has no
    /// sensor of is NaN throughout.
    pub fn read(&mut self, time_s: f64, sensed: &Sensed) -> Sensed {
        let scale = self.scale;
        let mut read = *sensed;
        read.current_a += self.noise(CURRENT * scale.current_a);
        read.torque_n_m += self.noise(TORQUE * scale.torque_n_m);
        read.supply_v += self.noise(SUPPLY * sensed.supply_v);
        read.thrust_n += self.noise(THRUST * scale.thrust_n);
        if let Some(full) = self.thrust_full_scale_n {
            read.thrust_n = read.thrust_n.clamp(-full, full);
        }
        if let Some(quantum) = self.thrust_quantum_n {
            read.thrust_n = (read.thrust_n / quantum).round() * quantum;
        }
        let flow_noise = self.noise(FLOW * scale.flow_m_s);
        read.flow_m_s = match self.flow_period_s {
            Some(_) if time_s + 1e-9 < self.next_flow_s => f64::NAN,
            Some(period) => {
                self.next_flow_s += period * (((time_s + 1e-9 - self.next_flow_s) / period).floor() + 1.0);
                sensed.flow_m_s + flow_noise
            }
            None => sensed.flow_m_s + flow_noise,
        };
        if self.without_thrust {
            read.thrust_n = f64::NAN;
        }
        if self.without_flow {
            read.flow_m_s = f64::NAN;
        }
        read
    }

    fn noise(&mut self, sigma: f64) -> f64 {
        // Drawn also when off, so that the switch leaves every other draw where it was.
        let draw: f64 = StandardNormal.sample(&mut self.random);
        if self.noise == 0.0 || !sigma.is_finite() { 0.0 } else { self.noise * sigma * draw }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scale() -> Scale {
        Scale {
            shaft_speed_rad_s: 80.0,
            torque_n_m: 10.0,
            thrust_n: 200.0,
            flow_m_s: 1.5,
            current_a: 9.0,
            command: 9.0,
            supply_v: 120.0,
            current_limit_a: 9.0,
            winding_resistance_ohm: 2.2,
            inertia_kg_m2: 0.01,
            tick_s: 0.002,
            duration_s: 10.0,
            clock_s: [0.0, 10.0],
            angle_known: true,
            turned_rad: f64::INFINITY,
            angle_rad: [0.0; 2],
            reverses: true,
        }
    }

    #[test]
    fn what_the_rig_has_no_sensor_of_is_not_measured() {
        let sensors = Sensors { thrust_sensor: false, flow_meter: false, ..Sensors::IDEAL };
        let read = Measuring::new(&sensors, scale(), 1.0, 1)
            .read(0.0, &Sensed { thrust_n: 5.0, ..Sensed::default() });
        assert!(read.thrust_n.is_nan() && read.flow_m_s.is_nan() && read.current_a.is_finite());
    }

    #[test]
    fn the_converter_clips_and_rounds_and_the_flow_meter_is_slow() {
        let sensors = Sensors {
            thrust_full_scale_n: Some(100.0),
            thrust_bits: Some(8),
            flow_rate_hz: Some(20.0),
            ..Sensors::IDEAL
        };
        let mut measuring = Measuring::new(&sensors, scale(), 0.0, 1);
        let sensed = Sensed { thrust_n: 10.0, flow_m_s: 1.0, ..Sensed::default() };
        let reads: Vec<Sensed> = (0..100).map(|i| measuring.read(f64::from(i) * 0.01, &sensed)).collect();
        let quantum = 200.0 / 256.0;
        assert!(
            reads
                .iter()
                .all(|r| (r.thrust_n / quantum).fract() == 0.0 && (r.thrust_n - 10.0).abs() <= quantum / 2.0)
        );
        assert_eq!(reads.iter().filter(|r| !r.flow_m_s.is_nan()).count(), 20);
        let over = Sensed { thrust_n: 1e6, ..Sensed::default() };
        assert_eq!(measuring.read(2.0, &over).thrust_n, 100.0);
    }

    #[test]
    fn noise_has_its_size() {
        let mut measuring = Measuring::new(&Sensors::IDEAL, scale(), 2.0, 7);
        let n = 20_000;
        let power: f64 =
            (0..n).map(|i| measuring.read(f64::from(i), &Sensed::default()).current_a.powi(2)).sum::<f64>()
                / f64::from(n);
        assert!((power.sqrt() / (2.0 * CURRENT * 9.0) - 1.0).abs() < 0.03);
    }
}
