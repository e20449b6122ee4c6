//! Tokens: who may read, command and administer. The file holds argon2 hashes only; a token is shown once, when
//! it is made.

use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::SystemTime;

use argon2::password_hash::{PasswordHash, PasswordHasher, PasswordVerifier, SaltString};
use argon2::{Algorithm, Argon2, Params, Version};
use kort_proto::ours::{Foreign, in_our_hands, make_folder};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use subtle::ConstantTimeEq;
use thiserror::Error;

use crate::thruster::lock;

/// What a token allows; each holds what the one before it does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Reads.
    Viewer,
    /// Commands.
    Pilot,
    /// Changes configuration, and recordings of others.
    Admin,
}

impl Role {
    /// Every role, the least first.
    pub const ALL: [Role; 3] = [Role::Viewer, Role::Pilot, Role::Admin];

    /// Its word.
    pub const fn name(self) -> &'static str {
        match self {
            Role::Viewer => "viewer",
            Role::Pilot => "pilot",
            Role::Admin => "admin",
        }
    }
}

/// Who asks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Identity {
    /// Name of the token; `local` where none is asked for.
    pub name: String,
    /// What it allows.
    pub role: Role,
    /// Hash of the token it was known by; none where none is asked for.
    pub hash: Option<Arc<str>>,
}

impl Identity {
    /// Whoever asks where no token is asked for.
    pub fn local() -> Identity {
        Identity { name: LOCAL.into(), role: Role::Admin, hash: None }
    }
}

/// Who the event log names where no token is asked for.
pub const LOCAL: &str = "local";
/// Who the event log says did what a process of the service does.
pub const PROCESSES: [&str; 4] = ["servo", "controller", "gateway", "supervisor"];

/// Why the file of tokens cannot be used.
#[derive(Debug, Error)]
#[error("{}: {why}\nhint: {hint}", file.display())]
pub struct TokenError {
    file: PathBuf,
    why: String,
    hint: &'static str,
}

/// The file as written.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Book {
    #[serde(default)]
    tokens: BTreeMap<String, Entry>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    role: Role,
    hash: String,
    /// The beginning of the whole token's SHA-256: tells a wrong token from this one without argon2. Of the secret's 256
    /// random bits it leaves whoever reads the file 192 to guess, each against argon2. A token of before has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    check: Option<String>,
}

/// Bytes of the digest that `check` holds.
const CHECK: usize = 8;

fn digest(token: &str) -> [u8; 32] {
    Sha256::digest(token.as_bytes()).into()
}

fn check(token: &str) -> String {
    digest(token).iter().take(CHECK).map(|byte| format!("{byte:02x}")).collect()
}

/// What to do where somebody else could have written the file.
const FOREIGN: &str = "whoever can write there could make a token of their own; see what lies there, then give it to this user and take the right to write from others (chown, chmod go-w), or name another file with gateway.tokens in kort.toml";

/// The argon2id parameters that OWASP names for little memory: 19 MiB, two passes.
fn argon2() -> Argon2<'static> {
    let params = Params::new(19_456, 2, 1, None).unwrap_or_default();
    Argon2::new(Algorithm::Argon2id, Version::V0x13, params)
}

impl Book {
    fn read(file: &Path) -> Result<Book, TokenError> {
        let fail = |why: String| TokenError {
            file: file.to_owned(),
            why,
            hint: "`kort token new NAME --role pilot` writes this file; it must belong to the user of the service",
        };
        if let Err(Foreign { path, why }) = in_our_hands(file) {
            return Err(TokenError { file: path, why, hint: FOREIGN });
        }
        let text = match fs::read_to_string(file) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Book::default()),
            Err(error) => return Err(fail(error.to_string())),
        };
        toml::from_str(&text).map_err(|error| fail(error.to_string().trim_end().to_owned()))
    }
}

impl Book {
    /// Does an identity stand here as it was let in?
    fn holds(&self, identity: &Identity) -> bool {
        let Some(hash) = &identity.hash else { return true };
        let entry = self.tokens.get(&identity.name);
        entry.is_some_and(|entry| entry.hash == **hash && entry.role == identity.role)
    }
}

