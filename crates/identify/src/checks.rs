//! Cheap checks before any model: what a glance at the columns tells.

use std::ops::Range;

use kort_thruster::rig::Rig;

use crate::data::{Series, pause_s};
use crate::gaps::GAP_INTERVALS;

mod spikes;
mod supply;
use spikes::spikes;
pub use supply::{Sag, supply_sag};

/// What the checks found: words for the report, and rows to leave out.
#[derive(Clone, Debug, Default)]
pub struct Checked {
    /// Words.
    pub notes: Vec<String>,
    /// Rows to leave out of every comparison.
    pub masked: Vec<bool>,
}

/// Longest run of one value in a sensor that should be noisy, in rows, before it counts as frozen.
const FROZEN_ROWS: usize = 40;
/// A frozen sensor goes on this many of its usual moves away from where it stood.
const FROZEN_MOVES: f64 = 3.0;
/// A drive may answer a step of its command this many rows late.
const LATE_ROWS: usize = 10;
/// Columns that say what is asked of the drive.
const COMMANDS: [&str; 5] = ["current_cmd_a", "voltage_cmd_v", "duty_cmd", "speed_cmd_rad_s", "thrust_cmd_n"];
/// Share of the largest command that counts as a step of it.
const STEP_SHARE: f64 = 0.05;
/// A gap longer than this may hide changes of the drive, s.
const LONG_GAP_S: f64 = 0.2;
/// After such a gap the state is taken as known again, s.
pub const SETTLE_S: f64 = 2.0;

/// Runs all checks on one recording.
pub fn check(series: &Series, rig: &Rig) -> Checked {
    let n = series.time_s.len();
    let mut out = Checked { notes: Vec::new(), masked: vec![false; n] };
    saturated_thrust(series, rig, &mut out);
    saturated_current(series, rig, &mut out);
    for name in ["thrust_n", "shaft_speed_rad_s", "torque_n_m", "current_a"] {
        if let Some(column) = series.column(name) {
            frozen(series, name, column, &mut out);
            spikes(series, name, column, &mut out);
        }
    }
    unsigned_speed(series, rig, &mut out);
    rest_bias(series, &mut out);
    gaps(series, &mut out);
    sparse_commands(series, &mut out);
    out.notes
        .extend(supply_sag(series).and_then(|sag| sag.words()).map(|sag| format!("{}: {sag}", series.name)));
    out
}

fn saturated_thrust(series: &Series, rig: &Rig, out: &mut Checked) {
    let (Some(full), Some(thrust)) = (rig.sensors.thrust_full_scale_n, series.column("thrust_n")) else {
        return;
    };
    let rows: Vec<usize> = (0..thrust.len()).filter(|k| thrust[*k].abs() >= 0.995 * full).collect();
    if rows.len() > 2 {
        out.notes.push(format!(
            "{}: thrust_n sits at its full scale of {full} N in {} rows; they are left out",
            series.name,
            rows.len()
        ));
        rows.into_iter().for_each(|k| out.masked[k] = true);
    }
}

fn saturated_current(series: &Series, rig: &Rig, out: &mut Checked) {
    let limit = rig.amplifier.current_limit_a;
    let Some(command) = series.column("current_cmd_a").filter(|_| limit.is_finite()) else { return };
    let over = command.iter().filter(|c| c.abs() > 1.001 * limit).count();
    if over > 0 {
        out.notes.push(format!(
            "{}: current_cmd_a exceeds the stated limit of {limit} A in {over} rows; the model clips there",
            series.name
        ));
    }
}

