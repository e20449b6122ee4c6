//! The command on the control grid, and where it jumps.

use super::{Driving, Prepared};
use kort_thruster::plant::Driven;

use super::fill::catmull_rom;

impl Prepared {
    /// Lets a measured signal that drives run on a curve between its samples instead of straight.
    pub fn curve_drivers(&mut self) {
        let time = self.time_s.clone();
        let values = match self.driving {
            Driving::Command(_) => return,
            Driving::Current | Driving::Power => self.command.clone(),
            Driving::Speed => self.speed_between.clone(),
        };
        let n = values.len();
        let mut row = 0;
        let tick_s = self.tick_s;
        for tick in &mut self.stimulus.ticks {
            while row + 2 < n && time[row + 1] <= tick.time_s + 0.02 * tick_s {
                row += 1;
            }
            let at = |t: f64| {
                let u = ((t - time[row]) / (time[row + 1] - time[row])).clamp(0.0, 1.0);
                let (before, after) = (values[row.saturating_sub(1)], values[(row + 2).min(n - 1)]);
                catmull_rom(before, values[row], values[row + 1], after, u)
            };
            let (a, b) = (at(tick.time_s), at(tick.time_s + tick_s));
            tick.driven = match tick.driven {
                Driven::Current(..) => Driven::Current(a, b),
                Driven::Speed(..) => Driven::Speed(a, b),
                Driven::Power(..) => Driven::Power(a, b),
                Driven::Command => Driven::Command,
            };
        }
    }

    /// The command at every control tick, where its edges came so many ticks before their rows.
    pub fn commands(&self, ticks_before: &[usize]) -> Vec<f64> {
        let ticks = self.stimulus.ticks.len();
        if !self.commanded {
            return vec![0.0; ticks];
        }
        let c = &self.command;
        let n = c.len();
        let mut edge_at: Vec<Option<usize>> = vec![None; n + 2];
        self.edges.iter().zip(ticks_before).for_each(|(row, before)| edge_at[*row] = Some(*before));
        let mut row = 0;
        let mut commands = Vec::with_capacity(ticks);
        for tick in &self.stimulus.ticks {
            let t = tick.time_s;
            while row + 2 < n && self.time_s[row + 1] <= t + 0.02 * self.tick_s {
                row += 1;
            }
            let (a, b) = (c[row], c[row + 1]);
            commands.push(match edge_at[row + 1] {
                Some(before) => {
                    let remaining = ((self.time_s[row + 1] - t) / self.tick_s).round() as usize;
                    if remaining <= before { b } else { a }
                }
                None => {
                    let u =
                        ((t - self.time_s[row]) / (self.time_s[row + 1] - self.time_s[row])).clamp(0.0, 1.0);
                    let smooth =
                        row > 0 && row + 2 < n && edge_at[row].is_none() && edge_at[row + 2].is_none();
                    if smooth { catmull_rom(c[row - 1], a, b, c[row + 2], u) } else { a + (b - a) * u }
                }
            });
        }
        commands
    }
}

/// A measured current as the command that made it: a sample caught in the middle of a jump (the
/// drive's lag) takes the value that follows, so that every step has one edge.
pub(super) fn steps_of(current: &[f64]) -> Vec<f64> {
    let mut out = current.to_vec();
    let mut sizes: Vec<f64> = current.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let usual = sizes.get(sizes.len() / 2).copied().unwrap_or(0.0);
    let range = current.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
    let jump = (8.0 * usual).max(0.02 * range);
    let mut k = 1;
    while k + 1 < current.len() {
        let (to, on) = (current[k] - current[k - 1], current[k + 1] - current[k]);
        if to.abs() > jump && on.abs() > 4.0 * usual && to * on > 0.0 {
            out[k] = current[k + 1];
            k += 1;
        }
        k += 1;
    }
    out
}

/// Takes a measured command's noise out: a parabola through the neighbours at each row, never
/// across an edge. Noise in the drive would pass for noise of the shaft.
pub(super) fn smooth_between(command: &mut [f64], edges: &[usize]) {
    const REACH: usize = 8;
    let raw = command.to_vec();
    let mut bounds: Vec<usize> = std::iter::once(0).chain(edges.iter().copied()).collect();
    bounds.push(raw.len());
    for segment in bounds.windows(2) {
        for (k, smooth) in command.iter_mut().enumerate().take(segment[1]).skip(segment[0]) {
            let (from, to) = (k.saturating_sub(REACH).max(segment[0]), (k + REACH + 1).min(segment[1]));
            if to - from < 4 {
                *smooth = raw[from..to].iter().sum::<f64>() / (to - from) as f64;
                continue;
            }
            let rows = to - from;
            let x = nalgebra::DMatrix::from_fn(rows, 3, |i, j| ((from + i) as f64 - k as f64).powi(j as i32));
            let y = nalgebra::DVector::from_column_slice(&raw[from..to]);
            let normal = x.tr_mul(&x);
            if let Some(c) = normal.cholesky() {
                *smooth = c.solve(&x.tr_mul(&y))[0];
            }
        }
    }
}

/// Rows where the command jumps: it holds on at least one side, so the change is a step.
pub(super) fn find_edges(command: &[f64]) -> Vec<usize> {
    let n = command.len();
    let range = command.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
    let mut sizes: Vec<f64> = command.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
    sizes.sort_by(f64::total_cmp);
    // Noise of a measured command; zero for a logged one that holds.
    let usual = sizes.get(sizes.len() / 2).copied().unwrap_or(0.0);
    (1..n)
        .filter(|k| {
            let jump = (command[*k] - command[k - 1]).abs();
            let before = if *k >= 2 { (command[k - 1] - command[k - 2]).abs() } else { 0.0 };
            let after = if k + 1 < n { (command[k + 1] - command[*k]).abs() } else { 0.0 };
            jump > 0.004 * range && jump > 4.0 * before.max(after).max(usual)
        })
        .collect()
}
