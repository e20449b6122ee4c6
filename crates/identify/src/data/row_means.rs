//! Is a measured current that drives a reading of an instant, or the mean since the row before?
//!
//! A bench samples; a drive's own log gives the mean of what flowed since its last row, which stands for the middle of the
//! interval. Taken for an instant's, everything that the current does comes half a row too early. Nobody writes down which
//! it is: both are tried on the baseline, and the likelier stays.

use super::fill::filled;
use super::{Driving, Prepared, Series};

/// The recordings with measured currents as means over their rows, where such a current drives.
pub fn row_means(recordings: &[Prepared], series: &[Series]) -> Option<Vec<Prepared>> {
    let each = recordings.iter().zip(series).map(|(recording, one)| {
        let current = one.column(recording.driving.column());
        let current = current.filter(|_| recording.driving == Driving::Current)?;
        // A step within a row is in its mean; there is none to place.
        Some(Prepared { row_means: true, command: filled(current), edges: Vec::new(), ..recording.clone() })
    });
    each.collect()
}

/// What was taken for true.
pub fn words() -> &'static str {
    "current_a is taken for the mean since the row before, as a drive's own log gives it, which fits better than a reading of an instant"
}
