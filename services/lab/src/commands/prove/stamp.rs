//! What a proof was made with: the commit, and the hash of the diagnosis constants.

use std::path::PathBuf;
use std::process::Command;

use kort_proof::Stamp;
use sha2::{Digest, Sha256};

/// File of the diagnosis constants, in a checkout.
const CONSTANTS: &str = "crates/diagnose/constants.toml";

/// Of the checkout that this is run in; unknown outside one.
pub fn stamp() -> Stamp {
    let Some(root) = root() else {
        return Stamp { commit: "unknown".into(), constants: "none".into() };
    };
    let head = git(&["rev-parse", "--short=12", "HEAD"]).unwrap_or_else(|| "unknown".into());
    // Changes of the sources count; what the proof itself writes does not.
    let changed = git(&[
        "status",
        "--porcelain",
        "--untracked-files=no",
        "--",
        "crates",
        "services",
        "proto",
        "Cargo.lock",
    ]);
    let mark = if changed.is_some_and(|list| !list.is_empty()) { "+" } else { "" };
    let constants = std::fs::read(root.join(CONSTANTS)).map_or_else(
        |_| "none".to_owned(),
        |bytes| Sha256::digest(&bytes).iter().take(8).map(|byte| format!("{byte:02x}")).collect(),
    );
    Stamp { commit: head + mark, constants }
}

/// Root of kort's checkout, if this is one.
fn root() -> Option<PathBuf> {
    let root = PathBuf::from(git(&["rev-parse", "--show-toplevel"])?);
    root.join("crates/proof").is_dir().then_some(root)
}

fn git(words: &[&str]) -> Option<String> {
    let output = Command::new("git").args(words).output().ok().filter(|output| output.status.success())?;
    Some(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}
