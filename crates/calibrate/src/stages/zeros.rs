//! Zeros of every sensor, with the drive at zero.

use kort_proto::signals::{Kind, SIGNALS};

use super::{Stage, Step};
use crate::facts::{Facts, RestReading};
use crate::plan::Plan;
use crate::session::Seen;
use crate::stop::Stop;

/// How long is listened, s.
const LISTENS_S: f64 = 2.0;
/// Furthest the shaft may creep meanwhile, rad.
const STANDS_RAD: f64 = 0.05;

/// Listens while nothing moves.
#[derive(Default)]
pub struct Zeros {
    from: Option<(f64, f64)>,
    sums: Vec<Sum>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    count: u32,
    first: f64,
    last: f64,
    /// Sums of what a reading is above the first, its square, and its product with the one before.
    sum: f64,
    squares: f64,
    products: f64,
    step: f64,
}

impl Sum {
    fn take(&mut self, value: f64) {
        if !value.is_finite() {
            return;
        }
        if self.count == 0 {
            (self.first, self.last) = (value, value);
        }
        let (above, before) = (value - self.first, self.last - self.first);
        let step = (value - self.last).abs();
        if step > 0.0 && (self.step == 0.0 || step < self.step) {
            self.step = step;
        }
        self.count += 1;
        self.sum += above;
        self.squares += above * above;
        self.products += above * before;
        self.last = value;
    }

    fn reading(&self) -> RestReading {
        if self.count == 0 {
            return RestReading::default();
        }
        let n = f64::from(self.count);
        let mean = self.sum / n;
        let variance = (self.squares / n - mean * mean).max(0.0);
        let kept = if variance > 0.0 {
            ((self.products / n - mean * mean) / variance).clamp(0.0, 0.99)
        } else {
            0.0
        };
        RestReading {
            count: self.count,
            mean: self.first + mean,
            sigma: variance.sqrt(),
            memory: (1.0 + kept) / (1.0 - kept),
            step: self.step,
        }
    }
}

impl Stage for Zeros {
    fn name(&self) -> &'static str {
        "zeros"
    }

    fn says(&self, _: &Plan, _: &Facts) -> String {
        format!("listens to every sensor for {LISTENS_S} s with the drive at zero; the shaft stands still")
    }

    fn tick(&mut self, _: &Plan, seen: &Seen, facts: &mut Facts) -> Result<Step, Stop> {
        let (from_s, from_rad) = *self.from.get_or_insert((seen.time_s, seen.angle_rad));
        self.sums.resize(SIGNALS.len(), Sum::default());
        for (sum, signal) in self.sums.iter_mut().zip(SIGNALS).filter(|(_, s)| s.kind == Kind::Measured) {
            sum.take((signal.get)(&seen.fresh));
        }
        let crept_rad = seen.angle_rad - from_rad;
        if crept_rad.abs() > STANDS_RAD {
            return Err(Stop::TurnsByItself { angle_rad: crept_rad.abs() });
        }
        if seen.time_s - from_s < LISTENS_S {
            return Ok(Step::Drive(0.0));
        }
        facts.rest = self.sums.iter().map(Sum::reading).collect();
        if !facts.measures("shaft_speed_rad_s") && !facts.measures("shaft_angle_rad") {
            return Err(Stop::Silent { signal: "shaft_speed_rad_s" });
        }
        for signal in ["thrust_n", "flow_m_s", "torque_n_m", "current_a"] {
            if !facts.measures(signal) {
                facts.left_out.push(("zeros", format!("{signal}: nothing measures it")));
            }
        }
        Ok(Step::Done)
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    /// A slow meter is read twenty times while the shaft stands: thirty such zeros all lie inside, but in one session of
    /// a hundred.
    #[test]
    fn thirty_zeros_of_few_readings_are_all_inside_but_in_one_session_of_a_hundred() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let mut zero = || {
            let mut sum = Sum::default();
            for _ in 0..20 {
                let noise: f64 = StandardNormal.sample(&mut random);
                sum.take(1.0 + noise);
            }
            sum.reading()
        };
        let sessions = 1000;
        let whole = (0..sessions)
            .filter(|_| (0..30).map(|_| zero()).filter(|r| (r.mean - 1.0).abs() > r.tolerance()).count() == 0)
            .count();
        assert!(whole * 100 >= sessions * 98, "{whole} of {sessions}");
        // A tolerance that says nothing would hold too.
        let usual = zero().tolerance();
        assert!((0.5..2.0).contains(&usual), "{usual} for a standard error of 0.22");
    }
}
