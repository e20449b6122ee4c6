//! The shipped configurations: each is readable, and each law has the file of its name.

use kort_control::{ControllerConfig, LawKind};

const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/controllers");

#[test]
fn every_law_has_its_file() {
    for law in LawKind::ALL {
        let text = std::fs::read_to_string(format!("{FOLDER}/{}.toml", law.name())).unwrap();
        assert_eq!(ControllerConfig::from_toml(&text).unwrap().law, law);
    }
}

#[test]
fn every_file_is_readable() {
    for file in std::fs::read_dir(FOLDER).unwrap() {
        let path = file.unwrap().path();
        ControllerConfig::from_toml(&std::fs::read_to_string(&path).unwrap())
            .unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    }
}
