//! `kort check`: reads configurations as the services would, and says everything that is wrong, at once.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use kort_proto::config::{Config, DEFAULT_PATH, is_there};
use serde::Serialize;

use crate::{DONE, USAGE};

/// Which files.
#[derive(Args)]
pub struct Check {
    /// Deployments, rigs, scenarios, controllers and column maps [default: config/kort.toml, else the one built in]
    #[arg(value_name = "CONFIG")]
    files: Vec<PathBuf>,
    /// One JSON document on stdout
    #[arg(long)]
    json: bool,
}

/// Something that is wrong.
#[derive(Debug, PartialEq, Serialize)]
struct Problem {
    file: String,
    key: Option<String>,
    found: Option<String>,
    /// Values that are allowed, where that is what is wrong and the words set them apart.
    allowed: Option<String>,
    hint: Option<String>,
    /// All that is said but the hint.
    message: String,
}

/// An effect that a rig states and no control law or observer uses: no mistake, and never passed over in silence.
#[derive(Debug, PartialEq, Serialize)]
struct Unused {
    /// The rig's.
    file: String,
    effect: &'static str,
    why: &'static str,
}

#[derive(Serialize)]
struct Report<'a> {
    schema: &'static str,
    problems: &'a [Problem],
    warnings: &'a [Problem],
    unused_effects: &'a [Unused],
}

/// What is found in the files.
#[derive(Default)]
struct Found {
    problems: Vec<Problem>,
    /// What is no mistake, and may not be as it is meant.
    warnings: Vec<Problem>,
    unused: Vec<Unused>,
}

impl Found {
    /// Takes over what is left out of a rig, once.
    fn unused(&mut self, file: &str, effects: impl IntoIterator<Item = (&'static str, &'static str)>) {
        for (effect, why) in effects {
            let unused = Unused { file: file.to_owned(), effect, why };
            if !self.unused.contains(&unused) {
                self.unused.push(unused);
            }
        }
    }
}

/// Said of a file without a single key: every service would take it for something else, or refuse it.
const HOLDS_NOTHING: &str = "holds no key at all\nhint: a deployment needs [thrusters.ID] with `rig` and `amplifier` (config/kort.toml explains every key); a rig, a scenario, a column map and a controller each their own sections";

/// Checks and prints; exit code 2 if anything is wrong.
pub fn run(args: &Check) -> ExitCode {
    let mut found = Found::default();
    if args.files.is_empty() {
        let default = Path::new(DEFAULT_PATH);
        deployment(is_there(default).then_some(default), &mut found);
    }
    for file in &args.files {
        match std::fs::read_to_string(file) {
            Ok(text) => one(file, &text, &mut found),
            Err(error) => {
                let words = format!("cannot be read: {error}");
                found.problems.push(problem(&file.display().to_string(), &words));
            }
        }
    }
    let Found { problems, warnings, unused } = found;
    if args.json {
        let (problems, warnings, unused_effects) = (&problems, &warnings, &unused);
        let report = Report { schema: "kort.check/1", problems, warnings, unused_effects };
        println!("{}", serde_json::to_string_pretty(&report).unwrap_or_default());
    } else {
        for problem in &problems {
            println!("{problem}");
        }
        for warning in &warnings {
            println!("WARNING: {warning}");
        }
        for Unused { file, effect, why } in &unused {
            println!("{file}: known {effect}: NOT USED: {why}");
        }
        if problems.is_empty() {
            println!("nothing is wrong");
        }
    }
    ExitCode::from(if problems.is_empty() { DONE } else { USAGE })
}

fn one(file: &Path, text: &str, found: &mut Found) {
    let name = file.display().to_string();
    let table: toml::Table = match text.parse() {
        Ok(table) => table,
        Err(error) => return found.problems.push(problem(&name, &error.to_string())),
    };
    if table.is_empty() {
        return found.problems.push(problem(&name, HOLDS_NOTHING));
    }
    if ["thrusters", "gateway", "transport"].iter().any(|key| table.contains_key(*key)) {
        return deployment(Some(file), found);
    }
    match described(&table, text, file) {
        Ok(left_out) => found.unused(&name, left_out),
        Err(wrong) => found.problems.extend(wrong.iter().map(|words| problem(&name, words))),
    }
}

/// A rig, a scenario, a column map or a controller; effects of a rig that nothing uses.
#[cfg(feature = "lab")]
fn described(
    table: &toml::Table,
    text: &str,
    file: &Path,
) -> Result<Vec<(&'static str, &'static str)>, Vec<String>> {
    let kind = kort_lab::check::Kind::of(table);
    kind.check(text, file).map(|()| kind.left_out(text))
}

