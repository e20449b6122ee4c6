//! The source itself: which way crates depend, what pure crates may touch, files that nothing uses,
//! files that grow too long, pages that are missing.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use kort_proto::faults::Fault;
use kort_thruster::effects;

/// What each crate of ours may depend on. Anything else is a wrong turn.
const DIRECTION: &[(&str, &[&str])] = &[
    ("crates/complaints", &[]),
    ("crates/thruster", &["kort-complaints"]),
    ("crates/scenario", &["kort-thruster"]),
    ("crates/truth", &[]),
    ("crates/proof", &["kort-truth", "kort-recording"]),
    ("crates/emulators", &["kort-thruster", "kort-proto"]),
    ("proto", &["kort-complaints"]),
    ("crates/recording", &["kort-complaints", "kort-proto"]),
    ("crates/control", &["kort-thruster"]),
    ("crates/identify", &["kort-thruster"]),
    ("crates/diagnose", &["kort-thruster", "kort-scenario", "kort-identify"]),
    ("crates/calibrate", &["kort-thruster", "kort-identify", "kort-proto"]),
    ("crates/reproduce", &["kort-thruster"]),
    ("crates/soak", &["kort-thruster", "kort-scenario", "kort-control", "kort-proto"]),
    ("services/servo", &["kort-thruster", "kort-scenario", "kort-proto"]),
    ("services/controller", &["kort-thruster", "kort-control", "kort-proto"]),
    ("services/gateway", &["kort-thruster", "kort-scenario", "kort-control", "kort-recording", "kort-proto"]),
    (
        "services/lab",
        &[
            "kort-thruster",
            "kort-scenario",
            "kort-control",
            "kort-recording",
            "kort-identify",
            "kort-diagnose",
            "kort-calibrate",
            "kort-truth",
            "kort-proof",
            "kort-reproduce",
            "kort-soak",
            "kort-proto",
            "kort-servo",
            "kort-controller",
        ],
    ),
    ("python", &["kort-lab", "kort-recording", "kort-thruster"]),
    (".", &["kort-servo", "kort-controller", "kort-gateway", "kort-lab", "kort-proto"]),
];

/// Crates without clock, thread, file or socket.
const PURE: &[&str] = &[
    "crates/complaints",
    "crates/thruster",
    "crates/scenario",
    "crates/truth",
    "crates/proof",
    "crates/control",
    "crates/identify",
    "crates/diagnose",
    "crates/calibrate",
    "crates/reproduce",
    "crates/soak",
];

/// Most lines of a source file.
const LINES: usize = 400;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read(path: impl AsRef<Path>) -> String {
    let path = root().join(path);
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Rust files under a folder, relative to the repository.
fn sources(folder: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut open = vec![root().join(folder)];
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                found.push(path.strip_prefix(root()).unwrap().to_path_buf());
            }
        }
    }
    found.sort();
    found
}

fn every_source() -> Vec<PathBuf> {
    ["crates", "services", "proto", "python", "tests", "benches"].iter().flat_map(|f| sources(f)).collect()
}

/// A file's code: comments, and what only tests see, left out.
fn code(path: &Path) -> String {
    let text = read(path);
    let shipped = text.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
    shipped.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
}

/// Names in one table of a crate's manifest.
fn dependencies(folder: &str, table: &str) -> BTreeSet<String> {
    let manifest: toml::Table = read(Path::new(folder).join("Cargo.toml")).parse().unwrap();
    manifest
        .get(table)
        .and_then(toml::Value::as_table)
        .map(|t| t.keys().cloned().collect())
        .unwrap_or_default()
}

#[test]
fn crates_depend_in_one_direction() {
    let mut folders = BTreeSet::from([".".to_string()]);
    let manifest: toml::Table = read("Cargo.toml").parse().unwrap();
    for member in manifest["workspace"]["members"].as_array().unwrap() {
        match member.as_str().unwrap().strip_suffix("/*") {
            None => folders.insert(member.as_str().unwrap().into()),
            Some(parent) => {
                for entry in std::fs::read_dir(root().join(parent)).unwrap() {
                    folders.insert(format!("{parent}/{}", entry.unwrap().file_name().to_string_lossy()));
                }
                true
            }
        };
    }
    let listed: BTreeSet<String> = DIRECTION.iter().map(|d| d.0.to_string()).collect();
    assert_eq!(folders, listed, "a crate without its line in DIRECTION, or the other way round");
    for (folder, allowed) in DIRECTION {
        for name in dependencies(folder, "dependencies").iter().filter(|n| n.starts_with("kort")) {
            assert!(allowed.contains(&name.as_str()), "{folder} must not depend on {name}");
        }
    }
}

