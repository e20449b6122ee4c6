//! The command on the control grid, and where it jumps.

use super::{Driving, Prepared};

use super::fill::catmull_rom;

impl Prepared {
    /// The command, or the measured current that drives in its place, at every control tick, where its edges came so
    /// many ticks before their rows. A tick in which one came has the mean of what was before it and after.
    pub fn commands(&self, ticks_before: &[f64]) -> Vec<f64> {
        let ticks = self.stimulus.ticks.len();
        if matches!(self.driving, Driving::Speed | Driving::Power) {
            return vec![0.0; ticks];
        }
        // A command acts from its tick on; of a measured signal a tick shows the mean.
        let at_tick_s = if self.driving == Driving::Current { 0.5 * self.tick_s } else { 0.0 };
        let c = &self.command;
        let n = c.len();
        // What returns from a jump came no further than the drive lets anything come.
        let (least, most) = c.iter().fold((0.0_f64, 0.0_f64), |(low, high), v| (low.min(*v), high.max(*v)));
        let mut edge_at: Vec<Option<f64>> = vec![None; n + 2];
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
                None if self.row_means => b,
                Some(before) => {
                    let remaining = ((self.time_s[row + 1] - t) / self.tick_s).round();
                    let share = (before + 1.0 - remaining).clamp(0.0, 1.0);
                    if share > 0.0 {
                        let interval_s = self.time_s[row + 1] - self.time_s[row];
                        let rows = (self.time_s[row + 1] - t - at_tick_s) / interval_s;
                        let came = if self.stepwise { b } else { before_its_row(c, row + 1, rows.max(0.0)) };
                        let after = came.clamp(least, most);
                        a + (after - a) * share
                    } else {
                        a
                    }
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
        let (to, on) = (change(current, k), change(current, k + 1));
        let beside = beside(to + on, change(current, k - 1)).max(beside(to + on, change(current, k + 2)));
        // What a control loop makes is no step: each of its samples is as good as the next.
        let one_step = (to + on).abs() > beside;
        if to.abs() > jump && on.abs() > 4.0 * usual && to * on > 0.0 && one_step {
            out[k] = current[k + 1];
            k += 1;
        }
        k += 1;
    }
    out
}

/// Share of a jump that is gone at the next row from which on it was a spike.
const SPIKE: f64 = 0.75;
/// Share of a jump that is gone at the next row from which on the law of its return shows.
const RETURNS: f64 = 0.125;
/// Most by which a return grows or shrinks from row to row, as it is followed back.
const FASTEST: f64 = 4.0;

/// A command's change to a row from the one before.
fn change(command: &[f64], row: usize) -> f64 {
    if row > 0 && row < command.len() { command[row] - command[row - 1] } else { 0.0 }
}

/// What a jump must be larger than beside a neighbouring change: what goes its own way may be the slope it lies on, what
/// goes the other way is none of it.
fn beside(jump: f64, change: f64) -> f64 {
    change.abs() * if change * jump > 0.0 { 4.0 } else { 1.0 / SPIKE }
}

/// Whether a change after a jump is its return: a loop that answers a step of its set-point jumps between two rows and is
/// on its way back when the next row shows it.
fn returns(jump: f64, after: f64) -> bool {
    jump * after < 0.0 && after.abs() < SPIKE * jump.abs()
}

/// A command so many rows before the row that first shows its jump, back along its return: a line, or the exponential
/// through three rows where they tell one.
fn before_its_row(command: &[f64], row: usize, rows: f64) -> f64 {
    let (jump, first, second) = (change(command, row), change(command, row + 1), change(command, row + 2));
    if !returns(jump, first) {
        return command[row];
    }
    let ratio = (second / first).clamp(1.0 / FASTEST, FASTEST);
    let told = first.abs() > RETURNS * jump.abs() && (ratio - 1.0).abs() > 1e-3;
    command[row] - first * if told { (ratio.powf(-rows) - 1.0) / (1.0 - ratio) } else { rows }
}

/// Usual change of a command from row to row: noise of a measured one, zero for a logged one that stands.
fn usual_change(command: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = command.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
    sizes.sort_by(f64::total_cmp);
    sizes.get(sizes.len() / 2).copied().unwrap_or(0.0)
}

/// Whether a command stands from most rows to the next: what it does between is steps, and where it comes back at the next
/// row it was set back.
pub(super) fn is_stepwise(command: &[f64]) -> bool {
    usual_change(command) == 0.0
}

/// Whether a change is one of three or more the same way: two may be two steps, and are no worse a slope of two rows.
fn is_on_slope(command: &[f64], row: usize) -> bool {
    let along = |by: isize| {
        row.checked_add_signed(by).is_some_and(|other| change(command, other) * change(command, row) > 0.0)
    };
    along(-1) && (along(1) || along(-2)) || along(1) && along(2)
}

/// Rows where the command jumps: it holds before and after, or goes other ways than the jump; a stepwise one wherever it is
/// on no slope.
pub(super) fn find_edges(command: &[f64], stepwise: bool) -> Vec<usize> {
    let range = command.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
    let usual = usual_change(command);
    let returns = |jump: f64, after: f64| !stepwise && returns(jump, after);
    let mut edges: Vec<usize> = Vec::new();
    for row in 1..command.len() {
        let jump = change(command, row);
        let (before, after) = (change(command, row - 1), change(command, row + 1));
        // What returns from a jump before is no slope: it slows down.
        let rows_since = edges.last().map(|edge| row - edge);
        let follows = rows_since == Some(1) && returns(before, jump);
        let returned = rows_since == Some(2) && returns(change(command, row - 2), before);
        let least = if stepwise && !is_on_slope(command, row) {
            0.0
        } else {
            let least = if returned { before.abs() / SPIKE } else { beside(jump, before) };
            least.max(beside(jump, after))
        };
        if !follows && jump.abs() > (0.004 * range).max(4.0 * usual).max(least) {
            edges.push(row);
        }
    }
    edges
}

#[cfg(test)]
mod tests {
    use super::{before_its_row, find_edges, is_stepwise, steps_of};

