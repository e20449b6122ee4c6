//! TLS by rustls: certificate and key from files, read again when they change, or made on request.

use std::fs;
use std::io::Write;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::{Duration, SystemTime};

use kort_proto::ours::{in_our_hands, make_folder};
use thiserror::Error;
use tokio_rustls::rustls::ServerConfig;
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::pem::PemObject;
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer};

use crate::settings::Tls;
use crate::thruster::lock;

/// Why there is no TLS.
#[derive(Debug, Error)]
#[error("gateway.tls, {file}: {why}\nhint: {hint}")]
pub struct TlsError {
    file: String,
    why: String,
    hint: &'static str,
}

impl TlsError {
    pub(crate) fn new(file: &Path, why: impl ToString) -> TlsError {
        let hint = "certificate and key are PEM files; self_signed = true makes both where neither is there";
        TlsError { file: file.display().to_string(), why: why.to_string(), hint }
    }
}

/// The certificate in force.
#[derive(Debug)]
pub struct Certificate {
    keys: Tls,
    now: Mutex<Loaded>,
}

#[derive(Debug)]
struct Loaded {
    stamps: Stamps,
    config: Arc<ServerConfig>,
    /// What is to be said of the time for which it is good.
    doubtful: Option<String>,
    /// When it ends, Unix time, s.
    ends_s: i64,
}

type Stamps = [Option<SystemTime>; 2];

impl Certificate {
    /// Reads certificate and key, and makes them first if that was asked for. `names` are what a certificate made
    /// here is good for.
    ///
    /// # Errors
    /// [`TlsError`] names the file.
    pub fn open(keys: &Tls, names: Vec<String>) -> Result<Certificate, TlsError> {
        if keys.self_signed && !keys.certificate.exists() && !keys.key.exists() {
            make(keys, names)?;
        }
        let now = Mutex::new(load(keys)?);
        Ok(Certificate { keys: keys.clone(), now })
    }

    /// What is no mistake, and keeps clients away all the same: it is good no more, or not yet.
    pub fn doubtful(&self) -> Option<String> {
        lock(&self.now).doubtful.clone()
    }

    /// When it ends, Unix time, s.
    pub fn ends_s(&self) -> i64 {
        lock(&self.now).ends_s
    }

    /// The configuration for the next connection.
    pub fn config(&self) -> Arc<ServerConfig> {
        Arc::clone(&lock(&self.now).config)
    }

    /// Takes over files that changed; broken ones are told, and the certificate before stays.
    pub fn refresh(&self) {
        let stamps = stamps(&self.keys);
        if lock(&self.now).stamps == stamps {
            return;
        }
        match load(&self.keys) {
            Ok(loaded) => {
                tracing::info!("the certificate was read anew");
                if let Some(words) = &loaded.doubtful {
                    tracing::warn!("{words}");
                }
                *lock(&self.now) = loaded;
            }
            Err(error) => {
                tracing::warn!("{error}; the certificate before stays in force");
                lock(&self.now).stamps = stamps;
            }
        }
    }
}

fn stamps(keys: &Tls) -> Stamps {
    [&keys.certificate, &keys.key].map(|file| fs::metadata(file).and_then(|about| about.modified()).ok())
}

fn load(keys: &Tls) -> Result<Loaded, TlsError> {
    // Before they are read: what changes meanwhile is read with the next look.
    let stamps = stamps(keys);
    let chain = CertificateDer::pem_file_iter(&keys.certificate)
        .and_then(Iterator::collect::<Result<Vec<_>, _>>)
        .map_err(|error| TlsError::new(&keys.certificate, error))?;
    let Some(first) = chain.first() else {
        return Err(TlsError::new(&keys.certificate, "holds no certificate"));
    };
    let (_, read) = x509_parser::parse_x509_certificate(first)
        .map_err(|error| TlsError::new(&keys.certificate, error))?;
    let [since_s, ends_s] =
        [read.validity().not_before, read.validity().not_after].map(|time| time.timestamp());
    in_our_hands(&keys.key).map_err(|foreign| {
        let hint = "whoever can write there could speak in this service's name; give the key to this user and take the \
                    right to write from others (chown, chmod go-w), or make another";
        TlsError { hint, ..TlsError::new(&foreign.path, foreign.why) }
    })?;
    // A group may read it, as Debian's `ssl-cert` does.
    let mode = fs::metadata(&keys.key).map(|about| about.mode()).unwrap_or_default();
    if mode & 0o004 != 0 {
        let why = format!("may be read by everybody on this machine (mode {:o}): chmod 600", mode & 0o7777);
        return Err(TlsError::new(&keys.key, why));
    }
    let key = PrivateKeyDer::from_pem_file(&keys.key).map_err(|error| TlsError::new(&keys.key, error))?;
    let mut config = ServerConfig::builder_with_provider(Arc::new(ring::default_provider()))
        .with_safe_default_protocol_versions()
        .and_then(|builder| builder.with_no_client_auth().with_single_cert(chain, key))
        .map_err(|error| TlsError::new(&keys.certificate, error))?;
    config.alpn_protocols = vec![b"http/1.1".to_vec()];
    let doubtful = doubtful(&keys.certificate, since_s, ends_s, SystemTime::now());
    Ok(Loaded { stamps, config: Arc::new(config), doubtful, ends_s })
}

