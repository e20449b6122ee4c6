//! What `fit` and `diagnose` read: recordings of one rig, its description, the model to compare.

use std::path::{Path, PathBuf};

use clap::Args;
use kort_identify::checks;
use kort_identify::data::{FEWEST_ROWS, Series};
use kort_recording::{ColumnMap, Recording, logs_in};
use kort_thruster::effects::{self, Descriptor};
use kort_thruster::models::ModelName;
use kort_thruster::rig::Rig;

use crate::failure::Failure;
use crate::files::rig_text;
use crate::outputs::Named;

/// Arguments that `fit` and `diagnose` share.
#[derive(Debug, Args)]
pub struct Input {
    /// Recordings of one rig: CSV (plain or gzip) or MCAP; several, and all in a folder, are used together
    #[arg(value_name = "REC", required = true)]
    pub recordings: Vec<PathBuf>,
    /// Rig description: what is stated of the thruster, its drive and its sensors [default: the one that a
    /// recording of the service holds]
    #[arg(long, value_name = "RIG")]
    pub rig: Option<PathBuf>,
    /// Model to compare with: model0, model1, model2, model3 or rotational_flow
    #[arg(long, value_name = "NAME", default_value = "model2")]
    pub model: ModelName,
    /// Column map for foreign logs: a shipped one or a TOML file
    #[arg(long, value_name = "NAME")]
    pub columns: Option<String>,
    /// Effects taken as present and fitted with the model, by their ids (`kort explain` lists them)
    #[arg(long, value_name = "EFFECT,…", value_delimiter = ',')]
    pub with: Vec<String>,
    /// Seed of everything drawn at random
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Threads to use [default: one a core]; the result is the same whatever their number
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub jobs: Option<u16>,
}

/// Everything read.
pub struct Loaded {
    /// Text of the rig description.
    pub rig_text: String,
    /// The rig.
    pub rig: Rig,
    /// The recordings.
    pub series: Vec<Series>,
    /// Notes of the reader, for the report.
    pub notes: Vec<String>,
    /// Rows were lost while reading, or will be left out because a sensor misbehaves there.
    pub lossy: bool,
}

impl Input {
    /// The files that are read.
    pub fn named(&self) -> Named {
        let recordings = self.recordings.iter();
        let named = recordings.fold(Named::default(), |named, path| named.reads("recording", path));
        named.reads_rig(self.rig.as_deref()).reads_map(self.columns.as_deref())
    }

