//! The comparison as one self-contained HTML page: tables, Pareto plot, the worst windows.

use maud::{Markup, html};

use kort_soak::{LawResult, OF_PLAIN, Point, SCORES, ScenarioResult, Score};

use super::{Report, adoption};
use crate::render::{Chart, Mark, Page, Series, facts, note, number, table};

/// The page.
pub fn page(report: &Report) -> String {
    let mut page = Page::new(
        "Controllers compared",
        format!(
            "kort soak: {:.0} virtual seconds; figures are means over seeds ± half their 95 % interval",
            report.virtual_seconds
        ),
    );
    for s in &report.scenarios {
        page.section(&format!("{} on {}", s.name, s.rig), scenario(s));
    }
    if let Some(all) = &report.adoption {
        page.section("Adoption", adoption::section(all));
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
        p class="soft" { "* no other law is better in both thrust error and energy per useful newton-second. Largest steady thrust " (number(s.thrust_max_n)) " N." }
        (pareto(s))
        h3 { "Worst windows" }
        @for l in shown(s) { (window(l)) }
    }
}

/// Tables of the scores: heading, and what stands in it.
const TABLES: [(&str, &[(&str, &str)]); 5] = [
    (
        "Thrust",
        &[
            ("thrust_rms_n", "RMS error [N]"),
            (OF_PLAIN, "of plain"),
            ("thrust_p95_n", "95 % below [N]"),
            ("thrust_bias_n", "mean [N]"),
        ],
    ),
    (
        "Steps",
        &[("rise_time_s", "rise [s]"), ("settle_time_s", "settle [s]"), ("overshoot_pct", "overshoot [%]")],
    ),
    (
        "Energy",
        &[
            ("energy_j", "energy [J]"),
            ("useful_impulse_n_s", "useful [N s]"),
            ("energy_per_impulse_j_n_s", "J per N s"),
            ("energy_over_ideal", "over the ideal"),
            ("copper_loss_per_impulse_j_n_s", "I²R J per N s"),
        ],
    ),
    (
        "Limits and wear",
        &[
            ("saturation_share", "at a limit"),
            ("current_travel_a_s", "wear [A/s]"),
            ("limits_broken", "limits broken"),
        ],
    ),
    (
        "Estimates and faults",
        &[
            ("flow_rms_m_s", "flow error [m/s]"),
            ("parameter_error", "parameter error"),
            ("error_over_true_parameters", "error, times that told the truth"),
            ("faults_injected", "faults"),
            ("faults_survived", "survived"),
            ("trips", "trips"),
        ],
    ),
];

fn scores(s: &ScenarioResult) -> Markup {
    html! {
        @for (heading, columns) in TABLES.iter().filter(|(_, columns)| !columns_of(s, columns).is_empty()) {
            h3 { (heading) }
            (scores_of(s, columns))
        }
    }
}

/// Columns that some law has a figure in.
fn columns_of<'a>(s: &ScenarioResult, columns: &'a [(&'a str, &'a str)]) -> Vec<&'a (&'a str, &'a str)> {
    columns.iter().filter(|(score, _)| s.laws.iter().any(|l| s.figure(l, score).is_some())).collect()
}

fn scores_of(s: &ScenarioResult, columns: &[(&str, &str)]) -> Markup {
    let columns = columns_of(s, columns);
    let mut head = vec!["controller"];
    head.extend(columns.iter().map(|(_, words)| *words));
    let rows: Vec<Vec<String>> = s
        .laws
        .iter()
        .map(|l| {
            let name = if l.efficient(&s.laws) { format!("{}\u{a0}*", l.name) } else { l.name.clone() };
            std::iter::once(name)
                .chain(columns.iter().map(|(score, _)| s.figure(l, score).map_or_else(|| "-".into(), cell)))
                .collect()
        })
        .collect();
    table(&head, &rows)
}

/// Mean and half the width of its interval, the latter to two digits.
fn cell(score: Score) -> String {
    let [low, high] = score.ends();
    let half = 0.5 * (high - low);
    if score.mean.is_nan() {
        "not known".into()
    } else if half == 0.0 {
        number(score.mean)
    } else {
        let digits = (1 - half.log10().floor() as i32).clamp(0, 5) as usize;
        format!("{:.digits$} ± {half:.digits$}", score.mean)
    }
}

fn pareto(s: &ScenarioResult) -> Markup {
    let words = "Thrust error against energy per useful newton-second: nearer the lower left corner is better; the dashed line joins \
                 the laws (*) that no other betters in both";
    let mut chart = Chart::new(words, "thrust error [N RMS]", "energy [J/(N s)]");
    chart.height = 420;
    let place = |l: &LawResult| (l.mean("thrust_rms_n"), l.mean("energy_per_impulse_j_n_s"));
    let finite = |(x, y): &(f64, f64)| x.is_finite() && y.is_finite();
    for l in &s.laws {
        let at = place(l);
        chart = chart.with(Series { name: l.name.clone(), mark: Mark::Named, points: vec![at] });
    }
    let mut front: Vec<(f64, f64)> =
        s.laws.iter().filter(|l| l.efficient(&s.laws)).map(place).filter(finite).collect();
    front.sort_by(|a, b| a.0.total_cmp(&b.0));
    chart.with(Series { name: String::new(), mark: Mark::Dashed, points: front }).draw()
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
