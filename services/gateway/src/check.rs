//! Could a gateway start? Asked before anything else is started, and by `kort check`.

use std::sync::Arc;

use kort_control::known::uses;
use kort_proto::config::Config;
use kort_thruster::rig::Rig;

use crate::error::GatewayError;
use crate::settings::{self, Settings};
use crate::tls::Certificate;
use crate::token::Tokens;

/// Could a gateway start with this configuration? Says so before anything else is started.
///
/// # Errors
/// If the address is taken or the folder of the recordings cannot be made.
pub fn check(settings: &Settings) -> Result<(), GatewayError> {
    let (bind, folder) = (settings.bind, settings.recordings.clone());
    let listener = std::net::TcpListener::bind(bind).map_err(|error| GatewayError::Bind { bind, error })?;
    if let Some(bind) = settings.foxglove {
        std::net::TcpListener::bind(bind).map_err(|error| GatewayError::Foxglove { bind, error })?;
    }
    drop(listener);
    std::fs::create_dir_all(&folder).map_err(|error| GatewayError::Recordings { folder, error })?;
    let events = settings.events.clone();
    std::fs::create_dir_all(&events).map_err(|error| GatewayError::Events { folder: events, error })?;
    let rigs = settings.rigs.clone();
    std::fs::create_dir_all(&rigs).map_err(|error| GatewayError::Rigs { folder: rigs, error })?;
    tokens(settings)?;
    certificate(settings)?;
    Ok(())
}

/// What is wrong with this configuration for a gateway: reads all that it reads, and touches no address. Each names
/// file, key, value and what is allowed.
pub fn check_config(config: &Config) -> Vec<GatewayError> {
    let mut wrong: Vec<GatewayError> =
        settings::thrusters(config).err().into_iter().map(Into::into).collect();
    match Settings::new_unchecked(config) {
        Err(error) => wrong.push(error.into()),
        Ok(settings) => {
            wrong.extend(settings.wrong().into_iter().map(|words| config.error(words).into()));
            wrong.extend(tokens(&settings).err());
            let keys = settings.tls.as_ref().filter(|keys| !keys.self_signed);
            wrong.extend(keys.and_then(|keys| Certificate::open(keys, Vec::new()).err()).map(Into::into));
        }
    }
    wrong
}

/// Effects of the deployment's rigs that no control law and no observer uses: file of the rig, effect, and why.
pub fn unused_effects(config: &Config) -> Vec<(String, &'static str, &'static str)> {
    let mut unused = Vec::new();
    for deployed in settings::thrusters(config).unwrap_or_default() {
        let (file, text) = deployed.rig;
        let Ok(rig) = Rig::from_toml(&text) else { continue };
        for (effect, why) in uses::left_out(&rig, deployed.heartbeat.as_secs_f64()) {
            unused.push((file.clone(), effect, why));
        }
    }
    unused
}

/// The tokens; where they are asked for there must be one.
pub(crate) fn tokens(settings: &Settings) -> Result<Tokens, GatewayError> {
    let tokens = Tokens::open(&settings.tokens)?;
    match settings.why_tokens() {
        Some(why) if tokens.count() == 0 => {
            Err(GatewayError::NoTokens { why, file: settings.tokens.clone() })
        }
        _ => Ok(tokens),
    }
}

/// The certificate, where TLS is asked for.
pub(crate) fn certificate(settings: &Settings) -> Result<Option<Arc<Certificate>>, GatewayError> {
    let Some(keys) = &settings.tls else { return Ok(None) };
    let mut names = vec!["localhost".to_owned(), "127.0.0.1".to_owned(), "::1".to_owned()];
    if !settings.bind.ip().is_unspecified() {
        names.push(settings.bind.ip().to_string());
    }
    names.extend(settings.hosts.iter().cloned());
    Ok(Some(Arc::new(Certificate::open(keys, names)?)))
}
