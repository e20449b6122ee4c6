//! Which instants are nearer to a row than to the next one.

use super::steps;

/// Up to here between a row and the next a message belongs to the first of them. Just below a half: stamps that lie midway,
/// as those of a topic twice as fast, go to the row behind them whatever their last digit.
const SHARE: f64 = 0.499;

/// A row, and the instants from which and before which it is the nearest one, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Near {
    pub at_s: f64,
    pub from_s: f64,
    pub to_s: f64,
}

/// Every row of these stamps. In a gap of the rows, before the first and behind the last of them nearness ends after half
/// a usual interval.
pub(super) fn of(stamps_s: &[f64]) -> impl Iterator<Item = Near> {
    let (usual_s, gaps) = steps(stamps_s);
    let mut gaps = gaps.into_iter().peekable();
    let mut from_s = stamps_s.first().map_or(f64::NAN, |first_s| first_s - (1.0 - SHARE) * usual_s);
    stamps_s.iter().enumerate().map(move |(row, at_s)| {
        let next_s = stamps_s.get(row + 1);
        let gap = gaps.next_if(|(begins_s, _)| begins_s == at_s).is_some();
        let step_s = next_s.filter(|_| !gap).map_or(usual_s, |next_s| next_s - at_s);
        let near = Near { at_s: *at_s, from_s, to_s: at_s + SHARE * step_s };
        from_s = match next_s {
            Some(next_s) if gap => next_s - (1.0 - SHARE) * usual_s,
            _ => near.to_s,
        };
        near
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_part_the_time_between_them_and_not_a_gap() {
        let mut stamps_s: Vec<f64> = (0..40).map(f64::from).collect();
        stamps_s.extend([100.0, 102.0, 103.0]);
        let near: Vec<Near> = of(&stamps_s).collect();
        assert_eq!(near.len(), 43);
        assert_eq!((near[0].from_s, near[0].to_s), (-0.501, 0.499));
        assert_eq!((near[39].to_s, near[40].from_s), (39.499, 99.499), "a gap belongs to no row");
        assert_eq!(near[40].to_s, 100.998, "a row that comes late is none");
        assert!(near.windows(2).all(|pair| pair[0].to_s <= pair[1].from_s));
        assert_eq!(of(&[]).count(), 0);
    }
}