    #[test]
    fn a_loop_that_answers_a_step_jumps_once_and_keeps_every_sample() {
        let answer = [1.0, 1.0, 1.0, -7.0, -4.0, -2.5, -1.75, -1.375, -1.2, -1.1, -1.0, -1.0, -1.0];
        assert_eq!(find_edges(&answer, false), [3]);
        assert_eq!(steps_of(&answer), answer);
        let before = |rows| before_its_row(&answer, 3, rows);
        assert_eq!(before(0.0), -7.0);
        assert!((before(1.0) + 13.0).abs() < 1e-9, "halved from row to row: {}", before(1.0));
    }

    #[test]
    fn a_step_a_spike_and_a_slope_are_told_apart() {
        let step = [0.0, 0.0, 0.0, 3.0, 3.0, 3.0];
        assert_eq!(find_edges(&step, true), [3]);
        assert_eq!(before_its_row(&step, 3, 0.7), 3.0);
        let pulse = [0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0];
        assert!(find_edges(&pulse, false).is_empty(), "gone at the next row");
        assert!(is_stepwise(&pulse), "what is set stays");
        assert_eq!(find_edges(&pulse, true), [3, 4]);
        let slope = [0.0, 0.0, 1.0, 2.0, 3.0, 3.0];
        assert!(!is_stepwise(&slope) && find_edges(&slope, false).is_empty());
        assert!(find_edges(&slope, true).is_empty());
        assert_eq!(find_edges(&[0.0, 0.0, 0.0, 1.0, 2.0, 2.0, 2.0, 2.0], true), [3, 4]);
        assert_eq!(
            steps_of(&[0.0, 0.0, 1.2, 3.0, 3.0, 3.0]),
            [0.0, 0.0, 3.0, 3.0, 3.0, 3.0],
            "a lag's sample"
        );
    }

    #[test]
    fn a_jump_is_seen_while_the_one_before_still_returns() {
        let twice = [1.0, 1.0, 1.0, -6.7, -4.5, 1.8, 1.0, 0.2, -0.2, -0.2, -0.2, -0.2, -0.2, -0.2];
        assert_eq!(find_edges(&twice, false), [3, 5]);
    }
}
