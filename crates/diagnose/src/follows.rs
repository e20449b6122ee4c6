//! How much of a residual follows what the machine does?
//!
//! Noise of a sensor, drift and turbulence do not know the shaft's speed, the water's or the motor's current; an error
//! of the equations does. So what a smooth function of these, fitted on some stretches of a recording, says of the
//! residual on the others is no noise, whatever its channel and however slow or rough the noise beside it is. A
//! function that was fitted to noise says nothing there, and does harm: the measure then is none.
//!
//! The function: piecewise linear over each input and over each pair of them (Hastie & Tibshirani 1990, Generalized
//! Additive Models), its weights held small (ridge) by what does best on stretches left out (Stone 1974, J. R. Stat.
//! Soc. B 36:111).

use kort_identify::between::evenly;
use kort_identify::fit::Fit;
use kort_identify::simulate::{Problem, Stack};
use kort_thruster::plant::Sensed;
use nalgebra::{Cholesky, DMatrix};

/// Most rows that are looked at.
const MOST_ROWS: usize = 3000;
/// Stretches that are left out in turn.
const STRETCHES: usize = 10;
/// Points of a curve over one input, and of a surface over two along each.
const POINTS: usize = 7;
const COARSE: usize = 4;
/// Time constants of the slow parts that an input is compared with, s: a transient of the rotor, one of the water.
const MEMORIES_S: [f64; 2] = [0.3, 1.5];
/// Penalties of a weight's square, as shares of what an even spread of all samples over the points would give.
const RIDGES: [f64; 3] = [1e-3, 1e-2, 1e-1];

/// Root mean square of what follows the machine's doing, by recording and channel; zero where nothing does.
pub fn follows(problem: &Problem, fit: &Fit, residual: &Stack) -> Vec<Vec<f64>> {
    let features = features(problem, fit);
    let rows: usize = problem.recordings.iter().map(|r| r.time_s.len()).sum();
    let every = rows.div_ceil(MOST_ROWS);
    // Channels that are sampled together share everything but their errors.
    let mut groups: Vec<Group> = Vec::new();
    for (r, recording) in problem.recordings.iter().enumerate() {
        let (from, to) = (recording.time_s[0], recording.time_s[recording.time_s.len() - 1]);
        for (c, channel) in recording.channels.iter().enumerate() {
            // A sensor slower than the log keeps all its samples.
            let few = channel.rows.len() * every < recording.time_s.len() * 2;
            let every = if few { 1 } else { every };
            let picks = spread(channel.rows.len(), every).filter(|k| !problem.masked[r][channel.rows[*k]]);
            let picks: Vec<usize> = picks.collect();
            let rows: Vec<(usize, usize)> = picks.iter().map(|k| (r, channel.rows[*k])).collect();
            let errors: Vec<f64> = picks.iter().map(|k| residual[r][c][*k]).collect();
            let stretch = |row: usize| {
                let part = (recording.time_s[row] - from) / (to - from).max(1e-9);
                ((part * STRETCHES as f64) as usize).min(STRETCHES - 1)
            };
            let stretches: Vec<usize> = rows.iter().map(|(_, row)| stretch(*row)).collect();
            match groups.iter_mut().find(|g| g.rows == rows) {
                Some(group) => group.errors.push((c, errors)),
                None => groups.push(Group { rows, stretches, errors: vec![(c, errors)] }),
            }
        }
    }
    let mut out: Vec<Vec<f64>> = problem.recordings.iter().map(|r| vec![0.0; r.channels.len()]).collect();
    for group in groups {
        let Some((r, _)) = group.rows.first() else { continue };
        group.sizes(&features).into_iter().for_each(|(c, size)| out[*r][c] = size);
    }
    out
}

/// One of every so many samples, at no fixed stride: a log beats with the sensor behind it, and a stride that keeps
/// time with the beat would take its error for one of the machine.
fn spread(samples: usize, every: usize) -> impl Iterator<Item = usize> {
    let at = move |j: usize| j * every + (evenly(j) * every as f64) as usize;
    (0..samples.div_ceil(every)).map(at).filter(move |k| *k < samples)
}

