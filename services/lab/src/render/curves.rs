//! Curves of a diagnosis: measured, baseline, explained; residuals by time and by regime.

use kort_diagnose::diagnose::Diagnosis;
use kort_diagnose::traces::Trace;
use maud::{Markup, html};

use super::{Chart, Mark, Series};

/// Colour of the baseline's bars, as in the charts.
pub const BEFORE: &str = "#d55e00";
/// Colour of the bars with everything found.
pub const AFTER: &str = "#0072b2";
/// Length of the window that shows the worst stretch, s.
const WINDOW_S: f64 = 3.0;
/// Recordings drawn: the page must stay small.
const MOST_RECORDINGS: usize = 3;
/// Fewest samples that make a point of a regime chart.
const FEWEST: usize = 8;

/// All charts, channel by channel.
pub fn all(diagnosis: &Diagnosis) -> Markup {
    let report = &diagnosis.report;
    let found = !report.findings.is_empty() || report.empirical_term.is_some();
    let mut spans: Vec<(f64, f64)> =
        report.mismatch.iter().flat_map(|m| &m.time_s).map(|s| (s[0], s[1])).collect();
    spans.sort_by(|a, b| a.0.total_cmp(&b.0));
    let several = report.recordings.len() > 1;
    let drawn = &report.recordings[..report.recordings.len().min(MOST_RECORDINGS)];
    html! {
        p class="soft" {
            "Measured has the colour of the text, the baseline is orange"
            @if found { ", the model with everything found blue" }
            "."
            @if !spans.is_empty() && !several { " Shaded: where most of the mismatch lies." }
            @if several && drawn.len() < report.recordings.len() { " The first " (drawn.len()) " recordings are drawn." }
        }
        @for trace in diagnosis.traces.channels.iter().filter(|t| drawn.contains(&t.recording)) {
            h3 {
                (trace.channel)
                @if let Some(column) = trace.under { " under " (column) }
                @if several { " " span class="soft" { (trace.recording) } }
            }
            (channel(trace, found, if several { &[] } else { &spans }))
        }
    }
}

fn channel(trace: &Trace, found: bool, spans: &[(f64, f64)]) -> Markup {
    let axis = axis(trace.channel);
    let t = &trace.time_s;
    let curves = |chart: Chart, rows: std::ops::Range<usize>, mark: Mark| {
        let t = &t[rows.clone()];
        let chart = chart
            .with(Series::new("measured", mark, t, &trace.measured[rows.clone()]))
            .with(Series::new("baseline", Mark::Line, t, &trace.baseline[rows.clone()]));
        if found {
            chart.with(Series::new("explained", Mark::Line, t, &trace.explained[rows]))
        } else {
            chart
        }
    };
    let whole = curves(Chart::new("Whole run.", "time [s]", &axis), 0..t.len(), Mark::Line).shaded(spans);
    let (before, after) = residuals(trace);
    let at = worst(trace, &before, &after, found);
    let zoom = curves(Chart::new("The stretch that differs most.", "time [s]", &axis), at, Mark::Dots);
    let blank = || Series::new("", Mark::Line, &[], &[]);
    let pair = |chart: Chart, x: &[f64], b: &[f64], a: &[f64]| {
        // The blank keeps each curve's colour.
        let chart = chart.with(blank()).with(Series::new("baseline", Mark::Line, x, b));
        if found { chart.with(Series::new("explained", Mark::Line, x, a)) } else { chart }
    };
    let left = pair(
        Chart::new("Residual: measured minus modelled.", "time [s]", format!("residual of {axis}")),
        t,
        &before,
        &after,
    )
    .shaded(spans);
    let rms = format!("rms residual of {axis}");
    let (speed, b, a) = binned(&trace.shaft_speed_rad_s, &before, &after, 13, |x| x);
    let by_speed = pair(Chart::new("Residual by shaft speed.", "shaft speed [rad/s]", &rms), &speed, &b, &a);
    let (since, b2, a2) = binned(&trace.since_step_s, &before, &after, 12, f64::ln);
    let since: Vec<f64> = since.iter().map(|x| x.exp()).collect();
    let by_step = pair(
        Chart::new("Residual by time since the last command step.", "time since step [s]", &rms),
        &since,
        &b2,
        &a2,
    );
    html! {
        (whole.draw()) (zoom.draw()) (left.draw())
        @if speed.len() > 2 { (by_speed.draw()) }
        @if since.len() > 2 { (by_step.draw()) }
    }
}

fn residuals(trace: &Trace) -> (Vec<f64>, Vec<f64>) {
    let minus = |model: &[f64]| trace.measured.iter().zip(model).map(|(m, s)| m - s).collect();
    (minus(&trace.baseline), minus(&trace.explained))
}