/// A certificate is served whatever the time: a machine under water may have lost its clock, and clients decide for themselves.
fn doubtful(file: &Path, since_s: i64, ends_s: i64, now: SystemTime) -> Option<String> {
    let now_s = now.duration_since(SystemTime::UNIX_EPOCH).map_or(0, |now| now.as_secs().cast_signed());
    let (what, when_s) = if now_s > ends_s {
        ("ended on", ends_s)
    } else if now_s < since_s {
        ("is good only from", since_s)
    } else {
        return None;
    };
    let when = SystemTime::UNIX_EPOCH + Duration::from_secs(when_s.max(0).cast_unsigned());
    Some(format!(
        "`gateway.tls.certificate` = {:?} {what} {}, and this machine's clock says {}: browsers and clients refuse it\nhint: put a new certificate in its place, it is read without a restart; see that the clock is right",
        file.display().to_string(),
        humantime::format_rfc3339_seconds(when),
        humantime::format_rfc3339_seconds(now),
    ))
}

fn make(keys: &Tls, names: Vec<String>) -> Result<(), TlsError> {
    let names: Vec<String> = names.iter().map(|name| name.trim_matches(['[', ']']).to_owned()).collect();
    let made =
        rcgen::generate_simple_self_signed(names).map_err(|error| TlsError::new(&keys.certificate, error))?;
    for (file, text, mode) in
        [(&keys.certificate, made.cert.pem(), 0o644), (&keys.key, made.signing_key.serialize_pem(), 0o600)]
    {
        let write = || {
            if let Some(folder) = file.parent().filter(|folder| !folder.as_os_str().is_empty()) {
                make_folder(folder)?;
            }
            let mut out = fs::OpenOptions::new().create_new(true).write(true).mode(mode).open(file)?;
            out.write_all(text.as_bytes())
        };
        write().map_err(|error| TlsError::new(file, error))?;
    }
    tracing::info!("made a self-signed certificate: {}", keys.certificate.display());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    /// To be made, in a folder that is not there yet.
    fn keys_in(folder: &Path) -> Tls {
        let folder = folder.join("tls");
        Tls { certificate: folder.join("cert.pem"), key: folder.join("key.pem"), self_signed: true }
    }

    #[test]
    fn a_certificate_that_is_good_no_more_or_not_yet_is_told_and_served() {
        let folder = tempfile::tempdir().unwrap();
        let keys = keys_in(folder.path());
        let names = || vec!["localhost".to_owned()];
        let certificate = Certificate::open(&keys, names()).unwrap();
        assert_eq!(certificate.doubtful(), None, "just made");
        for (years, words) in [((2001, 2002), "ended on 2002-"), ((2900, 2901), "is good only from 2900-")] {
            let mut params = rcgen::CertificateParams::new(names()).unwrap();
            params.not_before = rcgen::date_time_ymd(years.0, 1, 1);
            params.not_after = rcgen::date_time_ymd(years.1, 1, 1);
            let key = rcgen::KeyPair::generate().unwrap();
            fs::write(&keys.certificate, params.self_signed(&key).unwrap().pem()).unwrap();
            fs::write(&keys.key, key.serialize_pem()).unwrap();
            certificate.refresh();
            let told = certificate.doubtful().expect("it is told");
            assert!(told.contains(words) && told.contains("cert.pem"), "{told}");
            assert_eq!(certificate.ends_s(), params.not_after.unix_timestamp());
            assert!(Certificate::open(&keys, names()).unwrap().doubtful().is_some(), "at a start too");
        }
    }

    #[test]
    fn a_certificate_is_made_once_and_read_anew_when_it_changes() {
        let folder = tempfile::tempdir().unwrap();
        let keys = keys_in(folder.path());
        let names = || vec!["localhost".to_owned(), "[::1]".to_owned()];
        let certificate = Certificate::open(&keys, names()).unwrap();
        let first = fs::read(&keys.certificate).unwrap();
        Certificate::open(&keys, names()).unwrap();
        assert_eq!(fs::read(&keys.certificate).unwrap(), first, "made once");
        // A key that everybody may read is no secret any more.
        fs::set_permissions(&keys.key, fs::Permissions::from_mode(0o644)).unwrap();
        let refused = Certificate::open(&keys, names()).unwrap_err().to_string();
        assert!(refused.contains("mode 644") && refused.contains("key.pem"), "{refused}");
        fs::set_permissions(&keys.key, fs::Permissions::from_mode(0o600)).unwrap();
        let before = certificate.config();
        fs::write(&keys.certificate, "broken").unwrap();
        certificate.refresh();
        assert!(Arc::ptr_eq(&before, &certificate.config()), "a broken file leaves what was");
        for file in [&keys.certificate, &keys.key] {
            fs::remove_file(file).unwrap();
        }
        make(&keys, names()).unwrap();
        certificate.refresh();
        assert!(!Arc::ptr_eq(&before, &certificate.config()));
    }
}
