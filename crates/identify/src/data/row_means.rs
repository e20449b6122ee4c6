//! Is a measured current that drives a reading of an instant, or the mean since the row before?
//!
//! A bench samples; a drive's own log gives the mean of what flowed since its last row, which stands for the middle of the
//! interval. Taken for an instant's, everything that the current does comes half a row too early. Nobody writes down which
//! it is: both are tried on the baseline, and the likelier stays.

use super::fill::filled;
use super::{Driving, Prepared, Series};

/// The recordings with measured currents as means over their rows, where such a current drives.
pub fn row_means(recordings: &[Prepared], series: &[Series]) -> Option<Vec<Prepared>> {
    let measured = |recording: &Prepared| recording.driving == Driving::Current;
    let each = recordings.iter().zip(series).map(|(recording, one)| {
        match one.column(recording.driving.column()).filter(|_| measured(recording)) {
            // A step within a row is in its mean; there is none to place.
            Some(current) => {
                Prepared { row_means: true, command: filled(current), edges: Vec::new(), ..recording.clone() }
            }
            None => recording.clone(),
        }
    });
    recordings.iter().any(measured).then(|| each.collect())
}

/// What was taken for true.
pub fn words() -> &'static str {
    "current_a is taken for the mean since the row before, as a drive's own log gives it, which fits better than a reading of an instant"
}

#[cfg(test)]
mod tests {
    use crate::readings::tests::read_and_said;

    const RIG: &str = "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = { value = 0.035, tol = 0.3 }\n\
                       torque_constant_nm_a = 1.0\nviscous_friction_nm_s = { value = 0.3, tol = 0.3 }\n\
                       [amplifier]\nkind = \"current\"\n";

    /// A motor that rubs, under a current that wanders and jumps and is logged every 20 ms: its mean since the last row, or what it
    /// is. Whether it is taken for the mean, and whether the report says so.
    fn taken_for_the_mean(mean: bool) -> (bool, bool) {
        const DT: f64 = 1e-4;
        let (mut speed, mut sum) = (0.0_f64, 0.0);
        let mut columns = [Vec::new(), Vec::new()];
        for k in 0..300_000_usize {
            let (t, step) = (k as f64 * DT, k / 4100);
            let current = 3.0 * ((step * step * 7919) as f64 * 0.37).sin() + 2.0 * (17.0 * t).sin();
            if k % 200 == 0 {
                let noise = 0.01 * ((k * k % 9973) as f64 * 0.37).sin();
                columns[0].push(if mean && k > 0 { sum / 200.0 } else { current });
                columns[1].push(speed + noise);
                sum = 0.0;
            }
            sum += current;
            speed += (current - 0.3 * speed) / 0.03 * DT;
        }
        let [driver, speeds] = columns;
        let columns = [("current_a", driver), ("shaft_speed_rad_s", speeds)];
        read_and_said(RIG, 0.02, columns, |read| read.row_means, "mean since the row before")
    }

    #[test]
    fn the_likelier_reading_is_taken_and_said() {
        assert_eq!(taken_for_the_mean(true), (true, true));
        assert_eq!(taken_for_the_mean(false), (false, false));
    }
}
