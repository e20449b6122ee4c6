//! Is a command held from row to row, or does it move on between them?
//!
//! A loop that logs itself writes every command down, and holds it until the next; a logger beside a faster loop sees
//! a command that moves on. The stated control rate tells which. Where none is stated, a course that runs straight
//! lies half an interval before one that is held, and would pass for a lag of the drive: both are tried on the
//! baseline, and the likelier stays.

use kort_thruster::rig::Rig;

use crate::data::{Driving, Prepared};
use crate::spectrum::median_interval;

/// The recordings with their commands held, where the rig does not tell and it makes a difference.
pub fn held(recordings: &[Prepared], rig: &Rig) -> Option<Vec<Prepared>> {
    if rig.sensors.control_rate_hz.is_some() || !recordings.iter().any(moves_on) {
        return None;
    }
    let each = recordings.iter().map(|r| Prepared { every_command: moves_on(r), ..r.clone() });
    Some(each.collect())
}

/// Whether a command changes from row to row otherwise than by steps that find their own tick.
fn moves_on(recording: &Prepared) -> bool {
    let change = |row: &usize| recording.command[*row] != recording.command[row - 1];
    let changes = (1..recording.command.len()).filter(change).count();
    matches!(recording.driving, Driving::Command(_))
        && recording.ticks_per_row > 1
        && changes > recording.edges.len()
}

/// What was taken for true.
pub fn words(recordings: &[Prepared]) -> String {
    let longest_s = recordings.iter().map(|r| median_interval(&r.time_s)).fold(0.0, f64::max);
    format!(
        "the rig does not state sensors.control_rate_hz: commands are taken as held from row to row, which fits better than moving on between rows; a lag of the drive up to {:.3} s would look the same",
        0.5 * longest_s
    )
}

#[cfg(test)]
mod tests {
    use crate::readings::tests::read_and_said;

    const RIG: &str = "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 1.0\n\
                       winding_resistance_ohm = 1.0\n[amplifier]\nkind = \"voltage\"\n";

    /// A motor with a time constant of 10 ms under a voltage that wanders, logged every 10 ms; the voltage is held,
    /// or runs straight. Whether it is taken as held, and whether the report says so.
    fn taken_as_held(held: bool, rig: &str) -> (bool, bool) {
        let voltage = |t: f64| 6.0 * (9.0 * t).sin() + 3.0 * (23.0 * t + 1.0).sin();
        let (rows, fine) = (1500, 50);
        let (mut speed, mut speeds) = (0.0_f64, Vec::new());
        for row in 0..rows {
            let at = |k: usize| voltage(0.01 * k as f64);
            let noise = 0.002 * ((row * row * 7919) as f64 * 0.37).sin();
            speeds.push(speed + noise);
            for part in 0..fine {
                let u = part as f64 / fine as f64;
                let volts = if held { at(row) } else { at(row) + (at(row + 1) - at(row)) * u };
                speed += (volts - speed) / 0.01 * (0.01 / fine as f64);
            }
        }
        let volts = (0..rows).map(|k| voltage(0.01 * k as f64)).collect();
        let columns = [("voltage_cmd_v", volts), ("shaft_speed_rad_s", speeds)];
        read_and_said(rig, 0.01, columns, |read| read.every_command, "held from row to row")
    }

    #[test]
    fn where_no_control_rate_is_stated_the_likelier_course_is_taken_and_said() {
        assert_eq!(taken_as_held(true, RIG), (true, true));
        assert_eq!(taken_as_held(false, RIG), (false, false));
    }

    #[test]
    fn a_stated_control_rate_tells() {
        let with = |rate_hz: f64| format!("{RIG}[sensors]\ncontrol_rate_hz = {rate_hz}\n");
        assert_eq!(taken_as_held(true, &with(500.0)), (false, false));
        assert_eq!(taken_as_held(false, &with(100.0)), (true, false));
    }
}
