//! Could a gateway start? Asked before anything else is started, and by `kort check`.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use kort_control::known::uses;
use kort_proto::config::{Config, ConfigError};
use kort_proto::ours::{Foreign, in_our_hands, make_folder, nobody_else_may_replace};
use kort_thruster::rig::Rig;

use crate::error::GatewayError;
use crate::settings::{self, Settings};
use crate::tls::{Certificate, TlsError};
use crate::token::Tokens;

/// Could a gateway start with this configuration? Says so before anything else is started.
///
/// # Errors
/// If the address is taken, a folder cannot be made or written to, or somebody else could have written what is believed.
pub fn check(settings: &Settings) -> Result<(), GatewayError> {
    let bind = settings.bind;
    let listener = std::net::TcpListener::bind(bind).map_err(|error| GatewayError::Bind { bind, error })?;
    if let Some(bind) = settings.foxglove {
        std::net::TcpListener::bind(bind).map_err(|error| GatewayError::Foxglove { bind, error })?;
    }
    drop(listener);
    ours(settings)?;
    for (folder, refused) in folders(settings) {
        can_write(folder).map_err(|error| refused(folder.clone(), error))?;
    }
    tokens(settings)?;
    certificate(settings)?;
    Ok(())
}

type Refused = fn(PathBuf, io::Error) -> GatewayError;

/// Where the gateway writes, and how it says that it cannot.
fn folders(settings: &Settings) -> [(&PathBuf, Refused); 5] {
    [
        (&settings.recordings, |folder, error| GatewayError::Recordings { folder, error }),
        (&settings.events, |folder, error| GatewayError::Events { folder, error }),
        (&settings.rigs, |folder, error| GatewayError::Rigs { folder, error }),
        (&settings.diagnoses, |folder, error| GatewayError::Diagnoses { folder, error }),
        (&settings.calibrations, |folder, error| GatewayError::Calibrations { folder, error }),
    ]
}

/// Is what the gateway believes, and where it writes what is believed later, in nobody else's hands? Asked before any of it
/// is read or made.
///
/// # Errors
/// [`GatewayError::Foreign`] names the first that is not.
pub(crate) fn ours(settings: &Settings) -> Result<(), GatewayError> {
    let key = settings.tls.as_ref().map(|keys| ("tls.key", &keys.key));
    let believed = [
        ("tokens", &settings.tokens),
        ("events", &settings.events),
        ("rigs", &settings.rigs),
        ("diagnoses", &settings.diagnoses),
        ("calibrations", &settings.calibrations),
    ];
    for (key, path) in believed.into_iter().chain(key) {
        in_our_hands(path).map_err(|Foreign { path, why }| GatewayError::Foreign { key, path, why })?;
    }
    // Nothing is believed of a recording but by whoever asks for it: a disk for all will do, where nobody replaces what is ours.
    let foreign = |Foreign { path, why }| GatewayError::Foreign { key: "recordings", path, why };
    nobody_else_may_replace(&settings.recordings).map_err(foreign)
}

/// Makes a folder and a file in it, which is gone again: a folder that is there may be one that nothing can be written to.
/// A full disk is no reason not to start: what it does not take is told when it is refused.
fn can_write(folder: &Path) -> io::Result<()> {
    make_folder(folder)?;
    let file = folder.join(format!(".kort-writes-{}", std::process::id()));
    match fs::OpenOptions::new().write(true).create_new(true).open(&file) {
        Err(error) if matches!(error.kind(), io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded) => {
            Ok(())
        }
        // Of one of the same number that was killed in between.
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => fs::remove_file(&file),
        made => made.and_then(|_| fs::remove_file(&file)),
    }
}

/// Could a file be made in this folder, or the folder first? Asks the nearest one above it that is there, and makes nothing.
fn could_write(folder: &Path) -> io::Result<()> {
    // The kernel shows itself there, and takes no file from anybody, whatever the rights say: /proc, /sys, cgroups.
    const OF_THE_KERNEL: [i64; 3] = [0x9fa0, 0x6265_6572, 0x6367_7270];
    let whole = std::path::absolute(folder)?;
    // A link that leads nowhere is there: no folder is made in its place.
    let there = whole.ancestors().find(|above| above.symlink_metadata().is_ok()).unwrap_or(&whole);
    let refused = |error: io::Error| io::Error::new(error.kind(), format!("{}: {error}", there.display()));
    if !there.is_dir() {
        return Err(refused(io::ErrorKind::NotADirectory.into()));
    }
    if rustix::fs::statfs(there).is_ok_and(|disk| OF_THE_KERNEL.contains(&disk.f_type)) {
        return Err(refused(io::Error::other("the kernel's own, no file can be made there")));
    }
    let rights = rustix::fs::Access::WRITE_OK | rustix::fs::Access::EXEC_OK;
    rustix::fs::access(there, rights).map_err(|error| refused(error.into()))
}

