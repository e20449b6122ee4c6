//! `kort soak`: several controllers through the same scripted hours, compared side by side.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::Args as ClapArgs;
use kort_control::known::uses;

use crate::failure::{Failure, Outcome, print, print_json, write_text};
use crate::files;
use crate::outputs::Named;
use crate::soak::{self, Instead, Loaded, Metrics, SoakError, Watch};

/// A scenario that takes this long, s, is run when it is asked for by name.
const LONG_S: f64 = 3600.0;

/// Run several controllers on the same plant, faults and references, and compare them
///
/// Virtual time by default; --live drives a running service through the same script in real time.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "Example:\n  kort soak config/scenarios/soak-towed.toml --controllers velocity_servo,model2_inversion --seeds 4 --html soak.html\n  kort soak soak-towed --rig my-rig.toml --controllers velocity_servo,default,drive_limits\n  kort soak all --rig all --seed 901 --markdown docs/control.md\n  kort soak soak-closed-loop --adopt --seeds 4 --html adoption.html"
)]
pub struct Args {
    /// Scenarios: files, or names of shipped ones; `all` for every one of less than an hour
    #[arg(required = true, value_name = "SCENARIO")]
    scenarios: Vec<PathBuf>,
    /// Rigs instead of the scenario's: files, or names of shipped ones; `all` for every one with a propeller
    #[arg(long, value_name = "RIG,…", value_delimiter = ',')]
    rig: Vec<PathBuf>,
    /// Controllers to compare: files of config/controllers/ without .toml, laws (`kort explain` lists them), `default`
    /// (the rig's own), `drive_limits` (what the drive leaves a law that is told everything)
    /// [default: the scenario's]
    #[arg(long, value_name = "A,B,…", value_delimiter = ',')]
    controllers: Option<Vec<String>>,
    /// How many seeds [default: the scenario's]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    seeds: Option<u32>,
    /// First seed
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Runs at the same time [default: all cores]
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    jobs: usize,
    /// Print one JSON document instead of tables
    #[arg(long)]
    json: bool,
    /// Write one self-contained page
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Put a table of rigs and scenarios into a page, between its marks; compares velocity_servo, default and
    /// drive_limits unless --controllers says otherwise
    #[arg(long, value_name = "FILE", conflicts_with = "live")]
    markdown: Option<PathBuf>,
    /// Hide effects in the plant by seed, diagnose the first run, adopt what is believed as [[effects]], run again
    #[arg(long, conflicts_with = "live")]
    adopt: bool,
    /// Drive a running service, for example http://127.0.0.1:8080, in real time
    #[arg(long, value_name = "URL")]
    live: Option<String>,
    /// Thruster of the running service
    #[arg(long, value_name = "ID", default_value = "t1", requires = "live")]
    thruster: String,
    /// Serve metrics of the run while it runs
    #[arg(long, value_name = "ADDRESS:PORT")]
    metrics_addr: Option<SocketAddr>,
}

impl Args {
    /// The files that it reads, and those that it writes.
    pub fn named(&self) -> Named {
        let scenarios = self.scenarios.iter();
        let named = scenarios.fold(Named::default(), |named, path| named.reads("scenario", path));
        let named = self.rig.iter().fold(named, |named, rig| named.reads_rig(Some(rig)));
        named.writes("--html", self.html.as_deref()).writes("--markdown", self.markdown.as_deref())
    }
}

/// Runs the soak.
///
/// # Errors
/// [`Failure`] names the file, the key and what is allowed.
pub fn run(args: &Args) -> Result<Outcome, Failure> {
    let table = ["velocity_servo", soak::DEFAULT, kort_soak::limits::NAME].map(str::to_owned);
    if let Some(url) = &args.live {
        an_address(url)?;
    }
    // After a comma people put a space.
    let trimmed = |names: &Vec<String>| names.iter().map(|name| name.trim().to_owned()).collect();
    let asked: Option<Vec<String>> = args.controllers.as_ref().map(trimmed);
    let controllers = match (&asked, &args.markdown) {
        (Some(controllers), _) => Some(controllers.as_slice()),
        (None, Some(_)) if !args.adopt => Some(table.as_slice()),
        (None, _) => None,
    };
    let wanted = Wanted { scenarios: &args.scenarios, rigs: &args.rig, controllers, seeds: args.seeds };
    let loaded = load(&wanted).map_err(Failure::input)?;
    for words in left_out(&loaded) {
        eprintln!("{words}");
    }
    let metrics = args.metrics_addr.map(Metrics::serve).transpose().map_err(Failure::input)?;
    if let Some(metrics) = &metrics {
        eprintln!("metrics on http://{}/metrics", metrics.address);
    }
    let watch = Watch { metrics: metrics.as_ref() };
    let report = match &args.live {
        Some(url) => soak::live(&loaded, url, &args.thruster, args.seed, &watch).map_err(Failure::failed)?,
        None if args.adopt => soak::adopt(&loaded, args.seed, args.jobs, &watch).map_err(Failure::failed)?,
        None => soak::soak(&loaded, args.seed, args.jobs, &watch).map_err(Failure::failed)?,
    };
    // The result is printed whatever becomes of its pages.
    let page = args.html.as_ref().map_or(Ok(()), |file| write_text(file, &soak::page(&report)));
    let table = args.markdown.as_ref().map_or(Ok(()), |file| soak::put_into(file, &report, args.seed));
    if args.json {
        print_json(&report.json())?;
    } else {
        print(&report.text())?;
    }
    page.and(table).map(|()| Outcome::Done)
}

