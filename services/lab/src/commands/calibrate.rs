//! `kort calibrate`: a guided session with a drive, from signs and zeros to a rig description.

use std::path::{Path, PathBuf};

use kort_calibrate::{Report, steps};
use kort_proto::config::Config;
use kort_proto::transport::{Deployment, idle};
use kort_recording::Format;
use kort_thruster::rig::Rig;
use rustix::process::nice;

use crate::calibrate::{conclude, live, rehearse};
use crate::failure::{Failure, Outcome, print, print_json, write_text};
use crate::outputs::Named;
use crate::{files, progress, render};

const EXAMPLE: &str = "\
Example: kort calibrate --config kort.toml --thruster t1 -o calibrated.toml
         kort calibrate --rehearse 20

The service must not run on this deployment meanwhile: calibrate starts the servo itself and takes the
controller's place. It says before each stage what it will do and how far the shaft will turn, and goes on
with Enter. Ctrl-C at any moment: zero torque. Read docs/hardware.md first.

Exit code 1: the session was aborted, or stopped because something is not as it should be; it says what.";

/// Calibrate a thruster on its drive: signs, zeros, friction, inertia, lags, thrust map; writes a rig and a recording
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLE)]
pub struct Calibrate {
    /// Deployment with the drive [default: config/kort.toml, else the one built in]
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Folder of the shared memory [default: transport.root of the deployment]
    #[arg(long, value_name = "DIR")]
    root: Option<PathBuf>,
    /// Thruster to calibrate
    #[arg(long, value_name = "ID", default_value = "t1")]
    thruster: String,
    /// Rig description to begin with [default: the deployment's]
    #[arg(long, value_name = "RIG")]
    rig: Option<PathBuf>,
    /// The rig description to write
    #[arg(short, long, value_name = "RIG", required_unless_present = "rehearse")]
    output: Option<PathBuf>,
    /// The recording to write: .csv, .csv.gz, .mcap or .parquet [default: beside the rig, .csv.gz]
    #[arg(long, value_name = "REC")]
    recording: Option<PathBuf>,
    /// Share of the largest drive that the session goes up to
    #[arg(long, value_name = "SHARE", default_value_t = 0.5, value_parser = share)]
    share: f64,
    /// Ask nobody before each stage
    #[arg(long)]
    yes: bool,
    /// No session: this many on virtual stands whose thruster is concealed, and every wiring fault on each; says how
    /// many of the stated quantities lie inside their tolerance
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=10_000))]
    rehearse: Option<u64>,
    /// Seed of the rehearsal and of the diagnosis
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Print one JSON document (kort.calibration/1, or kort.calibration-rehearsal/1)
    #[arg(long)]
    json: bool,
    /// A job of the service that runs on this deployment, which has this process id: its servo is used, and its
    /// controller stands aside
    #[arg(long, value_name = "PID", hide = true)]
    job: Option<u32>,
}

impl Calibrate {
    /// The files that it reads, and those that it writes.
    pub fn named(&self) -> Named {
        if self.rehearse.is_some() {
            return Named::default();
        }
        let named = Named::default().reads_rig(self.rig.as_deref());
        let named = self.config.iter().fold(named, |named, file| named.reads("deployment", file));
        let recording = self.output.as_deref().map(|output| self.recorded(output));
        named.writes_toml("-o", self.output.as_deref()).writes("--recording", recording.as_deref())
    }

    /// The recording to write.
    fn recorded(&self, output: &Path) -> PathBuf {
        self.recording.clone().unwrap_or_else(|| output.with_extension("csv.gz"))
    }

    /// The service's process that this is a job of.
    pub fn job_of(&self) -> Option<u32> {
        self.job
    }
}

fn share(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "a number".to_owned())?;
    if (0.05..=1.0).contains(&value) { Ok(value) } else { Err("0.05 to 1".into()) }
}

/// Runs it.
///
/// # Errors
/// Unreadable input; a session that was stopped.
pub fn run(args: &Calibrate) -> Result<Outcome, Failure> {
    let config = Config::load(args.config.as_deref()).map_err(Failure::input)?;
    let (file, rig_text, rig) = stated(args, &config)?;
    match (args.rehearse, &args.output) {
        (Some(rigs), _) => rehearsal(args, &rig, rigs),
        (None, Some(output)) => {
            // Neither the deployment nor its rig need be named to be read.
            let named = args.named().reads("rig description", &file);
            let named = config.file.iter().fold(named, |named, file| named.reads("deployment", file));
            named.check()?;
            // An ending that is no format's is not found out behind an hour at the bench.
            Format::of(&args.recorded(output)).map_err(Failure::input)?;
            session(args, &config, &rig_text, &rig, output)
        }
        (None, None) => Err(Failure::input("-o RIG is missing\nhint: the rig description to write")),
    }
}