/// Could certificate and key be read, or made where that is asked for and neither is there?
fn could_speak_tls(keys: &settings::Tls) -> Result<(), GatewayError> {
    if !(keys.self_signed && !keys.certificate.exists() && !keys.key.exists()) {
        Certificate::open(keys, Vec::new())?;
        return Ok(());
    }
    for file in [&keys.certificate, &keys.key] {
        let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty());
        could_write(folder.unwrap_or(Path::new("."))).map_err(|error| TlsError::new(file, error))?;
    }
    Ok(())
}

/// What is wrong with this configuration for a gateway: reads all that it reads, and touches no address. Each names
/// file, key, value and what is allowed.
pub fn check_config(config: &Config) -> Vec<GatewayError> {
    let (_, of_files) = settings::thrusters_with_all(config);
    let mut wrong: Vec<GatewayError> = of_files.into_iter().map(Into::into).collect();
    match Settings::new_unchecked(config) {
        Err(error) => wrong.push(error.into()),
        Ok(settings) => {
            wrong.extend(settings.wrong().into_iter().map(|words| config.error(words).into()));
            let unwritable = |(folder, refused): (&PathBuf, Refused)| {
                could_write(folder).err().map(|error| refused(folder.clone(), error))
            };
            wrong.extend(folders(&settings).into_iter().filter_map(unwritable));
            wrong.extend(tokens(&settings).err());
            wrong.extend(settings.tls.as_ref().and_then(|keys| could_speak_tls(keys).err()));
        }
    }
    wrong
}

/// What is no mistake of this configuration, and hardly as it is meant; the gateway says it in its log when it starts.
pub fn doubtful(config: &Config) -> Vec<ConfigError> {
    let Ok(settings) = Settings::new_unchecked(config) else { return Vec::new() };
    // What is to be made is good, and what cannot be read is told as wrong.
    let keys = settings.tls.as_ref().filter(|keys| keys.certificate.exists() && keys.key.exists());
    let certificate = keys.and_then(|keys| Certificate::open(keys, Vec::new()).ok()?.doubtful());
    settings.doubtful().into_iter().chain(certificate).map(|words| config.error(words)).collect()
}

/// Effects of the deployment's rigs that no control law and no observer uses: file of the rig, effect, and why.
pub fn unused_effects(config: &Config) -> Vec<(String, &'static str, &'static str)> {
    let mut unused = Vec::new();
    for deployed in settings::thrusters_with_all(config).0 {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_tried_and_left_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let state = folder.path().join("state/events");
        can_write(&state).unwrap();
        assert_eq!(fs::read_dir(&state).unwrap().count(), 0);
        let blocked = folder.path().join("blocked");
        fs::write(&blocked, "").unwrap();
        assert!(can_write(&blocked).is_err() && can_write(&blocked.join("x")).is_err());
        // Nobody, root neither, makes a file there.
        assert!(can_write(Path::new("/proc/self")).is_err());
    }

    #[test]
    fn what_could_be_written_is_found_out_without_making_anything() {
        let folder = tempfile::tempdir().unwrap();
        could_write(&folder.path().join("state/events")).unwrap();
        could_write(Path::new("kort-state/events")).unwrap();
        let blocked = folder.path().join("blocked");
        fs::write(&blocked, "").unwrap();
        for bad in [&blocked, &blocked.join("x"), Path::new("/proc/nope"), Path::new("/sys/nope/x")] {
            assert!(could_write(bad).is_err(), "{}", bad.display());
        }
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_certificate_to_be_made_is_asked_for_where_one_of_its_files_is_there() {
        let folder = tempfile::tempdir().unwrap();
        let keys = |certificate: &str, key: &str| settings::Tls {
            certificate: folder.path().join(certificate),
            key: folder.path().join(key),
            self_signed: true,
        };
        could_speak_tls(&keys("a.pem", "a.key")).unwrap();
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        for (certificate, key) in [("a.pem", "a.key"), ("b.pem", "b.key")] {
            Certificate::open(&keys(certificate, key), vec!["localhost".into()]).unwrap();
        }
        could_speak_tls(&keys("a.pem", "a.key")).unwrap();
        let strangers = could_speak_tls(&keys("a.pem", "b.key")).unwrap_err().to_string();
        assert!(strangers.contains("a.pem"), "{strangers}");
        let lacking = could_speak_tls(&keys("a.pem", "none.key")).unwrap_err().to_string();
        assert!(lacking.contains("none.key"), "{lacking}");
        assert!(could_speak_tls(&keys("none.pem", "a.key")).is_err());
    }
}