/// Rigs are read with the deployment that names them.
#[cfg(not(feature = "lab"))]
fn described(_: &toml::Table, _: &str, _: &Path) -> Result<Vec<(&'static str, &'static str)>, Vec<String>> {
    Err(vec!["this kort was built without its laboratory, and reads deployments only\nhint: check it with a whole one".into()])
}

/// Everything that servo, controller and gateway would refuse.
fn deployment(file: Option<&Path>, into: &mut Found) {
    let name = file.map_or_else(|| "built-in configuration".to_owned(), |file| file.display().to_string());
    let (config, wrong) = Config::load_with_all(file);
    let of_services = config.iter().flat_map(services);
    for words in wrong.iter().map(ToString::to_string).chain(of_services) {
        let found = problem(&name, &words);
        if !into.problems.contains(&found) {
            into.problems.push(found);
        }
    }
    let absent = config.iter().flat_map(kort_proto::cores::absent);
    into.warnings.extend(absent.map(|words| problem(&name, &words.to_string())));
    #[cfg(feature = "gateway")]
    into.warnings.extend(
        config.iter().filter_map(kort_gateway::doubtful).map(|words| problem(&name, &words.to_string())),
    );
    #[cfg(feature = "gateway")]
    for (file, effect, why) in config.iter().flat_map(kort_gateway::unused_effects) {
        into.unused(&file, [(effect, why)]);
    }
}

/// What each service says.
fn services(config: &Config) -> Vec<String> {
    let mut said = Vec::new();
    #[cfg(feature = "servo")]
    said.extend(kort_servo::problems(config).iter().map(ToString::to_string));
    #[cfg(feature = "controller")]
    for id in config.thrusters.keys() {
        said.extend(kort_controller::problems(config, id).iter().map(ToString::to_string));
    }
    #[cfg(feature = "gateway")]
    said.extend(kort_gateway::check_config(config).iter().map(ToString::to_string));
    said
}

/// Takes a message apart: `file: `key` = value is …\nhint: …`.
fn problem(file: &str, message: &str) -> Problem {
    let (what, hint) = match message.split_once("hint:") {
        Some((what, hint)) => (what.trim(), Some(hint.trim().to_owned())),
        None => (message.trim(), None),
    };
    let (file, what) = match what.split_once(": ") {
        Some((named, rest)) if named.ends_with(".toml") => (named, rest),
        _ => (file, what),
    };
    // The TOML reader shows the line, and says behind the hint in which key it lies.
    let (hint, within) = match hint.as_deref().and_then(|hint| hint.rsplit_once("\nin `")) {
        Some((hint, key)) => (Some(hint.trim().to_owned()), key.strip_suffix('`')),
        None => (hint, None),
    };
    let parsing = what.contains("TOML parse error");
    let pointed = if parsing { pointed_at(what) } else { None };
    let named = || what.split('`').nth(1).filter(|_| !parsing || what.contains(" field `"));
    let key = pointed.map(|(key, _)| key).or_else(named).or(within).map(str::to_owned);
    let after = |words: &[&str]| words.iter().find_map(|words| Some(what.split_once(words)?.1));
    // A colon within a value (an address) is followed by no space, a comma within a list by one.
    let ends = [" is ", " does ", " asks ", ": ", ";", ", and ", ", but ", ", which ", "\n"];
    let found = after(&["` = ", "` holds ", "` has "])
        .and_then(|rest| ends.iter().try_fold(rest, |found, end| found.split(end).next()))
        .or(pointed.map(|(_, value)| value))
        .map(|found| found.trim().to_owned());
    let allowed = after(&[
        "is allowed: ",
        " is outside ",
        "allowed is ",
        "allowed are ",
        "known are ",
        "expected one of ",
        "here are ",
    ]);
    // A type; names of ours mean nothing to others.
    let of_type = || after(&[", expected "]).filter(|kind| pointed.is_some() && !kind.starts_with("struct "));
    let allowed = allowed.or_else(of_type);
    // Where the words only say that it is none of them, the hint counts them up.
    let allowed = allowed.or_else(|| hint.as_deref()?.strip_prefix("known are "));
    let allowed = allowed.map(|allowed| allowed.trim().replace('`', ""));
    Problem { file: file.to_owned(), key, found, allowed, hint, message: what.to_owned() }
}

