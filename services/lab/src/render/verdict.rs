//! The diagnosis in words: what the text and the page say alike, and the text itself.

use kort_diagnose::report::{Finding, HeldOut, ParameterReport, Report, Verdict};

use kort_thruster::parameters::{Parameter, Parameters};
use kort_thruster::rig::Rig;

use super::number;
use super::text::{Sheet, parameter_rows};

/// A verdict in three words, and its tone for the page.
pub fn badge(verdict: Verdict) -> (&'static str, &'static str) {
    match verdict {
        Verdict::NoMismatch => ("No mismatch", "good"),
        Verdict::Explained => ("Mismatch explained", "good"),
        Verdict::PartlyExplained => ("Mismatch partly explained", "warn"),
        Verdict::Ambiguous => ("Explained, name ambiguous", "warn"),
        Verdict::Unexplained => ("Mismatch unexplained", "bad"),
        Verdict::InsufficientData => ("Insufficient data", "warn"),
    }
}

/// An identifier as words.
pub fn plain(id: &str) -> String {
    id.replace('_', " ")
}

/// A share as a percentage.
pub fn percent(x: f64) -> String {
    format!("{:.0} %", 100.0 * x)
}

/// Values of a finding that are shown at once: what is free in time has eighty.
pub const SHOWN: usize = 8;

/// `value ± error unit`.
pub fn value(p: &ParameterReport) -> String {
    let unit = if p.unit == "1" { "" } else { &p.unit };
    format!("{} = {} ± {} {unit}", p.name, number(p.value), number(p.std_error)).trim_end().to_string()
}

/// Time spans in words.
pub fn spans(list: &[[f64; 2]]) -> String {
    list.iter().map(|s| format!("{} to {} s", number(s[0]), number(s[1]))).collect::<Vec<_>>().join(", ")
}

/// What the held-out data say of an effect.
pub fn gain(heldout: &HeldOut) -> String {
    format!(
        "removes {} of the error above the noise on data it was not fitted to (95 % interval {} to {})",
        percent(heldout.excess_error_removed),
        percent(heldout.interval_95[0]),
        percent(heldout.interval_95[1])
    )
}

/// How far a baseline parameter moved: percent, and standard deviations of its statement.
pub fn moved(p: &ParameterReport, rig: &Rig) -> String {
    let Some(stated) = p.stated.filter(|s| *s != 0.0) else { return "-".into() };
    let percent = format!("{:+.1} %", 100.0 * (p.value / stated - 1.0));
    let known = || rig.effects.iter().flat_map(|known| &known.parameters).find(|(name, _)| *name == p.name);
    let quantity = Parameter::ALL
        .into_iter()
        .find(|q| q.name() == p.name)
        .and_then(|q| Parameters::quantity(rig, q))
        .or_else(|| known().map(|(_, quantity)| *quantity))
        .filter(|q| q.sigma() > 0.0);
    match quantity {
        Some(q) => format!("{percent} ({:.1} sigma)", ((p.value - stated) / q.sigma()).abs()),
        None => percent,
    }
}

/// A scenario as the file that `kort simulate` reads.
pub fn scenario(value: &serde_json::Value) -> String {
    toml::to_string_pretty(value).unwrap_or_else(|_| serde_json::to_string_pretty(value).unwrap_or_default())
}

