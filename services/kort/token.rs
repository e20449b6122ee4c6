//! `kort token`: makes the tokens of the gateway.

use std::process::ExitCode;

use clap::{Subcommand, ValueEnum};
use kort_gateway::token::{self, Role};

use crate::{DONE, Service, USAGE, fail};

/// What to do with tokens.
#[derive(Subcommand)]
pub enum Token {
    /// Make a token; it is printed once, only its hash is stored
    #[command(after_help = "Example: kort token new bridge --role pilot\n\n\
        Then: curl -H \"Authorization: Bearer TOKEN\" https://HOST:8080/v1/thrusters\n\
        To revoke it delete its section from the file that gateway.tokens names.")]
    New {
        /// Whose it is: 1 to 32 letters, digits, `-` or `_`; it stands in the event log
        #[arg(value_name = "NAME")]
        name: String,
        /// viewer reads, pilot commands, admin changes recordings of others too
        #[arg(long)]
        role: RoleName,
        #[command(flatten)]
        service: Service,
    },
}

/// A role as written on the command line.
#[derive(Clone, Copy, ValueEnum)]
pub enum RoleName {
    /// Reads
    Viewer,
    /// Commands
    Pilot,
    /// Changes configuration, and recordings of others
    Admin,
}

/// Makes the token and prints it.
pub fn run(command: Token) -> Result<ExitCode, ExitCode> {
    let Token::New { name, role, service } = command;
    let (config, _) = service.load()?;
    let settings = kort_gateway::Settings::new_unchecked(&config).map_err(|e| fail(USAGE, &e))?;
    let role = match role {
        RoleName::Viewer => Role::Viewer,
        RoleName::Pilot => Role::Pilot,
        RoleName::Admin => Role::Admin,
    };
    let made = token::make(&settings.tokens, &name, role).map_err(|e| fail(USAGE, &e))?;
    eprintln!(
        "{} may {} now; this is shown once, its hash is in {}:",
        name,
        role.name(),
        settings.tokens.display()
    );
    println!("{made}");
    Ok(ExitCode::from(DONE))
}
