//! Is what drives what its sensor says?
//!
//! Where a measured current, power or speed drives the model, the noise of its sensor shakes the model and not the shaft.
//! A hypothesis that answers less to what drives, by a motor that saturates or a heavier rotor, would be believed for it
//! (errors in variables; Söderström 2007, Automatica 43:939). What a sample departs by from the cubic through its four
//! neighbours is noise, or a motion as fast: where the log is quiet, noise. What drives is simulated with as much noise
//! again, signs drawn (the wild bootstrap; Wu 1986, Ann. Stat. 14:1261).

use kort_thruster::plant::Driven;

use crate::between::evenly;
use crate::data::{Driving, Prepared};

/// Rows of a piece over which the noise is judged.
const PIECE: usize = 50;
/// Share of the pieces that are quieter than the one whose noise is taken for the sensor's: in a closed loop what it sees
/// moves as fast beside it.
const QUIET: f64 = 0.1;
/// Rows beside a step that tell nothing of the noise.
const BESIDE: usize = 3;

impl Prepared {
    /// Whether what drives was measured, and not commanded.
    pub(crate) fn is_driven_by_a_sensor(&self) -> bool {
        !matches!(self.driving, Driving::Command(_))
    }

    /// What drives, with as much noise again as its sensor has. `commands` are those of the control grid.
    pub(crate) fn misread(&mut self, commands: &mut [f64]) {
        if !self.is_driven_by_a_sensor() {
            return;
        }
        let noise = self.noise_of_what_drives();
        let mut row = 0;
        for (tick, command) in self.stimulus.ticks.iter_mut().zip(commands) {
            while row + 2 < noise.len() && self.time_s[row + 1] <= tick.time_s + 0.02 * self.tick_s {
                row += 1;
            }
            let (start_s, end_s) = (self.time_s[row], self.time_s[row + 1]);
            let at = |time_s: f64| {
                let u = ((time_s - start_s) / (end_s - start_s)).clamp(0.0, 1.0);
                noise[row] + (noise[row + 1] - noise[row]) * u
            };
            *command += at(tick.time_s + 0.5 * self.tick_s);
            let (first, last) = (at(tick.time_s), at(tick.time_s + self.tick_s));
            tick.driven = match tick.driven {
                Driven::Speed(a, b) => Driven::Speed(a + first, b + last),
                Driven::Power(a, b) => Driven::Power(a + first, b + last),
                by_command => by_command,
            };
        }
    }

    /// By row, in the unit of what drives; none at its steps.
    fn noise_of_what_drives(&self) -> Vec<f64> {
        let values = if self.driving == Driving::Speed { &self.speed_between } else { &self.command };
        let mut noise: Vec<f64> = (0..values.len()).map(|row| departure(&self.time_s, values, row)).collect();
        for edge in &self.edges {
            let to = (edge + BESIDE).min(noise.len());
            noise[edge.saturating_sub(BESIDE).min(to)..to].fill(0.0);
        }
        as_where_quiet(noise)
    }
}

/// What a sample departs by from the cubic through its four neighbours, its sign drawn: of white noise, as large as that.
fn departure(time_s: &[f64], values: &[f64], row: usize) -> f64 {
    const NEIGHBOURS: [usize; 4] = [0, 1, 3, 4];
    let about = |of: &[f64]| -> Option<[f64; 5]> {
        row.checked_sub(2).and_then(|from| of.get(from..from + 5)?.try_into().ok())
    };
    let (Some(time_s), Some(values)) = (about(time_s), about(values)) else { return 0.0 };
    // Lagrange's weights of the neighbours.
    let weight = |of: usize| -> f64 {
        let others = NEIGHBOURS.into_iter().filter(|other| *other != of);
        others.map(|other| (time_s[2] - time_s[other]) / (time_s[of] - time_s[other])).product()
    };
    let weights = NEIGHBOURS.map(|of| (weight(of), values[of]));
    let foretold: f64 = weights.iter().map(|(weight, value)| weight * value).sum();
    let spread = 1.0 + weights.iter().map(|(weight, _)| weight * weight).sum::<f64>();
    let sign = if evenly(row) < 0.5 { -1.0 } else { 1.0 };
    sign * (values[2] - foretold) / spread.sqrt()
}

/// Departures, none larger in its piece than they are in the quiet ones.
fn as_where_quiet(mut departures: Vec<f64>) -> Vec<f64> {
    let size = |piece: &[f64]| (piece.iter().map(|d| d * d).sum::<f64>() / piece.len().max(1) as f64).sqrt();
    let mut sizes: Vec<f64> = departures.chunks(PIECE).map(size).collect();
    sizes.sort_by(f64::total_cmp);
    let quiet = sizes.get((QUIET * sizes.len() as f64) as usize).copied().unwrap_or(0.0);
    for piece in departures.chunks_mut(PIECE) {
        let share = (quiet / size(piece).max(1e-300)).min(1.0);
        piece.iter_mut().for_each(|d| *d *= share);
    }
    departures
}

#[cfg(test)]
mod tests {
    use super::{as_where_quiet, departure};

    /// From -1 to 1, evenly.
    fn white(k: usize) -> f64 {
        2.0 * (((k as f64 * 12.9898).sin() * 43_758.545_3).fract().abs()) - 1.0
    }

    fn rms(of: impl IntoIterator<Item = f64>) -> f64 {
        let (sum, n) = of.into_iter().fold((0.0, 0), |(sum, n), v| (sum + v * v, n + 1));
        (sum / f64::from(n)).sqrt()
    }

    #[test]
    fn a_cubic_departs_by_nothing_and_noise_by_its_size() {
        let even: Vec<f64> = (0..5000).map(f64::from).collect();
        // Logged when there was time to: intervals of a half and of five quarters.
        let uneven: Vec<f64> = (0..5000).map(|k| f64::from(k) + 0.25 * f64::from(k % 3)).collect();
        let noise: Vec<f64> = (0..5000).map(white).collect();
        for time_s in [even, uneven] {
            let cubic: Vec<f64> = time_s[..9].iter().map(|t| t.powi(3) - 2.0 * t).collect();
            assert!((0..9).all(|row| departure(&time_s, &cubic, row).abs() < 1e-9));
            let departs = rms((0..5000).map(|row| departure(&time_s, &noise, row)));
            assert!((departs / rms(noise.iter().copied()) - 1.0).abs() < 0.05, "{departs}");
        }
    }

    #[test]
    fn a_sensor_is_as_noisy_where_the_machine_moves_as_where_it_rests() {
        let of = |k: usize| if (k / 500).is_multiple_of(2) { white(k) } else { 20.0 * white(k) };
        let noise = as_where_quiet((0..4000).map(of).collect());
        assert!(rms(noise[500..1000].to_vec()) < 1.1 * rms(noise[..500].to_vec()));
        assert!((rms(noise) / rms((0..500).map(white)) - 1.0).abs() < 0.2);
    }
}
