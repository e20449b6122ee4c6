//! The pages of docs as a reader follows them: their `sh` blocks in order, in one shell and an empty folder; each line
//! of a `text` block is looked for in what the blocks since the last one printed. `…` stands for anything.

use std::path::Path;
use std::process::{Command, Stdio};

use super::KORT;

/// Blocks that no test runs, by page and beginning, and why.
const NOT_RUN: &[(&str, &str, &str)] = &[
    (
        "docs/control.md",
        "kort soak config/scenarios/soak-{",
        "minutes of work: tests/soak.rs runs shorter scenarios",
    ),
    (
        "docs/control.md",
        "kort soak soak-recovery-drag",
        "minutes of work: tests/soak.rs runs shorter scenarios",
    ),
    (
        "docs/hardware.md",
        "kort calibrate --config",
        "minutes of a drive in real time: tests/drives/calibrate.rs does it",
    ),
    (
        "docs/measured-recordings.md",
        "kort prove --measured DIR",
        "writes the page itself, from sets that are not all here",
    ),
    ("docs/measured-recordings.md", "kort diagnose t200_static", "the whole table is not in the repository"),
    (
        "docs/index.md",
        "python benches/beside_mss.py",
        "minutes of work with Octave, MSS and PySINDy, which are fetched",
    ),
    ("docs/operations.md", "apt install ./target/debian", "installs as root: packaging/test.sh does it"),
    ("docker/README.md", "docker compose", "needs docker"),
    ("CONTRIBUTING.md", "cargo test --test tidy", "builds and runs the tests that this is one of"),
    ("CONTRIBUTING.md", "export CI=true", "how CI builds: nothing is printed"),
    (
        "python/README.md",
        "pip install",
        "builds in release: python/tests/run.sh builds and installs the same wheel",
    ),
];

/// Is this block of a page run by nobody?
fn is_left_out(page: &str, commands: &str) -> bool {
    NOT_RUN.iter().any(|(of, start, _)| *of == page && commands.trim_start().starts_with(start))
}

/// What a page holds of both kinds, in order.
enum Block {
    Run(String),
    Seen(Vec<String>),
}

fn blocks(page: &str) -> Vec<Block> {
    let fenced = page.split("```").skip(1).step_by(2);
    fenced
        .filter_map(|block| {
            let (kind, text) = block.split_once('\n')?;
            match kind {
                "sh" => Some(Block::Run(text.into())),
                "text" => Some(Block::Seen(text.lines().map(str::to_owned).collect())),
                _ => None,
            }
        })
        .collect()
}

/// Is `wanted` somewhere in `line`, with anything in place of each `…`?
fn shows(line: &str, wanted: &str) -> bool {
    let mut rest = line;
    wanted.split('…').all(|part| match rest.find(part) {
        Some(at) => {
            rest = &rest[at + part.len()..];
            true
        }
        None => false,
    })
}

/// Lines that build, start or test kort itself: the test has done so.
fn is_done(line: &str) -> bool {
    ["cargo ", "tests/run.sh"].iter().any(|start| line.starts_with(start))
}

/// What a page may take. Its own waits end before: each sleeps, and none may sleep past two thirds of this.
const LONGEST_S: u32 = 600;

/// Stands before a page's commands: every wait ends, and what the page started ends with it.
fn prelude() -> String {
    format!(
        r#"exec 2>&1
set -e
curl() {{ command curl --max-time 10 "$@"; }}
sleep() {{ [ $SECONDS -lt {} ] || {{ echo "waited too long"; exit 1; }}; command sleep "$@"; }}
trap 'for job in $(jobs -p); do kill -TERM $job || true; done; wait' EXIT
"#,
        LONGEST_S / 3 * 2
    )
}

/// Runs a page of the repository, with the program that the tests built in place of what `cargo` would build, and the
/// service at `port`, slow enough for a machine full of tests; test signals are shorter. What was printed.
///
/// # Panics
/// A line of a `text` block is not printed, the service answers with a problem, a command is not found, or it takes
/// too long.
pub fn follow(page: &str, port: u16) -> String {
    follow_with(page, port, &[])
}

