//! The comparison as one self-contained HTML page: tables, Pareto plot, the worst windows.

use maud::{Markup, html};

use super::report::{LawResult, Report, ScenarioResult};
use super::score::{Point, SCORES, Score};
use crate::render::{Chart, Mark, Page, Series, facts, note, number, table};

/// The page.
pub fn page(report: &Report) -> String {
    let mut page = Page::new(
        "Controllers compared",
        format!(
            "kort soak: {:.0} virtual seconds; figures are means over seeds with 95 % intervals",
            report.virtual_seconds
        ),
    );
    for s in &report.scenarios {
        page.section(&s.name, scenario(s));
    }
    let words: Vec<(&str, String)> = SCORES.iter().map(|(n, w)| (*n, (*w).to_owned())).collect();
    page.section("What the scores are", facts(&words));
    page.into_html()
}

fn scenario(s: &ScenarioResult) -> Markup {
    html! {
        p { (s.what) }
        (note("", html! { (s.verdict) }))
        (scores(s))
        p class="soft" { "* no other law is better in both thrust error and energy. Largest steady thrust " (number(s.thrust_max_n)) " N." }
        (pareto(s))
        h3 { "Worst windows" }
        @for l in shown(s) { (window(l)) }
    }
}

fn scores(s: &ScenarioResult) -> Markup {
    let columns: Vec<&str> =
        SCORES.iter().map(|(n, _)| *n).filter(|n| s.laws.iter().any(|l| l.score(n).is_some())).collect();
    let mut head = vec!["controller"];
    head.extend(&columns);
    let rows: Vec<Vec<String>> = s
        .laws
        .iter()
        .map(|l| {
            let name = if l.efficient(&s.laws) { format!("{} *", l.name) } else { l.name.clone() };
            std::iter::once(name)
                .chain(columns.iter().map(|c| l.score(c).map_or_else(|| "-".into(), cell)))
                .collect()
        })
        .collect();
    table(&head, &rows)
}

fn cell(score: Score) -> String {
    if score.ci95[0] == score.ci95[1] {
        number(score.mean)
    } else {
        format!("{} ({} to {})", number(score.mean), number(score.ci95[0]), number(score.ci95[1]))
    }
}

fn pareto(s: &ScenarioResult) -> Markup {
    let mut chart = Chart::new(
        "Thrust error against energy: nearer the lower left corner is better",
        "thrust error [N RMS]",
        "energy [kJ]",
    );
    for l in &s.laws {
        let (x, y) = (l.mean("thrust_rms_n"), 1e-3 * l.mean("energy_j"));
        if x.is_finite() && y.is_finite() {
            chart = chart.with(Series::new(l.name.clone(), Mark::Dots, &[x], &[y]));
        }
    }
    chart.draw()
}

/// The best, the plain and the worst law, each once.
fn shown(s: &ScenarioResult) -> Vec<&LawResult> {
    let worst = s.laws.iter().max_by(|a, b| a.mean("thrust_rms_n").total_cmp(&b.mean("thrust_rms_n")));
    let mut laws: Vec<&LawResult> = Vec::new();
    for l in [s.best(), s.plain(), worst].into_iter().flatten() {
        if !laws.iter().any(|x| std::ptr::eq(*x, l)) {
            laws.push(l);
        }
    }
    laws
}

fn window(l: &LawResult) -> Markup {
    let points = &l.worst.points;
    let series = |name: &str, mark: Mark, get: fn(&Point) -> f32| Series {
        name: name.into(),
        mark,
        points: points.iter().map(|p| (f64::from(p[0]), f64::from(get(p)))).collect(),
    };
    let caption = |what: &str| format!("{}: {what}", l.name);
    html! {
        p { (l.name) ": " (number(l.worst.rms_n)) " N RMS in its worst window" }
        (Chart::new(caption("thrust"), "time [s]", "thrust [N]")
            .with(series("given", Mark::Line, |p| p[2]))
            .with(series("asked for", Mark::Dashed, |p| p[1])).draw())
        (Chart::new(caption("shaft speed"), "time [s]", "speed [rad/s]").with(series("", Mark::Line, |p| p[3])).draw())
        (Chart::new(caption("axial flow"), "time [s]", "flow [m/s]")
            .with(series("true", Mark::Line, |p| p[4]))
            .with(series("estimated", Mark::Dashed, |p| p[5])).draw())
    }
}
