//! `kort`: thrust control for marine thrusters, and a laboratory that finds what the model left
//! out. This file parses and dispatches; every subcommand lives in a folder of its own.
//!
//! Aboard the laboratory can be left out (`--no-default-features --features servo,controller,gateway`): then the service can do all but
//! diagnose its recordings.

mod check;
#[cfg(feature = "servo")]
mod job;
mod options;
#[cfg(feature = "gateway")]
mod token;
#[cfg(all(feature = "servo", feature = "controller", feature = "gateway"))]
mod up;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand};
use kort_proto::config::Config;
#[cfg(feature = "servo")]
use kort_proto::messages::Trip;
use kort_proto::transport::Deployment;
#[cfg(feature = "servo")]
use rustix::process::Signal;

/// Done.
const DONE: u8 = 0;
/// Failed.
const FAILED: u8 = 1;
/// Wrong usage or unreadable input.
const USAGE: u8 = 2;
/// Said to a command that is not there.
#[cfg(not(feature = "lab"))]
const NO_LAB: &str = "this kort has no such command, for it was built without its laboratory\nhint: take the recording to a whole one; kort --help names what is here";

#[cfg(all(feature = "servo", feature = "controller", feature = "gateway"))]
const UP_EXAMPLE: &str =
    "Example: kort up --config config/kort.toml\n\nThen: curl http://127.0.0.1:8080/v1/thrusters/t1";

#[derive(Parser)]
#[command(name = "kort", version, about = "Thrust control for marine thrusters, and a laboratory beside it")]
#[command(
    after_help = "Without a command: kort up, on a simulated copy of a real test stand.\n\nExample: kort"
)]
#[command(args_conflicts_with_subcommands = true)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    up: Service,
}

#[derive(Subcommand)]
enum Command {
    /// Start and watch servo, controller and gateway; Ctrl-C stops them, thrust at zero first
    #[cfg(all(feature = "servo", feature = "controller", feature = "gateway"))]
    #[command(after_help = UP_EXAMPLE)]
    Up(Service),
    /// The servo alone: the loop that drives the amplifier
    #[cfg(feature = "servo")]
    #[command(after_help = "Example: kort servo --config config/kort.toml --thruster t1")]
    Servo {
        #[command(flatten)]
        service: Service,
        #[command(flatten)]
        which: Which,
        /// Open the shared memory that another process owns, instead of creating it
        #[arg(long)]
        join: bool,
        #[command(flatten)]
        latched: Latched,
        /// The stop that ended the servo before: time in ns, thrust in N, shaft speed in rad/s
        #[arg(long, value_name = "NS,N,RAD/S", hide = true, value_parser = trip, allow_hyphen_values = true)]
        tripped: Option<Trip>,
        /// The process that started this one: the servo ends with it
        #[arg(long, value_name = "PID", hide = true)]
        parent: Option<u32>,
    },
    /// The controller alone: from setpoint to drive command
    #[cfg(feature = "controller")]
    #[command(after_help = "Example: kort controller --config config/kort.toml --thruster t1")]
    Controller {
        #[command(flatten)]
        service: Service,
        #[command(flatten)]
        which: Which,
        #[command(flatten)]
        latched: Latched,
    },
    /// The gateway alone: console, REST API, WebSocket, metrics, recordings
    #[cfg(feature = "gateway")]
    #[command(after_help = "Example: kort gateway --config config/kort.toml")]
    Gateway(Service),
    /// Read configurations as the services would, and say everything that is wrong
    #[command(after_help = "Example: kort check config/kort.toml config/thrusters/t200.toml")]
    Check(check::Check),
    /// Make a token: who may read, command or administer
    #[cfg(feature = "gateway")]
    #[command(subcommand, after_help = "Example: kort token new bridge --role pilot")]
    Token(token::Token),
    #[cfg(feature = "lab")]
    #[command(flatten)]
    Lab(kort_lab::Command),
}

#[derive(Args, Clone)]
struct Service {
    /// Deployment to run [default: config/kort.toml, else the one built in]
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Folder of the shared memory [default: transport.root of the deployment]
    #[arg(long, value_name = "DIR")]
    root: Option<PathBuf>,
}

#[cfg(any(feature = "servo", feature = "controller"))]
#[derive(Args)]
struct Which {
    /// Thruster to serve
    #[arg(long, value_name = "ID", default_value = "t1")]
    thruster: String,
}

#[cfg(any(feature = "servo", feature = "controller"))]
#[derive(Args)]
struct Latched {
    /// Faults that the process before had latched, as a bitset: they stay until somebody clears them
    #[arg(long, value_name = "BITS", default_value_t = 0, hide = true)]
    latched: u64,
}

/// Reads `--tripped`.
#[cfg(feature = "servo")]
fn trip(text: &str) -> Result<Trip, String> {
    let words = || "three numbers, for example 1000000000,80.0,63.0".to_owned();
    let parts: Vec<&str> = text.split(',').collect();
    let [at, thrust, speed] = parts.as_slice() else { return Err(words()) };
    Ok(Trip {
        at_ns: at.parse().map_err(|_| words())?,
        thrust_n: thrust.parse().map_err(|_| words())?,
        shaft_speed_rad_s: speed.parse().map_err(|_| words())?,
        drive: f64::NAN,
    })
}

impl Service {
    fn load(&self) -> Result<(Config, Deployment), ExitCode> {
        let config = Config::load(self.config.as_deref()).map_err(|e| fail(USAGE, &e))?;
        let root = self.root.as_deref().unwrap_or(&config.transport.root);
        let deployment = Deployment::new(Some(root));
        Ok((config, deployment))
    }
}

