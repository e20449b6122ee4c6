//! What the drive may have done while the log was silent.
//!
//! A command that changes often changes within gaps too, and nobody wrote it down: until its trace has died away
//! the rows after such a gap tell nothing. How long that is the stated rig tells: two simulations, one with the
//! command straight across the gap and one with it at its far end, and the rows on which they differ. Where a measured
//! current, speed or power drives, what it did while it had no samples is as unknown: it may have gone straight from
//! one to the next or have stood and jumped.

use kort_thruster::plant::Driven;

use crate::data::Prepared;
use crate::hypothesis::Hypothesis;
use crate::simulate::Problem;
use crate::spectrum::median_interval;

/// Usual intervals from row to row beyond which rows are missing.
pub const GAP_INTERVALS: f64 = 3.5;
/// Changes of the command to be expected within a gap from which on one may have been missed.
const MISSED: f64 = 0.1;
/// Difference of the two simulations that still counts, over full scale: noise of a good sensor.
const SHOWS: f64 = 0.01;

/// Rows of samples of a column between which it has none for longer than usual.
pub fn unsampled(time_s: &[f64], column: &[f64]) -> Vec<(usize, usize)> {
    let known: Vec<usize> = (0..column.len()).filter(|row| column[*row].is_finite()).collect();
    let usual_s = median_interval(&known.iter().map(|row| time_s[*row]).collect::<Vec<f64>>());
    let long = |w: &&[usize]| time_s[w[1]] - time_s[w[0]] > GAP_INTERVALS * usual_s;
    known.windows(2).filter(long).map(|w| (w[0], w[1])).collect()
}

impl Prepared {
    /// Whether the log misses rows just before this one.
    fn after_gap(&self, row: usize, usual_s: f64) -> bool {
        row > 0 && self.time_s[row] - self.time_s[row - 1] > GAP_INTERVALS * usual_s
    }

    /// Gaps in which a change of what drives may have been missed, by the rows they lie between.
    fn silent(&self) -> Vec<(usize, usize)> {
        if self.is_driven_by_a_sensor() {
            return self.unsampled.iter().copied().filter(|gap| !self.after_pause(gap.1)).collect();
        }
        let usual_s = median_interval(&self.time_s);
        // Of a stepwise command every turn is an edge.
        let turn = |w: &&[f64]| !self.stepwise && (w[1] - w[0]) * (w[2] - w[1]) < 0.0;
        let turns = self.command.windows(3).filter(turn).count();
        let often_1_s = (self.edges.len() + turns) as f64 / self.duration_s();
        (1..self.time_s.len())
            .filter(|row| self.after_gap(*row, usual_s) && !self.after_pause(*row))
            .filter(|row| often_1_s * (self.time_s[*row] - self.time_s[row - 1]) > MISSED)
            .map(|row| (row - 1, row))
            .collect()
    }

    /// What drives, as it may have been between these rows: a command at its far end, what was measured as it was before.
    /// `commands` are those of the control grid.
    fn drive_across(&mut self, commands: &mut [f64], silent: &[(usize, usize)]) {
        let (low, high) =
            commands.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), c| (l.min(*c), h.max(*c)));
        let measured = self.is_driven_by_a_sensor();
        for (before, after) in silent {
            let tick = |k: usize| self.stimulus.logs[k].0.min(commands.len());
            let (from, to) = (tick(*before), tick(*after));
            let Some((first, was)) = commands.get(from).copied().zip(self.stimulus.ticks.get(from)) else {
                continue;
            };
            let was = was.driven;
            for command in &mut commands[from..to] {
                let far = if *command - low > high - *command { low } else { high };
                *command = if measured { first } else { far };
            }
            for tick in &mut self.stimulus.ticks[from..to] {
                tick.driven = match was {
                    Driven::Speed(a, _) => Driven::Speed(a, a),
                    Driven::Power(a, _) => Driven::Power(a, a),
                    by_command => by_command,
                };
            }
        }
    }
}

/// Rows on which what gaps hide may still show.
pub struct Hidden {
    /// By recording and row.
    pub rows: Vec<Vec<bool>>,
    /// Gaps that hide something, by recording.
    gaps: Vec<usize>,
}

impl Hidden {
    /// A line for every recording that has some.
    pub fn words(&self, recordings: &[Prepared]) -> Vec<String> {
        let line = |((recording, rows), gaps): ((&Prepared, &Vec<bool>), &usize)| {
            let left_out = rows.iter().filter(|hidden| **hidden).count();
            let lost = if recording.is_driven_by_a_sensor() {
                format!("{} has no samples in {gaps} gaps", recording.driving.column())
            } else {
                format!("the command changes so often that some of it is lost in {gaps} gaps")
            };
            (left_out > 0).then(|| {
                format!(
                    "{}: {lost}; {left_out} rows in and after them, on which that may still show, are left out",
                    recording.name
                )
            })
        };
        recordings.iter().zip(&self.rows).zip(&self.gaps).filter_map(line).collect()
    }
}

