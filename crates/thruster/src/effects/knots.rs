//! Something of the water that changes with time in its own way: straight pieces between knots.

use super::{Scale, Spec, Stretch};
use crate::real::Real;

/// Names of knots, as many as a recording may need.
macro_rules! knot_names {
    ($unit:literal; $($n:literal)*) => { [$(concat!("knot_", $n, $unit)),*] };
}

/// Names of knots of a speed.
pub(super) const SPEED: [&str; MOST] = knot_names!("_m_s";
    1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32 33 34 35 36 37 38
    39 40 41 42 43 44 45 46 47 48 49 50 51 52 53 54 55 56 57 58 59 60 61 62 63 64 65 66 67 68 69 70 71 72 73
    74 75 76 77 78 79 80 81 82);
/// Names of knots of a share.
pub const SHARE: [&str; MOST] = knot_names!("";
    1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32 33 34 35 36 37 38
    39 40 41 42 43 44 45 46 47 48 49 50 51 52 53 54 55 56 57 58 59 60 61 62 63 64 65 66 67 68 69 70 71 72 73
    74 75 76 77 78 79 80 81 82);

/// Most knots.
const MOST: usize = 82;
/// Shortest distance of two knots, s.
const CLOSEST_S: f64 = 0.8;

/// The distance of the knots, then the knots: one every 0.8 s or every eightieth of the recording,
/// whichever is longer.
pub fn specs(
    scale: &Scale,
    names: &[&'static str; MOST],
    unit: &'static str,
    start: f64,
    (low, high): (f64, f64),
    sigma: f64,
) -> Vec<Spec> {
    let spacing_s = (scale.duration_s / (MOST - 2) as f64).max(CLOSEST_S);
    let count = ((scale.duration_s / spacing_s).ceil() as usize + 1).clamp(2, MOST);
    let knots = names[..count].iter().enumerate().map(|(k, name)| Spec {
        acts: Some(Stretch {
            from_s: (k as f64 - 1.0) * spacing_s,
            length_s: 2.0 * spacing_s,
            period_s: count as f64 * spacing_s,
        }),
        ..Spec::strength(name, unit, start, low, high).sigma(sigma)
    });
    std::iter::once(Spec::held("knot_spacing_s", "s", spacing_s, spacing_s, spacing_s)).chain(knots).collect()
}

/// Straight pieces; the knots repeat past the last one, so a recording may begin at any time.
pub struct Knots<T> {
    spacing_s: f64,
    values: Vec<T>,
}

impl<T: Real> Knots<T> {
    /// From an effect's values: the distance, then the knots.
    pub fn new(values: &[T]) -> Self {
        Self { spacing_s: values[0].re(), values: values[1..].to_vec() }
    }

    /// The value at a time.
    pub fn at(&self, time_s: f64) -> T {
        let count = self.values.len();
        let place = (time_s / self.spacing_s).rem_euclid(count as f64);
        let (knot, part) = (place as usize % count, place.fract());
        let (from, to) = (self.values[knot], self.values[(knot + 1) % count]);
        from + (to - from) * part
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn straight_between_knots_and_around_the_end() {
        let knots = Knots::new(&[2.0, 1.0, 3.0, -1.0]);
        assert_eq!(knots.at(0.0), 1.0);
        assert_eq!(knots.at(1.0), 2.0);
        assert_eq!(knots.at(5.0), 0.0);
        assert_eq!(knots.at(6.0), 1.0);
        assert_eq!(knots.at(-1.0), 0.0);
    }
}
