//! Another user of the machine who was there first, or writes where we do. As root the stranger is user 65534; as
//! anybody else only what needs no other user is tried.

use std::fs::{self, Permissions};
use std::os::unix::fs::{PermissionsExt, chown, symlink};
use std::path::Path;

use crate::LEASE_MS;
use crate::common::{self, Site, Stack, kill, run};

const STRANGER: u32 = 65534;

/// Refused at the start with these words and a hint, nothing of ours written anywhere.
fn is_refused(site: &Site, what: &Path, why: &str) {
    let out = run(&mut site.command("up"));
    let words = String::from_utf8_lossy(&out.stderr);
    assert_eq!(out.status.code(), Some(1), "{words}");
    for part in [what.to_str().unwrap(), why, "hint:", "--root"] {
        assert!(words.contains(part), "{part} is not in {words}");
    }
    assert_eq!(words.matches("error:").count(), 1, "one message: {words}");
}

/// Like `/tmp`: everybody may lay something there, nobody may take it away.
fn shared(site: &Site) {
    fs::set_permissions(site.folder.path(), Permissions::from_mode(0o1777)).unwrap();
}

const BESIDE: [&str; 6] = [
    "shm.lock",
    "shm.gateway.lock",
    "shm.generation",
    "shm.generation.new",
    "shm.watched",
    "shm.watched.new",
];

#[test]
fn what_another_user_laid_where_we_begin_is_refused_in_words() {
    let site = Site::new();
    shared(&site);
    if !rustix::process::geteuid().is_root() {
        eprintln!("not tried: files of another user (this is not root)");
        return;
    }
    let forged = r#"{"thrusters": {"t1": {"armed": true, "servo_faults": 4096}}}"#;
    for name in BESIDE {
        let file = site.folder.path().join(name);
        fs::write(&file, forged).unwrap();
        // Ours to read and write, as far as the mode goes.
        fs::set_permissions(&file, Permissions::from_mode(0o666)).unwrap();
        chown(&file, Some(STRANGER), Some(STRANGER)).unwrap();
        is_refused(&site, &file, "belongs to user 65534, this is user 0");
        assert_eq!(fs::read_to_string(&file).unwrap(), forged, "{name}");
        fs::remove_file(&file).unwrap();
    }
    fs::create_dir(site.root()).unwrap();
    fs::set_permissions(site.root(), Permissions::from_mode(0o777)).unwrap();
    chown(site.root(), Some(STRANGER), Some(STRANGER)).unwrap();
    is_refused(&site, &site.root(), "belongs to user 65534, this is user 0");
    // Who only joins believes it no more than who owns.
    let generation = format!("1 {}", kort_proto::names::MESSAGES_VERSION);
    fs::write(site.folder.path().join("shm.generation"), generation).unwrap();
    let out = run(&mut site.command("controller"));
    let words = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.code() == Some(1) && words.contains("belongs to user 65534"), "{words}");
    fs::remove_dir(site.root()).unwrap();
}

#[test]
fn a_link_that_somebody_laid_is_never_written_through() {
    common::in_real_time(|| {
        let site = Site::new();
        shared(&site);
        let victim = site.folder.path().join("victim");
        fs::write(&victim, "whole").unwrap();
        for name in BESIDE {
            let link = site.folder.path().join(name);
            symlink(&victim, &link).unwrap();
            is_refused(&site, &link, "is a link");
            fs::remove_file(link).unwrap();
        }
        // Laid under way, where the next draft will be: told, and the thrust knows nothing of it.
        let mut stack = Stack::start_at(site);
        symlink(&victim, stack.site.folder.path().join("shm.watched.new")).unwrap();
        stack.thrust(60.0, LEASE_MS);
        common::wait("the log to name it", || {
            stack.site.log().contains("shm.watched.new: is a link").then_some(())
        });
        assert_eq!(fs::read_to_string(&victim).unwrap(), "whole");
        kill(stack.supervisor.id(), "INT");
        assert!(stack.supervisor.wait().unwrap().success());
        assert_eq!(fs::read_to_string(&victim).unwrap(), "whole");
    });
}

/// What the names of a running deployment's objects in `/dev/shm` begin with.
pub fn in_shared_memory(site: &Site) -> String {
    let nodes = fs::read_dir(site.root()).unwrap().flatten().next().unwrap().path().join("nodes");
    let entry = fs::read_dir(nodes).unwrap().flatten().find(|e| e.path().is_file()).unwrap();
    entry.file_name().into_string().unwrap().split_inclusive('_').take(2).collect()
}

