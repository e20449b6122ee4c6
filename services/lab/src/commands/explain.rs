//! `kort explain`: the catalogue of omitted physics, the control laws, observers and estimators, or one of
//! them in full.

mod advice;
mod controllers;

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use kort_control::About;
use kort_control::known::uses::{self, Use};
use kort_thruster::effects::{self, ALL, Descriptor, Scale};
use kort_thruster::parameters::Parameters;
use serde::Serialize;

use crate::failure::{Failure, Outcome, print, print_json};
use crate::files;

const EXAMPLE: &str = "\
Example: kort explain rotational_flow
         kort explain look_ahead
         kort explain --for t200
         kort explain --json | jq '.effects[] | select(.path == \"shaft\") | .effect'
         kort explain --markdown > docs/catalogue.md";

/// Width of the text, columns.
const WIDTH: usize = 96;

/// Look up the physics a model may leave out, or a control law, observer or estimator
///
/// Of an effect: what it is, how it shows, what it is confused with. Of a law: where it comes from, what
/// it assumes, what it needs measured, how it fails.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLE)]
pub struct Args {
    /// One effect, law, observer or estimator by its name in reports [default: the whole catalogue]
    effect: Option<String>,
    /// The default controller of a rig, by file or name, with its time scales and the reasons
    #[arg(long = "for", value_name = "RIG", conflicts_with_all = ["effect", "markdown"])]
    rig: Option<PathBuf>,
    /// Print one JSON document (kort.explain/1)
    #[arg(long, conflicts_with = "markdown")]
    json: bool,
    /// Print the whole catalogue in full as Markdown
    #[arg(long, conflicts_with = "effect")]
    markdown: bool,
}

/// Does it.
///
/// # Errors
/// The effect is not in the catalogue; the message names the nearest one.
pub fn run(args: &Args) -> Result<Outcome, Failure> {
    if let Some(rig) = &args.rig {
        return advice::run(rig, args.json);
    }
    let controller = args.effect.as_deref().map(plain).and_then(|name| About::find(&name));
    let chosen = match (&args.effect, controller) {
        (_, Some(_)) => Vec::new(),
        (Some(id), None) => vec![find(id)?],
        (None, None) => ALL.to_vec(),
    };
    if args.json {
        let controllers = match (&args.effect, controller) {
            (_, Some(about)) => vec![controllers::Entry::of(about)],
            (Some(_), None) => Vec::new(),
            (None, None) => controllers::Entry::all(),
        };
        let effects = chosen.iter().map(|effect| Entry::of(effect)).collect();
        print_json(&Document { schema: "kort.explain/1", effects, controllers })?;
    } else if let Some(about) = controller {
        print(&controllers::Entry::of(about).in_full())?;
    } else if args.markdown {
        print(&markdown(&chosen))?;
    } else if args.effect.is_some() {
        print(&in_full(&Entry::of(chosen[0])))?;
    } else {
        print(&format!("{}\n{}\nOne in full: kort explain NAME\n", table(&chosen), controllers::table()))?;
    }
    Ok(Outcome::Done)
}

/// A name as it is written here: case and hyphens are forgiven.
fn plain(name: &str) -> String {
    name.to_lowercase().replace(['-', ' '], "_")
}

/// An effect by its identifier.
fn find(id: &str) -> Result<&'static Descriptor, Failure> {
    let wanted = plain(id);
    effects::find(&wanted).ok_or_else(|| {
        let likeness = |d: &Descriptor| {
            let whole = strsim::jaro_winkler(d.id, &wanted);
            // A part of the name is the usual near miss: `backlash`, `friction`.
            if wanted.len() > 2 && d.id.contains(&wanted) {
                1.0 + whole
            } else if wanted.len() > 3 && d.what.contains(&wanted) {
                // A workshop word stands in the description: `swirl` in rotational_flow.
                0.9 + 0.1 * whole
            } else {
                whole
            }
        };
        let nearest = ALL.iter().max_by(|a, b| likeness(a).total_cmp(&likeness(b)));
        let hint = match nearest.filter(|d| likeness(d) > 0.7) {
            Some(d) => format!("did you mean `{}`?", d.id),
            None => "`kort explain` lists the catalogue, and the control laws".into(),
        };
        Failure::input(format!(
            "effect: `{id}` is not one of the {} in the catalogue\nhint: {hint}",
            ALL.len()
        ))
    })
}

/// The rig whose sizes stand for those of every other in ranges.
const STAND: &str = "whitcomb-yoerger-1999";

/// Its scale, at the full current of its drive.
fn stand() -> &'static Scale {
    static OF_STAND: OnceLock<Scale> = OnceLock::new();
    OF_STAND.get_or_init(|| {
        let Ok(rig) = files::read_rig(Path::new(STAND)) else { return Scale::ANY };
        let parameters = Parameters::stated(&rig);
        kort_scenario::scale(&rig, &parameters, rig.amplifier.current_limit_a, 1e-3, 60.0)
    })
}

