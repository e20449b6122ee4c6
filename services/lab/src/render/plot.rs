//! Charts over two axes, as SVG inside the page.

use maud::{Markup, PreEscaped, html};
use plotters::prelude::*;

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    /// A line through the points; NaN breaks it.
    Line,
    /// A dashed line.
    Dashed,
    /// A dot a point.
    Dots,
    /// A large dot a point, the series' name beside it.
    Named,
}

/// One series.
#[derive(Clone, Debug)]
pub struct Series {
    /// Name in the legend; empty for none.
    pub name: String,
    /// Points (x, y).
    pub points: Vec<(f64, f64)>,
    /// How it is drawn.
    pub mark: Mark,
}

impl Series {
    /// A series from two columns.
    pub fn new(name: impl Into<String>, mark: Mark, x: &[f64], y: &[f64]) -> Self {
        Self { name: name.into(), mark, points: x.iter().copied().zip(y.iter().copied()).collect() }
    }
}

/// A chart.
#[derive(Clone, Debug, Default)]
pub struct Chart {
    /// Words under it.
    pub caption: String,
    /// Name and unit of the x axis, for example `time [s]`.
    pub x: String,
    /// Name and unit of the y axis.
    pub y: String,
    /// What is drawn, first at the back.
    pub series: Vec<Series>,
    /// Stretches of x to shade.
    pub spans: Vec<(f64, f64)>,
    /// Height in pixels at full width; zero means 300.
    pub height: u32,
}

/// Colours told apart also by people who see red and green alike (Okabe and Ito), dark first.
const COLOURS: [RGBColor; 6] = [
    RGBColor(0x1b, 0x27, 0x33),
    RGBColor(0xd5, 0x5e, 0x00),
    RGBColor(0x00, 0x72, 0xb2),
    RGBColor(0x00, 0x9e, 0x73),
    RGBColor(0xcc, 0x79, 0xa7),
    RGBColor(0xa6, 0x7c, 0x00),
];
const WIDTH: u32 = 900;
/// Points a line needs at this width; a longer one keeps the extremes of each stretch.
const LINE_POINTS: usize = 1800;
const DOTS: usize = 4000;

impl Chart {
    /// A chart with axis titles.
    pub fn new(caption: impl Into<String>, x: impl Into<String>, y: impl Into<String>) -> Self {
        Self { caption: caption.into(), x: x.into(), y: y.into(), ..Self::default() }
    }

    /// Adds a series.
    pub fn with(mut self, series: Series) -> Self {
        self.series.push(series);
        self
    }

    /// Shades stretches of x.
    pub fn shaded(mut self, spans: &[(f64, f64)]) -> Self {
        self.spans.extend_from_slice(spans);
        self
    }

    /// The figure. A chart without a finite point says so.
    pub fn draw(&self) -> Markup {
        let mut svg = String::new();
        let drawn = self.bounds().and_then(|bounds| self.draw_svg(&mut svg, bounds).ok());
        html! {
            figure {
                @if drawn.is_some() { (PreEscaped(svg)) } @else { p class="soft" { "nothing to draw" } }
                figcaption {
                    (self.caption)
                    @for (i, s) in self.series.iter().enumerate().filter(|(_, s)| !s.name.is_empty() && s.mark != Mark::Named) {
                        " " span style=(format!("color:{};white-space:nowrap", hex(i))) {
                            (match s.mark { Mark::Line => "━ ", Mark::Dashed => "╌ ", _ => "● " }) (s.name)
                        }
                    }
                }
            }
        }
    }

    fn bounds(&self) -> Option<[f64; 4]> {
        let mut b = [f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY];
        for (x, y) in self.series.iter().flat_map(|s| &s.points) {
            if x.is_finite() && y.is_finite() {
                b = [b[0].min(*x), b[1].max(*x), b[2].min(*y), b[3].max(*y)];
            }
        }
        if b[0] > b[1] {
            return None;
        }
        let pad = |low: f64, high: f64| {
            let size = high - low;
            if size > 0.0 { 0.04 * size } else { 0.5 * low.abs().max(1.0) }
        };
        let named = self.series.iter().any(|s| s.mark == Mark::Named);
        let (px, py) = (if b[1] > b[0] && !named { 0.0 } else { pad(b[0], b[1]) }, pad(b[2], b[3]));
        Some([b[0] - px, b[1] + px, b[2] - py, b[3] + py])
    }