/// Key and value at which a reader of TOML points, with carets below the line that it shows.
fn pointed_at(what: &str) -> Option<(&str, &str)> {
    let mut lines = what.lines();
    let line = lines.by_ref().find_map(|line| line.trim_start().split_once(" | "))?.1;
    let below = lines.next()?.split_once("| ")?.1;
    let from = below.find('^')?;
    let key = line.get(..from)?.trim_end().strip_suffix('=')?.trim_end();
    let key = key.rsplit([' ', '{', ',']).next()?;
    Some((key, line.get(from..from + below.trim().len())?))
}

impl std::fmt::Display for Problem {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: {}", self.file, self.message)?;
        match &self.hint {
            Some(hint) => write!(f, "\nhint: {hint}"),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_holds_nothing_is_a_problem() {
        for text in ["", "# only a word\n"] {
            let mut found = Found::default();
            one(Path::new("kort.toml"), text, &mut found);
            let problems = found.problems;
            assert_eq!(problems.len(), 1, "{problems:?}");
            assert!(problems[0].message.contains("no key at all"), "{problems:?}");
            assert_eq!(problems[0].allowed, None, "{problems:?}");
            assert!(
                problems[0].hint.as_ref().is_some_and(|hint| hint.contains("[thrusters.ID]")),
                "{problems:?}"
            );
        }
    }

    /// Key, value found and values allowed of a message.
    fn apart(message: &str) -> [Option<String>; 3] {
        let Problem { key, found, allowed, .. } = problem("kort.toml", message);
        [key, found, allowed]
    }

    #[test]
    fn a_message_is_taken_apart() {
        let found = problem(
            "kort.toml",
            "my.toml: `thrusters.t1.limits.current_a` = 1000000 is outside 0.001 to 9\nhint: at most 9",
        );
        assert_eq!(found.file, "my.toml");
        assert_eq!(found.hint.as_deref(), Some("at most 9"));
        for (message, key, value, allowed) in [
            (&*found.message, "thrusters.t1.limits.current_a", "1000000", "0.001 to 9"),
            (
                "`gateway.hosts` holds \"a:1\"; allowed are names and addresses\nhint: \"a\"",
                "gateway.hosts",
                "\"a:1\"",
                "names and addresses",
            ),
            (
                "`thrusters.t1.servo.cores` holds 9, which this machine does not have; here are 0-3",
                "thrusters.t1.servo.cores",
                "9",
                "0-3",
            ),
            (
                "`amplifier.kind` = curent is outside what is allowed: \"current\" or \"speed\"\nhint: say it",
                "amplifier.kind",
                "curent",
                "\"current\" or \"speed\"",
            ),
            (
                "`thrusters.t1.amplifier` = \"x\" is no drive\nhint: known are \"simulated\", \"vesc\"",
                "thrusters.t1.amplifier",
                "\"x\"",
                "\"simulated\", \"vesc\"",
            ),
            (
                "TOML parse error at line 2, column 12\n  |\n2 | observer = \"x\"\n  |            ^^^\nunknown variant `x`, expected one of `ekf`, `ukf`",
                "observer",
                "\"x\"",
                "ekf, ukf",
            ),
            (
                "TOML parse error at line 9, column 21\n  |\n9 | servo = { rate_hz = \"x\" }\n  |                     ^^^\ninvalid type: string \"x\", expected f64\nhint: a number",
                "rate_hz",
                "\"x\"",
                "f64",
            ),
        ] {
            let [key, value, allowed] = [key, value, allowed].map(|part| Some(part.to_owned()));
            assert_eq!(apart(message), [key, value, allowed], "{message}");
        }
        let [key, found, allowed] =
            apart("section [a]: unknown field `frozn_s`, expected one of `frozen_s`, `spike_rad_s`");
        assert_eq!((key.as_deref(), found), (Some("frozn_s"), None));
        assert_eq!(allowed.as_deref(), Some("frozen_s, spike_rad_s"));
    }

    /// A sentence is no value: where the words say something else than what is allowed, nothing stands there.
    #[test]
    fn what_is_not_set_apart_is_not_called_allowed() {
        for (message, value) in [
            ("`gateway.bind` = [::]:8080 is reached from other machines: no tls", "[::]:8080"),
            ("`thrusters.t1.controller.rate_hz` = 300 does not divide servo.rate_hz = 500", "300"),
        ] {
            let found = problem("kort.toml", message);
            assert_eq!(
                (found.found.as_deref(), found.allowed, &*found.message),
                (Some(value), None, message)
            );
        }
    }
}