/// The report for a terminal.
pub fn text(report: &Report, rig: &Rig) -> String {
    let mut sheet = Sheet::new(&format!(
        "{}: {} against {} on rig {}",
        badge(report.verdict).0.to_uppercase(),
        report.baseline.model,
        report.recordings.join(", "),
        report.rig
    ));
    sheet.paragraph("");
    sheet.paragraph(&report.summary);
    if !report.mismatch.is_empty() {
        sheet.heading("Where");
        for m in &report.mismatch {
            sheet.item(&format!(
                "{} path, most in {}: {}; {} sigma, {} of the error above the noise",
                m.path,
                m.channel,
                m.regime,
                number(m.significance_sigma.round()),
                percent(m.share_of_excess_error)
            ));
            if !m.time_s.is_empty() {
                sheet.more(&format!("mostly at {}", spans(&m.time_s)));
            }
        }
    }
    if !report.findings.is_empty() {
        sheet.heading("What");
        report.findings.iter().for_each(|f| finding(&mut sheet, f));
    }
    if let Some(term) = &report.empirical_term {
        sheet.heading("What is known of it, without a name");
        sheet.item(&format!("{} path, {}: {}", term.path, term.enters, term.expression));
        sheet.more(&gain(&term.heldout));
        heldout(&mut sheet, &term.heldout);
    }
    if let Some(left) = &report.remainder {
        sheet.heading("What is left");
        sheet.item(&format!(
            "{} of the error above the noise, {} path, most in {}, {}",
            percent(left.share_of_excess_error),
            left.path,
            left.channel,
            left.regime
        ));
    }
    if report.explanations.len() > 1 {
        sheet.heading("Names that are right together");
        for e in report.explanations.iter().take(SHOWN) {
            sheet.item(&format!("{}: {}", short(e.probability), set(&e.effects)));
        }
    }
    if !report.alternatives.is_empty() {
        sheet.heading("Tried and set aside");
        for a in &report.alternatives {
            sheet.item(&format!(
                "{} (probability {}): {}",
                plain(&a.effect),
                short(a.probability),
                a.why_not
            ));
        }
    }
    sheet.heading(&format!("Baseline {} re-fitted", report.baseline.model));
    sheet.table(
        &["", "stated", "fitted", "std error", "unit", "moved", ""],
        &parameter_rows(&report.baseline.parameters, rig),
    );
    sheet.paragraph("");
    let rows: Vec<Vec<String>> = report
        .baseline
        .channels
        .iter()
        .map(|(name, c)| {
            let percent = |x: f64| format!("{:.3} %", 100.0 * x);
            vec![name.clone(), percent(c.nrmse_train), percent(c.nrmse_heldout), percent(c.noise_floor)]
        })
        .collect();
    sheet.table(&["error / full scale", "fitted rows", "held-out rows", "noise alone"], &rows);
    if let Some(next) = &report.next_experiment {
        sheet.heading("Next experiment");
        let parts = next.separates.iter().map(|s| plain(s)).collect::<Vec<_>>().join(" from ");
        sheet.item(&format!("{}: {}", next.excitation, next.why));
        if !parts.is_empty() {
            sheet.more(&format!("parts {parts}; its scenario for kort simulate is in --json and --html"));
        }
    }
    if !report.notes.is_empty() {
        sheet.heading("Notes");
        report.notes.iter().for_each(|n| sheet.item(n));
    }
    sheet.into_text()
}

/// A set of effects in words.
pub fn set(effects: &[String]) -> String {
    if effects.is_empty() {
        return "none of the catalogue".into();
    }
    effects.iter().map(|e| plain(e)).collect::<Vec<_>>().join(" and ")
}

fn short(p: f64) -> String {
    format!("{p:.2}")
}

fn finding(sheet: &mut Sheet, f: &Finding) {
    sheet.item(&format!("{} ({} path), probability {}", plain(&f.effect), f.path, short(f.probability)));
    sheet.more(&f.statement);
    sheet.more(&f.equation);
    let (shown, folded) = f.parameters.split_at(f.parameters.len().min(SHOWN));
    for p in shown {
        let bound = if p.at_bound == Some(true) { " (at its bound)" } else { "" };
        sheet.more(&format!("{}{bound}", value(p)));
    }
    if let (Some(first), Some(last)) = (folded.first(), folded.last()) {
        sheet.more(&format!("{} to {}: in the JSON and on the page", first.name, last.name));
    }
    sheet.more(&gain(&f.heldout));
    heldout(sheet, &f.heldout);
    if !f.confounded_with.is_empty() {
        let list: Vec<String> = f.confounded_with.iter().map(|c| plain(c)).collect();
        sheet.more(&format!("this recording cannot tell it from {}", list.join(", ")));
    }
    f.evidence.iter().for_each(|e| sheet.more(&format!("* {e}")));
    if let Some(why) = &f.not_adopted {
        sheet.more(&format!("a rig does not take it over: {why}"));
    }
}

fn heldout(sheet: &mut Sheet, heldout: &HeldOut) {
    let rows: Vec<Vec<String>> = heldout
        .channels
        .iter()
        .map(|(name, c)| {
            let percent = |x: f64| format!("{:.3} %", 100.0 * x);
            vec![format!("  {name}"), percent(c.nrmse_before), percent(c.nrmse_after)]
        })
        .collect();
    sheet.table(&["  held out", "before", "after"], &rows);
}
