//! Scores of one run, gathered tick by tick.

mod histogram;
mod steps;
mod worst;

use std::collections::BTreeMap;

use kort_thruster::rig::Rig;

use crate::disc::Disc;
use histogram::Histogram;
use steps::Steps;
use worst::Worst;
pub use worst::{Point, Window};

/// What one tick shows to the scores.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sample {
    /// Time, s.
    pub time_s: f64,
    /// Thrust asked for, N.
    pub reference_n: f64,
    /// True thrust, N.
    pub thrust_n: f64,
    /// True shaft speed, rad/s.
    pub shaft_speed_rad_s: f64,
    /// True motor current, A.
    pub current_a: f64,
    /// True axial flow, m/s.
    pub flow_m_s: f64,
    /// Ambient axial flow, m/s.
    pub ambient_m_s: f64,
    /// Observer's axial flow, m/s.
    pub flow_estimate_m_s: f64,
    /// The command or the thruster was at a limit.
    pub saturated: bool,
    /// Drive, current or speed was beyond what the rig allows.
    pub broken: bool,
    /// The drive is off for a fault that the scenario put in: not the law's error.
    pub excused: bool,
}

/// Names, units and what smaller means, of every score.
pub const SCORES: &[(&str, &str)] = &[
    ("thrust_rms_n", "thrust error, root mean square, N"),
    ("thrust_p95_n", "thrust error that 95 % of the time is not passed, N"),
    ("thrust_bias_n", "mean thrust error, N"),
    ("rise_time_s", "time to 90 % of a step, s"),
    ("settle_time_s", "time until thrust stays within 5 % of a step, s"),
    ("overshoot_pct", "overshoot of a step, %"),
    (
        "energy_j",
        "electrical energy: motor torque times speed where it drives, and copper loss where the rig states a winding resistance, J",
    ),
    (
        "useful_impulse_n_s",
        "thrust given in the direction asked for, up to what was asked for, over time: what is thrown beyond or against it is of no use, N s",
    ),
    ("energy_per_impulse_j_n_s", "energy per useful newton-second, J/(N s)"),
    (
        "copper_loss_per_impulse_j_n_s",
        "copper loss (I2R) per useful newton-second, J/(N s); not known if the rig states no winding resistance",
    ),
    (
        "energy_over_ideal",
        "energy over the least that an ideal actuator disc needs for the useful thrust in the same water (inverse of the figure of merit): power grows with thrust to 1.5, so that this compares laws that give different thrust",
    ),
    ("saturation_share", "share of time at a limit"),
    ("current_travel_a_s", "travel of the motor current per second: wear, A/s"),
    ("flow_rms_m_s", "observer's flow error, root mean square, m/s"),
    ("error_over_true_parameters", "thrust error, RMS, over that of the same law told the true parameters"),
    ("parameter_error", "largest relative error of an adapted coefficient at the end"),
    ("faults_injected", "faults put in"),
    ("faults_survived", "faults after which thrust came back"),
    ("trips", "how often the servo went off, faults put in included"),
    ("limits_broken", "ticks beyond a limit; must be 0"),
];

/// Gathers the scores of one run.
pub struct Tally {
    dt_s: f64,
    scale_n: f64,
    resistance_ohm: Option<f64>,
    torque_constant_nm_a: f64,
    disc: Disc,
    settle_s: f64,
    ticks: u64,
    squares: f64,
    sum: f64,
    errors: Histogram,
    energy_j: f64,
    copper_j: f64,
    impulse_n_s: f64,
    ideal_j: f64,
    saturated: u64,
    travel_a: f64,
    last_current_a: f64,
    flow_squares: f64,
    broken: u64,
    steps: Steps,
    worst: Worst,
}

