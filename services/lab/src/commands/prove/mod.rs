//! `kort prove`: the blind proof of `kort diagnose`.
//!
//! Cases come from the truth simulation; `diagnose` sees the recording and the rig file alone; only
//! then are the answers opened and counted.

mod cases;
mod page;
mod score;
mod tally;

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use kort_truth::{CaseKind, REPORTING_SEED};
use rayon::prelude::*;

use crate::failure::{Failure, Outcome, print, print_json, write_text};
use crate::progress;

const EXAMPLE: &str = "\
Example: kort prove --quick --html proof.html
         kort prove --markdown docs/proof.md          (340 cases; the reported run)
         kort prove --write-cases /tmp/cases --cases 20   (cases to look at; nothing is diagnosed)

Seeds 1 to 999 were used for tuning; a proof that counts uses others (the default).";

/// Prove `diagnose` blind: hide physics, diagnose the recordings alone, open the answers
#[derive(Debug, Args)]
#[command(after_help = EXAMPLE)]
pub struct Prove {
    /// Cases in all, split as in the full proof (150 single, 100 clean, 30 pair, 30 confounded, 30 outside)
    #[arg(long, value_name = "N", conflicts_with = "quick", value_parser = clap::value_parser!(u32).range(5..=1_000_000))]
    cases: Option<u32>,
    /// A twentieth of the full proof
    #[arg(long)]
    quick: bool,
    /// First seed of the cases
    #[arg(long, value_name = "N", default_value_t = REPORTING_SEED)]
    seed: u64,
    /// Threads to use [default: one a core]; the verdicts are the same whatever their number
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    /// Print one JSON document (kort.prove/1)
    #[arg(long)]
    json: bool,
    /// Write the proof as one self-contained page
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Write the proof as a Markdown page
    #[arg(long, value_name = "FILE")]
    markdown: Option<PathBuf>,
    /// Write the cases (recording.csv, rig.toml, answer.json) and diagnose nothing
    #[arg(long, value_name = "DIR", conflicts_with_all = ["json", "html", "markdown"])]
    write_cases: Option<PathBuf>,
}

/// Cases of each kind in the full proof.
const FULL: [(CaseKind, u32); 5] = [
    (CaseKind::Single, 150),
    (CaseKind::Clean, 100),
    (CaseKind::Pair, 30),
    (CaseKind::Confounded, 30),
    (CaseKind::Outside, 30),
];

impl Prove {
    /// Does it.
    ///
    /// # Errors
    /// An output file that cannot be written.
    pub fn run(self) -> Result<Outcome, Failure> {
        let threads = self.jobs.map_or(0, usize::from);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(Failure::failed)?;
        let plan = self.plan();
        if let Some(folder) = &self.write_cases {
            let bar = progress::bar(plan.len() as u64, "cases written");
            let write =
                |&(kind, seed): &(CaseKind, u64)| cases::write(folder, kind, seed).inspect(|()| bar.inc(1));
            pool.install(|| plan.par_iter().try_for_each(write))?;
            drop(bar);
            eprintln!("wrote {} cases under {}", plan.len(), folder.display());
            return Ok(Outcome::Done);
        }
        let started = Instant::now();
        let bar = progress::bar(plan.len() as u64, "cases diagnosed");
        let mut results: Vec<score::Scored> = Vec::with_capacity(plan.len());
        let scored = |&(kind, seed): &(CaseKind, u64)| {
            let (answer, report) = cases::diagnose_blind(kind, seed);
            bar.inc(1);
            score::open(&answer, &report)
        };
        pool.install(|| plan.par_iter().map(scored).collect_into_vec(&mut results));
        drop(bar);
        eprintln!("{} cases diagnosed in {:.0} s", plan.len(), started.elapsed().as_secs_f64());

        let proof = tally::Proof::new(self.seed, results);
        if let Some(path) = &self.html {
            write_text(path, &page::html(&proof))?;
            eprintln!("wrote {}", path.display());
        }
        if let Some(path) = &self.markdown {
            write_text(path, &page::markdown(&proof))?;
            eprintln!("wrote {}", path.display());
        }
        if self.json {
            print_json(&proof.json())?
        } else {
            print(&page::text(&proof))
        }
        Ok(Outcome::Done)
    }

    /// Kind and seed of every case.
    fn plan(&self) -> Vec<(CaseKind, u64)> {
        let full: u32 = FULL.iter().map(|(_, count)| count).sum();
        let wanted = if self.quick { full / 20 } else { self.cases.unwrap_or(full) };
        let share =
            |count: u32| (f64::from(count) * f64::from(wanted) / f64::from(full)).round().max(1.0) as u64;
        FULL.iter()
            .flat_map(|&(kind, count)| (0..share(count)).map(move |index| (kind, self.seed + index)))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Cli {
        #[command(flatten)]
        prove: Prove,
    }

    fn plan(words: &[&str]) -> Vec<(CaseKind, u64)> {
        Cli::parse_from(std::iter::once(&"prove").chain(words)).prove.plan()
    }

    #[test]
    fn the_full_proof_has_the_promised_sizes_and_no_tuning_seed() {
        let plan = plan(&[]);
        for (kind, count) in FULL {
            assert_eq!(plan.iter().filter(|(k, _)| *k == kind).count(), count as usize);
        }
        assert!(plan.iter().all(|(_, seed)| *seed >= REPORTING_SEED));
    }

    #[test]
    fn a_small_proof_keeps_every_kind() {
        assert!(
            CaseKind::ALL.into_iter().all(|kind| plan(&["--cases", "5"]).iter().any(|(k, _)| *k == kind))
        );
        assert_eq!(plan(&["--quick"]).len(), 8 + 5 + 2 + 2 + 2);
    }
}
