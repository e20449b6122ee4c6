//! Single rows that stand out of a column: a byte that was lost, a plug that was touched.

use super::{Checked, commands, largest};
use crate::data::Series;

/// A spike stands out of its neighbours by this many times their usual distance.
const RATIO: f64 = 40.0;
/// What follows a command from row to row does so within this many rows.
const FOLLOWED_ROWS: usize = 3;

/// Leaves single rows out that stand out of a column where no command calls for it.
pub(super) fn spikes(series: &Series, name: &str, column: &[f64], out: &mut Checked) {
    let commands = commands(series);
    let jump = |k: usize| (column[k] - 0.5 * (column[k - 1] + column[k + 1])).abs();
    let known: Vec<usize> = (1..column.len().saturating_sub(1))
        .filter(|k| (k - 1..=k + 1).all(|i| column[i].is_finite()))
        .collect();
    let mut sizes: Vec<f64> = known.iter().map(|k| jump(*k)).collect();
    sizes.sort_by(f64::total_cmp);
    let Some(usual) = sizes.get(sizes.len() / 2).copied() else { return };
    let scale = largest(column);
    let limit = (RATIO * usual).max(0.25 * scale);
    let found: Vec<usize> = known
        .into_iter()
        .filter(|k| {
            usual > 0.0 && jump(*k) > limit && alone(column, *k, jump(*k)) && !turns_round(&commands, *k)
        })
        .collect();
    if let Some(first) = found.first() {
        out.notes.push(format!(
            "{}: {name} spikes in {} single rows (first at {:.2} s); they are left out",
            series.name,
            found.len(),
            series.time_s[*first]
        ));
        found.into_iter().for_each(|k| out.masked[k] = true);
    }
}

/// Whether a row alone stands out by so much: its neighbours are near each other, and on one side at least near theirs, as those
/// of a pulse that the log has three rows of are not.
fn alone(column: &[f64], row: usize, by: f64) -> bool {
    let near = |a: usize, b: usize| {
        let step = column.get(a).zip(column.get(b)).map_or(0.0, |(a, b)| (a - b).abs());
        !step.is_finite() || step < 0.2 * by
    };
    near(row - 1, row + 1) && (row < 2 || near(row - 2, row - 1) || near(row + 1, row + 2))
}

/// Whether a command goes one way and back again from row to row about this one: what follows it then does so too.
fn turns_round(commands: &[(&[f64], f64)], row: usize) -> bool {
    commands.iter().any(|(command, least)| {
        let rows = row.saturating_sub(FOLLOWED_ROWS)..(row + 2).min(command.len());
        let moves: Vec<f64> = command[rows].windows(2).map(|w| w[1] - w[0]).collect();
        moves.windows(2).any(|m| m[0] * m[1] < 0.0 && m.iter().all(|by| by.abs() > *least))
    })
}

#[cfg(test)]
mod tests {
    use kort_thruster::rig::Rig;

    use crate::checks::check;
    use crate::data::Series;

    #[test]
    fn what_follows_a_command_that_turns_round_is_no_spike() {
        // A slow swing with a turn at a quarter of the log's rate every two seconds.
        let burst =
            |k: usize| if (100..104).contains(&(k % 200)) { [5.0, 0.0, -5.0, 0.0][k % 4] } else { 0.0 };
        let command: Vec<f64> = (0..2000).map(|k| (0.01 * k as f64).sin() + burst(k)).collect();
        let mut current: Vec<f64> = std::iter::once(0.0).chain(command.iter().copied()).take(2000).collect();
        let rig = "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 1.0\n";
        let notes = |current: &[f64]| {
            let columns =
                vec![("current_cmd_a".into(), command.clone()), ("current_a".into(), current.to_vec())];
            let time_s = (0..2000).map(|k| 0.01 * k as f64).collect();
            let log = Series { name: "log".into(), time_s, columns };
            check(&log, &Rig::from_toml(rig).unwrap()).notes.join("\n")
        };
        assert!(!notes(&current).contains("spikes"), "{}", notes(&current));
        current[1050] += 6.0;
        assert!(
            notes(&current).contains("current_a spikes in 1 single rows (first at 10.50 s)"),
            "{}",
            notes(&current)
        );
    }

    #[test]
    fn a_pulse_that_has_neighbours_is_no_spike() {
        let rig = Rig::from_toml(
            "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 1.0\n",
        )
        .unwrap();
        let left_out = |pulse: [f64; 3]| {
            let mut current: Vec<f64> = (0..2000).map(|k| 1.5 * (0.02 * k as f64).sin()).collect();
            pulse.iter().enumerate().for_each(|(j, by)| current[1050 + j] += by);
            let time_s = (0..2000).map(|k| 0.01 * k as f64).collect();
            let log = Series { name: "log".into(), time_s, columns: vec![("current_a".into(), current)] };
            check(&log, &rig).masked.iter().filter(|masked| **masked).count()
        };
        assert_eq!(left_out([0.0, 9.0, 0.0]), 1);
        assert_eq!(left_out([9.0, 0.0, 9.0]), 2, "two of three rows");
        assert_eq!(left_out([4.0, 9.0, 4.0]), 0, "a braking current that lasts three rows");
    }
}
