//! A page: title, sections, tables, notes.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::number;

/// The whole look. Dark text on white, or light on dark for who asks for it, as the console shows it. On a phone tables
/// scroll inside their own boxes; charts are as wide as the page, with larger letters, which the drawing shrinks again.
const STYLE: &str = "
:root { --ink: #1b2733; --soft: #5b6b7a; --line: #d8e0e7; --band: #f4f7fa; --accent: #0b6fb8; --paper: #fff; color-scheme: light dark; }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 1.5rem 1.25rem 4rem; max-width: 62rem; color: var(--ink); background: var(--paper);
  font: 16px/1.55 system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', sans-serif; }
header { border-bottom: 2px solid var(--ink); margin-bottom: 1.5rem; padding-bottom: .5rem; }
h1 { font-size: 1.6rem; line-height: 1.2; margin: 0 0 .25rem; }
h2 { font-size: 1.2rem; margin: 2.2rem 0 .6rem; }
h3 { font-size: 1rem; margin: 1.4rem 0 .4rem; }
p { margin: .5rem 0; }
.lead { font-size: 1.08rem; }
.soft, figcaption, footer { color: var(--soft); font-size: .88rem; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; margin: .5rem 0 1rem; font-size: .92rem; }
th, td { text-align: left; padding: .35rem .8rem .35rem .4rem; border-bottom: 1px solid var(--line); vertical-align: top; }
thead th { border-bottom: 2px solid var(--line); white-space: nowrap; }
td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
tbody tr:nth-child(even) { background: var(--band); }
figure { margin: 1rem 0; }
figure svg { max-width: 100%; height: auto; display: block; overflow: visible; }
code, pre { font: .88em/1.45 ui-monospace, 'Cascadia Mono', Menlo, Consolas, monospace; }
pre { background: var(--band); padding: .7rem .9rem; white-space: pre-wrap; overflow-wrap: anywhere; border-radius: 4px; }
.note { border-left: 4px solid var(--accent); background: var(--band); padding: .6rem .9rem; margin: .8rem 0; }
.note.good { border-color: #2a8a4a; } .note.warn { border-color: #c77700; } .note.bad { border-color: #b3261e; }
.bar { background: var(--accent); height: .8rem; min-width: 1px; border-radius: 2px; }
td.bars { width: 45%; min-width: 8rem; }
.heat td { text-align: center; padding: .25rem .4rem; font-variant-numeric: tabular-nums; }
.heat th { font-weight: 500; font-size: .82rem; } .heat thead th { writing-mode: vertical-rl; transform: rotate(180deg); text-align: left; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .2rem 1rem; margin: .5rem 0; }
dt { color: var(--soft); } dd { margin: 0; }
footer { margin-top: 3rem; border-top: 1px solid var(--line); padding-top: .6rem; }
@media screen and (max-width: 48rem) {
  figure svg text { font-size: 15px; } figure svg text[transform] { translate: -16px 0; } }
@media screen and (max-width: 36rem) {
  figure svg text { font-size: 18px; } figure svg text[dy='-0.5ex'] { translate: 0 12px; }
  figure svg text[transform] { font-size: 16px; translate: -20px 0; } }
@media (max-width: 40rem) { body { padding: 1rem .8rem 3rem; font-size: 15px; } h1 { font-size: 1.3rem; }
  dl { grid-template-columns: 1fr; gap: 0; } dd { margin-bottom: .4rem; } }
@media screen and (prefers-color-scheme: dark) {
  :root { --ink: #e4eaf0; --soft: #9fb0bf; --line: #33414e; --band: #1b252f; --accent: #3f9ae0; --paper: #12181f; }
  a { color: #7cb8ff; }
  /* Drawn dark on light: turned over, with the hues kept. */
  figure svg, figcaption [style] { filter: invert(1) hue-rotate(180deg); } }
@media print { body { max-width: none; } figure, table { break-inside: avoid; } }
";

/// A self-contained page.
pub struct Page {
    title: String,
    subtitle: String,
    body: Vec<Markup>,
}

impl Page {
    /// A page with its title and one line under it.
    pub fn new(title: impl Into<String>, subtitle: impl Into<String>) -> Self {
        Self { title: title.into(), subtitle: subtitle.into(), body: Vec::new() }
    }

    /// Adds anything.
    pub fn add(&mut self, part: Markup) -> &mut Self {
        self.body.push(part);
        self
    }

    /// Adds a section with its heading.
    pub fn section(&mut self, heading: &str, part: Markup) -> &mut Self {
        self.add(html! { section { h2 { (heading) } (part) } })
    }

    /// The HTML document.
    pub fn into_html(self) -> String {
        html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    title { (self.title) }
                    style { (PreEscaped(STYLE)) }
                }
                body {
                    header { h1 { (self.title) } p class="soft" { (self.subtitle) } }
                    main { @for part in &self.body { (part) } }
                    footer { "kort " (env!("CARGO_PKG_VERSION")) }
                }
            }
        }
        .into_string()
    }
}

/// A table; cells that read as numbers stand right.
pub fn table(head: &[&str], rows: &[Vec<String>]) -> Markup {
    let numeric = |text: &str| {
        text.trim_end_matches(" %").trim_start_matches("± ").split(" ± ").all(|x| x.parse::<f64>().is_ok())
    };
    let right: Vec<bool> = (0..head.len())
        .map(|i| {
            let cells: Vec<&String> = rows.iter().filter_map(|r| r.get(i)).filter(|c| *c != "-").collect();
            !cells.is_empty() && cells.iter().all(|c| numeric(c))
        })
        .collect();
    let class = |i: usize| right.get(i).copied().unwrap_or(false).then_some("n");
    html! {
        div class="scroll" { table {
            thead { tr { @for (i, name) in head.iter().enumerate() { th class=[class(i)] { (name) } } } }
            tbody { @for row in rows { tr {
                @for (i, cell) in row.iter().enumerate() { td class=[class(i)] { (cell) } }
            } } }
        } }
    }
}

/// Pairs of a name and a value.
pub fn facts(pairs: &[(&str, String)]) -> Markup {
    html! { dl { @for (name, value) in pairs { dt { (name) } dd { (value) } } } }
}

/// A box that stands out; `tone` is `""`, `"good"`, `"warn"` or `"bad"`.
pub fn note(tone: &str, text: Markup) -> Markup {
    html! { div class=(format!("note {tone}")) { (text) } }
}

/// Horizontal bars from zero to the largest value.
pub fn bars(caption: &str, unit: &str, rows: &[(String, f64)]) -> Markup {
    let top = rows.iter().map(|r| r.1.abs()).filter(|v| v.is_finite()).fold(0.0, f64::max);
    let width = |v: f64| if top > 0.0 && v.is_finite() { 100.0 * v.abs() / top } else { 0.0 };
    html! {
        figure {
            div class="scroll" { table style="width:100%" { tbody { @for (name, value) in rows { tr {
                td { (name) }
                td class="n" { (number(*value)) " " (unit) }
                td class="bars" { div class="bar" style=(format!("width:{:.1}%", width(*value))) {} }
            } } } } }
            figcaption { (caption) }
        }
    }
}

/// A table whose cells are tinted from zero (white) to the largest value; zero cells stay empty.
pub fn heat_map(caption: &str, rows: &[String], columns: &[String], values: &[Vec<f64>]) -> Markup {
    let top = values.iter().flatten().copied().filter(|v| v.is_finite()).fold(0.0, f64::max);
    let tint = |v: f64| {
        let part = if top > 0.0 && v.is_finite() { (v / top).clamp(0.0, 1.0) } else { 0.0 };
        let ink = if part > 0.6 { ";color:#fff" } else { "" };
        format!("background:rgba(11,111,184,{part:.2}){ink}")
    };
    html! {
        figure {
            div class="scroll" { table class="heat" {
                thead { tr { th {} @for name in columns { th { (name) } } } }
                tbody { @for (name, cells) in rows.iter().zip(values) { tr {
                    th { (name) }
                    @for v in cells { td style=(tint(*v)) { @if *v != 0.0 { (number(*v)) } } }
                } } }
            } }
            figcaption { (caption) }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_is_self_contained_and_escapes() {
        let mut page = Page::new("a < b", "why");
        page.section("Table", table(&["name", "value"], &[vec!["<x>".into(), "1.5".into()]]));
        page.section("Heat", heat_map("c", &["r".into()], &["k".into()], &[vec![f64::NAN]]));
        page.section("Bars", bars("c", "N", &[("a".into(), 0.0)]));
        let html = page.into_html();
        assert!(html.contains("a &lt; b") && html.contains("&lt;x&gt;"));
        assert!(html.contains("class=\"n\"") && html.contains("width=device-width"));
        for outside in ["http://", "https://", "<script", "@import", "src="] {
            assert!(!html.contains(outside), "{outside}");
        }
    }
}
