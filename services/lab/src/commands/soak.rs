//! `kort soak`: several controllers through the same scripted hours, compared side by side.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::Args as ClapArgs;

use crate::failure::{Failure, Outcome, check_writable, print, print_json, write_text};
use crate::soak::{self, Metrics, SoakError, Watch};

/// Run several controllers on the same plant, faults and references, and compare them
///
/// Virtual time by default; --live drives a running service through the same script in real time.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "Example:\n  kort soak config/scenarios/soak-towed.toml --controllers velocity_servo,model2_inversion --seeds 4 --html soak.html"
)]
pub struct Args {
    /// Scenario files; the shipped ones are config/scenarios/soak-*.toml
    #[arg(required = true, value_name = "SCENARIO")]
    scenarios: Vec<PathBuf>,
    /// Controllers to compare: files of config/controllers/ without .toml, or laws (`kort explain` lists them)
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

/// Runs the soak.
///
/// # Errors
/// [`Failure`] names the file, the key and what is allowed.
pub fn run(args: &Args) -> Result<Outcome, Failure> {
    let controllers = args.controllers.as_deref();
    let loaded = args
        .scenarios
        .iter()
        .map(|path| soak::load(path, controllers, args.seeds))
        .collect::<Result<Vec<_>, SoakError>>()
        .map_err(Failure::input)?;
    if let Some(file) = &args.html {
        check_writable(file)?;
    }
    let metrics = args.metrics_addr.map(Metrics::serve).transpose().map_err(Failure::input)?;
    if let Some(metrics) = &metrics {
        eprintln!("metrics on http://{}/metrics", metrics.address);
    }
    let watch = Watch { metrics: metrics.as_ref() };
    let report = match &args.live {
        Some(url) => soak::live(&loaded, url, &args.thruster, args.seed, &watch).map_err(Failure::failed)?,
        None => soak::soak(&loaded, args.seed, args.jobs, &watch).map_err(Failure::failed)?,
    };
    if let Some(file) = &args.html {
        write_text(file, &soak::page(&report))?;
    }
    if args.json {
        print_json(&report.json())?;
    } else {
        print(&report.text());
    }
    Ok(Outcome::Done)
}