/// Errors of channels that are sampled on the same rows.
struct Group {
    /// Recording and row.
    rows: Vec<(usize, usize)>,
    stretches: Vec<usize>,
    /// By channel.
    errors: Vec<(usize, Vec<f64>)>,
}

impl Group {
    /// Root mean square of what follows, by channel.
    fn sizes(&self, features: &[Vec<Vec<f64>>]) -> Vec<(usize, f64)> {
        let n = self.rows.len();
        let Some((r, row)) = self.rows.first() else { return Vec::new() };
        let width = features[*r][*row].len();
        let x = DMatrix::from_fn(width, n, |j, k| features[self.rows[k].0][self.rows[k].1][j]);
        let y = DMatrix::from_fn(n, self.errors.len(), |k, c| self.errors[c].1[k]);
        let whole: Vec<f64> = y.column_iter().map(|e| e.norm_squared()).collect();
        let mut best = whole.clone();
        // Rows of one stretch of one recording lie together.
        let spans: Vec<(usize, usize)> = spans(&self.stretches);
        let grams: Vec<DMatrix<f64>> = spans
            .iter()
            .map(|(from, to)| {
                let part = x.columns(*from, to - from);
                part * part.transpose()
            })
            .collect();
        let product = |from: usize, to: usize| x.columns(from, to - from) * y.rows(from, to - from);
        let (gram, all): (DMatrix<f64>, DMatrix<f64>) = (grams.iter().sum(), product(0, n));
        for ridge in RIDGES {
            let mut left = vec![0.0; whole.len()];
            for (own, (from, to)) in grams.iter().zip(&spans) {
                let mut normal = &gram - own;
                (0..width).for_each(|j| normal[(j, j)] += ridge * n as f64 / width as f64);
                let Some(normal) = Cholesky::new(normal) else { return Vec::new() };
                let weights = normal.solve(&(&all - product(*from, *to)));
                let said = x.columns(*from, to - from).tr_mul(&weights);
                let missed = y.rows(*from, to - from) - said;
                left.iter_mut().zip(missed.column_iter()).for_each(|(l, m)| *l += m.norm_squared());
            }
            best.iter_mut().zip(left).for_each(|(b, l)| *b = b.min(l));
        }
        let size = |(whole, left): (f64, f64)| ((whole - left) / n as f64).max(0.0).sqrt();
        self.errors.iter().map(|e| e.0).zip(whole.into_iter().zip(best).map(size)).collect()
    }
}

/// From where to where each value lasts.
fn spans(stretches: &[usize]) -> Vec<(usize, usize)> {
    let mut out: Vec<(usize, usize)> = Vec::new();
    for (k, stretch) in stretches.iter().enumerate() {
        match out.last_mut() {
            Some(last) if stretches[last.0] == *stretch => last.1 = k + 1,
            _ => out.push((k, k + 1)),
        }
    }
    out
}

