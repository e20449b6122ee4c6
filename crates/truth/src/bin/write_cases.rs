//! Writes cases of the blind proof to a folder, for tuning.

use kort_truth::{CaseKind, Selection};
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (mut kind, mut count, mut seed, mut out) = (CaseKind::Single, 10u64, 1u64, PathBuf::from("cases"));
    let mut selection = Selection::default();
    let mut args = std::env::args().skip(1);
    while let Some(flag) = args.next() {
        let value = args.next().ok_or(format!("{flag}: value missing"))?;
        match flag.as_str() {
            "--kind" => {
                kind = CaseKind::ALL
                    .into_iter()
                    .find(|k| k.name() == value)
                    .ok_or("--kind: single, clean, pair, confounded or outside")?
            }
            "--n" => count = value.parse()?,
            "--seed" => seed = value.parse()?,
            "--out" => out = PathBuf::from(value),
            "--effect" => selection.effect = Some(value),
            "--strength" => selection.strength = Some(value.parse()?),
            _ => return Err(format!("unknown option {flag}").into()),
        }
    }
    for index in 0..count {
        let case = kort_truth::case(kind, seed + index, &selection);
        let folder = out.join(format!("{}-{:04}-{}", kind.name(), seed + index, case.answer.label()));
        std::fs::create_dir_all(&folder)?;
        std::fs::write(folder.join("recording.csv"), &case.recording_csv)?;
        std::fs::write(folder.join("rig.toml"), &case.rig_toml)?;
        std::fs::write(folder.join("answer.json"), serde_json::to_string_pretty(&case.answer)?)?;
        println!("{}", folder.display());
    }
    Ok(())
}