/// A number with as many digits as a range needs.
fn digits(value: f64) -> String {
    let decimals = if value == 0.0 || !value.is_finite() {
        0
    } else {
        (2 - value.abs().log10().floor() as i32).clamp(0, 12)
    };
    let text = format!("{value:.*}", decimals as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[derive(Serialize)]
struct Document {
    schema: &'static str,
    effects: Vec<Entry>,
    /// Laws, observers, estimators.
    controllers: Vec<controllers::Entry>,
}

/// An effect as it is printed.
#[derive(Serialize)]
struct Entry {
    effect: &'static str,
    path: &'static str,
    what: &'static str,
    equation: &'static str,
    signature: &'static str,
    confused_with: &'static [&'static str],
    separated_by: &'static str,
    reference: &'static str,
    parameters: Vec<Parameter>,
    /// What laws and observers do with it where a rig states it: a sentence each.
    used_for: Vec<&'static str>,
    /// Why none of them can use it, if so.
    not_used: Option<&'static str>,
    /// Why none of them can with another drive or at other values, where some can.
    not_used_elsewhere: Option<&'static str>,
    /// The same in the words of `--for`.
    #[serde(skip)]
    usage: String,
}

#[derive(Serialize)]
struct Parameter {
    name: &'static str,
    unit: &'static str,
    /// Smallest and largest value that a scenario, a fit or a diagnosis takes it from; null where there is none.
    low: f64,
    high: f64,
    /// The rig of which the range is, where it goes by the rig's size.
    range_of: Option<&'static str>,
    /// "strength": the effect vanishes when all strengths are zero; "shape": where, how fast.
    role: &'static str,
}

impl Entry {
    fn of(effect: &'static Descriptor) -> Self {
        let role = |shape| if shape { "shape" } else { "strength" };
        let usage = uses::of_effect(effect);
        let never = usage.uses.is_empty();
        Self {
            usage: usage.words(),
            not_used: usage.left.filter(|_| never),
            not_used_elsewhere: usage.left.filter(|_| !never),
            used_for: usage.uses.into_iter().map(Use::words).collect(),
            effect: effect.id,
            path: effect.path.name(),
            what: effect.what,
            equation: effect.equation,
            signature: effect.signature,
            confused_with: effect.confused_with,
            separated_by: effect.separated_by,
            reference: effect.reference,
            parameters: (effect.parameters)(&Scale::ANY)
                .into_iter()
                .zip((effect.parameters)(stand()))
                .map(|(any, s)| Parameter {
                    name: s.name,
                    unit: s.unit,
                    low: s.low,
                    high: s.high,
                    range_of: ((any.low, any.high) != (s.low, s.high)).then_some(STAND),
                    role: role(s.shape),
                })
                .collect(),
        }
    }

    /// Parameters with unit, strengths first in words.
    fn parameter_list(&self) -> String {
        let one = |p: &Parameter| match p.unit {
            "1" => format!("{} ({})", p.name, p.role),
            unit => format!("{} [{unit}] ({})", p.name, p.role),
        };
        self.parameters.iter().map(one).collect::<Vec<_>>().join(", ")
    }

    /// The same with the range that each may have.
    fn parameter_ranges(&self) -> String {
        let one = |p: &Parameter| {
            let unit = if p.unit == "1" { String::new() } else { format!(" {}", p.unit) };
            let of = p.range_of.map_or_else(String::new, |rig| format!(" on the rig {rig}"));
            format!("{} ({}): {} to {}{unit}{of}", p.name, p.role, digits(p.low), digits(p.high))
        };
        self.parameters.iter().map(one).collect::<Vec<_>>().join("; ")
    }

    /// Headings and texts, in the order of reading.
    fn sections(&self) -> [(&'static str, String); 8] {
        [
            ("What it is", self.what.into()),
            ("Equation", self.equation.into()),
            ("What it looks like", self.signature.into()),
            ("Confused with", self.confused_with.join(", ")),
            ("Separated by", self.separated_by.into()),
            (PARAMETERS, self.parameter_list()),
            (USED_FOR, format!("{}.", self.usage)),
            ("Reference", self.reference.into()),
        ]
    }
}

/// Heading of an effect's parameters.
const PARAMETERS: &str = "Parameters";
/// Heading of what laws and observers do with an effect.
const USED_FOR: &str = "Known in a rig, used for";

fn table(effects: &[&Descriptor]) -> String {
    let mut text = format!("{} effects that a thruster model may leave out\n", effects.len());
    let name_width = effects.iter().map(|e| e.id.len()).max().unwrap_or(0);
    for effect in effects {
        let head = format!("{:name_width$}  {:6}  ", effect.id, effect.path.name());
        let indent = " ".repeat(head.len());
        let options = textwrap::Options::new(WIDTH.max(head.len() + 48))
            .initial_indent(&head)
            .subsequent_indent(&indent);
        text += &format!("\n{}", textwrap::fill(effect.what, options));
    }
    text + "\n"
}

fn in_full(entry: &Entry) -> String {
    let mut text = format!("{} ({} path)\n", entry.effect, entry.path);
    for (heading, body) in entry.sections() {
        let body = if heading == PARAMETERS { entry.parameter_ranges() } else { body };
        let options = textwrap::Options::new(WIDTH).initial_indent("  ").subsequent_indent("  ");
        let _ = write!(text, "\n{heading}\n{}\n", textwrap::fill(&body, options));
    }
    text
}

fn markdown(effects: &[&'static Descriptor]) -> String {
    let mut text = format!(
        "# Physics a model may leave out\n\n\
         Written by `kort explain --markdown` from `crates/thruster/src/effects/`; do not edit here.\n\
         {} effects in five paths: shaft, drive, flow, blade, sensor. A *strength* is a parameter at whose zero \
         the effect vanishes; a *shape* says where, how fast, how sharp.\n\n| effect | path | what it is |\n| --- | --- | --- |\n",
        effects.len()
    );
    // A bar would end the cell.
    let cell = |s: &str| s.replace('|', "\\|");
    for effect in effects {
        let _ =
            writeln!(text, "| [`{0}`](#{0}) | {1} | {2} |", effect.id, effect.path.name(), cell(effect.what));
    }
    for effect in effects {
        let entry = Entry::of(effect);
        let _ = write!(text, "\n## {}\n\n", entry.effect);
        // What laws do with it belongs to the rig's page, `docs/control.md`.
        for (heading, body) in entry.sections().into_iter().filter(|(heading, _)| *heading != USED_FOR) {
            let body = match heading {
                "Equation" => format!("`{body}`"),
                "Confused with" => {
                    let links: Vec<String> =
                        entry.confused_with.iter().map(|id| format!("[`{id}`](#{id})")).collect();
                    links.join(", ")
                }
                _ => body.replace('|', "\\|"),
            };
            let _ = writeln!(text, "- **{heading}:** {body}");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_near_miss_names_the_nearest() {
        for (asked, meant) in [
            ("rotational_flows", "rotational_flow"),
            ("coulomb", "coulomb_friction"),
            ("backlash", "gear_backlash"),
            ("tranport_delay", "transport_delay"),
            ("swirl", "rotational_flow"),
        ] {
            let failure = find(asked).map(|d| d.id).unwrap_err();
            assert_eq!(failure.code(), 2);
            assert!(failure.to_string().contains(&format!("hint: did you mean `{meant}`?")), "{failure}");
        }
        assert!(find("xyz").map(|d| d.id).unwrap_err().to_string().contains("lists the catalogue"));
        assert_eq!(find("Rotational-Flow").unwrap().id, "rotational_flow");
    }

    #[test]
    fn an_effect_is_told_with_the_ranges_of_its_parameters() {
        for effect in ALL.iter() {
            let entry = Entry::of(effect);
            for parameter in &entry.parameters {
                assert!(parameter.low <= parameter.high, "{}.{}", entry.effect, parameter.name);
            }
        }
        let text = in_full(&Entry::of(find("rotational_flow").unwrap()));
        assert!(text.contains("swirl_yield (strength): 0 to 3"), "{text}");
        let text = in_full(&Entry::of(find("coulomb_friction").unwrap()));
        assert!(text.contains(STAND) && text.contains("N m on the rig"), "{text}");
    }

    #[test]
    fn the_table_names_every_effect() {
        let text = table(ALL);
        assert!(ALL.iter().all(|e| text.lines().any(|l| l.starts_with(e.id))));
        assert!(text.lines().all(|l| l.chars().count() <= WIDTH), "{text}");
    }

    #[test]
    fn the_document_is_the_one_this_program_writes() {
        let kept = include_str!("../../../../docs/catalogue.md");
        assert!(kept == markdown(ALL), "run: kort explain --markdown > docs/catalogue.md");
    }

    #[test]
    fn one_effect_shows_all_that_is_known_of_it() {
        for effect in ALL {
            let text = in_full(&Entry::of(effect));
            for id in effect.confused_with {
                assert!(text.contains(id), "{text}");
            }
            for heading in
                ["What it is", "Equation", "What it looks like", "Separated by", "Parameters", "Reference"]
            {
                assert!(text.contains(heading), "{text}");
            }
        }
    }
}
