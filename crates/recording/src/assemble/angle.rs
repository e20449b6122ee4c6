//! An angle that a sensor gives within one turn, counted on over its turns: what kort calls the shaft's angle is unwrapped.

use std::f64::consts::{PI, TAU};

use crate::recording::Recording;

const COLUMN: &str = "shaft_angle_rad";

/// A jump of more than this between two samples of an angle that is all over the turn is one from an end of it to its beginning.
const JUMP: f64 = PI;

/// All over the turn.
const WIDE: f64 = 0.75 * TAU;

/// A shaft that turned further than this between two samples may have turned the other way.
const SURE: f64 = 0.8 * PI;

/// Rounding of what a log wrote of a whole turn.
const ROUNDED: f64 = 0.01;

/// Counts turns where the angle is within one throughout and jumps across its end; takes the column out where the log is too
/// slow to tell which way it went.
pub(super) fn unwrap(recording: &mut Recording) {
    let Some(place) = recording.columns.iter().position(|column| column.name == COLUMN) else { return };
    let values = &mut recording.columns[place].values;
    let samples = || values.iter().copied().filter(|value| value.is_finite());
    let (low, high) = (samples().fold(f64::INFINITY, f64::min), samples().fold(f64::NEG_INFINITY, f64::max));
    let steps = || samples().zip(samples().skip(1)).map(|(before, now)| now - before);
    if !(WIDE..TAU + ROUNDED).contains(&(high - low)) || !steps().any(|step| step.abs() > JUMP) {
        return;
    }
    let turns = |step: f64| (step / TAU).round();
    let longest = steps().map(|step| (step - TAU * turns(step)).abs()).fold(0.0, f64::max);
    if longest > SURE {
        recording.losses.push(format!(
            "`{COLUMN}` is left out: it is within one turn and jumps across its end, and between two samples it goes {:.2} of a turn, so that nobody can tell which way; log it faster",
            longest / TAU
        ));
        recording.columns.remove(place);
        return;
    }
    let (mut before, mut whole, mut jumps) = (None, 0.0, 0_u64);
    for value in values.iter_mut().filter(|value| value.is_finite()) {
        let step = turns(*value - before.unwrap_or(*value));
        before = Some(*value);
        whole -= step;
        jumps += u64::from(step != 0.0);
        *value += TAU * whole;
    }
    recording.notes.push(format!(
        "`{COLUMN}` is within one turn and jumps across its end {jumps} time(s): its turns are counted, at most {:.2} of one between two samples",
        longest / TAU
    ));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::Column;

    fn of(angles: impl Iterator<Item = f64>) -> Recording {
        let values: Vec<f64> = angles.collect();
        let time_s = (0..values.len()).map(|k| k as f64 * 0.01).collect();
        let columns = vec![Column::new(COLUMN, values)];
        let mut recording = Recording { time_s, columns, ..Recording::default() };
        unwrap(&mut recording);
        recording
    }

    #[test]
    fn a_sawtooth_is_counted_on_over_its_turns_both_ways() {
        let truth: Vec<f64> = (0..400).map(|k| 3.0 + 20.0 * (f64::from(k) * 0.02).sin()).collect();
        for low in [0.0, -PI] {
            let read = of(truth.iter().enumerate().map(|(k, angle)| {
                // Not every row has a sample.
                if k % 7 == 3 { f64::NAN } else { (angle - low).rem_euclid(TAU) + low }
            }));
            let angle = read.column(COLUMN).unwrap();
            let off = angle[0] - truth[0];
            assert!((off / TAU - (off / TAU).round()).abs() < 1e-9);
            for (k, (angle, truth)) in angle.iter().zip(&truth).enumerate().filter(|(k, _)| k % 7 != 3) {
                assert!((angle - truth - off).abs() < 1e-9, "{k}: {angle} beside {truth}");
            }
            assert!(
                read.notes[0].contains("turns are counted") && read.losses.is_empty(),
                "{:?}",
                read.notes
            );
        }
    }

    #[test]
    fn what_is_no_sawtooth_stays_and_what_is_too_slow_to_tell_is_left_out() {
        for angles in [
            (0..50).map(|k| f64::from(k) * 0.9).collect::<Vec<_>>(),
            (0..50).map(|k| (f64::from(k) * 0.3).sin() * 2.0).collect(),
            vec![0.0, 0.1, 3.0, 3.1, 0.2],
            vec![],
        ] {
            let read = of(angles.iter().copied());
            assert_eq!(read.column(COLUMN).unwrap(), angles);
            assert!(read.notes.is_empty());
        }
        let read = of((0..60).map(|k| (f64::from(k) * 0.9 * PI).rem_euclid(TAU)));
        assert!(
            read.columns.is_empty() && read.losses[0].contains("`shaft_angle_rad` is left out"),
            "{:?}",
            read.losses
        );
    }
}
