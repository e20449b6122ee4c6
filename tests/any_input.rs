//! Any bytes at the entries that read what others wrote: nothing panics, and what is wrong is named with its place.
//! The same entries are fuzzed where cargo-fuzz is installed (`fuzz/`); this is the stand-in everywhere else.

#[path = "../fuzz/entry_points.rs"]
mod entry_points;
#[path = "logs/writers.rs"]
#[allow(dead_code)]
mod writers;

use std::io::Read;
use std::path::{Path, PathBuf};

use entry_points::{body, deployment, description, recording, wire};
use kort_gateway::bodies::Body;
use proptest::prelude::*;
use proptest::sample::Index;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Every file of a folder.
fn files(folder: &str) -> Vec<Vec<u8>> {
    let mut paths: Vec<PathBuf> =
        std::fs::read_dir(root().join(folder)).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    let found: Vec<Vec<u8>> =
        paths.iter().filter(|p| p.is_file()).map(|path| std::fs::read(path).unwrap()).collect();
    assert!(!found.is_empty(), "{folder} holds no seeds");
    found
}

fn texts(folder: &str) -> Vec<String> {
    files(folder).into_iter().map(|bytes| String::from_utf8(bytes).unwrap()).collect()
}

/// What breaks readers: numbers at their ends, wrong kinds, quotes, brackets, bytes that are no text.
const PIECES: &[&[u8]] = &[
    b"nan",
    b"-inf",
    b"1e999",
    b"-1e-320",
    b"9223372036854775808",
    b"-0",
    b"true",
    b"null",
    b"\"",
    b"\"\"",
    b"'",
    b"[",
    b"]",
    b"{",
    b"}",
    b"[]",
    b"{}",
    b"=",
    b",",
    b";",
    b"\t",
    b"\n",
    b"\r\n",
    b"\0",
    b"\xff\xfe",
    b"\xf0\x9f",
    b"e",
    b"1979-05-27",
    b"\\u0000",
    b"\\ud800",
    b"#",
    b".",
    b"[[effects]]\n",
    b"[x]\n",
    b"time_s",
];

/// A change of a file: where, what becomes of so many bytes there.
type Edit = (Index, usize, Index, bool);

fn edits() -> impl Strategy<Value = Vec<Edit>> {
    prop::collection::vec((any::<Index>(), 0usize..6, any::<Index>(), any::<bool>()), 1..6)
}

/// The beginnings of logs of others, one of each kind; a database is nothing without its end.
fn logs() -> &'static [Vec<u8>] {
    static LOGS: std::sync::LazyLock<Vec<Vec<u8>>> = std::sync::LazyLock::new(|| {
        let unpacked = files("tests/recordings/logs").into_iter().map(|packed| {
            let mut bytes = Vec::new();
            match flate2::read::GzDecoder::new(packed.as_slice()).read_to_end(&mut bytes) {
                Ok(_) => bytes,
                Err(_) => packed,
            }
        });
        let written = [writers::dataflash(40), writers::candump(40).into_bytes(), writers::blackbox(40)];
        let all = unpacked.chain(written);
        all.map(|mut bytes| {
            if !bytes.starts_with(b"SQLite") {
                bytes.truncate(20_000);
            }
            bytes
        })
        .collect()
    });
    &LOGS
}

fn one(of: &[Vec<u8>], at: Index) -> &[u8] {
    &of[at.index(of.len())]
}

/// Overwrites, inserts and cuts.
fn edited(seed: &[u8], edits: &[Edit]) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    for (place, taken, piece, cut) in edits {
        let at = place.index(bytes.len() + 1);
        let end = (at + taken).min(bytes.len());
        if *cut && *taken == 5 {
            bytes.truncate(at);
        } else {
            bytes.splice(at..end, PIECES[piece.index(PIECES.len())].iter().copied());
        }
    }
    bytes
}