    /// The effects named by `--with`.
    ///
    /// # Errors
    /// An id that the catalogue does not have, with the nearest that it has.
    pub fn known_effects(&self) -> Result<Vec<&'static Descriptor>, Failure> {
        // After a comma people put a space.
        let one = |id: &str| {
            effects::find(id).ok_or_else(|| {
                let near = effects::ALL
                    .iter()
                    .max_by(|a, b| strsim::jaro_winkler(a.id, id).total_cmp(&strsim::jaro_winkler(b.id, id)))
                    .map_or("", |e| e.id);
                Failure::input(format!(
                    "--with {id}: no effect of the catalogue\nhint: did you mean {near}? `kort explain` lists all"
                ))
            })
        };
        self.with.iter().map(|id| one(id.trim())).collect()
    }

    /// Reads all files.
    ///
    /// # Errors
    /// Names file, field, value found and what is allowed.
    pub fn load(&self) -> Result<Loaded, Failure> {
        let (recordings, skipped) = self.read()?;
        let mut loaded = self.take(recordings)?;
        for words in skipped {
            eprintln!("warning: {words}");
            loaded.notes.push(words);
            loaded.lossy = true;
        }
        Ok(loaded)
    }

    /// The recordings, and words on those that were passed over: a logger that begins a file at each reset leaves some
    /// with a header and no more, which are no reason to refuse the others.
    fn read(&self) -> Result<(Vec<Recording>, Vec<String>), Failure> {
        let map = self.columns.as_deref().map(ColumnMap::find).transpose().map_err(Failure::input)?;
        let files = self.files()?;
        let (mut recordings, mut skipped) = (Vec::new(), Vec::new());
        for (path, in_folder) in &files {
            if path.extension().is_some_and(|e| e == "json") && !path.exists() {
                let file = path.display();
                return Err(Failure::input(format!(
                    "{file}: there is no such file\nhint: --json takes no file, it prints: kort … --json > {file}"
                )));
            }
            match Recording::read(path, map.as_ref()) {
                Ok(short) if files.len() > 1 && short.rows() < FEWEST_ROWS => {
                    let rows = short.rows();
                    skipped.push(format!(
                        "{}: {rows} row(s) of data; at least {FEWEST_ROWS} are needed",
                        path.display()
                    ));
                }
                Ok(recording) => recordings.push(recording),
                Err(e) if files.len() > 1 && (*in_folder || e.has_no_rows()) => {
                    skipped.push(format!("{}: {}", e.file, e.problem));
                }
                Err(e) => return Err(Failure::input(e)),
            }
        }
        match skipped.first().filter(|_| recordings.is_empty()) {
            Some(first) => Err(Failure::input(format!(
                "none of {} files is a recording of {FEWEST_ROWS} rows or more; the first: {first}\nhint: is a column map needed (`kort columns FILE`)? files of a row each are joined first: (cat FIRST.csv; tail -qn +2 OTHERS.csv) > all.csv",
                files.len()
            ))),
            None => {
                let passed = |words: String| format!("{words}; this file is passed over");
                Ok((recordings, skipped.into_iter().map(passed).collect()))
            }
        }
    }

    /// The files that are named, and those of named folders, which are marked.
    fn files(&self) -> Result<Vec<(PathBuf, bool)>, Failure> {
        let mut files: Vec<(PathBuf, bool)> = Vec::new();
        for path in &self.recordings {
            let inside = if path.is_dir() { logs_in(path) } else { Vec::new() };
            // A folder without any is refused as what it is when it is read.
            let marked = if inside.is_empty() {
                vec![(path.clone(), false)]
            } else {
                inside.into_iter().map(|log| (log, true)).collect()
            };
            for (path, in_folder) in marked {
                if files.iter().any(|(other, _)| *other == path) {
                    return Err(Failure::in_file(&path, "is given twice\nhint: name every recording once"));
                }
                files.push((path, in_folder));
            }
        }
        Ok(files)
    }

    /// What was read, or never was in a file, with the rig that it belongs to.
    ///
    /// # Errors
    /// As [`Input::load`].
    pub fn take(&self, recordings: Vec<Recording>) -> Result<Loaded, Failure> {
        let (rig_text, rig) = self.rig(&recordings)?;
        let mut out = Loaded { rig_text, rig, series: Vec::new(), notes: Vec::new(), lossy: false };
        for recording in recordings {
            // Said aloud too: a caller of --json may look at the exit code only.
            for loss in &recording.losses {
                eprintln!("warning: {}: {loss}", recording.name);
            }
            let named = |text: &String| format!("{}: {text}", recording.name);
            out.lossy |= !recording.losses.is_empty();
            let read = out.notes.len() + recording.losses.len();
            out.notes.extend(recording.losses.iter().chain(&recording.notes).map(named));
            if self.rig.is_none()
                && let Some(since_s) = recording.about.get("rig_since_s.2")
            {
                let words = named(&format!(
                    "another rig description was in force from {since_s} s on; the first one that the file holds is taken, --rig says otherwise"
                ));
                eprintln!("warning: {words}");
                out.notes.push(words);
            }
            if !recording.unused.is_empty() {
                out.notes.push(named(&format!(
                    "columns that the column map leaves out: {}",
                    recording.unused.join(", ")
                )));
            }
            let series = Series {
                name: recording.name,
                time_s: recording.time_s,
                columns: recording.columns.into_iter().map(|c| (c.name, c.values)).collect(),
            };
            let checked = checks::check(&series, &out.rig);
            if checked.masked.contains(&true) {
                out.lossy = true;
                out.notes[read..].iter().chain(&checked.notes).for_each(|note| eprintln!("note: {note}"));
            }
            out.series.push(series);
        }
        Ok(out)
    }

    /// The rig of `--rig`, else the one that the recordings hold: all of them the same.
    fn rig(&self, recordings: &[Recording]) -> Result<(String, Rig), Failure> {
        if let Some(path) = &self.rig {
            let text = rig_text(path)?;
            let rig = Rig::from_toml_with_all(&text).map_err(|wrong| Failure::in_file_all(path, wrong))?;
            return Ok((text, rig));
        }
        let mut held: Option<(&String, &Path)> = None;
        for recording in recordings {
            let path = Path::new(&recording.name);
            let Some(text) = recording.about.get("rig") else {
                return Err(Failure::in_file(path, "holds no rig description\nhint: name it with --rig RIG"));
            };
            if let Some((other, first)) = held.filter(|(other, _)| *other != text) {
                let words = format!(
                    "holds another rig description ({} bytes) than {} ({} bytes)\nhint: recordings of one rig belong together; --rig RIG says which counts",
                    text.len(),
                    first.display(),
                    other.len()
                );
                return Err(Failure::in_file(path, words));
            }
            held = Some((text, path));
        }
        let (text, path) = held.ok_or_else(|| Failure::failed("no recording is named"))?;
        let rig =
            Rig::from_toml(text).map_err(|e| Failure::in_file(path, format!("its rig description: {e}")))?;
        Ok((text.clone(), rig))
    }

    /// Runs work on the asked number of threads.
    ///
    /// # Errors
    /// The threads cannot be started.
    pub fn on_threads<T: Send>(&self, work: impl FnOnce() -> T + Send) -> Result<T, Failure> {
        let threads = self.jobs.map_or(0, usize::from);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(Failure::failed)?;
        Ok(pool.install(work))
    }
}