/// iceoryx2 gives one of its objects to everybody (the segment that counts its participants); whoever writes there
/// keeps a gateway's successor from starting. Nothing of ours in `/dev/shm` is anybody else's, successors' included.
#[test]
fn nothing_in_shared_memory_can_be_opened_by_others() {
    common::in_real_time(|| {
        let stack = Stack::start();
        let prefix = in_shared_memory(&stack.site);
        let are_ours = || {
            let objects: Vec<_> = fs::read_dir("/dev/shm")
                .unwrap()
                .flatten()
                .filter(|object| object.file_name().to_string_lossy().starts_with(&prefix))
                .collect();
            assert!(
                objects.iter().any(|object| object.file_name().to_string_lossy().ends_with("global_mgmt"))
            );
            for object in objects {
                // One that is being removed this moment is nobody's.
                let Ok(about) = object.metadata() else { continue };
                let mode = about.permissions().mode() & 0o777;
                assert_eq!(mode & 0o077, 0, "{}: mode {mode:o}", object.path().display());
            }
        };
        are_ours();
        for role in ["gateway", "controller", "servo"] {
            let first = stack.process_of(role);
            kill(first, "KILL");
            common::wait("a successor", || stack.process(role).filter(|process| *process != first));
            stack.wait_until_up();
            are_ours();
        }
    });
}

/// What is believed (tokens) and what is written on and on (events, rigs) lies in nobody else's hands, folder and file.
#[test]
fn what_another_user_could_write_is_neither_believed_nor_gone_on_with() {
    let site = Site::new();
    let state = site.folder.path().join("state");
    let text = fs::read_to_string(site.config()).unwrap();
    let ours = format!("{}/", site.folder.path().display());
    let theirs = format!(
        "rigs = \"{0}/rigs\"\nevents = \"{0}/events\"\ntokens = \"{0}/tokens.toml\"\n",
        state.display()
    );
    let kept =
        text.lines().filter(|l| !l.starts_with("events") && !l.starts_with("tokens")).collect::<Vec<_>>();
    let text = kept.join("\n").replace("[gateway]\n", &format!("[gateway]\n{theirs}"));
    fs::write(site.config(), &text).unwrap();
    let mode = |path: &Path, mode| fs::set_permissions(path, Permissions::from_mode(mode)).unwrap();
    let refused = |path: &Path, why: &str| {
        let out = run(&mut site.command("up"));
        let words = String::from_utf8_lossy(&out.stderr);
        assert!(!out.status.success() && out.stdout.is_empty(), "{words}");
        for part in [path.to_str().unwrap(), why, "hint:", "chmod go-w"] {
            assert!(words.contains(part), "{part} is not in {words}");
        }
        assert_eq!(words.matches("error:").count(), 1, "one message: {words}");
    };
    let tokens = state.join("tokens.toml");
    fs::create_dir(&state).unwrap();
    fs::write(&tokens, "").unwrap();
    mode(&tokens, 0o666);
    refused(&tokens, "may be written by others (mode 666)");
    mode(&tokens, 0o600);
    mode(&state, 0o777);
    refused(&state, "may replace what is in it (mode 777)");
    mode(&state, 0o755);
    for folder in ["events", "rigs"].map(|name| state.join(name)) {
        fs::create_dir(&folder).unwrap();
        mode(&folder, 0o777);
        refused(&folder, "may be written by others");
        mode(&folder, 0o755);
    }
    // Recordings may lie on a disk for all, but not where others could replace them.
    let recordings = state.join("recordings");
    fs::create_dir(&recordings).unwrap();
    let kept = fs::read_to_string(site.config()).unwrap();
    let elsewhere = kept.lines().filter(|l| !l.starts_with("recordings")).collect::<Vec<_>>().join("\n");
    let named = format!("[gateway]\nrecordings = \"{}\"\n", recordings.display());
    fs::write(site.config(), elsewhere.replace("[gateway]\n", &named)).unwrap();
    mode(&recordings, 0o777);
    refused(&recordings, "may replace what is in it (mode 777)");
    mode(&recordings, 0o755);
    if rustix::process::geteuid().is_root() {
        for path in [&state, &tokens, &state.join("events")] {
            chown(path, Some(STRANGER), Some(STRANGER)).unwrap();
            refused(path, "user 65534");
            chown(path, Some(0), Some(0)).unwrap();
        }
    }
    // A key of TLS that others may write is theirs.
    let certificate = rcgen::generate_simple_self_signed(["localhost".to_owned()]).unwrap();
    let [cert, key] = ["cert.pem", "key.pem"].map(|name| site.folder.path().join(name));
    fs::write(&cert, certificate.cert.pem()).unwrap();
    fs::write(&key, certificate.signing_key.serialize_pem()).unwrap();
    mode(&key, 0o666);
    site.add("[gateway]", &format!("tls = {{ certificate = \"{ours}cert.pem\", key = \"{ours}key.pem\" }}"));
    refused(&key, "may be written by others (mode 666)");
}