impl Tally {
    /// For a thruster as its rig states it, with its largest thrust; the start is not scored.
    pub fn new(dt_s: f64, rig: &Rig, scale_n: f64, settle_s: f64) -> Self {
        Self {
            dt_s,
            scale_n,
            resistance_ohm: rig.motor.winding_resistance_ohm.map(|r| r.value),
            torque_constant_nm_a: rig.motor.torque_constant_nm_a.value,
            disc: Disc::of(rig),
            settle_s,
            ticks: 0,
            squares: 0.0,
            sum: 0.0,
            errors: Histogram::new(),
            energy_j: 0.0,
            copper_j: 0.0,
            impulse_n_s: 0.0,
            ideal_j: 0.0,
            saturated: 0,
            travel_a: 0.0,
            last_current_a: 0.0,
            flow_squares: 0.0,
            broken: 0,
            steps: Steps::new(dt_s, scale_n),
            worst: Worst::new(dt_s),
        }
    }

    /// Root mean square of the thrust error so far, N.
    pub fn rms_n(&self) -> f64 {
        (self.squares / self.ticks.max(1) as f64).sqrt()
    }

    /// Energy so far, J.
    pub fn energy_j(&self) -> f64 {
        self.energy_j
    }

    /// One tick.
    pub fn tick(&mut self, s: &Sample) {
        self.broken += u64::from(s.broken);
        if s.time_s < self.settle_s {
            self.last_current_a = s.current_a;
            self.steps.begin_at(s.reference_n);
            return;
        }
        let dt = self.dt_s;
        let copper = self.resistance_ohm.unwrap_or(0.0) * s.current_a * s.current_a;
        let shaft = self.torque_constant_nm_a * s.current_a * s.shaft_speed_rad_s;
        self.energy_j += (copper + shaft.max(0.0)) * dt;
        self.copper_j += copper * dt;
        let useful_n = (s.thrust_n * s.reference_n.signum()).clamp(0.0, s.reference_n.abs());
        self.impulse_n_s += useful_n * dt;
        self.ideal_j += self.disc.power_w(useful_n, s.ambient_m_s * s.reference_n.signum()) * dt;
        self.travel_a += (s.current_a - self.last_current_a).abs();
        self.last_current_a = s.current_a;
        self.saturated += u64::from(s.saturated);
        let error = s.thrust_n - s.reference_n;
        if !s.excused {
            self.ticks += 1;
            self.squares += error * error;
            self.sum += error;
            self.flow_squares += (s.flow_estimate_m_s - s.flow_m_s).powi(2);
            self.errors.count(error.abs() / self.scale_n);
        }
        self.steps.tick(s);
        self.worst.tick(s);
    }