    fn draw_svg(&self, svg: &mut String, b: [f64; 4]) -> Result<(), Box<dyn std::error::Error>> {
        let height = if self.height == 0 { 300 } else { self.height };
        let root = SVGBackend::with_string(svg, (WIDTH, height)).into_drawing_area();
        // Ticks are sums of their step: what rounding leaves of zero is zero.
        let tick = |span: f64| move |v: &f64| super::number(if v.abs() < 1e-9 * span { 0.0 } else { *v });
        let mut chart = ChartBuilder::on(&root)
            .margin(8)
            .x_label_area_size(42)
            .y_label_area_size(68)
            .build_cartesian_2d(b[0]..b[1], b[2]..b[3])?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(RGBColor(0xe3, 0xe9, 0xee))
            .axis_style(RGBColor(0x5b, 0x6b, 0x7a))
            .label_style(("sans-serif", 14))
            .axis_desc_style(("sans-serif", 15))
            .x_desc(&self.x)
            .y_desc(&self.y)
            .x_label_formatter(&tick(b[1] - b[0]))
            .y_label_formatter(&tick(b[3] - b[2]))
            .draw()?;
        let shade = RGBColor(0xd5, 0x5e, 0x00).mix(0.12).filled();
        chart.draw_series(
            self.spans
                .iter()
                .filter(|s| s.1 > b[0] && s.0 < b[1])
                .map(|s| Rectangle::new([(s.0.max(b[0]), b[2]), (s.1.min(b[1]), b[3])], shade)),
        )?;
        let mut labels = Labels::default();
        for (i, series) in self.series.iter().enumerate() {
            let colour = COLOURS[i % COLOURS.len()];
            match series.mark {
                Mark::Named => {
                    chart.draw_series(series.points.iter().map(|p| Circle::new(*p, 5, colour.filled())))?;
                    labels.0.extend(series.points.iter().map(|p| (chart.backend_coord(p), i)));
                }
                Mark::Dots => {
                    let every = series.points.len().div_ceil(DOTS).max(1);
                    let finite = |p: &&(f64, f64)| p.0.is_finite() && p.1.is_finite();
                    chart.draw_series(
                        series
                            .points
                            .iter()
                            .step_by(every)
                            .filter(finite)
                            .map(|p| Circle::new(*p, 2, colour.filled())),
                    )?;
                }
                Mark::Line | Mark::Dashed => {
                    for run in runs(&series.points) {
                        let style = colour.stroke_width(2);
                        if series.mark == Mark::Dashed {
                            chart.draw_series(DashedLineSeries::new(run, 7, 4, style))?;
                        } else {
                            chart.draw_series(LineSeries::new(run, style))?;
                        }
                    }
                }
            }
        }
        for (dot, at, i) in labels.placed(|i| self.series[i].name.len()) {
            let colour = COLOURS[i % COLOURS.len()];
            if (at.1 - dot.1).abs() > LABEL_PX / 2 {
                root.draw(&PathElement::new(vec![dot, at], colour.stroke_width(1)))?;
            }
            let style = TextStyle::from(("sans-serif", 14).into_font()).color(&colour);
            root.draw(&Text::new(self.series[i].name.clone(), (at.0, at.1 - 7), style))?;
        }
        root.present()?;
        drop(chart);
        Ok(())
    }
}

/// Height of a label and width of one of its letters, pixels.
const LABEL_PX: i32 = 15;
const LETTER_PX: i32 = 8;

/// Names beside dots: where the dot is, and whose.
#[derive(Default)]
struct Labels(Vec<(Pixel, usize)>);

/// Place on the chart: across, down.
type Pixel = (i32, i32);