/// What the function is linear in, at every row of every recording: curves over speed, flow and current of the
/// simulation and over how each differs from its own slow parts, and surfaces over two of them.
fn features(problem: &Problem, fit: &Fit) -> Vec<Vec<Vec<f64>>> {
    let rows = problem.rows(&fit.hypothesis, &fit.values);
    let mut out: Vec<Vec<Vec<f64>>> = rows.iter().map(|rows| vec![vec![1.0]; rows.len()]).collect();
    let signals: [fn(&Sensed) -> f64; 3] = [|s| s.true_speed_rad_s, |s| s.flow_m_s, |s| s.current_a];
    let mut inputs: Vec<[Input; 3]> = Vec::new();
    for of in signals {
        let signal: Input = rows.iter().map(|rows| rows.iter().map(of).collect()).collect();
        let moved = MEMORIES_S.map(|memory_s| {
            let each = signal.iter().zip(&problem.recordings);
            unit(each.map(|(s, recording)| moved(s, &recording.time_s, memory_s)).collect())
        });
        let [short, long] = moved;
        // What does not move tells nothing.
        inputs.extend([Some([unit(signal), short, long])].into_iter().flatten().filter(|i| !i[0].is_empty()));
    }
    for input in inputs.iter().flatten().filter(|i| !i.is_empty()) {
        for (out, x) in out.iter_mut().flatten().zip(input.iter().flatten()) {
            out.extend(hats(POINTS, *x));
        }
    }
    let beside: Vec<(&Input, &Input)> = (0..inputs.len())
        .flat_map(|k| {
            let own = (&inputs[k][0], &inputs[k][1]);
            inputs[k + 1..].iter().map(|other| (&inputs[k][0], &other[0])).chain([own]).collect::<Vec<_>>()
        })
        .filter(|(_, other)| !other.is_empty())
        .collect();
    for (one, other) in beside {
        let both = one.iter().flatten().zip(other.iter().flatten());
        for (out, (x, y)) in out.iter_mut().flatten().zip(both) {
            out.extend(hats(COARSE, *x).flat_map(|a| hats(COARSE, *y).map(move |b| a * b)));
        }
    }
    out
}

/// A signal at every row of every recording; empty if it does not move.
type Input = Vec<Vec<f64>>;

/// Over its root mean square.
fn unit(signal: Input) -> Input {
    let n: usize = signal.iter().map(Vec::len).sum();
    let rms = (signal.iter().flatten().map(|v| v * v).sum::<f64>() / n.max(1) as f64).sqrt();
    if !(rms > 1e-9 && rms.is_finite()) {
        return Vec::new();
    }
    signal.into_iter().map(|one| one.into_iter().map(|v| v / rms).collect()).collect()
}

/// How a signal differs from its slow part.
fn moved(signal: &[f64], time_s: &[f64], memory_s: f64) -> Vec<f64> {
    let mut slow = signal.first().copied().unwrap_or(0.0);
    let mut before = time_s.first().copied().unwrap_or(0.0);
    signal
        .iter()
        .zip(time_s)
        .map(|(value, now)| {
            slow += (value - slow) * (1.0 - (-(now - before) / memory_s).exp());
            before = *now;
            value - slow
        })
        .collect()
}

/// Weights of the points of a piecewise linear curve over -2 to 2 root mean squares, held beyond.
fn hats(points: usize, at: f64) -> impl Iterator<Item = f64> {
    let last = (points - 1) as f64;
    let place = ((at / 4.0 + 0.5) * last).clamp(0.0, last);
    (0..points).map(move |k| (1.0 - (place - k as f64).abs()).max(0.0))
}

#[cfg(test)]
mod tests {
    use super::{follows, spread};
    use crate::stand;

    fn of(error: impl Fn(f64, f64, f64) -> f64) -> f64 {
        stand::left(error, |problem, fit, residual| follows(problem, fit, residual)[0][0])
    }

    #[test]
    fn an_error_that_is_a_function_of_the_speed_follows_under_noise_as_large() {
        let size = of(|speed, _, noise| (2.0 * speed).sin() + noise);
        assert!((0.55..0.85).contains(&size), "{size} of {}", 0.5_f64.sqrt());
    }

    #[test]
    fn samples_are_picked_in_order_at_no_fixed_stride() {
        assert!(spread(7, 1).eq(0..7));
        let picks: Vec<usize> = spread(4000, 2).collect();
        assert!(picks.windows(2).all(|w| w[1] > w[0]) && picks.len() == 2000);
        let odd = picks.iter().filter(|k| *k % 2 == 1).count();
        assert!((900..1100).contains(&odd), "{odd} of 2000");
    }

    #[test]
    fn noise_and_a_drift_of_their_own_do_not() {
        let white = of(|_, _, noise| noise);
        let drift = of(|_, time, noise| (0.4 * time).sin() + 0.3 * noise);
        assert!(white < 0.1 && drift < 0.1, "{white}, {drift}");
    }
}