proptest! {
    #[test]
    fn any_bytes_at_every_entry(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        wire(&bytes);
        let _ = recording(&bytes);
        if let Ok(text) = std::str::from_utf8(&bytes) {
            let _ = (description(text), deployment(text));
        }
        for kind in Body::ALL {
            let _ = body(kind, &bytes);
        }
    }

    #[test]
    fn damaged_recordings(seed in any::<Index>(), edits in edits()) {
        let seeds = [files("fuzz/seeds/csv"), files("fuzz/seeds/mcap")].concat();
        let _ = recording(&edited(one(&seeds, seed), &edits));
    }

    #[test]
    fn damaged_descriptions(seed in any::<Index>(), edits in edits()) {
        let seeds = ["thrusters", "scenarios", "controllers", "columns"].map(|f| files(&format!("config/{f}")));
        if let Ok(text) = String::from_utf8(edited(one(&seeds.concat(), seed), &edits)) {
            let _ = description(&text);
        }
    }

    #[test]
    fn damaged_deployments(edits in edits()) {
        let seed = std::fs::read(root().join("config/kort.toml")).unwrap();
        if let Ok(text) = String::from_utf8(edited(&seed, &edits)) {
            let _ = deployment(&text);
        }
    }

    #[test]
    fn damaged_answers_of_drives(seed in any::<Index>(), edits in edits()) {
        let seeds = files("fuzz/seeds/wires");
        wire(&edited(one(&seeds, seed), &edits));
    }

    #[test]
    fn damaged_bodies_and_messages(seed in any::<Index>(), edits in edits()) {
        let seeds = [files("fuzz/seeds/bodies"), files("fuzz/seeds/messages")].concat();
        let bytes = edited(one(&seeds, seed), &edits);
        for kind in Body::ALL {
            let _ = body(kind, &bytes);
        }
    }

    #[test]
    fn damaged_logs_of_others(seed in any::<Index>(), edits in edits(), flips in prop::collection::vec((any::<Index>(), 0u8..8), 0..8)) {
        let mut bytes = edited(one(logs(), seed), &edits);
        for (at, bit) in flips {
            let at = at.index(bytes.len().max(1));
            bytes.iter_mut().skip(at).take(1).for_each(|byte| *byte ^= 1 << bit);
        }
        let _ = recording(&bytes);
    }

    /// One bad cell among good rows: its line and its column are named.
    #[test]
    fn a_bad_cell_is_named_by_line_and_column(rows in 3usize..40, bad in any::<Index>(), word in "[g-z]{1,8}") {
        let bad = bad.index(rows);
        let mut text = String::from("time_s,current_cmd_a,thrust_n\n");
        for row in 0..rows {
            let cell = if row == bad { word.as_str() } else { "1.5" };
            text += &format!("{},{cell},2\n", row as f64 * 0.01);
        }
        let words = recording(text.as_bytes()).unwrap_err();
        prop_assert!(words.contains(&format!("line {}", bad + 2)) && words.contains("current_cmd_a"), "{}", words);
    }

    /// A key that nobody knows, in any section of any shipped file: it is named.
    #[test]
    fn an_unknown_key_is_named(seed in any::<Index>(), section in any::<Index>(), key in "zz[a-z]{3,6}_q") {
        let seeds = [texts("config/thrusters"), texts("config/columns")].concat();
        let text = &seeds[seed.index(seeds.len())];
        let ends: Vec<usize> = text
            .match_indices("\n[")
            .filter(|(at, _)| !text[at + 1..].starts_with("[["))
            .map(|(at, _)| at + 1 + text[at + 1..].find('\n').unwrap())
            .collect();
        let at = ends[section.index(ends.len())];
        let spoilt = format!("{}\n{key} = 1\n{}", &text[..at], &text[at..]);
        let words = description(&spoilt).unwrap_err();
        prop_assert!(words.contains(&key), "{}", words);
        let kort = std::fs::read_to_string(root().join("config/kort.toml")).unwrap();
        let words = deployment(&kort.replacen("[gateway]", &format!("[gateway]\n{key} = 1"), 1)).unwrap_err();
        prop_assert!(words.contains(&key) && words.contains("gateway"), "{}", words);
    }

    /// A field of the wrong kind, or one that nobody knows, is named; a list is no body.
    #[test]
    fn a_bad_field_is_named(key in "zz[a-z]{3,6}", number in any::<i32>()) {
        for (kind, seed) in [
            (Body::Setpoint, r#"{"thrust_n": 25.0"#),
            (Body::Lease, r#"{"holder": "bench""#),
            (Body::Controller, r#"{"controller": "velocity_servo""#),
            (Body::Excitation, r#"{"limit": 60"#),
            (Body::Rig, r#"{"revision": 1"#),
            (Body::Analysis, r#"{"last_s": 60"#),
            (Body::Recording, r#"{"name": "x""#),
            (Body::Message, r#"{"setpoint": {"thrust_n": 1}, "lease_id": "x""#),
        ] {
            prop_assert_eq!(body(kind, format!("{seed}}}").as_bytes()), Ok(()));
            let problem = body(kind, format!("{seed}, \"{key}\": {number}}}").as_bytes()).unwrap_err();
            prop_assert!(problem["detail"].as_str().unwrap().contains(&key), "{}", problem);
            let list = format!("[{number}, {number}, {number}]");
            prop_assert_eq!(&body(kind, list.as_bytes()).unwrap_err()["status"], 422);
        }
        let nested = format!("{{\"setpoint\": [{number}], \"lease_id\": \"x\"}}");
        prop_assert_eq!(&body(Body::Message, nested.as_bytes()).unwrap_err()["status"], 422);
    }
}
