//! The report of `kort fit` as text.

use kort_identify::identify::FitReport;
use kort_thruster::rig::Rig;

use super::number;
use super::text::{Sheet, error_rows, parameter_rows};

/// The report for a terminal.
pub fn text(report: &FitReport, rig: &Rig) -> String {
    let mut sheet = Sheet::new(&format!(
        "{} fitted to {} of {:.0} s on rig {}",
        report.model,
        if report.recordings.len() == 1 {
            "a recording".into()
        } else {
            format!("{} recordings", report.recordings.len())
        },
        report.seconds,
        report.rig
    ));
    sheet.heading("Parameters");
    sheet.table(
        &["", "stated", "fitted", "std error", "unit", "moved", ""],
        &parameter_rows(&report.parameters, rig),
    );
    sheet.heading("Errors (root mean square, % of full scale)");
    let rows = error_rows(&report.channels);
    sheet.table(&["", "fitted rows", "held-out rows", "noise alone", "white"], &rows);
    if !report.not_identifiable.is_empty() {
        sheet.heading("Not fixed by these recordings");
        for group in &report.not_identifiable {
            sheet.item(&format!("{}: {}.", group.parameters.join(", "), group.why));
            sheet.more(&format!("Would fix it: {}.", group.excitation));
        }
    }
    if !report.correlations.is_empty() {
        sheet.heading("Correlated beyond 0.9");
        for pair in &report.correlations {
            sheet.item(&format!("{}: {:+.3}", pair.parameters.join(" and "), pair.correlation));
        }
    }
    if !report.symptoms.is_empty() {
        sheet.heading("Symptoms");
        report.symptoms.iter().for_each(|s| sheet.item(s));
    }
    sheet.heading("Trust");
    let starts = &report.starts;
    if starts.agreed == starts.tried {
        sheet.item(&format!("all {} starts ended in the same place", starts.tried));
    } else {
        sheet.item(&format!(
            "{} of {} starts ended in the same place; the worst ended {} higher in twice the log-likelihood",
            starts.agreed,
            starts.tried,
            number(starts.worst_gap)
        ));
    }
    for state in report.initial_states.iter().filter(|s| s.estimated) {
        sheet.item(&format!(
            "{} begins moving: fitted start {} rad/s, flow {} m/s",
            state.recording,
            number(state.shaft_speed_rad_s),
            number(state.flow_m_s)
        ));
    }
    if !report.notes.is_empty() {
        sheet.heading("Notes");
        report.notes.iter().for_each(|n| sheet.item(n));
    }
    sheet.into_text()
}