/// The rig to begin with: its file, its text.
fn stated(args: &Calibrate, config: &Config) -> Result<(PathBuf, String, Rig), Failure> {
    if let Some(path) = &args.rig {
        let text = files::rig_text(path)?;
        let rig = Rig::from_toml(&text).map_err(|e| Failure::in_file(path, e))?;
        return Ok((path.clone(), text, rig));
    }
    let thruster = config.thruster(&args.thruster).map_err(Failure::input)?;
    let (file, text) = config.rig_text(&args.thruster, thruster).map_err(Failure::input)?;
    let rig = Rig::from_toml(&text).map_err(|e| Failure::input(format!("{file}: {e}")))?;
    Ok((file.into(), text, rig))
}

fn session(
    args: &Calibrate,
    config: &Config,
    rig_text: &str,
    rig: &Rig,
    output: &Path,
) -> Result<Outcome, Failure> {
    let recording = args.recorded(output);
    let root = args.root.as_deref().unwrap_or(&config.transport.root);
    let deployment = Deployment::new(Some(root));
    let bench = live::Bench {
        file: args.config.as_deref(),
        config,
        deployment: &deployment,
        thruster: &args.thruster,
        rig,
        share: args.share,
        yes: args.yes,
        job: args.job.is_some(),
    };
    let ended = live::run(&bench)?;
    // Whatever follows, and whatever the session ended for, what was measured is kept.
    let period_s = ended.session.plan().period_s;
    let saved = conclude::save(ended.session.log(), period_s, &recording);
    if args.job.is_some() {
        behind_everything_else();
    } else if matches!(saved, Ok(true)) {
        eprintln!("what was measured is in {}", recording.display());
    }
    let facts = ended.session.facts();
    let mut report = Report {
        schema: "kort.calibration/1",
        kort_version: env!("CARGO_PKG_VERSION"),
        thruster: args.thruster.clone(),
        steps: steps(facts, None),
        rig: None,
        recording: matches!(saved, Ok(true)).then(|| recording.display().to_string()),
        diagnosis: None,
        stopped: ended.stopped,
    };
    if let Some(why) = report.stopped.clone() {
        if let Err(lost) = &saved {
            eprintln!("warning: the recording is lost: {lost}");
        }
        if args.json {
            print_json(&report)?;
        } else {
            print(&render::calibration::text(&report))?;
        }
        return Err(Failure::failed(why));
    }
    saved?;
    ended.signals.let_through()?;
    let spinner = args.job.is_none().then(progress::spinner);
    let told = |text: &str| match &spinner {
        Some(spinner) => spinner.set_message(text.to_string()),
        None => eprintln!("step: {text}"),
    };
    let estimate = conclude::estimated(ended.session.log(), period_s, rig, facts, &told)?;
    let (text, left_out) = conclude::rig_text(rig_text, &estimate)?;
    // The result is printed whatever becomes of its file, and of the diagnosis behind it.
    let written = write_text(output, &text);
    let calibrated = Rig::from_toml(&text).map_err(|e| Failure::in_file(output, e))?;
    let diagnosis = conclude::diagnosed(&estimate, &calibrated, args.seed, &told);
    drop(spinner);
    report.steps = steps(facts, Some(&estimate));
    if let Some(step) = report.steps.last_mut() {
        step.skipped_because.extend(left_out);
    }
    report.rig = written.is_ok().then(|| output.display().to_string());
    report.diagnosis = diagnosis.as_ref().ok().map(|diagnosis| diagnosis.report.summary.clone());
    if args.json {
        print_json(&report)?;
    } else {
        print(&render::calibration::text(&report))?;
        if let Ok(diagnosis) = &diagnosis {
            print(&render::verdict::text(&diagnosis.report, &calibrated))?;
        }
    }
    written.and(diagnosis.map(|_| Outcome::Done))
}

/// The session is over, the service goes on: from now on this process runs where nothing else wants the processor.
fn behind_everything_else() {
    let _ = nice(19);
    if let Some(words) = idle() {
        eprintln!("warning: {words}");
    }
}

fn rehearsal(args: &Calibrate, rig: &Rig, rigs: u64) -> Result<Outcome, Failure> {
    let bar = progress::bar(rigs, "rehearsing");
    let done = || bar.inc(1);
    let rehearsal = rehearse::rehearse(rig, rigs, args.seed, args.share, &done)?;
    drop(bar);
    if args.json {
        print_json(&rehearsal)?;
    } else {
        print(&render::calibration::rehearsal(&rehearsal))?;
    }
    Ok(Outcome::Done)
}
