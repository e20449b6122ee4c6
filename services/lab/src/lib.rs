//! The laboratory: simulate, fit, diagnose, explain, calibrate, soak, reproduce, prove.
//!
//! [`Command`] is what the program `kort` shows of it; [`run`] does one. To add a subcommand:
//! a file in `commands/` with `Args` and `run`, and a line in [`Command`].

mod believed;
pub mod calibrate;
pub mod check;
pub mod commands;
pub mod failure;
pub mod files;
pub mod fitted_rig;
pub mod input;
pub mod outputs;
pub mod progress;
pub mod render;
pub mod soak;

pub use commands::Command;
pub use failure::{Failure, Outcome};

/// Does one command: results on stdout, talk and errors on stderr.
///
/// Exit codes: 0 done, 1 failed, 2 wrong usage or unreadable input, 3 done but data were lost or
/// skipped.
pub fn run(command: Command) -> std::process::ExitCode {
    match command.run() {
        Ok(Outcome::Done) => 0.into(),
        Ok(Outcome::DoneWithLoss) => 3.into(),
        Err(failure) => {
            eprintln!("error: {failure}");
            failure.code().into()
        }
    }
}
