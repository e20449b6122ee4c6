//! One file a subcommand.

use clap::Subcommand;

use crate::failure::{Failure, Outcome};

/// The laboratory's subcommands.
#[derive(Debug, Subcommand)]
pub enum Command {}

impl Command {
    /// Does it.
    pub fn run(self) -> Result<Outcome, Failure> {
        match self {}
    }
}