fn frozen(series: &Series, name: &str, column: &[f64], out: &mut Checked) {
    let scale = largest(column);
    let mut moves: Vec<f64> =
        column.windows(2).map(|w| (w[1] - w[0]).abs()).filter(|move_| *move_ > 0.0).collect();
    moves.sort_by(f64::total_cmp);
    let usual = moves.get(moves.len() / 2).copied().unwrap_or(0.0);
    if !varies(column) {
        return;
    }
    let commands = commands(series);
    let mut from = 0;
    for k in 1..=column.len() {
        if k < column.len() && column[k] == column[from] {
            continue;
        }
        let stood = std::mem::replace(&mut from, k)..k;
        let at = column[stood.start];
        // At rest a quantised sensor may well stand still, ...
        if stood.len() < FROZEN_ROWS || at.abs() <= 0.05 * scale {
            continue;
        }
        // ... and so may a coarse one while nothing is asked of the drive: a frozen one has missed a step of the command, or
        // goes on elsewhere although none was given.
        let late = k.saturating_sub(LATE_ROWS).max(stood.start);
        let missed = steps(&commands, stood.start..late)
            || !steps(&commands, late..column.len().min(k + 1))
                && column.get(k).is_some_and(|next| (next - at).abs() > FROZEN_MOVES * usual);
        if missed {
            out.notes.push(format!(
                "{}: {name} stands still at {at:.4} from {:.2} s to {:.2} s (frozen sensor?); those rows are left out",
                series.name,
                series.time_s[stood.start],
                series.time_s[k - 1]
            ));
            out.masked[stood].fill(true);
        }
    }
}

/// The commands, each with the least change that is a step of it.
fn commands(series: &Series) -> Vec<(&[f64], f64)> {
    let there = COMMANDS.iter().filter_map(|name| series.column(name));
    there.map(|command| (command, STEP_SHARE * largest(command))).collect()
}

/// Whether a command changes within these rows by more than this.
fn steps(commands: &[(&[f64], f64)], rows: Range<usize>) -> bool {
    commands.iter().any(|(command, least)| {
        let within = command[rows.clone()].iter().copied().filter(|c| c.is_finite());
        let (low, high) = within.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), c| (l.min(c), h.max(c)));
        high - low > *least
    })
}

/// The largest size in a column.
fn largest(column: &[f64]) -> f64 {
    column.iter().filter(|v| v.is_finite()).fold(0.0_f64, |m, v| m.max(v.abs()))
}

/// A sensor that repeats itself everywhere is coarse, not frozen.
fn varies(column: &[f64]) -> bool {
    let same = column.windows(2).filter(|w| w[0] == w[1]).count();
    (same as f64) < 0.5 * column.len() as f64
}

/// Readings below zero by more than this share of the largest are more than a sensor's noise about rest.
const ABOUT_REST: f64 = 0.02;
/// One reading in so many may be an outlier.
const OUTLIERS: usize = 200;

/// Whether only the size of the shaft speed was recorded: never negative, but for noise and outliers, although the
/// drive reverses.
pub fn is_unsigned_speed(series: &Series) -> bool {
    let Some(speed) = series.column("shaft_speed_rad_s") else { return false };
    let below = -ABOUT_REST * largest(speed);
    let never_negative = speed.iter().filter(|v| **v < below).count() <= speed.len() / OUTLIERS;
    let reversed = |name: &&str| {
        series.column(name).is_some_and(|c| {
            let top = largest(c);
            let negative = c.iter().filter(|v| **v < -0.2 * top).count();
            negative > c.len() / 20
        })
    };
    // A current brakes as well as it reverses: it tells only where nothing says which way the drive is to turn.
    let asked = ASKED.iter().any(|name| series.column(name).is_some());
    never_negative && if asked { ASKED.iter().any(reversed) } else { TAKEN.iter().any(reversed) }
}

/// Columns that say which way the drive is to turn.
const ASKED: [&str; 3] = ["voltage_cmd_v", "duty_cmd", "speed_cmd_rad_s"];
/// Columns whose sign tells the direction, or that something brakes.
const TAKEN: [&str; 3] = ["current_cmd_a", "current_a", "thrust_n"];

fn unsigned_speed(series: &Series, rig: &Rig, out: &mut Checked) {
    let stated = rig.effects.iter().any(|known| known.effect == "unsigned_speed_sensor");
    if is_unsigned_speed(series) && !stated {
        out.notes.push(format!(
            "{}: shaft_speed_rad_s is never negative although the drive reverses: an unsigned speed sensor, whose sign is taken from the model (unsigned_speed_sensor); a column map's sign_of gives it the command's",
            series.name
        ));
    }
}