/// The same with files that the page takes for granted.
///
/// # Panics
/// As [`follow`].
pub fn follow_with(page: &str, port: u16, given: &[(&str, &[u8])]) -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(root.join(page)).unwrap();
    let text =
        text.replace("rate_hz = 50,", "rate_hz = 10,").replace("\"duration_s\": 20", "\"duration_s\": 12");
    let folder = tempfile::tempdir().unwrap();
    for shared in ["tests", "config", "docs"] {
        std::os::unix::fs::symlink(root.join(shared), folder.path().join(shared)).unwrap();
    }
    for (name, bytes) in given {
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    let blocks = blocks(&text);
    let mut script = prelude();
    for (i, block) in blocks.iter().enumerate() {
        match block {
            Block::Run(commands) if is_left_out(page, commands) => {}
            Block::Run(commands) => {
                for line in commands.lines().filter(|line| !is_done(line)) {
                    script += &line.replace("127.0.0.1:8080", &format!("127.0.0.1:{port}"));
                    script.push('\n');
                }
            }
            Block::Seen(_) => script += &format!("echo '<<< {i}'\n"),
        }
    }
    let programs = Path::new(KORT).parent().unwrap().display().to_string();
    // A command that hangs is killed here, with all that runs in its group.
    let done = Command::new("timeout")
        .args(["--signal=TERM", "--kill-after=5", &LONGEST_S.to_string(), "bash", "-c", &script])
        .current_dir(folder.path())
        .env("PATH", format!("{programs}:{}", std::env::var("PATH").unwrap_or_default()))
        .env("KORT_ROOT", folder.path().join("shm"))
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&done.stdout).into_owned();
    assert!(done.status.success(), "{page}: {}:\n{said}", done.status);
    assert!(!said.contains("urn:kort:problem"), "{page}: the service refused something:\n{said}");
    assert!(!said.contains("command not found"), "{page}:\n{said}");
    let mut rest = said.as_str();
    for (i, block) in blocks.iter().enumerate() {
        let Block::Seen(wanted) = block else { continue };
        let (shown, after) = rest
            .split_once(&format!("<<< {i}\n"))
            .unwrap_or_else(|| panic!("{page}: it did not come to block {i}:\n{said}"));
        for line in wanted {
            assert!(shown.lines().any(|s| shows(s, line)), "{page}: nothing shows `{line}`:\n{shown}");
        }
        rest = after;
    }
    said
}

/// Every page that shows commands, beside those that this repository's tests follow (`followed`).
///
/// # Panics
/// A page shows commands that nobody runs and nobody has said why, or a block does not say what it is.
pub fn none_is_forgotten(followed: &[&str]) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut pages: Vec<String> =
        ["README.md", "CONTRIBUTING.md", "docker/README.md", "python/README.md"].map(str::to_owned).to_vec();
    for folder in ["docs", "docs/faults"] {
        let entries = std::fs::read_dir(root.join(folder)).unwrap().map(|entry| entry.unwrap().file_name());
        let names =
            entries.map(|name| name.to_string_lossy().into_owned()).filter(|name| name.ends_with(".md"));
        pages.extend(names.map(|name| format!("{folder}/{name}")));
    }
    for page in pages {
        let text = std::fs::read_to_string(root.join(&page)).unwrap();
        for block in text.split("```").skip(1).step_by(2) {
            let (kind, commands) = block.split_once('\n').unwrap_or((block, ""));
            assert!(
                !kind.is_empty(),
                "{page}: a block does not say what it is (sh, text, toml, …):\n{commands}"
            );
            let run = followed.contains(&page.as_str()) || is_left_out(&page, commands);
            assert!(kind != "sh" || run, "{page}: nobody runs\n{commands}");
        }
    }
}

/// The number behind a word in what a page printed.
pub fn number_after(said: &str, word: &str) -> f64 {
    let (_, rest) = said.split_once(word).unwrap_or_else(|| panic!("no `{word}` in {said}"));
    let number = rest.split_whitespace().next().unwrap_or_default();
    number.parse().unwrap_or_else(|_| panic!("`{number}` behind `{word}` is no number"))
}
