//! `kort prove --measured`: folders in, the comparison with their keys out.

use std::path::{Path, PathBuf};

use kort_proof::concealed::{self, Concealed};
use kort_proof::measured::{Compared, Key, Measured, Set, compare};
use kort_proof::{Diagnosis, File};
use rayon::prelude::*;

use super::{Prove, diagnosis, page, stamp};
use crate::failure::{Failure, Outcome, print, print_json, read_text, write_text};
use crate::progress;

/// Marks between which the table stands in a page.
const BEGIN: &str = "<!-- kort prove --measured: begin -->";
const END: &str = "<!-- kort prove --measured: end -->";
/// Recordings of a set in which changes are hidden.
const CHANGED: usize = 3;

/// Does it.
///
/// # Errors
/// A folder, key or rig that cannot be read; an output file that cannot be written.
pub fn run(folder: &Path, prove: &Prove) -> Result<Outcome, Failure> {
    // What the checkout comes to while this runs is another program.
    let stamp = stamp::stamp();
    let sets = read(folder, &prove.set)?;
    let catalogue: Vec<&str> = kort_thruster::effects::ALL.iter().map(|effect| effect.id).collect();
    let jobs: Vec<(&Set, &File, bool)> = sets
        .iter()
        .flat_map(|set| {
            let step = set.recordings.len().div_ceil(CHANGED).max(1);
            set.recordings.iter().enumerate().map(move |(place, file)| (set, file, place % step == 0))
        })
        .collect();
    let bar = progress::bar(jobs.len() as u64, "recordings diagnosed");
    let one = |&(set, file, change): &(&Set, &File, bool)| -> Result<(Compared, Vec<Concealed>), Failure> {
        let rig = set.rig(&file.name).map_err(Failure::input)?;
        let report = diagnosis::Ours.diagnose(std::slice::from_ref(file), rig);
        let hidden = match &report {
            Ok(base) if prove.concealed && change => {
                concealed::conceal(set, file, base, concealed::ALL, &diagnosis::Ours)
                    .map_err(Failure::input)?
            }
            _ => Vec::new(),
        };
        let compared = compare::compare(&set.name, &file.name, &set.key.of(&file.name), report, &catalogue);
        bar.inc(1);
        Ok((compared, hidden))
    };
    let results = jobs.par_iter().map(one).collect::<Result<Vec<_>, _>>()?;
    drop(bar);
    let (compared, hidden): (Vec<Compared>, Vec<Vec<Concealed>>) = results.into_iter().unzip();
    let measured = Measured::new(stamp, compared, hidden.into_iter().flatten().collect());
    // The result is printed whatever becomes of its page.
    let written = prove.markdown.as_ref().map_or(Ok(()), |path| {
        write_text(path, &placed(path, &measured.markdown())?)?;
        eprintln!("wrote {}", path.display());
        Ok(())
    });
    if prove.json {
        print_json(&measured.json())?;
    } else {
        print(&page::measured_text(&measured))?;
    }
    written.map(|()| Outcome::Done)
}

/// Every folder with a key, in the order of their names.
fn read(folder: &Path, chosen: &[String]) -> Result<Vec<Set>, Failure> {
    let mut places = entries(folder)?;
    places.retain(|place| place.join("answers.toml").is_file());
    let name = |place: &Path| place.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let known: Vec<String> = places.iter().map(|place| name(place)).collect();
    if let Some(unknown) = chosen.iter().find(|wanted| !known.contains(wanted)) {
        return Err(Failure::input(format!(
            "--set {unknown}: no such set in {}\nhint: one of {}",
            folder.display(),
            known.join(", ")
        )));
    }
    if places.is_empty() {
        return Err(Failure::in_file(
            folder,
            "no folder in it holds an answers.toml\nhint: give the folder above the sets",
        ));
    }
    places.retain(|place| chosen.is_empty() || chosen.contains(&name(place)));
    places.iter().map(|place| set(place, name(place))).collect()
}

fn set(place: &Path, name: String) -> Result<Set, Failure> {
    let key = Key::read(&name, &read_text(&place.join("answers.toml"))?).map_err(Failure::input)?;
    let mut set = Set { name, key, recordings: Vec::new(), rigs: Vec::new() };
    for path in entries(place)? {
        let file = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let recorded = [".csv", ".csv.gz", ".mcap"].iter().any(|end| file.ends_with(end));
        if recorded && set.key.knows(&file) {
            let bytes = std::fs::read(&path).map_err(|error| {
                Failure::input(format!("{}: cannot be read: {error}\nhint: check the path", path.display()))
            })?;
            set.recordings.push(File { name: file, bytes });
        } else if file.ends_with(".toml") && file != "answers.toml" {
            set.rigs.push((file, read_text(&path)?));
        }
    }
    Ok(set)
}

/// What is in a folder, by name.
fn entries(folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let unread = |error: std::io::Error| {
        Failure::input(format!("{}: cannot be read: {error}\nhint: give a folder of sets", folder.display()))
    };
    let mut list = std::fs::read_dir(folder)
        .map_err(unread)?
        .map(|entry| entry.map(|entry| entry.path()))
        .collect::<Result<Vec<_>, _>>()
        .map_err(unread)?;
    list.sort();
    Ok(list)
}

/// A page with the table between its marks; a new page has nothing else.
fn placed(path: &Path, table: &str) -> Result<String, Failure> {
    let table = format!("{BEGIN}\n{table}{END}\n");
    let page = if path.exists() { read_text(path)? } else { String::new() };
    if page.trim().is_empty() {
        return Ok(format!("# Measured recordings\n\n{table}"));
    }
    match (page.split_once(BEGIN), page.split_once(END)) {
        (Some((before, _)), Some((_, after))) => {
            Ok(format!("{before}{table}{}", after.trim_start_matches('\n')))
        }
        _ => Err(Failure::in_file(
            path,
            format!("has no place for the table\nhint: put two lines into it, {BEGIN} and {END}"),
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_takes_its_place_and_leaves_the_rest() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("page.md");
        std::fs::write(&path, format!("# Head\n\n{BEGIN}\nold\n{END}\n\nTail\n")).unwrap();
        let page = placed(&path, "new\n").unwrap();
        assert_eq!(page, format!("# Head\n\n{BEGIN}\nnew\n{END}\nTail\n"));
        std::fs::write(&path, "# Another page\n").unwrap();
        assert!(placed(&path, "new\n").unwrap_err().to_string().contains("hint: put two lines"));
        assert!(placed(&folder.path().join("none.md"), "new\n").unwrap().starts_with("# Measured"));
    }
}
