//! The report of `kort calibrate` as text.

use kort_calibrate::{Report, Stated};

use super::number;
use super::text::Sheet;
use crate::calibrate::rehearse::Rehearsal;

/// A session for a terminal.
pub fn text(report: &Report) -> String {
    let mut sheet = Sheet::new(&format!("calibration of {}", report.thruster));
    for step in &report.steps {
        sheet.heading(&step.name);
        sheet.item(&step.result);
        let row = |q: &Stated| {
            vec![q.name.clone(), number(q.value), format!("± {}", number(q.tolerance)), q.unit.clone()]
        };
        let rows: Vec<Vec<String>> = step.quantities.iter().map(row).collect();
        if !rows.is_empty() {
            sheet.table(&["", "value", "tolerance", "unit"], &rows);
        }
        step.skipped_because.iter().for_each(|why| sheet.item(&format!("left out: {why}")));
    }
    let written = [("rig", &report.rig), ("recording", &report.recording), ("stopped", &report.stopped)];
    let written: Vec<String> = written
        .into_iter()
        .filter_map(|(what, words)| Some(format!("{what}: {}", words.as_ref()?)))
        .collect();
    if !written.is_empty() {
        sheet.heading("Result");
        written.iter().for_each(|words| sheet.item(words));
    }
    sheet.into_text()
}

/// A rehearsal for a terminal.
pub fn rehearsal(rehearsal: &Rehearsal) -> String {
    let mut sheet = Sheet::new(&format!(
        "{} of {} stated quantities inside their tolerance; {} of {} wiring faults found before half a turn",
        rehearsal.inside[0], rehearsal.inside[1], rehearsal.found[0], rehearsal.found[1]
    ));
    let whole =
        rehearsal.rigs.iter().filter(|r| r.stopped.is_none() && r.quantities.iter().all(|q| q.inside));
    sheet.item(&format!("{} of {} rigs with every quantity inside", whole.count(), rehearsal.rigs.len()));
    for rig in rehearsal.rigs.iter().filter(|r| r.stopped.is_some()) {
        sheet.item(&format!("seed {} stopped: {}", rig.seed, rig.stopped.as_deref().unwrap_or_default()));
    }
    let mut names: Vec<&str> = Vec::new();
    for q in rehearsal.rigs.iter().flat_map(|r| &r.quantities) {
        let name = family(&q.name);
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let rows: Vec<Vec<String>> = names
        .into_iter()
        .map(|name| {
            let all: Vec<_> = rehearsal
                .rigs
                .iter()
                .flat_map(|r| &r.quantities)
                .filter(|q| family(&q.name) == name)
                .collect();
            let mut sizes: Vec<f64> = all.iter().map(|q| (q.value - q.truth).abs() / q.tolerance).collect();
            sizes.sort_by(f64::total_cmp);
            // Of nothing there is no share.
            let sized = all.iter().filter(|q| q.truth != 0.0);
            let mut relative: Vec<f64> = sized.map(|q| 100.0 * (q.tolerance / q.truth).abs()).collect();
            relative.sort_by(f64::total_cmp);
            vec![
                name.to_owned(),
                format!("{} of {}", all.iter().filter(|q| q.inside).count(), all.len()),
                number(sizes[sizes.len() / 2]),
                number(sizes[sizes.len() - 1]),
                relative
                    .get(relative.len() / 2)
                    .map_or("–".into(), |share| format!("{} %", number(*share))),
            ]
        })
        .collect();
    sheet.heading("By quantity");
    sheet.table(&["", "inside", "median error over tolerance", "worst", "median tolerance"], &rows);
    let missed = rehearsal.troubles.iter().filter(|t| !t.found || t.way_rad >= std::f64::consts::PI);
    let missed: Vec<String> = missed
        .map(|t| format!("seed {}, {}: after {} rad: {}", t.seed, t.trouble, number(t.way_rad), t.said))
        .collect();
    if !missed.is_empty() {
        sheet.heading("Wiring faults not found, or late");
        missed.iter().for_each(|words| sheet.item(words));
    }
    sheet.into_text()
}

/// All levels of the thrust map are one family.
fn family(name: &str) -> &str {
    name.split(" at ").next().unwrap_or(name)
}
