//! The stretches of a long recording that are compared.
//!
//! What hypotheses cost grows with the time that is simulated, what the recording tells does not: most of an hour is
//! more of the same. Of a long recording stretches are taken in which most moves, half of them spread over its whole
//! length, so that what changes slowly shows as well; between them the simulation leaps. After a leap what was fast before
//! has to be forgotten first, so no stretch is short beside that, and what lies between two is a pause or is compared too:
//! across a mere gap the command would be unknown, and it is not.

use std::ops::Range;

use kort_thruster::rig::Rig;

use crate::checks::SETTLE_S;
use crate::data::{KNOWN, Series, control_period_s, pause_s};
use crate::spectrum::median_interval;

/// Control ticks that are simulated for one hypothesis at most: 200 s at 500 Hz.
const MOST_TICKS: f64 = 1e5;
/// Rows of all recordings of which nothing is left out: of a slow log every row counts.
const FEWEST_ROWS: f64 = 5000.0;
/// Most stretches of one recording.
const STRETCHES: usize = 10;
/// Shortest stretch, s: a quarter of it is lost after the leap.
const SHORTEST_S: f64 = 4.0 * SETTLE_S;

/// The rows of each recording that are compared; none where all are.
pub fn stretches(series: &[Series], rig: &Rig) -> Option<Vec<Vec<Range<usize>>>> {
    let ticks = |one: &Series| {
        let pause_s = pause_s(&one.time_s);
        let seconds: f64 = one.time_s.windows(2).map(|w| w[1] - w[0]).filter(|s| *s <= pause_s).sum();
        seconds / control_period_s(rig, median_interval(&one.time_s))
    };
    let all: f64 = series.iter().map(ticks).sum();
    // Less than twice as much is not worth leaving something out.
    let rows: usize = series.iter().map(|one| one.time_s.len()).sum();
    let share = (MOST_TICKS / all).max(FEWEST_ROWS / rows as f64);
    (share < 0.5).then(|| series.iter().map(|one| of_one(one, share)).collect())
}

/// A recording without the rows that are not compared.
pub fn excerpt(series: &Series, rows: &[Range<usize>]) -> Series {
    let kept = |values: &[f64]| rows.iter().flat_map(|r| &values[r.clone()]).copied().collect();
    Series {
        name: series.name.clone(),
        time_s: kept(&series.time_s),
        columns: series.columns.iter().map(|(name, values)| (name.clone(), kept(values))).collect(),
    }
}

/// What was left out, in words; none if nothing was.
pub fn words(series: &Series, rows: &[Range<usize>]) -> Option<String> {
    let span = |r: &Range<usize>| series.time_s[r.end - 1] - series.time_s[r.start];
    let compared: usize = rows.iter().map(Range::len).sum();
    let stretches = match rows.len() {
        1 => "one stretch".into(),
        several => {
            format!(
                "{several} stretches; between them only what is slow (heat, a tank's return flow) is followed"
            )
        }
    };
    (compared < series.time_s.len()).then(|| {
        format!(
            "{}: of {:.0} s the {:.0} s in which most moves are compared, in {stretches}",
            series.name,
            span(&(0..series.time_s.len())),
            rows.iter().map(span).sum::<f64>(),
        )
    })
}

/// Rows of one recording, a share of its length or the shortest stretch if that is more.
fn of_one(series: &Series, share: f64) -> Vec<Range<usize>> {
    let (rows, time_s) = (series.time_s.len(), &series.time_s);
    let span_s = time_s[rows - 1] - time_s[0];
    let stretch_s = (share * span_s / STRETCHES as f64).max(SHORTEST_S);
    let blocks = ((span_s / stretch_s) as usize).clamp(1, rows);
    let count = ((share * blocks as f64).round() as usize).clamp(1, STRETCHES);
    let bounds: Vec<usize> = (0..=blocks).map(|k| k * rows / blocks).collect();
    let moves = movement(series, &bounds);
    let livelier = |a: &usize, b: &usize| moves[*b].total_cmp(&moves[*a]);
    let spread = count / 2;
    let mut chosen: Vec<usize> = (0..spread)
        .filter_map(|s| (s * blocks / spread..(s + 1) * blocks / spread).min_by(livelier))
        .collect();
    let mut rest: Vec<usize> = (0..blocks).filter(|k| !chosen.contains(k)).collect();
    rest.sort_by(livelier);
    chosen.extend(rest.into_iter().take(count - spread));
    chosen.sort_unstable();
    let pause_s = pause_s(time_s);
    let mut stretches: Vec<Range<usize>> = Vec::new();
    for k in chosen {
        match stretches.last_mut() {
            Some(last) if time_s[bounds[k]] - time_s[last.end - 1] <= pause_s => last.end = bounds[k + 1],
            _ => stretches.push(bounds[k]..bounds[k + 1]),
        }
    }
    stretches
}

