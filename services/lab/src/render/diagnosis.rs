//! The diagnosis as one self-contained page.

use kort_diagnose::diagnose::Diagnosis;
use kort_diagnose::report::{EmpiricalTerm, Finding, HeldOut, ParameterReport, Report};
use kort_thruster::rig::Rig;
use maud::{Markup, html};

use super::text::error_rows;
use super::verdict::{SHOWN, badge, gain, percent, plain, scenario, set, spans};
use super::{Page, curves, facts, note, number, table};

/// The page.
pub fn page(diagnosis: &Diagnosis, rig: &Rig) -> String {
    let report = &diagnosis.report;
    let (words, tone) = badge(report.verdict);
    let mut page = Page::new(format!("{words}: {}", report.rig), report.recordings.join(", "));
    page.add(note(
        tone,
        html! { p style="margin:0" { strong { (words) } } p class="lead" { (report.summary) } },
    ));
    page.add(facts(&[
        ("Model", report.baseline.model.clone()),
        ("Data", format!("{} recording(s), {} s", report.recordings.len(), number(report.seconds))),
        ("Rig", report.rig.clone()),
    ]));
    if !report.mismatch.is_empty() {
        page.section("Where it lies", whereabouts(report));
    }
    if !report.findings.is_empty() {
        page.section("What was left out", html! { @for f in &report.findings { (finding(f)) } });
    }
    if let Some(term) = &report.empirical_term {
        page.section("What is known of it, without a name", empirical(term));
    }
    if report.explanations.len() > 1 {
        page.section("Names that are right together", explanations(report));
    }
    page.section("Measured, modelled, explained", curves::all(diagnosis));
    page.section("The re-fitted baseline", baseline(report, rig));
    if !report.alternatives.is_empty() {
        page.section("Tried and set aside", rivals(report));
    }
    if let Some(next) = &report.next_experiment {
        let parts: Vec<String> =
            next.separates.iter().filter(|s| *s != "unknown").map(|s| plain(s)).collect();
        page.section(
            "The next experiment",
            html! {
                p { strong { (next.excitation) } }
                p { (next.why) }
                @if !parts.is_empty() { p class="soft" { "It parts " (parts.join(" from ")) "." } }
                p class="soft" { "Save as next.toml and try it first with "
                    code { "kort simulate --rig RIG --scenario next.toml -o next.csv" } ":" }
                pre { (scenario(&next.scenario)) }
            },
        );
    }
    if !report.notes.is_empty() {
        page.section("Notes", html! { ul { @for n in &report.notes { li { (n) } } } });
    }
    page.section("How to read this page", glossary());
    page.into_html()
}

fn whereabouts(report: &Report) -> Markup {
    let rows: Vec<Vec<String>> = report
        .mismatch
        .iter()
        .map(|m| {
            vec![
                m.path.clone(),
                m.channel.clone(),
                m.regime.clone(),
                spans(&m.time_s),
                number(m.significance_sigma.round()),
                percent(m.share_of_excess_error),
            ]
        })
        .collect();
    table(&["path", "shows most in", "when and where", "mostly at", "sigma", "share"], &rows)
}

fn finding(f: &Finding) -> Markup {
    html! {
        h3 { (plain(&f.effect)) " " span class="soft" {
            "on the " (f.path) " path, probability " (format!("{:.2}", f.probability)) } }
        p { (f.statement) }
        pre { (f.equation) }
        (values(&f.parameters))
        p { "With it the model " (gain(&f.heldout)) "." }
        (heldout(&f.heldout))
        @if !f.confounded_with.is_empty() {
            (note("warn", html! {
                "This recording cannot tell it from "
                (f.confounded_with.iter().map(|c| plain(c)).collect::<Vec<_>>().join(", ")) "."
            }))
        }
        ul { @for e in &f.evidence { li { (e) } } }
        @if let Some(why) = &f.not_adopted { p { "A rig description does not take it over: " (why) "." } }
    }
}

/// A finding's values, the first few open.
fn values(parameters: &[ParameterReport]) -> Markup {
    let rows: Vec<Vec<String>> = parameters
        .iter()
        .map(|p| {
            vec![
                p.name.clone(),
                number(p.value),
                format!("± {}", number(p.std_error)),
                p.unit.clone(),
                if p.at_bound == Some(true) { "at its bound".into() } else { String::new() },
            ]
        })
        .collect();
    let head = ["value of", "fitted", "standard error", "unit", ""];
    let (shown, folded) = rows.split_at(rows.len().min(SHOWN));
    html! {
        (table(&head, shown))
        @if !folded.is_empty() {
            details { summary { "and " (folded.len()) " more" } (table(&head, folded)) }
        }
    }
}