fn rest_bias(series: &Series, out: &mut Checked) {
    let Some(command) = ["current_cmd_a", "voltage_cmd_v", "duty_cmd", "speed_cmd_rad_s"]
        .iter()
        .find_map(|n| series.column(n))
    else {
        return;
    };
    let first = command.iter().take_while(|c| **c == 0.0).count();
    if first < 30 {
        return;
    }
    for name in ["thrust_n", "torque_n_m", "current_a"] {
        let Some(column) = series.column(name) else { continue };
        let rest: Vec<f64> =
            column[..first.min(column.len())].iter().copied().filter(|v| v.is_finite()).collect();
        if rest.len() < 20 {
            continue;
        }
        let n = rest.len() as f64;
        let mean = rest.iter().sum::<f64>() / n;
        let deviation = (rest.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
        let scale = largest(column);
        if mean.abs() > 6.0 * deviation / n.sqrt() && mean.abs() > 0.005 * scale {
            out.notes.push(format!(
                "{}: {name} reads {mean:.4} at rest before the first command ({:.1} % of its range): zero it, or let the diagnosis judge the bias",
                series.name,
                100.0 * mean / scale
            ));
        }
    }
}

/// A command logged less often than the rows: it is held, and when it changed is known coarsely only.
fn sparse_commands(series: &Series, out: &mut Checked) {
    for name in ["current_cmd_a", "voltage_cmd_v", "duty_cmd", "speed_cmd_rad_s"] {
        let Some(column) = series.column(name) else { continue };
        let empty = column.iter().filter(|v| !v.is_finite()).count();
        if empty * 20 > column.len() {
            out.notes.push(format!(
                "{}: {empty} of {} cells of {name} are empty; the value before is taken to stand. A change may have come anywhere between two samples, so delays and lags shorter than that cannot be told",
                series.name,
                column.len()
            ));
        }
    }
}

/// How many gaps begin at a step of the command: within an interval of the row that first shows it.
fn after_steps(series: &Series, usual_s: f64) -> usize {
    let Some(command) = COMMANDS.iter().find_map(|name| series.column(name)) else { return 0 };
    let top = largest(command);
    let steps = |k: usize| {
        // Rows about the gap: the step stands in the last before it or the first after it.
        (k.saturating_sub(1)..(k + 2).min(command.len() - 1))
            .any(|i| (command[i + 1] - command[i]).abs() > STEP_SHARE * top)
    };
    let wide = |k: &usize| series.time_s[k + 1] - series.time_s[*k] > GAP_INTERVALS * usual_s;
    (0..series.time_s.len().saturating_sub(1)).filter(wide).filter(|k| steps(*k)).count()
}

fn gaps(series: &Series, out: &mut Checked) {
    let mut steps: Vec<f64> = series.time_s.windows(2).map(|w| w[1] - w[0]).collect();
    steps.sort_by(f64::total_cmp);
    let Some(usual) = steps.get(steps.len() / 2).copied() else { return };
    let pause_s = pause_s(&series.time_s);
    let missed: Vec<f64> =
        steps.into_iter().filter(|s| *s > GAP_INTERVALS * usual && *s <= pause_s).collect();
    let wide = missed.len();
    // What the drive did in a long gap is not known, nor then the state after it.
    let mut long = 0;
    let mut known_from_s = f64::NEG_INFINITY;
    for (k, w) in series.time_s.windows(2).enumerate() {
        if w[1] - w[0] > (GAP_INTERVALS * usual).max(LONG_GAP_S) {
            long += usize::from(w[1] - w[0] <= pause_s);
            known_from_s = w[1] + SETTLE_S;
        }
        out.masked[k + 1] |= w[1] < known_from_s;
    }
    let hurried = after_steps(series, usual);
    let follow = if 2 * hurried > wide {
        format!(
            "; {hurried} of them begin at a step of the command, so that what answers it is seen late, and not equally late for every step"
        )
    } else {
        String::new()
    };
    let left_out = match long {
        0 => String::new(),
        _ => format!("; the {SETTLE_S} s after each of the {long} longer than {LONG_GAP_S} s are left out"),
    };
    let Some(longest) = missed.last() else { return };
    out.notes.push(format!(
        "{}: the log misses rows (log_gaps): {wide} gaps longer than 3 intervals (longest {longest:.3} s){follow}; the model runs across them with its inputs straight, and only rows that are there are compared{left_out}",
        series.name
    ));
}

/// What a log's pauses do, in words.
pub fn pauses(series: &Series) -> Option<String> {
    let pause_s = pause_s(&series.time_s);
    let lengths = || series.time_s.windows(2).map(|w| w[1] - w[0]).filter(|s| *s > pause_s);
    let longest = lengths().max_by(f64::total_cmp)?;
    Some(format!(
        "{}: the log pauses {} times for more than {pause_s} s (longest {longest:.0} s): after each the simulation starts anew from the recorded state, and {SETTLE_S} s are left out",
        series.name,
        lengths().count()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A drive that reverses every second, logged at 100 Hz; rows that `there` leaves out are missing.
    fn log(speed: fn(f64) -> f64, there: fn(usize) -> bool) -> Series {
        let rows: Vec<usize> = (0..2000).filter(|k| there(*k)).collect();
        let time_s: Vec<f64> = rows.iter().map(|k| 0.01 * *k as f64).collect();
        let command: Vec<f64> = rows.iter().map(|k| if k / 100 % 2 == 0 { 5.0 } else { -5.0 }).collect();
        let speed = time_s.iter().zip(&command).map(|(t, c)| speed(c.signum() * (1.0 + 0.1 * t.sin())));
        let speed = speed.collect();
        let columns = vec![("current_cmd_a".into(), command), ("shaft_speed_rad_s".into(), speed)];
        Series { name: "log".into(), time_s, columns }
    }

    const RIG: &str =
        "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 1.0\n";

    fn notes_on(series: &Series, rig: &str) -> String {
        check(series, &Rig::from_toml(rig).unwrap()).notes.join("\n")
    }

    fn notes(series: &Series) -> String {
        notes_on(series, RIG)
    }

    #[test]
    fn a_speed_without_its_sign_is_told_from_one_with_it() {
        assert!(is_unsigned_speed(&log(f64::abs, |_| true)));
        // Noise about rest is no sign; a hundredth of full scale.
        assert!(is_unsigned_speed(&log(|s| if s > 0.0 { s } else { -0.01 }, |_| true)));
        assert!(!is_unsigned_speed(&log(|s| s, |_| true)));
        assert!(notes(&log(f64::abs, |_| true)).contains("unsigned_speed_sensor"));
        let stated = format!("{RIG}[[effects]]\neffect = \"unsigned_speed_sensor\"\nunsigned = 1\n");
        assert!(!notes_on(&log(f64::abs, |_| true), &stated).contains("unsigned_speed_sensor"));
        // A current that brakes reverses nothing where a command says which way the drive is to turn.
        let mut braked = log(f64::abs, |_| true);
        braked.columns.push(("voltage_cmd_v".into(), vec![4.0; braked.time_s.len()]));
        assert!(!is_unsigned_speed(&braked));
    }

    #[test]
    fn a_coarse_sensor_in_steady_running_is_not_frozen_and_one_that_misses_a_reversal_is() {
        // Counts of a tenth, so slow a swing that one count lasts many rows.
        assert!(!notes(&log(|s| (30.0 * s).round() / 10.0, |_| true)).contains("frozen"));
        let mut log = log(|s| s, |_| true);
        let speed = &mut log.columns[1].1;
        let noisy: Vec<f64> =
            speed.iter().enumerate().map(|(k, v)| v + 0.01 * (0.7 * k as f64).sin()).collect();
        *speed = noisy;
        assert!(!notes(&log).contains("frozen"));
        log.columns[1].1[250..350].fill(1.1);
        assert!(notes(&log).contains("stands still at 1.1000 from 2.50 s"), "{}", notes(&log));
    }

    #[test]
    fn gaps_that_follow_the_commands_are_said_to() {
        assert!(!notes(&log(|s| s, |_| true)).contains("log_gaps"));
        let after_steps = notes(&log(|s| s, |k| !(1..9).contains(&(k % 100))));
        assert!(after_steps.contains("log_gaps") && after_steps.contains("begin at a step"), "{after_steps}");
        let between = notes(&log(|s| s, |k| !(41..49).contains(&(k % 100))));
        assert!(between.contains("log_gaps") && !between.contains("begin at a step"), "{between}");
    }
}
