//! Seeds that a reported proof has used: none is used twice. The ledger is a TOML file of ranges, each
//! with the commit that used it; it grows by a block of text, so that what stands in it stays as it is.

use std::ops::Range;

use serde::Deserialize;
use thiserror::Error;

use crate::Stamp;

/// A range of seeds that was used.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Used {
    /// First seed.
    pub first: u64,
    /// Last seed.
    pub last: u64,
    /// By which commit.
    pub commit: String,
    /// Hash of the diagnosis constants then.
    #[serde(default)]
    pub constants: String,
    /// For what.
    #[serde(default)]
    pub what: String,
}

/// The ledger.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ledger {
    /// Ranges, oldest first.
    #[serde(default, rename = "used")]
    pub used: Vec<Used>,
}

/// Why a range of seeds may not be used.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum Refusal {
    /// Used before.
    #[error(
        "--seed {wanted}: seeds {first} to {last} were used by {commit} ({what})\nhint: --seed {free} is the first that was never used; a proof on seeds that were looked at proves nothing"
    )]
    UsedBefore {
        /// Asked for.
        wanted: u64,
        /// The range in the ledger.
        first: u64,
        /// Its last.
        last: u64,
        /// By.
        commit: String,
        /// For.
        what: String,
        /// First seed that is free.
        free: u64,
    },
    /// Seeds for tuning, without saying so.
    #[error(
        "--seed {wanted}: seeds below {reporting} are for tuning\nhint: say --tuning (nothing is then reported), or take --seed {free}"
    )]
    Tuning {
        /// Asked for.
        wanted: u64,
        /// First seed of reports.
        reporting: u64,
        /// First seed that is free.
        free: u64,
    },
    /// A tuning run on seeds that are kept for reports.
    #[error("--tuning: seed {wanted} is kept for reports\nhint: tune on seeds below {reporting}")]
    Reporting {
        /// Asked for.
        wanted: u64,
        /// First seed of reports.
        reporting: u64,
    },
}

impl Ledger {
    /// Reads one.
    ///
    /// # Errors
    /// The parser's words.
    pub fn read(text: &str) -> Result<Self, String> {
        toml::from_str(text).map_err(|error| error.to_string())
    }

    /// First seed of reports that nobody used, in whole millions.
    pub fn free(&self) -> u64 {
        const STEP: u64 = 1_000_000;
        let last =
            self.used.iter().map(|used| used.last).max().unwrap_or(0).max(kort_truth::REPORTING_SEED - 1);
        (last / STEP + 1) * STEP
    }

    /// Whether a run may use these seeds.
    ///
    /// # Errors
    /// [`Refusal`] says why not and which seeds are free.
    pub fn allow(&self, seeds: &Range<u64>, tuning: bool) -> Result<(), Refusal> {
        let reporting = kort_truth::REPORTING_SEED;
        let free = self.free();
        if tuning {
            return if seeds.end > reporting {
                Err(Refusal::Reporting { wanted: seeds.start, reporting })
            } else {
                Ok(())
            };
        }
        if seeds.start < reporting {
            return Err(Refusal::Tuning { wanted: seeds.start, reporting, free });
        }
        match self.used.iter().find(|used| used.first < seeds.end && seeds.start <= used.last) {
            Some(used) => Err(Refusal::UsedBefore {
                wanted: seeds.start,
                first: used.first,
                last: used.last,
                commit: used.commit.clone(),
                what: used.what.clone(),
                free,
            }),
            None => Ok(()),
        }
    }
}

/// The block to put behind a ledger's text for a run.
pub fn entry(seeds: &Range<u64>, stamp: &Stamp, what: &str) -> String {
    let Stamp { commit, constants } = stamp;
    format!(
        "\n[[used]]\nfirst = {}\nlast = {}\ncommit = {commit:?}\nconstants = {constants:?}\nwhat = {what:?}\n",
        seeds.start,
        seeds.end.saturating_sub(1)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeds_are_used_once() {
        let stamp = Stamp { commit: "abc".into(), constants: "1f".into() };
        let text = entry(&(3_000_000..3_000_150), &stamp, "blind proof");
        let ledger = Ledger::read(&text).unwrap();
        assert_eq!(ledger.used[0].last, 3_000_149);
        assert_eq!(ledger.free(), 4_000_000);
        let again = ledger.allow(&(3_000_149..3_000_200), false).unwrap_err();
        assert!(again.to_string().contains("hint: --seed 4000000"), "{again}");
        assert_eq!(ledger.allow(&(3_000_150..3_000_200), false), Ok(()));
        assert_eq!(Ledger::default().free(), 1_000_000);
    }

    #[test]
    fn tuning_and_reporting_seeds_do_not_mix() {
        let ledger = Ledger::default();
        assert!(matches!(ledger.allow(&(5..9), false), Err(Refusal::Tuning { .. })));
        assert_eq!(ledger.allow(&(5..9), true), Ok(()));
        assert!(matches!(ledger.allow(&(999_999..1_000_001), true), Err(Refusal::Reporting { .. })));
    }

    #[test]
    fn a_ledger_with_an_unknown_key_is_refused() {
        assert!(
            Ledger::read("[[used]]\nfirst = 1\nlast = 2\ncommit = \"a\"\nwhom = 3\n")
                .unwrap_err()
                .contains("whom")
        );
    }
}