/// A dependency that no file names is dead weight: it is built, and nobody knows why.
#[test]
fn every_dependency_is_used() {
    for (folder, _) in DIRECTION {
        let places =
            if *folder == "." { vec!["services/kort".to_string()] } else { vec![format!("{folder}/src")] };
        let tests = ["tests", "benches", "examples"].map(|f| Path::new(folder).join(f));
        for table in ["dependencies", "dev-dependencies"] {
            let mut files: Vec<PathBuf> = places.iter().flat_map(|f| sources(f)).collect();
            if table == "dev-dependencies" {
                let there = tests.iter().filter(|f| root().join(f).is_dir());
                files.extend(there.flat_map(|f| sources(&f.to_string_lossy())));
            }
            let texts: Vec<String> = files.iter().map(read).collect();
            for name in dependencies(folder, table) {
                let word = name.replace('-', "_");
                let used = texts.iter().any(|text| text.contains(&word));
                assert!(used, "{folder}/Cargo.toml: [{table}] has {name}, which nothing there uses");
            }
        }
    }
}

#[test]
fn pure_crates_have_no_clock_thread_file_or_socket() {
    const OUTSIDE: &[&str] = &[
        "tokio",
        "axum",
        "iceoryx2",
        "rustix",
        "libc",
        "ureq",
        "tokio-tungstenite",
        "prometheus",
        "clap",
        "tempfile",
    ];
    for folder in PURE {
        let used = dependencies(folder, "dependencies");
        for name in OUTSIDE {
            assert!(!used.contains(*name), "{folder} is pure and must not depend on {name}");
        }
        assert!(
            matches!(*folder, "crates/identify" | "crates/diagnose") || !used.contains("rayon"),
            "{folder}: threads belong to identify and diagnose"
        );
        // A program beside the library may write files.
        let library =
            sources(&format!("{folder}/src")).into_iter().filter(|p| !p.parent().unwrap().ends_with("bin"));
        for path in library {
            let code = code(&path);
            for module in ["time", "thread", "fs", "net", "process", "env"] {
                let name = format!("std::{module}");
                let at = code.match_indices(&name).find(|(i, _)| {
                    !code[i + name.len()..].starts_with(|c: char| c.is_alphanumeric() || c == '_')
                });
                assert!(at.is_none(), "{} is pure and must not use {name}", path.display());
            }
        }
    }
}

#[test]
fn the_truth_simulation_serves_the_proof_alone() {
    for path in sources("services").into_iter().chain(sources("crates")).chain(sources("proto")) {
        let proof = ["services/lab/src/commands/prove", "crates/proof", "crates/truth"];
        let proof = proof.iter().any(|folder| path.starts_with(folder));
        assert!(proof || !code(&path).contains("kort_truth"), "{} must not use kort_truth", path.display());
    }
    // No inverse crime: neither side knows the other's equations.
    for table in ["dependencies", "dev-dependencies"] {
        let ours: Vec<String> =
            dependencies("crates/truth", table).into_iter().filter(|n| n.starts_with("kort")).collect();
        assert!(ours.is_empty(), "crates/truth must know none of {ours:?}");
    }
}

/// Files that no `mod` line names are not compiled: they are dead.
#[test]
fn every_file_is_part_of_its_crate() {
    let all = ["crates", "services", "proto", "python"].iter().flat_map(|f| sources(f));
    for path in
        all.filter(|p| p.components().any(|c| c.as_os_str() == "src") || p.starts_with("services/kort"))
    {
        let stem = path.file_stem().unwrap().to_string_lossy().into_owned();
        let folder = path.parent().unwrap();
        if matches!(stem.as_str(), "lib" | "main") || folder.ends_with("bin") {
            continue;
        }
        let (name, folder) = if stem == "mod" {
            (folder.file_name().unwrap().to_string_lossy().into_owned(), folder.parent().unwrap())
        } else {
            (stem, folder)
        };
        let parents = [
            folder.join("mod.rs"),
            folder.join("lib.rs"),
            folder.join("main.rs"),
            folder.with_extension("rs"),
        ];
        let declared = parents.iter().filter(|p| root().join(p).is_file()).any(|p| {
            let text = read(p);
            let words = format!("mod {name};");
            // Effects are listed by name in a macro that declares them.
            let listed = text.contains("mod $name;")
                && text.split(|c: char| !c.is_alphanumeric() && c != '_').any(|word| word == name);
            listed || text.lines().map(str::trim).any(|l| l == words || l.ends_with(&format!(" {words}")))
        });
        assert!(declared, "{}: no `mod {name};` names it", path.display());
    }
}