/// Refuses what no service can be reached at.
fn an_address(url: &str) -> Result<(), Failure> {
    let uri = url.parse::<ureq::http::Uri>().ok();
    let served = |uri: &ureq::http::Uri| {
        matches!(uri.scheme_str(), Some("http" | "https")) && uri.host().is_some_and(|host| !host.is_empty())
    };
    if uri.as_ref().is_some_and(served) {
        return Ok(());
    }
    Err(Failure::input(format!(
        "--live {url}: is no address of a service; allowed are http://HOST:PORT and https://HOST:PORT\nhint: --live http://127.0.0.1:8080, which `kort up` prints"
    )))
}

/// What is named twice in a list.
fn twice<T: PartialEq>(list: &[T]) -> Option<&T> {
    list.iter().enumerate().find(|(at, one)| list[..*at].contains(one)).map(|(_, one)| one)
}

/// Refuses what would only be run again, and compared with itself.
fn each_once(wanted: &Wanted) -> Result<(), Failure> {
    let said = |what: &str, name: &dyn std::fmt::Display| {
        Failure::input(format!(
            "{what} {name} is given twice\nhint: name each once; --seeds N runs it with more seeds"
        ))
    };
    let scenario = twice(wanted.scenarios).map(|path| said("scenario", &path.display()));
    let rig = twice(wanted.rigs).map(|path| said("--rig", &path.display()));
    let controller = wanted.controllers.and_then(twice).map(|name| said("--controllers", name));
    scenario.or(rig).or(controller).map_or(Ok(()), Err)
}

/// What of the rigs' effects no law reckons with, in words: once a rig, however many scenarios and laws run on it.
fn left_out(loaded: &[Loaded]) -> Vec<String> {
    let mut said = Vec::new();
    for l in loaded {
        for (effect, why) in uses::left_out(&l.rig, 1.0 / l.scenario.control_rate_hz) {
            let words = format!(
                "rig {:?}: known {effect}: NOT USED: {why}\nhint: every law that is compared goes on without it; `kort explain {effect}` tells what it does",
                l.rig.name
            );
            if !said.contains(&words) {
                said.push(words);
            }
        }
    }
    said
}

/// What a comparison is made of.
#[derive(Clone, Copy, Debug, Default)]
pub struct Wanted<'a> {
    /// Scenarios: files, or names of shipped ones; `all` for every one of less than an hour.
    pub scenarios: &'a [PathBuf],
    /// Rigs instead of the scenario's; `all` for every one with a propeller.
    pub rigs: &'a [PathBuf],
    /// Controllers instead of the scenario's.
    pub controllers: Option<&'a [String]>,
    /// How many seeds instead of the scenario's.
    pub seeds: Option<u32>,
}

/// Every scenario on its own rig, or on every rig asked for.
///
/// # Errors
/// [`SoakError`] names the file, the key and what is allowed.
pub fn load(wanted: &Wanted) -> Result<Vec<Loaded>, SoakError> {
    each_once(wanted)?;
    let is_all = |list: &[PathBuf]| list.len() == 1 && list[0].as_os_str() == "all";
    let every_scenario = is_all(wanted.scenarios);
    let scenarios: Vec<PathBuf> = if every_scenario {
        files::soak_scenarios().into_iter().map(PathBuf::from).collect()
    } else {
        wanted.scenarios.to_vec()
    };
    let every_rig = is_all(wanted.rigs);
    let rigs: Vec<Option<PathBuf>> = match (every_rig, wanted.rigs.is_empty()) {
        (true, _) => files::rigs().into_iter().map(|name| Some(PathBuf::from(name))).collect(),
        (false, true) => vec![None],
        (false, false) => wanted.rigs.iter().cloned().map(Some).collect(),
    };
    let mut loaded = Vec::new();
    for scenario in &scenarios {
        for rig in &rigs {
            // A dry rig has no thrust to control; asked for by name it is refused with that reason.
            if every_rig
                && rig.as_deref().is_some_and(|r| files::read_rig(r).is_ok_and(|r| r.propeller.is_none()))
            {
                continue;
            }
            let instead =
                Instead { rig: rig.as_deref(), controllers: wanted.controllers, seeds: wanted.seeds };
            loaded.push(soak::load(scenario, &instead)?);
        }
    }
    loaded.retain(|l| !every_scenario || l.scenario.duration_s < LONG_S);
    Ok(loaded)
}
