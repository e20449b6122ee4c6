//! Where a command turns round faster than its log can follow.
//!
//! Through the rows of a sine beyond a quarter of their rate a line shows less than there was, and beyond half of it another
//! sine, slower (aliasing; Shannon 1949, Proc. IRE 37:10). A chirp that runs past comes back as if it were slow, so what
//! follows is lost as well until the command stands or has been slow for long. Where each command is logged nothing is. What
//! turns round as often and by chance, as a stiff loop's answer to its sensor's noise and counts does, has no slower likeness:
//! that is doubt between samples ([`crate::between`]), and no row is lost for it.

use crate::data::{Driving, Prepared};
use crate::hypothesis::Hypothesis;
use crate::simulate::Problem;
use crate::thin::Thin;

/// Rows that are looked at together.
const WINDOW: usize = 16;
/// Share of them at which the command turns round from which on it is faster than a quarter of their rate.
const TURNS: f64 = 0.5;
/// Share of its power that a command may differ by from one frequency's course, `x[k+1] + x[k-1] = 2 cos(w) x[k]`, to be one:
/// a sine's is nothing, a chirp's a twentieth at most; of white noise one window in a hundred thousand is below 0.12.
const STRAYS: f64 = 0.1;
/// Change from row to row that counts, as a share of the command's range: less is noise of a loop.
const CHANGE: f64 = 0.1;
/// For how many times as long a command must be slow, after it was faster, to be taken for slow: past a whole rate a sine that
/// goes on rising evenly comes back for as long as it took from a quarter of it to three.
const SLOW_AGAIN: usize = 2;
/// Share of the rows under command beyond which a recording tells nothing.
const NEARLY_ALL: f64 = 0.9;

impl Prepared {
    /// From which row to which what was commanded is not known for what the log holds of it.
    fn too_slow(&self) -> Vec<(usize, usize)> {
        let n = self.command.len();
        let mut lost = Vec::new();
        if !matches!(self.driving, Driving::Command(_)) || self.every_command || self.ticks_per_row < 2 {
            return lost;
        }
        let (low, high) =
            self.command.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), c| (l.min(*c), h.max(*c)));
        let large = CHANGE * (high - low);
        let turns = |row: usize| {
            let [before, after] = [row, row + 1].map(|k| self.command[k] - self.command[k - 1]);
            before * after < 0.0 && before.abs().min(after.abs()) > large
        };
        let fast = |row: usize| {
            let often = (row..row + WINDOW).filter(|k| turns(*k)).count() as f64 >= TURNS * WINDOW as f64;
            often && of_one_frequency(&self.command[row - 1..=row + WINDOW])
        };
        let stands = |row: usize| {
            let window = &self.command[row..row + WINDOW];
            window.iter().all(|command| *command == window[0])
        };
        let mut row = 1;
        while row + WINDOW < n {
            if !fast(row) {
                row += 1;
                continue;
            }
            let (mut last, mut until) = (row, row);
            while until + WINDOW < n && !stands(until) && until - last <= SLOW_AGAIN * (last + WINDOW - row) {
                until += 1;
                if until + WINDOW < n && fast(until) {
                    last = until;
                }
            }
            if until + WINDOW >= n {
                until = n - 1;
            }
            lost.push((row, until));
            row = until + 1;
        }
        lost
    }
}

/// Whether a course swings about its mean with one frequency, known or not.
fn of_one_frequency(course: &[f64]) -> bool {
    let mean = course.iter().sum::<f64>() / course.len() as f64;
    // Neighbours' sum, and what is between them.
    let of = |w: &[f64]| (w[0] + w[2] - 2.0 * mean, w[1] - mean);
    let sum = |of_pair: fn((f64, f64)) -> f64| course.windows(3).map(|w| of_pair(of(w))).sum::<f64>();
    let (power, both, beside) = (sum(|(_, x)| x * x), sum(|(s, x)| s * x), sum(|(s, _)| s * s));
    beside - both * both / power.max(f64::MIN_POSITIVE) < STRAYS * 2.0 * power
}

impl Problem<'_> {
    /// Rows that the log is too slow for, and those after them on which that still shows, by recording; none where it keeps
    /// up.
    pub fn too_slow(&self, stated: &Hypothesis) -> Option<Vec<Vec<bool>>> {
        let spans: Vec<_> = self.recordings.iter().map(Prepared::too_slow).collect();
        let mut rows = self.shown_after(&spans, stated)?;
        for (rows, spans) in rows.iter_mut().zip(&spans) {
            spans.iter().for_each(|(from, to)| rows[*from..=*to].fill(true));
        }
        Some(rows)
    }
}

/// A line for every recording that has some.
pub fn words<'a>(recordings: &'a [Prepared], rows: &'a [Vec<bool>]) -> impl Iterator<Item = String> + 'a {
    recordings.iter().zip(rows).filter_map(|(recording, rows)| {
        let first = rows.iter().position(|lost| *lost)?;
        Some(format!(
            "{}: from {:.3} s on the command turns round faster than the log can follow: what was commanded between rows is not known, and {} rows are left out; log the command at the control rate, or slow it down",
            recording.name,
            recording.time_s[first],
            rows.iter().filter(|lost| **lost).count()
        ))
    })
}