impl Labels {
    /// Dot, place of the label and its series; from the top down, a label that would cover another
    /// goes further down.
    fn placed(mut self, letters: impl Fn(usize) -> usize) -> Vec<(Pixel, Pixel, usize)> {
        self.0.sort_by_key(|((_, y), _)| *y);
        let mut placed: Vec<(Pixel, Pixel, usize)> = Vec::new();
        let width = |i: usize| LETTER_PX * letters(i) as i32;
        for (dot, i) in self.0 {
            let right = dot.0 + 9 + width(i) < WIDTH as i32;
            let mut at = (if right { dot.0 + 9 } else { dot.0 - 9 - width(i) }, dot.1);
            for (_, other, j) in &placed {
                let apart = other.0 > at.0 + width(i) || at.0 > other.0 + width(*j);
                if !apart && (at.1 - other.1).abs() < LABEL_PX {
                    at.1 = other.1 + LABEL_PX;
                }
            }
            placed.push((dot, at, i));
        }
        placed
    }
}

fn hex(i: usize) -> String {
    let RGBColor(r, g, b) = COLOURS[i % COLOURS.len()];
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// Finite runs of a line, thinned to what the width can show: of each stretch its lowest and
/// highest point stay, so no spike disappears.
fn runs(points: &[(f64, f64)]) -> Vec<Vec<(f64, f64)>> {
    let finite = |p: &(f64, f64)| p.0.is_finite() && p.1.is_finite();
    let stretch = (2 * points.len()).div_ceil(LINE_POINTS).max(1);
    points
        .split(|p| !finite(p))
        .filter(|run| !run.is_empty())
        .map(|run| {
            if stretch < 3 {
                return run.to_vec();
            }
            run.chunks(stretch)
                .flat_map(|chunk| {
                    let by = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
                    let (low, high) = (chunk.iter().min_by(by), chunk.iter().max_by(by));
                    let mut both: Vec<(f64, f64)> = low.into_iter().chain(high).copied().collect();
                    both.sort_by(|a, b| a.0.total_cmp(&b.0));
                    both
                })
                .collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spike_survives_thinning() {
        let mut points: Vec<(f64, f64)> = (0..100_000).map(|i| (f64::from(i), 0.0)).collect();
        points[54_321].1 = 7.0;
        let thin = runs(&points);
        assert!(thin[0].len() <= 2 * LINE_POINTS);
        assert!(thin[0].iter().any(|p| p.1 == 7.0));
    }

    #[test]
    fn a_tick_at_zero_says_zero() {
        let chart = Chart::new("residual", "time [s]", "residual of current [A]").with(Series::new(
            "",
            Mark::Line,
            &[0.0, 25.0],
            &[-0.1173, 0.1127],
        ));
        let mut svg = String::new();
        chart.draw_svg(&mut svg, chart.bounds().unwrap()).unwrap();
        assert!(svg.contains("0.05") && !svg.contains("e-1"), "{svg}");
    }

    #[test]
    fn labels_do_not_cover_each_other() {
        let labels = Labels(vec![((100, 50), 0), ((104, 52), 1), ((110, 49), 2), ((880, 50), 3)]);
        let placed = labels.placed(|_| 10);
        for (k, a) in placed.iter().enumerate() {
            assert!(a.1.0 >= 0 && a.1.0 + 80 < 900, "{a:?}");
            for b in &placed[k + 1..] {
                assert!((a.1.1 - b.1.1).abs() >= LABEL_PX || (a.1.0 - b.1.0).abs() > 80, "{a:?} {b:?}");
            }
        }
    }

    #[test]
    fn charts_draw_and_empty_ones_say_so() {
        let x = [0.0, 1.0, 2.0, 3.0];
        let chart = Chart::new("speed", "time [s]", "speed [rad/s]")
            .with(Series::new("measured", Mark::Dots, &x, &[0.0, 1.0, f64::NAN, 2.0]))
            .with(Series::new("model", Mark::Dashed, &x, &[0.0, 1.0, 1.5, 2.0]))
            .shaded(&[(0.5, 1.5)]);
        let html = chart.draw().into_string();
        assert!(html.contains("<svg") && html.contains("time [s]") && html.contains("measured"));
        let empty = Chart::new("", "", "").with(Series::new("", Mark::Line, &[f64::NAN], &[1.0]));
        assert!(empty.draw().into_string().contains("nothing to draw"));
    }
}
