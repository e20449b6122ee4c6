//! One file a subcommand.

mod calibrate;
mod columns;
mod convert;
pub mod diagnose;
mod explain;
pub mod fit;
mod fit_table;
mod prove;
mod reproduce;
pub mod simulate;
pub mod soak;

use clap::Subcommand;

use crate::failure::{Failure, Outcome};
use crate::outputs::Named;

/// The laboratory's subcommands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Calibrate a thruster on its drive: signs, zeros, friction, inertia, lags, thrust map; writes a rig and a recording
    Calibrate(calibrate::Calibrate),
    /// Say what is in a log of others, and propose a column map for it
    Columns(columns::Args),
    /// Write a recording, or a log of others through a column map, as CSV, MCAP or Parquet
    Convert(convert::Args),
    /// Find what the model left out: where, what, how much better with it
    Diagnose(diagnose::Diagnose),
    /// Look up the physics a model may leave out: what it is, how it shows, what it is confused with
    Explain(explain::Args),
    /// Identify a model's parameters, with standard errors and a held-out score
    Fit(fit::Fit),
    /// Make a rig description from a table of settled points, and say what it cannot fix
    FitTable(fit_table::Args),
    /// Compute the seed paper's tables and figures, ours beside the printed value
    Reproduce(reproduce::Args),
    /// Make a recording from a model, with the stand's sensors
    Simulate(simulate::Args),
    /// Run several controllers on the same plant, faults and references, and compare them
    Soak(soak::Args),
    /// Prove `diagnose` blind: hide physics, diagnose the recordings alone, open the answers
    Prove(prove::Prove),
}

impl Command {
    /// The service's process that this is a job of: it ends with it.
    pub fn job_of(&self) -> Option<u32> {
        match self {
            Command::Diagnose(diagnose) => diagnose.job_of(),
            Command::Fit(fit) => fit.job_of(),
            Command::Calibrate(calibrate) => calibrate.job_of(),
            _ => None,
        }
    }

    /// Does it command a drive? Whatever else is a job gives way to everything else.
    pub fn drives(&self) -> bool {
        matches!(self, Command::Calibrate(_))
    }

    /// The files that it reads, and those that it writes.
    fn named(&self) -> Named {
        match self {
            Command::Calibrate(args) => args.named(),
            Command::Columns(args) => args.named(),
            Command::Convert(args) => args.named(),
            Command::Diagnose(diagnose) => diagnose.named(),
            Command::Explain(_) => Named::default(),
            Command::Fit(fit) => fit.named(),
            Command::FitTable(args) => args.named(),
            Command::Reproduce(args) => args.named(),
            Command::Simulate(args) => args.named(),
            Command::Soak(args) => args.named(),
            Command::Prove(prove) => prove.named(),
        }
    }

    /// Does it.
    pub fn run(self) -> Result<Outcome, Failure> {
        self.named().check()?;
        match self {
            Command::Calibrate(args) => calibrate::run(&args),
            Command::Columns(args) => columns::run(&args),
            Command::Convert(args) => convert::run(&args),
            Command::Diagnose(diagnose) => diagnose.run(),
            Command::Explain(args) => explain::run(&args),
            Command::Fit(fit) => fit.run(),
            Command::FitTable(args) => fit_table::run(&args),
            Command::Reproduce(args) => reproduce::run(&args),
            Command::Simulate(args) => simulate::run(&args),
            Command::Soak(args) => soak::run(&args),
            Command::Prove(prove) => prove.run(),
        }
    }
}