fn main() -> ExitCode {
    let asked = options::with_negative_numbers(Cli::command()).try_get_matches();
    let cli = match asked.and_then(|matches| Cli::from_arg_matches(&matches)) {
        Ok(cli) => cli,
        #[cfg(not(feature = "lab"))]
        Err(e) if e.kind() == clap::error::ErrorKind::InvalidSubcommand => {
            return fail(USAGE, &NO_LAB);
        }
        Err(e) => {
            let printed = e.print();
            if e.use_stderr() {
                options::hint(&e);
                return ExitCode::from(USAGE);
            }
            return said(printed).map_or_else(|code| code, |()| ExitCode::from(DONE));
        }
    };
    match cli.command {
        Some(command) => dispatch(command),
        #[cfg(all(feature = "servo", feature = "controller", feature = "gateway"))]
        None => dispatch(Command::Up(cli.up)),
        #[cfg(not(all(feature = "servo", feature = "controller", feature = "gateway")))]
        None => {
            let _ = Cli::command().print_help();
            Ok(ExitCode::from(USAGE))
        }
    }
    .unwrap_or_else(|code| code)
}

fn dispatch(command: Command) -> Result<ExitCode, ExitCode> {
    match command {
        #[cfg(all(feature = "servo", feature = "controller", feature = "gateway"))]
        Command::Up(service) => {
            log();
            check::refuse(service.config.as_deref())?;
            let (config, deployment) = service.load()?;
            finish(up::run(&config, &deployment))
        }
        #[cfg(feature = "servo")]
        Command::Servo { service, which, join, latched, tripped, parent } => {
            log();
            if let Some(parent) = parent {
                job::follow(parent, Signal::TERM)?;
            }
            let (config, deployment) = service.load()?;
            let inherited =
                kort_servo::Inherited { latched: latched.latched, tripped: tripped.unwrap_or_default() };
            finish(kort_servo::run(&config, &deployment, &which.thruster, join, inherited))
        }
        #[cfg(feature = "controller")]
        Command::Controller { service, which, latched } => {
            log();
            let (config, deployment) = service.load()?;
            finish(kort_controller::run(&config, &deployment, &which.thruster, latched.latched))
        }
        #[cfg(feature = "gateway")]
        Command::Gateway(service) => {
            log();
            let (config, deployment) = service.load()?;
            finish(kort_gateway::run(&config, &deployment))
        }
        Command::Check(args) => check::run(&args),
        #[cfg(feature = "gateway")]
        Command::Token(command) => token::run(command),
        #[cfg(feature = "lab")]
        Command::Lab(command) => {
            if let Some(parent) = command.job_of() {
                job::begin(parent, command.drives())?;
            }
            Ok(kort_lab::run(command))
        }
    }
}

fn finish<E: std::fmt::Display + Blames>(result: Result<(), E>) -> Result<ExitCode, ExitCode> {
    result.map(|()| ExitCode::from(DONE)).map_err(|e| fail(if e.blames_input() { USAGE } else { FAILED }, &e))
}

/// Whether an error is about what the user wrote, or about what happened.
trait Blames {
    fn blames_input(&self) -> bool;
}

#[cfg(all(feature = "servo", feature = "controller", feature = "gateway"))]
impl Blames for up::UpError {
    fn blames_input(&self) -> bool {
        match self {
            Self::Config(_) | Self::Refused { .. } => true,
            Self::Servo(e) => e.blames_input(),
            Self::Controller(e) => e.blames_input(),
            Self::Gateway(e) => e.blames_input(),
            Self::Transport(_)
            | Self::System { .. }
            | Self::DoesNotStart { .. }
            | Self::NotStopped { .. } => false,
        }
    }
}

#[cfg(feature = "servo")]
impl Blames for kort_servo::ServoError {
    fn blames_input(&self) -> bool {
        matches!(self, Self::Config(_) | Self::Rig { .. })
    }
}

#[cfg(feature = "controller")]
impl Blames for kort_controller::ControllerError {
    fn blames_input(&self) -> bool {
        matches!(self, Self::Config(_) | Self::Rig { .. } | Self::Law { .. } | Self::Model { .. })
    }
}

#[cfg(feature = "gateway")]
impl Blames for kort_gateway::GatewayError {
    fn blames_input(&self) -> bool {
        matches!(self, Self::Config(_) | Self::NoTokens { .. } | Self::Tokens(_) | Self::Tls(_))
    }
}

fn fail(code: u8, error: &dyn std::fmt::Display) -> ExitCode {
    // Where nobody listens the exit code still speaks; eprintln! would panic.
    let _ = std::io::Write::write_all(&mut std::io::stderr(), format!("error: {error}\n").as_bytes());
    ExitCode::from(code)
}

/// Prints a result, all of it.
fn print(text: &str) -> std::io::Result<()> {
    use std::io::Write;
    let mut out = std::io::stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush())
}

/// Ends a command whose result could not be printed; where nobody wanted the rest (`kort … | head`), quietly.
fn said(printed: std::io::Result<()>) -> Result<(), ExitCode> {
    match printed {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(fail(
            FAILED,
            &format!(
                "the result cannot be printed: {error}\nhint: check where standard output goes: is that disk full?"
            ),
        )),
        _ => Ok(()),
    }
}

/// Logs to stderr; `RUST_LOG` chooses how much, for example `RUST_LOG=debug`.
fn log() {
    use tracing_subscriber::EnvFilter;
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("info"));
    let terminal = std::io::IsTerminal::is_terminal(&std::io::stderr());
    let _ = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(terminal)
        // A log on a full disk must not end a servo: what cannot be written is not complained of where it cannot
        // be written either.
        .log_internal_errors(false)
        .try_init();
}
