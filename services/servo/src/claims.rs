//! What only one device of a deployment may have: a port, a node, a channel that gives a command. Each drive and each instrument says
//! what it takes (`claims`), and here is seen that no two take the same.

use std::path::{Path, PathBuf};

use kort_proto::config::{Config, ConfigError};

/// Something that one device has to itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Claim {
    /// The key that names it, in its device's section.
    pub key: &'static str,
    /// The key's value, as a file has it.
    pub value: String,
    /// What it is, whatever it is called: the same words are the same thing.
    pub thing: String,
    /// What is allowed of it.
    pub allowed: String,
    /// What to do.
    pub hint: &'static str,
}

impl Claim {
    /// A serial port: whoever opens it second takes the first one's answers.
    pub fn port(path: &Path) -> Self {
        let hint = "/dev/serial/by-id has a name for each; several drives on one bus need an adapter each, CANopen ones an interface of the system (port = \"can0\")";
        Self::file("port", path, real(path), "one device a port", hint)
    }

    /// A file of a device, which `at` is, whatever its name.
    pub fn file(key: &'static str, named: &Path, at: PathBuf, allowed: &str, hint: &'static str) -> Self {
        let (value, thing) = (format!("{named:?}"), at.display().to_string());
        Self { key, value, thing, allowed: allowed.to_owned(), hint }
    }

    /// The one drive of a kind with this number of its maker's.
    pub fn identity(kind: &str, identity: &str) -> Self {
        Self {
            key: "identity",
            value: format!("\"{identity}\""),
            thing: format!("{kind} {identity}"),
            allowed: "one thruster a drive".to_owned(),
            hint: "which of them has it? the log of its servo tells the number of the drive that answers",
        }
    }
}

/// Where a path leads: `/dev/serial/by-id/…` and `/dev/ttyACM0` are one device. What is not there is what it is called in the
/// folder that is; two names of one device that is not plugged in yet are told when its port is opened, by its lock.
pub fn real(path: &Path) -> PathBuf {
    let in_folder = || Some(path.parent()?.canonicalize().ok()?.join(path.file_name()?));
    path.canonicalize().ok().or_else(in_folder).unwrap_or_else(|| path.to_owned())
}

/// A claim, and whose it is.
#[derive(Clone, Debug)]
pub struct Taken {
    /// The thruster.
    pub id: String,
    /// The section of its device.
    pub section: String,
    /// What it takes.
    pub claim: Claim,
}

/// A thing that two devices take.
#[derive(Debug)]
pub struct Double {
    /// Their thrusters, which may be one.
    pub ids: [String; 2],
    /// Which, what, and what to do.
    pub error: ConfigError,
}

/// What is taken more than once; each key of a device is told once.
pub fn doubles(config: &Config, taken: &[Taken]) -> Vec<Double> {
    let mut found: Vec<Double> = Vec::new();
    let mut told: Vec<(&str, &str)> = Vec::new();
    for (n, second) in taken.iter().enumerate() {
        let (section, Claim { key, value, thing, allowed, hint }) = (&second.section, &second.claim);
        let before = taken.get(..n).unwrap_or_default();
        let Some(first) = before.iter().find(|first| first.claim.thing == *thing) else { continue };
        if told.contains(&(section.as_str(), *key)) {
            continue;
        }
        told.push((section.as_str(), *key));
        let spelt = Some(&first.claim.value).filter(|spelt| *spelt != value);
        let spelt = spelt.map_or_else(String::new, |spelt| format!(" = {spelt}"));
        found.push(Double {
            ids: [first.id.clone(), second.id.clone()],
            error: config.error(format!(
                "`{section}.{key}` = {value} is `{}.{}`{spelt} too; allowed is {allowed}\nhint: {hint}",
                first.section, first.claim.key
            )),
        });
    }
    found
}
