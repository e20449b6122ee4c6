//! Where does an effect act? Channel, regime and time spans of the error it removes.

use kort_identify::simulate::{Problem, Stack};

/// Where an error lies.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// Channel with most of it (against its noise).
    pub channel: &'static str,
    /// Words.
    pub regime: String,
    /// Spans that hold most of it.
    pub spans: Vec<[f64; 2]>,
}

/// A time after an edge that counts as transient, s.
const TRANSIENT_S: f64 = 0.4;

/// A way to sort samples.
struct Class {
    words: &'static str,
    takes: fn(&Sample) -> bool,
}

struct Sample {
    /// Speed over the largest speed, signed.
    speed: f64,
    since_edge_s: f64,
}

const CLASSES: &[Class] = &[
    Class { words: "within 0.4 s of a command step", takes: |s| s.since_edge_s < TRANSIENT_S },
    Class { words: "in steady running", takes: |s| s.since_edge_s >= TRANSIENT_S && s.speed.abs() > 0.1 },
    Class { words: "near standstill (below 10 % of top speed)", takes: |s| s.speed.abs() <= 0.1 },
    Class { words: "at low speed (10 to 45 %)", takes: |s| s.speed.abs() > 0.1 && s.speed.abs() <= 0.45 },
    Class { words: "at high speed (above 75 %)", takes: |s| s.speed.abs() > 0.75 },
    Class { words: "turning ahead", takes: |s| s.speed > 0.1 },
    Class { words: "turning astern", takes: |s| s.speed < -0.1 },
];

/// Locates the squared error that goes from `before` to `after` (measured minus simulated).
/// `speed` is the simulated shaft speed at each row of each recording.
pub fn locate(problem: &Problem, before: &Stack, after: &Stack, speed: &[Vec<f64>]) -> Place {
    let mut best: (f64, &'static str) = (f64::MIN, "");
    for name in problem.recordings.iter().flat_map(|r| &r.channels).map(|c| c.response.name()) {
        let (mut removed, mut left, mut n) = (0.0, 0.0, 0);
        each(problem, before, after, name, |_, _, b, a| {
            removed += b - a;
            left += a;
            n += 1;
        });
        let height = removed / (left / n.max(1) as f64).max(1e-300);
        if height > best.0 {
            best = (height, name);
        }
    }
    let channel = best.1;
    let top = speed.iter().flatten().fold(1e-9_f64, |m, v| m.max(v.abs()));
    let since: Vec<Vec<f64>> = problem.recordings.iter().map(since_edge).collect();
    let mut total = 0.0;
    let mut count = 0.0;
    let mut by_class = vec![(0.0, 0.0); CLASSES.len()];
    let mut by_second: std::collections::BTreeMap<(usize, i64), f64> = std::collections::BTreeMap::new();
    each(problem, before, after, channel, |r, row, b, a| {
        let sample = Sample { speed: speed[r][row] / top, since_edge_s: since[r][row] };
        total += b - a;
        count += 1.0;
        for (class, sums) in CLASSES.iter().zip(&mut by_class) {
            if (class.takes)(&sample) {
                sums.0 += b - a;
                sums.1 += 1.0;
            }
        }
        *by_second.entry((r, problem.recordings[r].time_s[row].floor() as i64)).or_insert(0.0) += b - a;
    });
    Place { channel, regime: words(total, count, &by_class), spans: spans(problem, &by_second, total) }
}

fn each(
    problem: &Problem,
    before: &Stack,
    after: &Stack,
    name: &str,
    mut f: impl FnMut(usize, usize, f64, f64),
) {
    for (r, recording) in problem.recordings.iter().enumerate() {
        for (c, channel) in recording.channels.iter().enumerate() {
            if channel.response.name() != name {
                continue;
            }
            for (i, row) in channel.rows.iter().enumerate() {
                if !problem.masked[r][*row] {
                    f(r, *row, before[r][c][i].powi(2), after[r][c][i].powi(2));
                }
            }
        }
    }
}

/// Time since the last step of the command at each row, s; infinite before the first.
pub fn since_edge(recording: &kort_identify::data::Prepared) -> Vec<f64> {
    let mut last = f64::NEG_INFINITY;
    let mut edges = recording.edges.iter().copied().peekable();
    (0..recording.time_s.len())
        .map(|row| {
            if edges.next_if(|e| *e <= row).is_some() {
                last = recording.time_s[row];
            }
            recording.time_s[row] - last
        })
        .collect()
}

/// Share of the error in one class that is still a share: the rest may hold a little less than none.
const MOST_OF_ALL: f64 = 1.05;

/// Classes that hold clearly more of the error than of the samples, and most of the error. One that holds more than all
/// of it says nothing: elsewhere the error grew.
fn words(total: f64, count: f64, by_class: &[(f64, f64)]) -> String {
    let mut picked: Vec<(f64, String)> = CLASSES
        .iter()
        .zip(by_class)
        .filter_map(|(class, (sum, n))| {
            let (share, part) = (sum / total.max(1e-300), n / count.max(1.0));
            (share > 0.45 && share <= MOST_OF_ALL && share > 1.25 * part).then(|| {
                (
                    share / part.max(1e-3),
                    format!(
                        "{} ({:.0} % of the error in {:.0} % of the time)",
                        class.words,
                        100.0 * share.min(1.0),
                        100.0 * part
                    ),
                )
            })
        })
        .collect();
    picked.sort_by(|a, b| b.0.total_cmp(&a.0));
    picked.truncate(2);
    if picked.is_empty() {
        "throughout".into()
    } else {
        picked.into_iter().map(|p| p.1).collect::<Vec<_>>().join(", ")
    }
}

/// The fewest seconds that hold 60 % of the error, joined where they touch; ten spans at most.
fn spans(
    problem: &Problem,
    by_second: &std::collections::BTreeMap<(usize, i64), f64>,
    total: f64,
) -> Vec<[f64; 2]> {
    let mut seconds: Vec<_> = by_second.iter().collect();
    seconds.sort_by(|a, b| b.1.total_cmp(a.1).then(a.0.cmp(b.0)));
    let mut kept = Vec::new();
    let mut sum = 0.0;
    for ((r, second), value) in seconds {
        if sum > 0.6 * total {
            break;
        }
        sum += value;
        kept.push((*r, *second));
    }
    kept.sort_unstable();
    let mut out: Vec<(usize, i64, i64)> = Vec::new();
    for (r, second) in kept {
        match out.last_mut() {
            Some(last) if last.0 == r && second <= last.2 + 1 => last.2 = second + 1,
            _ => out.push((r, second, second + 1)),
        }
    }
    out.sort_by_key(|(r, a, b)| (std::cmp::Reverse(b - a), *r, *a));
    out.truncate(10);
    out.sort_unstable();
    out.into_iter()
        .map(|(r, a, b)| {
            let times = &problem.recordings[r].time_s;
            [(a as f64).max(times[0]), (b as f64).min(times[times.len() - 1])]
        })
        .collect()
}