/// Makes a token and stores its hash; returns what the bearer must show.
///
/// # Errors
/// The name is not allowed or taken, or the file cannot be written.
pub fn make(file: &Path, name: &str, role: Role) -> Result<String, TokenError> {
    let fail = |why: String, hint: &'static str| TokenError { file: file.to_owned(), why, hint };
    let allowed = (1..=32).contains(&name.len())
        && name.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'-' || b == b'_');
    if !allowed {
        return Err(fail(
            format!("token name {name:?}; allowed are 1 to 32 letters, digits, `-` or `_`"),
            "the name stands in the event log: bridge, bench-2, grafana",
        ));
    }
    if PROCESSES.contains(&name) || name == LOCAL {
        return Err(fail(
            format!(
                "token name {name:?} is what the event log calls a process of the service, or whoever needs no token; allowed is any other"
            ),
            "a name that others recognise: bridge, bench-2, grafana",
        ));
    }
    let mut book = Book::read(file)?;
    if book.tokens.contains_key(name) {
        return Err(fail(
            format!("there is a token named {name:?} already"),
            "choose another name, or delete its section from this file to revoke it",
        ));
    }
    let secret: String = rand::random::<[u8; 32]>().iter().map(|byte| format!("{byte:02x}")).collect();
    let unable =
        |what: String| fail(what, "see that the random source and memory of this machine are usable");
    let salt = SaltString::encode_b64(&rand::random::<[u8; 16]>()).map_err(|e| unable(e.to_string()))?;
    let hash = argon2().hash_password(secret.as_bytes(), &salt).map_err(|e| unable(e.to_string()))?;
    let token = format!("{name}.{secret}");
    book.tokens.insert(name.to_owned(), Entry { role, hash: hash.to_string(), check: Some(check(&token)) });
    write(file, &book).map_err(|error| {
        fail(error.to_string(), "gateway.tokens in kort.toml names the file; its folder must be writable")
    })?;
    Ok(token)
}

/// Whole or not at all, and for this user's eyes only.
fn write(file: &Path, book: &Book) -> std::io::Result<()> {
    if let Some(folder) = file.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        make_folder(folder)?;
    }
    let draft = file.with_extension("draft");
    let _ = fs::remove_file(&draft);
    let mut out = fs::OpenOptions::new().create_new(true).write(true).mode(0o600).open(&draft)?;
    out.write_all(b"# Tokens of the gateway: argon2 hashes. Delete a section to revoke its token.\n")?;
    out.write_all(toml::to_string(book).map_err(std::io::Error::other)?.as_bytes())?;
    out.sync_all()?;
    fs::rename(draft, file)
}

/// Checks tokens against the file, which is read anew when it changed.
#[derive(Debug)]
pub struct Tokens {
    file: PathBuf,
    known: Mutex<Known>,
}

#[derive(Debug, Default)]
struct Known {
    stamp: Option<Stamp>,
    book: Book,
    /// SHA-256 of tokens that argon2 has accepted: it need not be asked for each request.
    accepted: Vec<([u8; 32], Identity)>,
}

impl Tokens {
    /// The tokens of a file.
    ///
    /// # Errors
    /// It is there and cannot be read.
    pub fn open(file: &Path) -> Result<Tokens, TokenError> {
        let known = Known { stamp: stamp(file), book: Book::read(file)?, accepted: Vec::new() };
        Ok(Tokens { file: file.to_owned(), known: Mutex::new(known) })
    }

    /// How many tokens there are.
    pub fn count(&self) -> usize {
        self.refresh();
        lock(&self.known).book.tokens.len()
    }

    /// Reads the file again if it changed; one that cannot be read any more revokes all.
    fn refresh(&self) {
        let now = stamp(&self.file);
        let mut known = lock(&self.known);
        if known.stamp != now {
            let book = Book::read(&self.file).unwrap_or_else(|error| {
                tracing::error!("{error}");
                Book::default()
            });
            *known = Known { stamp: now, book, accepted: Vec::new() };
        }
    }

    /// Whose token is this, if it was accepted before? Fast, and in the same time whatever is shown.
    pub fn remembered(&self, token: &str) -> Option<Identity> {
        self.refresh();
        let digest = digest(token);
        let known = lock(&self.known);
        let mut found = None;
        for (accepted, identity) in &known.accepted {
            if bool::from(accepted.ct_eq(&digest)) {
                found = Some(identity.clone());
            }
        }
        found
    }

    /// Could this be one of the tokens? False costs no argon2, and takes the same time whatever the name: a flood of wrong
    /// tokens keeps nobody waiting. As long as one in the file has no check every token could be, for else time would tell
    /// which names there are.
    pub fn is_likely(&self, token: &str) -> bool {
        let shown = check(token);
        let known = lock(&self.known);
        let tokens = &known.book.tokens;
        let name = token.split_once('.').map_or("", |(name, _)| name);
        // Of every token, so that where it stands tells nothing either.
        tokens.iter().fold(false, |likely, (of, entry)| {
            let alike = entry
                .check
                .as_ref()
                .is_none_or(|check| bool::from(check.as_bytes().ct_eq(shown.as_bytes())) & (of == name));
            likely | alike
        })
    }