/// Why recordings tell nothing of which the log is too slow for nearly all.
pub fn tells_nothing(recordings: &[Prepared], rows: &[Vec<bool>]) -> Option<Thin> {
    let (mut lost, mut under_command) = (0, 0);
    for (recording, rows) in recordings.iter().zip(rows) {
        let on = recording.command.iter().zip(rows).filter(|(command, _)| **command != 0.0);
        on.for_each(|(_, row)| {
            lost += usize::from(*row);
            under_command += 1;
        });
    }
    (lost as f64 > NEARLY_ALL * f64::from(under_command)).then(|| Thin {
        why: "the command turns round faster than the log can follow: what drove the machine is not known. Log it at the control rate, or slow it down".into(),
        still: true,
        of_the_log: false,
    })
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use kort_thruster::models::ModelName;
    use kort_thruster::rig::Rig;
    use rand::{Rng as _, SeedableRng};

    use super::{WINDOW, of_one_frequency, tells_nothing};
    use crate::data::Series;
    use crate::noise::Criterion;
    use crate::setup::Setup;

    /// First row that is lost of 4 s at 100 Hz, and whether nothing is told.
    fn lost(voltage: fn(f64) -> f64) -> (Option<usize>, bool) {
        let rig = "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 1.0\n\
                   winding_resistance_ohm = 1.0\n[amplifier]\nkind = \"voltage\"\n[sensors]\ncontrol_rate_hz = 1000\n";
        let rig = Rig::from_toml(rig).unwrap();
        let time_s: Vec<f64> = (0..400).map(|k| 0.01 * f64::from(k)).collect();
        let command: Vec<f64> = time_s.iter().map(|t| voltage(*t)).collect();
        let speed = command.iter().map(|volts| 0.9 * volts).collect();
        let columns = vec![("voltage_cmd_v".into(), command), ("shaft_speed_rad_s".into(), speed)];
        let series = [Series { name: "log".into(), time_s, columns }];
        let criterion =
            Criterion { form_error: 0.005, own_form_error: 0.2, facts_a_band: 10.0, timing_s: 0.001 };
        let Setup { problem, baseline, .. } =
            Setup::new(&series, &rig, ModelName::Model2, criterion).unwrap();
        let Some(rows) = problem.too_slow(&baseline) else { return (None, false) };
        (rows[0].iter().position(|lost| *lost), tells_nothing(&problem.recordings, &rows).is_some())
    }

    #[test]
    fn a_chirp_is_lost_from_a_quarter_of_the_rate_on_and_not_found_again_where_it_comes_back_as_slow() {
        // 25 t Hz: a quarter of the rate after 1 s, the rate itself at the end, where its samples hardly move.
        let (first, nothing) = lost(|t| 5.0 * (TAU * 12.5 * t * t).sin());
        assert!((85..105).contains(&first.unwrap()), "{first:?}");
        assert!(!nothing);
    }

    #[test]
    fn a_command_that_stands_is_known_again() {
        let (first, nothing) = lost(|t| if t < 1.0 { 5.0 * (TAU * 40.0 * t).sin() } else { 5.0 });
        assert!(first.unwrap() < 5 && !nothing);
        let (_, nothing) = lost(|t| 5.0 * (TAU * if t < 0.8 { 40.0 } else { 2.0 } * t).sin());
        assert!(!nothing, "so is one that is slow for long");
    }

    #[test]
    fn steps_a_slow_sine_and_the_noise_of_a_loop_are_followed() {
        assert_eq!(lost(|t| if ((5.0 * t) as usize).is_multiple_of(2) { 5.0 } else { -5.0 }).0, None);
        assert_eq!(lost(|t| 5.0 * (TAU * 8.0 * t).sin()).0, None);
        assert_eq!(lost(|t| 5.0 * (TAU * t).sin() + 0.2 * (TAU * 45.0 * t).sin()).0, None);
        // Scattered by the digits of the row's number, evenly from -5 to 5.
        let scattered =
            |t: f64| 10.0 * (((100.0 * t).round() * 78.233).sin() * 43_758.545).rem_euclid(1.0) - 5.0;
        assert_eq!(lost(scattered).0, None, "what a loop makes of noise has no slower likeness");
    }

    /// What [`super::STRAYS`] stands between.
    #[test]
    fn a_chirp_is_of_one_frequency_in_every_window_and_noise_hardly_ever() {
        let windows = |course: &[f64]| course.windows(WINDOW + 2).map(of_one_frequency).collect::<Vec<_>>();
        let chirp: Vec<f64> = (0..400).map(|k| (TAU * 0.00125 * f64::from(k * k)).sin()).collect();
        // From a quarter of the rows' rate to nearly all of it.
        assert!(windows(&chirp[100..380]).into_iter().all(|one| one));
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let noise: Vec<f64> = (0..100_000).map(|_| rng.random_range(-1.0..1.0)).collect();
        let taken = windows(&noise).into_iter().filter(|one| *one).count();
        assert!(taken < 10, "{taken} of 100,000");
    }

    #[test]
    fn what_is_all_too_fast_tells_nothing() {
        assert!(lost(|t| 5.0 * (TAU * 40.0 * t).sin()).1);
    }
}
