//! `kort token`: makes the tokens of the gateway.

use std::process::ExitCode;

use clap::{Subcommand, ValueEnum};
use kort_gateway::token::{self, Role};
use serde::Serialize;

use crate::{DONE, FAILED, Service, USAGE, fail, print};

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
        /// Print one JSON document (kort.token/1)
        #[arg(long)]
        json: bool,
        #[command(flatten)]
        service: Service,
    },
}

/// A token as `--json` shows it, once.
#[derive(Serialize)]
struct Made<'a> {
    schema: &'static str,
    name: &'a str,
    role: &'static str,
    /// The file that holds its hash.
    file: &'a str,
    token: &'a str,
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
    let Token::New { name, role, json, service } = command;
    let (config, _) = service.load()?;
    let settings = kort_gateway::Settings::new_unchecked(&config).map_err(|e| fail(USAGE, &e))?;
    let role = match role {
        RoleName::Viewer => Role::Viewer,
        RoleName::Pilot => Role::Pilot,
        RoleName::Admin => Role::Admin,
    };
    let made = token::make(&settings.tokens, &name, role).map_err(|e| fail(USAGE, &e))?;
    let file = settings.tokens.display().to_string();
    let shown = if json {
        let document =
            Made { schema: "kort.token/1", name: &name, role: role.name(), file: &file, token: &made };
        serde_json::to_string_pretty(&document).unwrap_or_default()
    } else {
        eprintln!("{name} may {} now; this is shown once, its hash is in {file}:", role.name());
        made.clone()
    };
    print(&(shown + "\n")).map_err(|error| {
        fail(
            FAILED,
            &format!(
                "the token of {name} cannot be printed, and nobody has seen it: {error}\nhint: take its section out of {file} and make another"
            ),
        )
    })?;
    Ok(ExitCode::from(DONE))
}
