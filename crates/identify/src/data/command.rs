//! The command on the control grid, and where it jumps.

use super::{Driving, Prepared};

use super::fill::catmull_rom;

impl Prepared {
    /// The command, or the measured current that drives in its place, at every control tick, where its edges came so
    /// many ticks before their rows.
    pub fn commands(&self, ticks_before: &[usize]) -> Vec<f64> {
        let ticks = self.stimulus.ticks.len();
        if matches!(self.driving, Driving::Speed | Driving::Power) {
            return vec![0.0; ticks];
        }
        // A command acts from its tick on; of a measured signal a tick shows the mean.
        let at_tick_s = if self.driving == Driving::Current { 0.5 * self.tick_s } else { 0.0 };
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
                None if self.every_command && self.driving != Driving::Current => a,
                None => {
                    let interval_s = self.time_s[row + 1] - self.time_s[row];
                    let u = ((t + at_tick_s - self.time_s[row]) / interval_s).clamp(0.0, 1.0);
                    let smooth = self.driving != Driving::Current
                        && row > 0
                        && row + 2 < n
                        && edge_at[row].is_none()
                        && edge_at[row + 2].is_none();
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
