//! `kort reproduce`: the seed paper's tables and figures, ours beside the printed value.

use std::fmt::Write;
use std::path::PathBuf;

use maud::html;
use serde::Serialize;

use crate::failure::{Failure, Outcome, print, print_json, write_text};
use crate::outputs::Named;
use crate::render::{Chart, Mark, Page, Series, number, table};
use kort_reproduce::{Figure, Part, Row, Shown, Verdict};

const EXAMPLE: &str = "\
Example: kort reproduce --html reproduce.html
         kort reproduce --json | jq '.rows[] | select(.verdict == \"disagrees\")'";

/// Compute the seed paper's tables and figures, ours beside the printed value
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLE)]
pub struct Args {
    /// Print one JSON document (kort.reproduce/1)
    #[arg(long)]
    json: bool,
    /// Write a self-contained page with the plots
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Seed of the noise in the repeated identification
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

impl Args {
    /// The files that it reads, and those that it writes.
    pub fn named(&self) -> Named {
        Named::default().writes("--html", self.html.as_deref())
    }
}

#[derive(Serialize)]
struct Document<'a> {
    schema: &'static str,
    kort_version: &'static str,
    seed: u64,
    rows: Vec<&'a Row>,
}

/// Does it.
///
/// # Errors
/// The page cannot be written.
pub fn run(args: &Args) -> Result<Outcome, Failure> {
    let parts = kort_reproduce::all(args.seed).map_err(Failure::failed)?;
    // The result is printed whatever becomes of its page.
    let written = args.html.as_ref().map_or(Ok(()), |path| {
        write_text(path, &page(&parts, args.seed)).inspect(|()| eprintln!("page: {}", path.display()))
    });
    if args.json {
        let rows = parts.iter().flat_map(|p| &p.rows).collect();
        print_json(&Document {
            schema: "kort.reproduce/1",
            kort_version: env!("CARGO_PKG_VERSION"),
            seed: args.seed,
            rows,
        })?;
    } else {
        print(&text(&parts))?;
    }
    written.map(|()| Outcome::Done)
}

fn shown(value: &Shown) -> String {
    match value {
        Shown::Number(x) => number(*x),
        Shown::Words(words) => words.clone(),
        Shown::Nothing => "not printed".into(),
    }
}

fn deviation(row: &Row) -> String {
    row.deviation_pct.map_or_else(String::new, |d| format!("{d:+.1} %"))
}

fn tally(parts: &[Part]) -> String {
    let count = |v| parts.iter().flat_map(|p| &p.rows).filter(|r| r.verdict == v).count();
    format!(
        "{} agree, {} disagree, {} cannot be checked",
        count(Verdict::Agrees),
        count(Verdict::Disagrees),
        count(Verdict::NotCheckable)
    )
}

fn text(parts: &[Part]) -> String {
    let mut out = String::new();
    for part in parts {
        let _ = writeln!(out, "{}\n", part.title);
        for row in &part.rows {
            let _ = writeln!(out, "  {:<14} {}", row.verdict.words(), row.what);
            let change = deviation(row);
            let _ = writeln!(
                out,
                "{:17}printed {}; ours {}{}",
                "",
                shown(&row.printed),
                shown(&row.ours),
                if change.is_empty() { String::new() } else { format!(" ({change})") }
            );
            if row.verdict != Verdict::Agrees {
                let _ = writeln!(out, "{:17}{}", "", row.note);
            }
        }
        out.push('\n');
    }
    let _ = writeln!(out, "{}", tally(parts));
    out
}

fn page(parts: &[Part], seed: u64) -> String {
    let mut page = Page::new(
        "The seed paper, reproduced",
        "Whitcomb and Yoerger, \"Comparative Experiments in the Dynamics and Model-Based Control of Marine Thrusters\"",
    );
    page.add(
        html! { p class="lead" { (tally(parts)) "." } p class="soft" { "kort reproduce --seed " (seed) } },
    );
    for part in parts {
        let rows: Vec<Vec<String>> = part
            .rows
            .iter()
            .map(|r| {
                vec![
                    r.what.clone(),
                    shown(&r.printed),
                    shown(&r.ours),
                    deviation(r),
                    r.verdict.words().into(),
                    r.note.clone(),
                ]
            })
            .collect();
        page.section(
            part.title,
            html! {
                p { (part.text) }
                (table(&["what", "printed", "ours", "deviation", "verdict", "note"], &rows))
                @for figure in &part.figures { (chart(figure).draw()) }
            },
        );
    }
    page.into_html()
}

fn chart(figure: &Figure) -> Chart {
    figure.series.iter().fold(Chart::new(&figure.caption, &figure.x, &figure.y), |chart, s| {
        let mark = match s.mark {
            kort_reproduce::Mark::Line => Mark::Line,
            kort_reproduce::Mark::Dashed => Mark::Dashed,
            kort_reproduce::Mark::Dots => Mark::Dots,
        };
        chart.with(Series { name: s.name.clone(), mark, points: s.points.clone() })
    })
}