/// How much moves in each block: the variance of every signal there, over its variance in all.
fn movement(series: &Series, bounds: &[usize]) -> Vec<f64> {
    let mut moves = vec![0.0; bounds.len() - 1];
    for (_, values) in series.columns.iter().filter(|(name, _)| KNOWN.contains(&name.as_str())) {
        let all = variance(values);
        if all > 0.0 {
            for (k, moved) in moves.iter_mut().enumerate() {
                *moved += variance(&values[bounds[k]..bounds[k + 1]]) / all;
            }
        }
    }
    moves
}

fn variance(values: &[f64]) -> f64 {
    let known = || values.iter().filter(|v| v.is_finite());
    let n = known().count().max(1) as f64;
    let mean = known().sum::<f64>() / n;
    known().map(|v| (v - mean).powi(2)).sum::<f64>() / n
}

#[cfg(test)]
mod tests {
    use kort_thruster::rig::Rig;

    use super::{SHORTEST_S, excerpt, stretches};
    use crate::data::{Series, pause_s};

    /// An hour at 20 Hz in which a drive is only used from 2000 to 2100 s, and hums a little all the time.
    fn hour() -> Series {
        let time_s: Vec<f64> = (0..72_000).map(|k| 0.05 * f64::from(k)).collect();
        let used = |t: f64| if (2000.0..2100.0).contains(&t) { 5.0 } else { 0.01 };
        let command = time_s.iter().map(|t| used(*t) * (3.0 * t).sin()).collect();
        let speed = time_s.iter().map(|t| used(*t) * (3.0 * t - 0.4).sin()).collect();
        let columns = vec![("current_cmd_a".into(), command), ("shaft_speed_rad_s".into(), speed)];
        Series { name: "hour".into(), time_s, columns }
    }

    fn rig() -> Rig {
        Rig::from_toml(
            "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 1.0\n",
        )
        .unwrap()
    }

    #[test]
    fn of_an_hour_what_is_used_is_compared_and_something_of_every_part() {
        let hour = hour();
        let rows = &stretches(std::slice::from_ref(&hour), &rig()).unwrap()[0];
        let part = excerpt(&hour, rows);
        assert!((4000..6000).contains(&part.time_s.len()), "{}", part.time_s.len());
        let in_use = part.time_s.iter().filter(|t| (2000.0..2100.0).contains(*t)).count();
        assert!(in_use > 1800, "{in_use}");
        for fifth in 0..5 {
            let (from, to) = (720.0 * f64::from(fifth), 720.0 * f64::from(fifth + 1));
            assert!(part.time_s.iter().any(|t| (from..to).contains(t)), "nothing from {from} to {to} s");
        }
        assert!(part.time_s.windows(2).all(|w| w[0] < w[1]));
    }

    /// What is left out between two stretches is a pause, and a stretch lasts longer than what is forgotten after it: a log of
    /// a drive at 5 kHz is long in ticks and short in seconds.
    #[test]
    fn stretches_of_a_fast_drive_are_no_gaps() {
        let mut fast = hour();
        let rows = 25_000;
        fast.time_s = (0..rows).map(|k| 0.004 * k as f64).collect();
        fast.columns.iter_mut().for_each(|c| c.1 = fast.time_s.iter().map(|t| (3.0 * t).sin()).collect());
        let mut rig = rig();
        rig.sensors.control_rate_hz = Some(5000.0);
        let rows = &stretches(std::slice::from_ref(&fast), &rig).unwrap()[0];
        for stretch in rows {
            let span_s = fast.time_s[stretch.end - 1] - fast.time_s[stretch.start];
            assert!(span_s > 0.99 * SHORTEST_S, "{stretch:?}");
        }
        let pauses = rows.windows(2).map(|w| fast.time_s[w[1].start] - fast.time_s[w[0].end - 1]);
        assert!(pauses.into_iter().all(|s| s > pause_s(&fast.time_s)), "{rows:?}");
    }

    #[test]
    fn a_short_recording_is_compared_whole() {
        let mut short = hour();
        short.time_s.truncate(6000);
        short.columns.iter_mut().for_each(|c| c.1.truncate(6000));
        assert!(stretches(&[short], &rig()).is_none());
    }
}
