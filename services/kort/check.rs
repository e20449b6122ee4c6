//! `kort check`: reads configurations as the services would, and says everything that is wrong, at once.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use kort_proto::complaint::Complaint;
use kort_proto::config::{Config, DEFAULT_PATH, is_there, is_told_by};
use kort_proto::transport::Deployment;
use serde::Serialize;

#[cfg(all(feature = "servo", feature = "controller", feature = "gateway"))]
use crate::fail;
use crate::{DONE, USAGE, print, said};

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
#[derive(Clone, Debug, PartialEq, Serialize)]
struct Problem {
    file: String,
    #[serde(flatten)]
    said: Complaint,
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
    /// Takes over what is wrong, once.
    fn problem(&mut self, found: Problem) {
        if !self.problems.contains(&found) {
            self.problems.push(found);
        }
    }

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
pub fn run(args: &Check) -> Result<ExitCode, ExitCode> {
    let mut found = Found::default();
    if args.files.is_empty() {
        deployment(None, &mut found);
    }
    for file in &args.files {
        match std::fs::read_to_string(file) {
            Ok(text) => one(file, &text, &mut found),
            Err(error) => {
                let hint = if file.is_dir() {
                    "it is a folder: name the files in it"
                } else {
                    "check the path, and that the file may be read"
                };
                let words = format!("cannot be read: {error}\nhint: {hint}");
                found.problems.push(problem(&file.display().to_string(), &words));
            }
        }
    }
    let Found { problems, warnings, unused } = found;
    if args.json {
        let (problems, warnings, unused_effects) = (&problems, &warnings, &unused);
        let report = Report { schema: "kort.check/1", problems, warnings, unused_effects };
        let text = serde_json::to_string_pretty(&report).unwrap_or_default();
        said(print(&(text + "\n")))?;
    } else {
        let mut lines: Vec<String> = problems.iter().map(ToString::to_string).collect();
        lines.extend(warnings.iter().map(|warning| format!("WARNING: {warning}")));
        lines.extend(
            unused
                .iter()
                .map(|Unused { file, effect, why }| format!("{file}: known {effect}: NOT USED: {why}")),
        );
        if problems.is_empty() {
            lines.push("nothing is wrong".into());
        }
        said(print(&(lines.join("\n") + "\n")))?;
    }
    Ok(ExitCode::from(if problems.is_empty() { DONE } else { USAGE }))
}

/// Refuses a deployment with all that keeps its services from starting, before any of them makes anything.
#[cfg(all(feature = "servo", feature = "controller", feature = "gateway"))]
pub fn refuse(file: Option<&Path>) -> Result<(), ExitCode> {
    let mut found = Found::default();
    wrong(file, &mut found);
    if found.problems.is_empty() {
        return Ok(());
    }
    let words: Vec<String> = found.problems.iter().map(ToString::to_string).collect();
    Err(fail(USAGE, &words.join("\nerror: ")))
}

fn one(file: &Path, text: &str, found: &mut Found) {
    let name = file.display().to_string();
    let table: toml::Table = match text.parse() {
        Ok(table) => table,
        Err(error) => {
            let words = format!(
                "{}\nhint: mend that line; what stands behind it was not looked at",
                error.to_string().trim_end()
            );
            return found.problems.push(problem(&name, &words));
        }
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

/// Everything that servo, controller and gateway would refuse, and what they would warn of.
fn deployment(file: Option<&Path>, into: &mut Found) {
    let (name, config) = wrong(file, into);
    let absent = config.iter().flat_map(kort_proto::cores::absent);
    into.warnings.extend(absent.map(|words| problem(&name, &words.to_string())));
    #[cfg(feature = "controller")]
    if let Some(config) = &config {
        let doubtful = config.thrusters.keys().filter_map(|id| kort_controller::doubtful(config, id));
        into.warnings.extend(doubtful.map(|words| problem(&name, &words.to_string())));
    }
    #[cfg(feature = "gateway")]
    into.warnings.extend(
        config.iter().flat_map(kort_gateway::doubtful).map(|words| problem(&name, &words.to_string())),
    );
    #[cfg(feature = "gateway")]
    for (file, effect, why) in config.iter().flat_map(kort_gateway::unused_effects) {
        into.unused(&file, [(effect, why)]);
    }
}

/// Everything that they would refuse in a file, in the default one where none is named; how it is called, and what could be
/// read.
fn wrong(file: Option<&Path>, into: &mut Found) -> (String, Option<Config>) {
    let default = Path::new(DEFAULT_PATH);
    let file = file.or_else(|| is_there(default).then_some(default));
    let name = file.map_or_else(|| "built-in configuration".to_owned(), |file| file.display().to_string());
    let (config, wrong) = Config::load_with_all(file);
    let of_services: Vec<String> = config.iter().flat_map(services).collect();
    let noted = config.iter().flat_map(Config::noted);
    for words in wrong.into_iter().chain(noted).map(|error| error.to_string()) {
        into.problem(problem(&name, &words));
    }
    // What could not be read is not told again as missing.
    let read: Vec<String> = into.problems.iter().filter_map(|read| read.said.key.clone()).collect();
    let unread = |said: &Complaint| {
        let nothing = said.message.contains("is missing") || said.found.as_deref() == Some("\"\"");
        let told = |key: &String| read.iter().any(|read| is_told_by(read, key));
        nothing && said.key.as_ref().is_some_and(told)
    };
    for found in of_services.iter().map(|words| problem(&name, words)).filter(|found| !unread(&found.said)) {
        into.problem(found);
    }
    (name, config)
}

/// What each service says.
fn services(config: &Config) -> Vec<String> {
    let mut said: Vec<String> = root(config).into_iter().collect();
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

/// A root that no service could keep shared memory at.
fn root(config: &Config) -> Option<String> {
    let root = Some(&config.transport.root).filter(|root| !root.as_os_str().is_empty())?;
    let refused = Deployment::new(Some(root)).config(0).err()?;
    Some(config.error(format!("`transport.root` = {refused}")).to_string())
}

/// What is said of a file, or of another that the words name: `file: …`.
fn problem(file: &str, message: &str) -> Problem {
    let (file, words) = match message.split_once(": ") {
        Some((named, rest)) if named.ends_with(".toml") => (named, rest),
        _ => (file, message),
    };
    Problem { file: file.to_owned(), said: Complaint::of(words) }
}

impl std::fmt::Display for Problem {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: {}", self.file, self.said.message)?;
        match &self.said.hint {
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
            assert!(problems[0].said.message.contains("no key at all"), "{problems:?}");
            assert_eq!(problems[0].said.allowed, None, "{problems:?}");
            assert!(
                problems[0].said.hint.as_ref().is_some_and(|hint| hint.contains("[thrusters.ID]")),
                "{problems:?}"
            );
        }
    }

    #[test]
    fn words_that_name_another_file_are_of_that_file() {
        let found = problem("kort.toml", "my.toml: `a` = 1 is outside 2 to 9\nhint: at most 9");
        assert_eq!((&*found.file, found.said.hint.as_deref()), ("my.toml", Some("at most 9")));
        assert_eq!(problem("kort.toml", "`a` = 1: no").file, "kort.toml");
    }
}
