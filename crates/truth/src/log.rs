//! From what the sensors showed each tick to the rows of a file.

use std::fmt::Write;

use crate::dice::Dice;
use crate::machine::{DriveKind, Machine};
use crate::run::Trace;

/// Columns that a case records.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Columns {
    /// The command of the drive.
    pub command: bool,
    /// A voltage drive's command stands as a duty.
    pub duty: bool,
    /// Motor current.
    pub current: bool,
    /// Shaft angle.
    pub angle: bool,
    /// Thrust.
    pub thrust: bool,
    /// Torque.
    pub torque: bool,
    /// Axial flow.
    pub flow: bool,
    /// Supply.
    pub supply: bool,
}

/// When rows are written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stamps {
    /// Every log interval.
    Even,
    /// Every log interval, some ticks early or late.
    Jitter,
    /// Whenever the logger comes round: between a half and two intervals.
    Uneven,
}

/// How a run is logged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogPlan {
    /// What.
    pub columns: Columns,
    /// When.
    pub stamps: Stamps,
    /// Instant at which the log begins, s: later than the run for a recording that starts in motion.
    pub from_s: f64,
    /// What the encoder shows where the run begins, rad.
    pub encoder_zero_rad: f64,
}

/// Rows; NaN is an empty cell.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// Log instants, s.
    pub time_s: Vec<f64>,
    /// Name and cells.
    pub columns: Vec<(&'static str, Vec<f64>)>,
}

/// Ticks at which rows are written.
fn ticks(machine: &Machine, plan: &LogPlan, count: usize, dice: &mut Dice) -> Vec<usize> {
    let every = machine.sensors.ticks_per_row;
    let first = (plan.from_s / machine.sensors.tick_s) as usize / every * every;
    match plan.stamps {
        Stamps::Even => (first..count).step_by(every).collect(),
        Stamps::Jitter => {
            let reach = (every / 3).max(1);
            let mut list: Vec<usize> = (first..count)
                .step_by(every.max(2))
                .map(|tick| (tick + dice.index(2 * reach + 1)).saturating_sub(reach).clamp(first, count - 1))
                .collect();
            list.dedup();
            list
        }
        Stamps::Uneven => {
            let mut list = vec![first];
            let mut at = first as f64;
            loop {
                at += every as f64 * dice.log_between(0.5, 2.0);
                if at >= count as f64 {
                    break;
                }
                if list.last().is_none_or(|last| (at as usize) > *last) {
                    list.push(at as usize);
                }
            }
            list
        }
    }
}

/// The table of a run; a set-point stands in a column of its own name.
pub fn table(
    machine: &Machine,
    trace: &Trace,
    setpoint: Option<(&'static str, &[f64])>,
    plan: &LogPlan,
    dice: &mut Dice,
) -> Table {
    let rows = ticks(machine, plan, trace.readings.len(), dice);
    let tick_s = machine.sensors.tick_s;
    let columns = plan.columns;
    let mut table =
        Table { time_s: rows.iter().map(|&tick| tick as f64 * tick_s).collect(), columns: Vec::new() };
    let mut add = |name: &'static str, at: &dyn Fn(usize) -> f64| {
        table.columns.push((name, rows.iter().map(|&tick| at(tick)).collect()));
    };
    if let Some((name, list)) = setpoint {
        let zero = if name == "shaft_angle_cmd_rad" { plan.encoder_zero_rad } else { 0.0 };
        add(name, &|tick| list[tick] + zero);
    }
    if columns.command {
        match machine.drive {
            DriveKind::Current => add("current_cmd_a", &|tick| trace.command[tick]),
            DriveKind::Voltage if columns.duty => {
                add("duty_cmd", &|tick| trace.command[tick] / machine.supply_v)
            }
            DriveKind::Voltage => add("voltage_cmd_v", &|tick| trace.command[tick]),
        }
    }
    let seen = |pick: fn(&crate::physics::Reading) -> f64| move |tick: usize| pick(&trace.readings[tick]);
    if columns.current {
        add("current_a", &seen(|r| r.current_a));
    }
    if columns.angle {
        add("shaft_angle_rad", &|tick| trace.readings[tick].angle_rad + plan.encoder_zero_rad);
    }
    add("shaft_speed_rad_s", &seen(|r| r.speed_rad_s));
    if columns.thrust {
        add("thrust_n", &seen(|r| r.thrust_n));
    }
    if columns.torque {
        add("torque_n_m", &seen(|r| r.torque_n_m));
    }
    if columns.flow {
        // The meter has a rate of its own: a row holds what it gave since the last, if anything.
        let period = 1.0 / machine.sensors.flow_rate_hz / tick_s;
        let mut given = None;
        let cells = rows
            .iter()
            .map(|&tick| {
                let sample = (tick as f64 / period + 1e-9).floor() as usize;
                let new = given != Some(sample);
                given = Some(sample);
                if new { trace.readings[(sample as f64 * period) as usize].flow_m_s } else { f64::NAN }
            })
            .collect();
        table.columns.push(("flow_m_s", cells));
    }
    if columns.supply {
        table.columns.push(("supply_v", rows.iter().map(|&tick| trace.readings[tick].supply_v).collect()));
    }
    table
}

impl Table {
    /// The table as a CSV file: six digits of each column's largest value.
    pub fn csv(&self) -> String {
        let digits: Vec<usize> = self
            .columns
            .iter()
            .map(|(_, cells)| {
                let top = cells
                    .iter()
                    .filter(|cell| cell.is_finite())
                    .fold(0.0, |top: f64, cell| top.max(cell.abs()));
                (5.0 - top.max(1e-9).log10().floor()).clamp(1.0, 12.0) as usize
            })
            .collect();
        let mut text = String::with_capacity(self.time_s.len() * 10 * (self.columns.len() + 1));
        text.push_str("time_s");
        for (name, _) in &self.columns {
            text.push(',');
            text.push_str(name);
        }
        text.push('\n');
        for (row, time_s) in self.time_s.iter().enumerate() {
            let _ = write!(text, "{time_s:.4}");
            for ((_, cells), digits) in self.columns.iter().zip(&digits) {
                text.push(',');
                if cells[row].is_finite() {
                    let _ = write!(text, "{:.*}", digits, cells[row]);
                }
            }
            text.push('\n');
        }
        text
    }

    /// Cells of a column.
    pub fn column(&self, name: &str) -> Option<&[f64]> {
        self.columns.iter().find(|(own, _)| *own == name).map(|(_, cells)| cells.as_slice())
    }

    /// Keeps the rows for which `keep` holds.
    pub fn retain(&mut self, keep: &[bool]) {
        let kept = |cells: &mut Vec<f64>| {
            let mut row = 0;
            cells.retain(|_| {
                row += 1;
                keep[row - 1]
            });
        };
        kept(&mut self.time_s);
        self.columns.iter_mut().for_each(|(_, cells)| kept(cells));
    }
}