    /// The scores, and the worst window.
    pub fn finish(mut self, extra: &[(&'static str, f64)]) -> Outcome {
        self.steps.close();
        let n = self.ticks.max(1) as f64;
        let seconds = n * self.dt_s;
        let mut scores = BTreeMap::new();
        scores.insert("thrust_rms_n", (self.squares / n).sqrt());
        scores.insert("thrust_p95_n", self.errors.percentile(0.95) * self.scale_n);
        scores.insert("thrust_bias_n", self.sum / n);
        for (name, values) in [
            ("rise_time_s", &self.steps.rises),
            ("settle_time_s", &self.steps.settles),
            ("overshoot_pct", &self.steps.overshoots),
        ] {
            if !values.is_empty() {
                scores.insert(name, values.iter().sum::<f64>() / values.len() as f64);
            }
        }
        scores.insert("energy_j", self.energy_j);
        scores.insert("useful_impulse_n_s", self.impulse_n_s);
        if self.ideal_j > 0.0 {
            scores.insert("energy_over_ideal", self.energy_j / self.ideal_j);
        }
        if self.impulse_n_s > 0.0 {
            scores.insert("energy_per_impulse_j_n_s", self.energy_j / self.impulse_n_s);
            let copper =
                if self.resistance_ohm.is_some() { self.copper_j / self.impulse_n_s } else { f64::NAN };
            scores.insert("copper_loss_per_impulse_j_n_s", copper);
        }
        scores.insert("saturation_share", self.saturated as f64 / n);
        scores.insert("current_travel_a_s", self.travel_a / seconds);
        scores.insert("flow_rms_m_s", (self.flow_squares / n).sqrt());
        scores.insert("limits_broken", self.broken as f64);
        scores.extend(extra.iter().copied());
        Outcome { scores, worst: self.worst.finish() }
    }
}

/// Scores and worst window of one run.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Scores by name; NaN is not known.
    pub scores: BTreeMap<&'static str, f64>,
    /// Worst window.
    pub worst: Window,
}

impl Outcome {
    /// The error as a multiple of that of the same law told the true parameters.
    pub fn compare(&mut self, told: &Self) {
        let ratio = self.scores["thrust_rms_n"] / told.scores["thrust_rms_n"];
        self.scores.insert("error_over_true_parameters", ratio);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tally(resistance_ohm: Option<f64>) -> Tally {
        const RIG: &str = include_str!("../../../config/thrusters/whitcomb-yoerger-1999.toml");
        let mut tally = Tally::new(1e-3, &Rig::from_toml(RIG).unwrap(), 100.0, 0.0);
        tally.resistance_ohm = resistance_ohm;
        tally
    }

    fn sample(time_s: f64, reference_n: f64, thrust_n: f64) -> Sample {
        Sample { time_s, reference_n, thrust_n, ..Sample::default() }
    }

    #[test]
    fn a_first_order_step_is_measured() {
        let mut tally = tally(Some(1.0));
        tally.tick(&sample(0.0, 0.0, 0.0));
        for k in 0..3000 {
            let t = f64::from(k) * 1e-3;
            tally.tick(&sample(t, 50.0, 50.0 * (1.0 - (-t / 0.1).exp())));
        }
        let scores = tally.finish(&[]).scores;
        assert!((scores["rise_time_s"] - 0.230).abs() < 0.003, "{scores:?}");
        assert!((scores["settle_time_s"] - 0.300).abs() < 0.003, "{scores:?}");
        assert_eq!(scores["overshoot_pct"], 0.0);
    }

    #[test]
    fn ninety_five_percent_of_the_time() {
        let mut tally = tally(Some(1.0));
        for k in 0..10_000 {
            tally.tick(&sample(0.0, 0.0, f64::from(k) * 1e-3));
        }
        let p95 = tally.finish(&[]).scores["thrust_p95_n"];
        assert!((p95 - 9.5).abs() < 0.15, "{p95}");
    }

    #[test]
    fn what_is_not_known_stays_so() {
        let mut tally = tally(None);
        tally.tick(&Sample { current_a: 3.0, ..sample(0.0, 10.0, 9.0) });
        assert!(tally.finish(&[]).scores["copper_loss_per_impulse_j_n_s"].is_nan());
    }

    /// What is thrown beyond the thrust asked for, or against it, is paid for and of no use.
    #[test]
    fn only_thrust_that_was_asked_for_is_useful() {
        let useful = |thrust_n: f64| {
            let mut tally = tally(None);
            for _ in 0..1000 {
                tally.tick(&Sample {
                    current_a: 2.0,
                    shaft_speed_rad_s: 10.0,
                    ..sample(0.0, -50.0, thrust_n)
                });
            }
            tally.finish(&[]).scores
        };
        let of = |thrust_n: f64| useful(thrust_n)["useful_impulse_n_s"];
        assert!((of(-40.0) - 40.0).abs() < 1e-9 && (of(-70.0) - 50.0).abs() < 1e-9);
        assert_eq!(of(30.0), 0.0);
        assert!(!useful(30.0).contains_key("energy_per_impulse_j_n_s"));
        // 40 N on a disc of 0.0531 m2: T^1.5 / sqrt(2 rho A) = 24.57 W; 2.46 N m turn at 10 rad/s.
        assert!((useful(-40.0)["energy_over_ideal"] - 24.6 / 24.57).abs() < 2e-3);
    }
}