/// One thing, one file, one line in its registry.
#[test]
fn every_effect_model_law_observer_and_estimator_is_registered() {
    let ids: BTreeSet<&str> = effects::ALL.iter().map(|e| e.id).collect();
    assert_eq!(ids.len(), effects::ALL.len(), "two effects of one name");
    for (folder, helpers) in [
        ("crates/thruster/src/effects", &["knots", "memory", "needs", "spec"][..]),
        ("crates/thruster/src/models", &["linear", "steady"]),
        ("crates/control/src/laws", &["aim", "lead", "speed_loop"]),
        ("crates/control/src/observers", &["belief", "load_torque"]),
        ("crates/control/src/estimators", &["regression"]),
    ] {
        let registry = read(Path::new(folder).join("mod.rs"));
        for path in sources(folder) {
            let name = path.file_stem().unwrap().to_string_lossy().into_owned();
            if name == "mod" || helpers.contains(&name.as_str()) {
                continue;
            }
            if folder.ends_with("effects") {
                assert!(ids.contains(name.as_str()), "{}: not in effects::ALL", path.display());
            } else {
                assert!(
                    registry.contains(&format!("\"{name}\"")),
                    "{}: no such name in mod.rs",
                    path.display()
                );
            }
        }
    }
    for id in ids {
        let file = format!("crates/thruster/src/effects/{id}.rs");
        assert!(root().join(&file).is_file(), "{id} is not in {file}");
    }
}

#[test]
fn every_effect_and_every_fault_has_its_page() {
    let catalogue = read("docs/catalogue.md");
    for effect in effects::ALL {
        assert!(catalogue.contains(&format!("`{}`", effect.id)), "docs/catalogue.md lacks {}", effect.id);
    }
    let pages: BTreeSet<String> = std::fs::read_dir(root().join("docs/faults"))
        .unwrap()
        .map(|e| e.unwrap().path().file_stem().unwrap().to_string_lossy().into_owned())
        .filter(|name| name != "README")
        .collect();
    let faults: BTreeSet<String> = Fault::ALL.iter().map(|f| f.name().to_string()).collect();
    assert_eq!(pages, faults, "docs/faults and the faults differ");
    for fault in Fault::ALL {
        let page = read(format!("docs/faults/{}.md", fault.name()));
        assert!(page.contains(&fault.code().to_string()), "docs/faults/{}.md lacks its code", fault.name());
    }
}

#[test]
fn no_file_grows_too_long() {
    for path in every_source() {
        let lines = read(&path).lines().count();
        assert!(lines <= LINES, "{} has {lines} lines; allowed: {LINES}: split it", path.display());
    }
}

/// Who adds something goes from file to file as this page says: each is there, by its end where the page has just named its folder.
#[test]
fn what_contributing_names_is_there() {
    let page = read("CONTRIBUTING.md");
    let outside_blocks: String = page.split("```").step_by(2).collect();
    let named = outside_blocks.split('`').skip(1).step_by(2);
    let paths: Vec<&str> =
        named.filter(|word| word.contains(['/', '.']) && !word.contains(['<', ' ', '*', ':', '#'])).collect();
    let is_file = |word: &&str| {
        word.ends_with(".rs") || word.ends_with(".md") || word.ends_with(".toml") || word.ends_with('/')
    };
    let sources = every_source();
    let files: Vec<&str> = paths.into_iter().filter(is_file).filter(|word| !word.contains("NAME")).collect();
    assert!(files.len() > 40, "{files:?}");
    for file in files {
        let there = root().join(file).exists()
            || sources.iter().any(|source| format!("/{}", source.display()).contains(&format!("/{file}")));
        assert!(there, "CONTRIBUTING.md names `{file}`, which is not there");
    }
}

#[test]
fn nothing_is_left_for_later() {
    for path in every_source().into_iter().filter(|p| !p.ends_with("tidy.rs")) {
        let code = code(&path);
        for left in ["todo!", "unimplemented!", "dbg!", "FIXME", "XXX"] {
            assert!(!code.contains(left), "{}: {left}", path.display());
        }
    }
}