/// The window with most error explained, or (if nothing was found) with most error.
fn worst(trace: &Trace, before: &[f64], after: &[f64], found: bool) -> std::ops::Range<usize> {
    let t = &trace.time_s;
    let gain = |k: usize| before[k] * before[k] - after[k] * after[k];
    let total: f64 = before.iter().map(|b| b * b).sum();
    // Where nothing was explained in this channel, the largest error is worth a look.
    let found = found && (0..t.len()).map(gain).filter(|g| *g > 0.0).sum::<f64>() > 1e-3 * total;
    let weight = |k: usize| if found { gain(k) } else { before[k] * before[k] };
    let (mut from, mut sum) = (0, 0.0);
    let mut best = (f64::NEG_INFINITY, 0..t.len().min(1));
    for to in 0..t.len() {
        sum += weight(to);
        while t[to] - t[from] > WINDOW_S {
            sum -= weight(from);
            from += 1;
        }
        if sum > best.0 {
            best = (sum, from..to + 1);
        }
    }
    // With a little of what came before.
    let start = t[best.1.start] - 0.3;
    t.partition_point(|x| *x < start)..best.1.end
}

/// Root mean squares of two residuals in bins of something, equally wide in `scale` of it.
fn binned(
    by: &[f64],
    before: &[f64],
    after: &[f64],
    bins: usize,
    scale: fn(f64) -> f64,
) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let at: Vec<f64> = by.iter().map(|x| scale(*x)).collect();
    let ok = |x: &f64| x.is_finite();
    let low = at.iter().copied().filter(ok).fold(f64::INFINITY, f64::min);
    let high = at.iter().copied().filter(ok).fold(f64::NEG_INFINITY, f64::max);
    let mut sums = vec![(0.0, 0.0, 0usize); bins];
    for ((x, b), a) in at.iter().zip(before).zip(after).filter(|((x, _), _)| x.is_finite()) {
        let bin = (((x - low) / (high - low).max(1e-12) * bins as f64) as usize).min(bins - 1);
        sums[bin].0 += b * b;
        sums[bin].1 += a * a;
        sums[bin].2 += 1;
    }
    let width = (high - low) / bins as f64;
    let mut out = (Vec::new(), Vec::new(), Vec::new());
    for (i, (b, a, n)) in sums.into_iter().enumerate().filter(|(_, s)| s.2 >= FEWEST) {
        out.0.push(low + (i as f64 + 0.5) * width);
        out.1.push((b / n as f64).sqrt());
        out.2.push((a / n as f64).sqrt());
    }
    out
}

/// Axis title of a channel: its name in words, its unit.
fn axis(channel: &str) -> String {
    let unit = kort_recording::columns::find(channel).map_or("", |k| k.unit);
    let name = match channel {
        "current_a" => "current",
        "shaft_speed_rad_s" => "shaft speed",
        "thrust_n" => "thrust",
        "torque_n_m" => "torque",
        "flow_m_s" => "axial flow",
        other => other,
    };
    format!("{name} [{unit}]")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trace() -> Trace {
        let time_s: Vec<f64> = (0..1000).map(|k| f64::from(k) * 0.01).collect();
        let wrong = |t: &f64| if (6.0..7.0).contains(t) { 1.0 } else { 0.0 };
        Trace {
            recording: "r".into(),
            under: None,
            channel: "thrust_n",
            measured: time_s.iter().map(wrong).collect(),
            baseline: vec![0.0; 1000],
            explained: time_s.iter().map(wrong).collect(),
            shaft_speed_rad_s: time_s.clone(),
            since_step_s: time_s.iter().map(|t| if *t < 1.0 { f64::INFINITY } else { t - 1.0 }).collect(),
            time_s,
        }
    }

    #[test]
    fn the_window_covers_the_worst_stretch() {
        let trace = trace();
        let (before, after) = residuals(&trace);
        let at = worst(&trace, &before, &after, true);
        assert!(trace.time_s[at.start] <= 6.0 && trace.time_s[at.end - 1] >= 6.99, "{at:?}");
    }

    #[test]
    fn a_channel_that_nothing_changed_shows_its_largest_error() {
        let mut trace = trace();
        trace.explained.clone_from(&trace.baseline);
        let (before, after) = residuals(&trace);
        let at = worst(&trace, &before, &after, true);
        assert!(trace.time_s[at.start] <= 6.0 && trace.time_s[at.end - 1] >= 6.99, "{at:?}");
    }

    #[test]
    fn bins_hold_root_mean_squares() {
        let (x, b, a) = binned(&[0.0; 20], &[2.0; 20], &[1.0; 20], 4, |x| x);
        assert_eq!((x.len(), b[0], a[0]), (1, 2.0, 1.0));
    }

    #[test]
    fn a_channel_draws() {
        let html = channel(&trace(), true, &[(6.0, 7.0)]).into_string();
        assert!(
            html.contains("thrust [N]") && html.contains("explained") && html.matches("<svg").count() == 5
        );
    }
}