impl Problem<'_> {
    /// Rows on which what a gap hides may still show; none if no gap hides anything.
    pub fn hidden_by_gaps(&self, stated: &Hypothesis) -> Option<Hidden> {
        let silent: Vec<_> = self.recordings.iter().map(Prepared::silent).collect();
        let rows = self.shown_after(&silent, stated)?;
        Some(Hidden { rows, gaps: silent.iter().map(Vec::len).collect() })
    }

    /// Rows on which what the command did between these may still show, by recording; none where there are none.
    pub fn shown_after(&self, silent: &[Vec<(usize, usize)>], stated: &Hypothesis) -> Option<Vec<Vec<bool>>> {
        if silent.iter().all(Vec::is_empty) {
            return None;
        }
        let (mut otherwise, mut inputs) = (self.clone(), stated.inputs.as_ref().clone());
        let driven = otherwise.recordings.iter_mut().zip(&mut inputs.commands);
        driven.zip(silent).for_each(|((recording, commands), gaps)| recording.drive_across(commands, gaps));
        let other = Hypothesis { inputs: inputs.into(), ..stated.clone() };
        let straight = self.respond(stated, &stated.start);
        let other = otherwise.respond(&other, &stated.start);
        let mut rows: Vec<Vec<bool>> = self.recordings.iter().map(|r| vec![false; r.time_s.len()]).collect();
        for (r, recording) in self.recordings.iter().enumerate() {
            for (c, channel) in recording.channels.iter().enumerate() {
                for (i, row) in channel.rows.iter().enumerate() {
                    let apart = (straight[r][c][i] - other[r][c][i]).abs() / channel.full_scale;
                    rows[r][*row] |= apart > SHOWS;
                }
            }
        }
        Some(rows)
    }
}

#[cfg(test)]
mod tests {
    use kort_thruster::models::ModelName;
    use kort_thruster::rig::Rig;

    use super::Hidden;
    use crate::data::Series;
    use crate::noise::Criterion;
    use crate::setup::Setup;

    const RIG: &str = "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 1.0\n\
                       winding_resistance_ohm = 1.0\n[amplifier]\nkind = \"voltage\"\n";

    /// Of a log of what drives and of the shaft's speed.
    fn hidden_in(rig: &str, time_s: Vec<f64>, driving: (&str, Vec<f64>), speed: Vec<f64>) -> Option<Hidden> {
        let columns = vec![(driving.0.into(), driving.1), ("shaft_speed_rad_s".into(), speed)];
        let series = [Series { name: "log".into(), time_s, columns }];
        let rig = Rig::from_toml(rig).unwrap();
        let criterion =
            Criterion { form_error: 0.01, own_form_error: 0.1, facts_a_band: 10.0, timing_s: 0.001 };
        let setup = Setup::new(&series, &rig, ModelName::Model2, criterion).unwrap();
        setup.problem.hidden_by_gaps(&setup.baseline)
    }

    /// A motor that settles within tens of milliseconds, reversed every `dwell` rows of 10 ms; 9 rows are missing
    /// after row 500.
    fn hidden(dwell: usize) -> Option<Hidden> {
        let rows: Vec<usize> = (0..1000).filter(|k| !(501..510).contains(k)).collect();
        let time_s: Vec<f64> = rows.iter().map(|k| 0.01 * *k as f64).collect();
        let command: Vec<f64> =
            rows.iter().map(|k| if (k / dwell).is_multiple_of(2) { 5.0 } else { -5.0 }).collect();
        let speed = rows.iter().map(|k| (*k as f64 * 0.7).sin()).collect();
        hidden_in(RIG, time_s, ("voltage_cmd_v", command), speed)
    }

    #[test]
    fn rows_after_a_gap_are_left_out_until_what_it_hides_has_died_away() {
        let hidden = hidden(10).expect("a change may have been missed");
        let left_out: Vec<usize> = (0..991).filter(|row| hidden.rows[0][*row]).collect();
        // The first row after the gap is 501.
        assert_eq!(left_out.first(), Some(&501));
        assert!((3..15).contains(&left_out.len()), "{left_out:?}");
    }

    /// The same motor under its measured current, which has no samples in these rows; it steps once, at row 520.
    fn hidden_of_current(without: std::ops::Range<usize>) -> Option<Hidden> {
        let time_s: Vec<f64> = (0..1000).map(|k| 0.01 * f64::from(k)).collect();
        let of = |k: usize| {
            if without.contains(&k) {
                f64::NAN
            } else if k < 520 {
                0.2
            } else {
                -0.3
            }
        };
        let speed = (0..1000).map(|k| (f64::from(k) * 0.7).sin()).collect();
        let fan = format!("{RIG}[load]\nkind = \"fan\"\nfan_coefficient_nm_s2 = 0.0005\n");
        hidden_in(&fan, time_s, ("current_a", (0..1000).map(of).collect()), speed)
    }

    #[test]
    fn what_a_measured_current_did_without_samples_is_left_out_where_it_shows() {
        let left_out = |without| {
            let hidden = hidden_of_current(without)?;
            Some((0..1000).filter(|row| hidden.rows[0][*row]).collect::<Vec<usize>>())
        };
        let step = left_out(501..540).expect("samples are missing");
        assert!((500..545).contains(step.first().unwrap()) && step.len() > 20, "{step:?}");
        assert_eq!(left_out(401..440), Some(Vec::new()), "it stood throughout");
        assert_eq!(left_out(519..521), None, "no more than usual");
    }

    #[test]
    fn a_command_that_hardly_changes_hides_nothing_in_a_gap() {
        assert!(hidden(400).is_none());
    }
}
