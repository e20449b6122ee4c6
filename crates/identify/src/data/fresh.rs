//! Samples that a logger repeats until the next one comes.
//!
//! A logger that is faster than a sensor writes the last sample again at every row: an ESC's telemetry at 10 Hz or a
//! force cell at 25 Hz in a log of 100 Hz. Taken for samples of their rows, repeats lie behind by half the sensor's
//! interval, which is a lag of physics to any model. Only the row that first shows a sample is one.

use super::Series;

/// Columns of sensors; what is commanded is meant to hold.
const SENSED: [&str; 10] = [
    "shaft_speed_rad_s",
    "shaft_angle_rad",
    "thrust_n",
    "torque_n_m",
    "current_a",
    "flow_m_s",
    "ambient_m_s",
    "supply_v",
    "supply_current_a",
    "temperature_c",
];

/// Fewest changes of a column that tell how it is sampled.
const FEWEST: usize = 20;
/// A change below this share of a column's size is the rounding of a computation.
const ROUNDING: f64 = 1e-7;
/// A change of so many counts of a column's resolution is no rounding.
const COUNTS: f64 = 3.0;
/// Where the usual change is so many counts, two samples are the same by chance once in so many rows at most.
const FINE: f64 = 20.0;
/// Share of the runs of one value that last longer than a row, from which on a finely resolved sensor repeats itself.
const REPEATS: f64 = 0.2;
/// Rows a sample up to which a coarse sensor only stood still now and then.
const STANDS: f64 = 1.1;
/// Share of the changes that may follow upon another although each sample lasts several rows: lost rows.
const LOST: f64 = 0.05;

/// A recording with only the first of each repeated sample, and words about the columns that repeat theirs.
pub fn fresh(series: &Series) -> (Series, Option<String>) {
    let mut out = series.clone();
    let mut found = Vec::new();
    for (name, column) in out.columns.iter_mut().filter(|c| SENSED.contains(&c.0.as_str())) {
        if let Some(rows) = rows_a_sample(column) {
            blank_repeats(column, rows);
            found.push(format!("{name} ({rows:.1} rows a sample)"));
        }
    }
    let words = (!found.is_empty()).then(|| {
        format!(
            "{}: samples are repeated until the next one comes: {}. Only the row that first shows a sample is taken for one, and it may have been read anywhere in the row before; better leave the cells empty where nothing new was read",
            series.name,
            found.join(", ")
        )
    });
    (out, words)
}

/// Rows that each sample of a column lasts, in the mean, where it is repeated.
fn rows_a_sample(column: &[f64]) -> Option<f64> {
    let known: Vec<f64> = column.iter().copied().filter(|v| v.is_finite()).collect();
    let changes: Vec<f64> = known.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
    let rounding = ROUNDING * known.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let mut sizes: Vec<f64> = changes.iter().copied().filter(|c| *c > rounding).collect();
    if sizes.len() < FEWEST {
        return None;
    }
    sizes.sort_by(f64::total_cmp);
    let (count, usual) = (sizes[sizes.len() / 100], sizes[sizes.len() / 2]);
    // A coarse sensor stands still for long, but where it moves fast it changes at every row; one that is repeated
    // never changes twice in a row.
    let large = |k: usize| changes.get(k).is_some_and(|c| *c > COUNTS * count);
    let moves: Vec<usize> = (0..changes.len()).filter(|k| large(*k)).collect();
    let follow =
        |k: &&usize| changes.get(**k + 1).is_some_and(|c| *c > 0.0) || **k > 0 && changes[**k - 1] > 0.0;
    let following = moves.iter().filter(follow).count();
    let never_twice = moves.len() >= FEWEST && (following as f64) < LOST * moves.len() as f64;
    let runs = runs(column);
    let longer = runs.iter().filter(|run| run.1 > 1).count();
    let by_no_chance = usual > FINE * count && longer as f64 > REPEATS * runs.len() as f64;
    if !never_twice && !by_no_chance {
        return None;
    }
    // Of the usual runs, a row longer or shorter: where the sensor reads the same again, one lasts as long as several.
    let mut lengths: Vec<usize> = runs.iter().map(|run| run.1).collect();
    lengths.sort_unstable();
    let middle = lengths[lengths.len() / 2];
    let usual: Vec<f64> = lengths.iter().filter(|l| **l <= middle + 1).map(|l| *l as f64).collect();
    // A coarse sensor that now and then shows the same is read at every row all the same.
    Some(usual.iter().sum::<f64>() / usual.len() as f64).filter(|rows| *rows > STANDS)
}