fn empirical(term: &EmpiricalTerm) -> Markup {
    html! {
        p { "It acts on the " (term.path) " path and adds to the " (term.enters) ":" }
        pre { (term.expression) }
        p class="soft" { "in terms of " (term.variables.join(", ")) }
        (values(&term.parameters))
        p { "The term " (gain(&term.heldout)) "." }
        (heldout(&term.heldout))
    }
}

/// Held-out errors by channel: a bar before, a bar after.
fn heldout(h: &HeldOut) -> Markup {
    let top = h.channels.values().map(|c| c.nrmse_before.max(c.nrmse_after)).fold(1e-12, f64::max);
    let bar = |x: f64, colour: &str| {
        html! { div class="bar" style=(format!("width:{:.1}%;height:.55rem;margin:.15rem 0;background:{colour}", 100.0 * x / top)) {} }
    };
    html! {
        div class="scroll" { table style="width:100%" {
            thead { tr { th { "held-out error, % of full scale" } th class="n" { "before" } th class="n" { "after" } th {} } }
            tbody { @for (name, c) in &h.channels { tr {
                td { (name) }
                td class="n" { (format!("{:.3}", 100.0 * c.nrmse_before)) }
                td class="n" { (format!("{:.3}", 100.0 * c.nrmse_after)) }
                td class="bars" { (bar(c.nrmse_before, curves::BEFORE)) (bar(c.nrmse_after, curves::AFTER)) }
            } } }
        } }
    }
}

fn baseline(report: &Report, rig: &Rig) -> Markup {
    let rows: Vec<Vec<String>> = report
        .baseline
        .parameters
        .iter()
        .map(|p| {
            vec![
                p.name.clone(),
                p.stated.map_or_else(|| "-".into(), number),
                number(p.value),
                format!("± {}", number(p.std_error)),
                p.unit.clone(),
                super::verdict::moved(p, rig),
                if p.at_bound == Some(true) { "at its bound".into() } else { String::new() },
            ]
        })
        .collect();
    let errors = error_rows(&report.baseline.channels);
    html! {
        p { "Parameters of " (report.baseline.model) ", free within their stated tolerances, nothing added." }
        (table(&["parameter", "stated", "fitted", "standard error", "unit", "moved", ""], &rows))
        (table(&["error, % of full scale", "on fitted rows", "on held-out rows", "noise alone", "residual white"], &errors))
    }
}

/// Names that are right together with their probabilities, and what the likeliest leaves.
fn explanations(report: &Report) -> Markup {
    let rows: Vec<Vec<String>> = report
        .explanations
        .iter()
        .take(SHOWN)
        .map(|e| vec![set(&e.effects), format!("{:.2}", e.probability)])
        .collect();
    html! {
        (table(&["effects", "probability"], &rows))
        @if let Some(left) = &report.remainder {
            p { (percent(left.share_of_excess_error)) " of the error above the noise is left, on the "
                (left.path) " path, most in " (left.channel) ", " (left.regime) "." }
        }
    }
}

fn rivals(report: &Report) -> Markup {
    html! {
        div class="scroll" { table {
            thead { tr { th { "effect" } th class="n" { "probability" } th { "why not" } } }
            tbody { @for a in &report.alternatives { tr {
                td { (plain(&a.effect)) }
                td class="n" { (format!("{:.2}", a.probability)) }
                td { (a.why_not) }
            } } }
        } }
    }
}

fn glossary() -> Markup {
    facts(&[
        ("path", "where an effect enters: drive (command to torque), shaft (torque balance), blade (lift and drag), flow (the water), sensor (the reading alone)".into()),
        ("baseline", "the model as it is, its parameters re-fitted within the stated tolerances".into()),
        ("held out", "rows that were left out of the fit and only used to score it".into()),
        ("error above the noise", "squared error beyond what measurement noise alone would leave".into()),
        ("sigma", "how far beyond the noise the mismatch stands, in standard deviations".into()),
        ("probability", "calibrated on blind cases: of names given 0.8, about 80 % are right".into()),
    ])
}
