//! Scores over seeds: mean and interval.

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Mean and its interval over seeds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Score {
    /// Mean over seeds.
    pub mean: f64,
    /// 95 % interval of the mean (Student's t); none with one seed.
    pub ci95: Option<[f64; 2]>,
}

impl Score {
    /// Ends of the interval, for comparing; both the mean where there is none.
    pub fn ends(&self) -> [f64; 2] {
        self.ci95.unwrap_or([self.mean; 2])
    }
}

/// Mean and 95 % interval of some values.
pub fn summarise(values: &[f64]) -> Score {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    if values.len() < 2 {
        return Score { mean, ci95: None };
    }
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let t = StudentsT::new(0.0, 1.0, n - 1.0).map_or(1.96, |d| d.inverse_cdf(0.975));
    let half = t * (variance / n).sqrt();
    Score { mean, ci95: Some([mean - half, mean + half]) }
}

/// Geometric mean and 95 % interval of ratios: of two laws on the same sea, seed by seed.
pub fn summarise_ratios(values: &[f64]) -> Score {
    let logs: Vec<f64> = values.iter().map(|v| v.ln()).collect();
    let Score { mean, ci95 } = summarise(&logs);
    Score { mean: mean.exp(), ci95: ci95.map(|ends| ends.map(f64::exp)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_have_an_interval_above_zero() {
        let s = summarise_ratios(&[0.5, 2.0]);
        assert!(
            (s.mean - 1.0).abs() < 1e-12
                && s.ends()[0] > 0.0
                && (s.ends()[0] * s.ends()[1] - 1.0).abs() < 1e-9
        );
    }

    #[test]
    fn one_seed_has_no_interval() {
        assert_eq!((summarise(&[2.0]).ci95, summarise_ratios(&[2.0]).ci95), (None, None));
    }

    #[test]
    fn the_interval_is_students() {
        let s = summarise(&[1.0, 2.0, 3.0]);
        assert!(
            (s.mean - 2.0).abs() < 1e-12 && (s.ends()[1] - 2.0 - 4.303 / 3f64.sqrt()).abs() < 1e-3,
            "{s:?}"
        );
    }
}