/// First rows and lengths of the runs of one value; empty cells end none.
fn runs(column: &[f64]) -> Vec<(usize, usize)> {
    let mut runs: Vec<(usize, usize)> = Vec::new();
    for (row, value) in column.iter().enumerate().filter(|(_, v)| v.is_finite()) {
        match runs.last_mut() {
            Some((first, length)) if column[*first] == *value => *length = row - *first + 1,
            _ => runs.push((row, 1)),
        }
    }
    runs
}

/// Empties the cells that repeat a sample; in a long run the sensor read the same again at its own rate.
fn blank_repeats(column: &mut [f64], rows_a_sample: f64) {
    for (first, length) in runs(column) {
        let read = (length as f64 / rows_a_sample).round().max(1.0) as usize;
        let samples: Vec<usize> =
            (0..read).map(|k| first + (k as f64 * rows_a_sample).ceil() as usize).collect();
        for row in (first..first + length).filter(|row| !samples.contains(row)) {
            column[row] = f64::NAN;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::fresh;
    use crate::data::Series;

    const ROWS: usize = 1000;

    /// A force in a log of 100 Hz, read at a rate and to a count; standing still before 2 s.
    fn thrust(rate_hz: f64, count: f64) -> Vec<f64> {
        let read = |row: usize| (0.01 * row as f64 * rate_hz).floor() / rate_hz;
        let force = |t: f64| {
            let noise = (7919.0 * t * t).sin();
            if t < 2.0 { 0.3 * noise } else { 20.0 * (1.3 * t).sin() + 0.3 * noise }
        };
        (0..ROWS).map(|row| (force(read(row)) / count).round() * count).collect()
    }

    fn samples(column: Vec<f64>) -> (usize, Option<String>) {
        let time_s = (0..ROWS).map(|k| 0.01 * k as f64).collect();
        let series = Series { name: "log".into(), time_s, columns: vec![("thrust_n".into(), column)] };
        let (fresh, words) = fresh(&series);
        (fresh.columns[0].1.iter().filter(|v| v.is_finite()).count(), words)
    }

    #[test]
    fn repeats_are_no_samples() {
        for (rate_hz, count) in [(20.0, 1e-6), (25.0, 0.05), (40.0, 1e-6), (80.0, 1e-6)] {
            let (left, words) = samples(thrust(rate_hz, count));
            let read = (0.01 * ROWS as f64 * rate_hz).round() as usize;
            assert!(left.abs_diff(read) < read / 20, "{left} of {read} at {rate_hz} Hz");
            assert!(words.is_some_and(|w| w.contains("thrust_n (")));
        }
    }

    #[test]
    fn a_sensor_read_at_every_row_keeps_every_sample_however_coarse() {
        for count in [1e-6, 0.1, 1.0, 4.0] {
            assert_eq!(samples(thrust(100.0, count)), (ROWS, None), "to {count} N");
        }
        let resting: Vec<f64> = (0..ROWS).map(|k| if k < 700 { 0.0 } else { (k as f64).sin() }).collect();
        assert_eq!(samples(resting), (ROWS, None));
    }

    #[test]
    fn a_slow_ramp_of_a_coarse_sensor_is_no_repeat() {
        let ramp = (0..ROWS).map(|k| (k / 5) as f64 * 0.1).collect();
        assert_eq!(samples(ramp), (ROWS, None));
    }
}