    /// Whose token is this? Takes tens of milliseconds, the same for a name that is not known.
    pub fn verify(&self, token: &str) -> Option<Identity> {
        let (name, secret) = token.split_once('.')?;
        let entry = lock(&self.known).book.tokens.get(name).cloned();
        // A hash of nothing that anybody knows: the work is the same.
        const NOBODY: &str =
            "$argon2id$v=19$m=19456,t=2,p=1$bm9ib2R5bm9ib2R5$qqq6ZbDQ6HfmTqQF1vJTUVg9BFRbnpBv2q1wIqnWVJc";
        let hash = entry.as_ref().map_or(NOBODY, |entry| entry.hash.as_str());
        let matches = PasswordHash::new(hash)
            .is_ok_and(|hash| argon2().verify_password(secret.as_bytes(), &hash).is_ok());
        let Entry { role, hash, .. } = entry.filter(|_| matches)?;
        let identity = Identity { name: name.to_owned(), role, hash: Some(hash.into()) };
        let digest = digest(token);
        let mut known = lock(&self.known);
        // The file may have changed meanwhile.
        if !known.book.holds(&identity) {
            return None;
        }
        known.accepted.push((digest, identity.clone()));
        Some(identity)
    }

    /// Is there a token of this name that may command?
    pub fn commands(&self, name: &str) -> bool {
        self.refresh();
        lock(&self.known).book.tokens.get(name).is_some_and(|entry| entry.role >= Role::Pilot)
    }

    /// Is what somebody was let in by still in force? A stream outlives many a change of the file.
    pub fn stands(&self, identity: &Identity) -> bool {
        self.refresh();
        lock(&self.known).book.holds(identity)
    }
}

/// Content, and whose it is: time of change, size, owner and mode.
type Stamp = (SystemTime, u64, u32, u32);

fn stamp(file: &Path) -> Option<Stamp> {
    let about = fs::metadata(file).ok()?;
    Some((about.modified().ok()?, about.len(), about.uid(), about.mode()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    #[test]
    fn a_token_is_known_by_its_secret_and_only_its_hash_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("state/tokens.toml");
        let token = make(&file, "bridge", Role::Pilot).unwrap();
        let kept = fs::read_to_string(&file).unwrap();
        assert!(!kept.contains(token.split_once('.').unwrap().1) && kept.contains("$argon2id$"), "{kept}");
        let tokens = Tokens::open(&file).unwrap();
        assert_eq!(tokens.remembered(&token), None);
        let bridge = tokens.verify(&token).unwrap();
        assert_eq!((bridge.name.as_str(), bridge.role), ("bridge", Role::Pilot));
        assert_eq!(tokens.remembered(&token), Some(bridge.clone()));
        make(&file, "bench", Role::Viewer).unwrap();
        assert!(tokens.stands(&bridge), "another token is no reason");
        for wrong in
            ["bridge.", "bridge", "", "nobody.abc", &format!("{token}0"), &token.replace("bridge", "bench")]
        {
            assert_eq!(tokens.verify(wrong), None, "{wrong}");
            assert_eq!(tokens.remembered(wrong), None, "{wrong}");
            assert!(!tokens.is_likely(wrong), "{wrong} costs argon2");
        }
        assert!(tokens.is_likely(&token));
        assert!(make(&file, "bridge", Role::Admin).unwrap_err().to_string().contains("already"));
        assert!(make(&file, "a b", Role::Admin).unwrap_err().to_string().contains("hint:"));
        // What others may write is believed no more, the moment they may.
        fs::set_permissions(&file, fs::Permissions::from_mode(0o666)).unwrap();
        assert!(Tokens::open(&file).unwrap_err().to_string().contains("mode 666"));
        fs::set_permissions(&file, fs::Permissions::from_mode(0o600)).unwrap();
        // One that a version before made has no check: it is known all the same, and every token could be it.
        let without: Vec<_> = kept.lines().filter(|line| !line.starts_with("check")).collect();
        fs::write(&file, without.join("\n")).unwrap();
        assert_eq!(tokens.remembered(&token), None);
        assert!(tokens.is_likely("nobody.abc"));
        assert_eq!(tokens.verify(&token).map(|bridge| bridge.name), Some("bridge".into()));
        fs::write(&file, "").unwrap();
        assert_eq!(tokens.remembered(&token), None, "revoked without a restart");
        assert!(!tokens.stands(&bridge), "and whoever is in by it is out");
    }

    #[test]
    fn roles_are_in_order() {
        assert!(Role::ALL.windows(2).all(|w| w[0] < w[1]));
    }
}
