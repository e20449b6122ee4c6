//! Seconds before and since a revision, compared under like commands only.

use std::collections::VecDeque;

use super::Second;

/// Seconds of a like command that are needed on both sides.
const LIKE: usize = 3;
/// An error is larger if it is so by this factor, and by so many standard errors of the seconds' scatter.
const LARGER: f64 = 1.1;
const SURE: f64 = 3.0;

/// Mean squares of both sides over like commands.
#[derive(Clone, Copy, Debug, Default)]
pub struct Compared {
    pub before_n2: f64,
    pub since_n2: f64,
    /// Of their difference, from the scatter of the seconds.
    variance_n4: f64,
    pub seconds: usize,
}

impl Compared {
    /// Of what was driven before and since.
    pub fn of(before: &VecDeque<Second>, since: &VecDeque<Second>) -> Compared {
        let mut all = Compared::default();
        let mut kinds: Vec<(i32, bool)> = since.iter().map(|second| second.like).collect();
        kinds.sort_unstable();
        kinds.dedup();
        for kind in kinds {
            let (b, s) = (Side::of(before, kind), Side::of(since, kind));
            if b.seconds < LIKE || s.seconds < LIKE {
                continue;
            }
            // Each kind of command counts as often on the one side as on the other.
            let seconds = b.seconds.min(s.seconds);
            let weight = seconds as f64;
            all.seconds += seconds;
            all.before_n2 += weight * b.mean;
            all.since_n2 += weight * s.mean;
            all.variance_n4 += weight * weight * (b.variance_of_mean + s.variance_of_mean);
        }
        if all.seconds > 0 {
            let weight = all.seconds as f64;
            all.before_n2 /= weight;
            all.since_n2 /= weight;
            all.variance_n4 /= weight * weight;
        }
        all
    }

    /// Is the error larger since, beyond its scatter?
    pub fn is_larger(&self) -> bool {
        self.since_n2.sqrt() > LARGER * self.before_n2.sqrt()
            && self.since_n2 - self.before_n2 > SURE * self.variance_n4.sqrt()
    }
}

/// Seconds of one kind of command.
struct Side {
    seconds: usize,
    mean: f64,
    variance_of_mean: f64,
}

impl Side {
    fn of(all: &VecDeque<Second>, kind: (i32, bool)) -> Side {
        let of_kind = || all.iter().filter(|second| second.like == kind).map(|second| second.mean_square_n2);
        let seconds = of_kind().count();
        let n = seconds as f64;
        let mean = of_kind().sum::<f64>() / n;
        let variance = of_kind().map(|value| (value - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
        Side { seconds, mean, variance_of_mean: variance / n }
    }
}
