//! The inference's constants, from `constants.toml`.

use kort_identify::noise::Criterion;
use serde::Deserialize;

/// All of them.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Constants {
    /// Of the likelihood.
    pub criterion: Criterion,
    /// Of the search.
    pub search: SearchConstants,
    /// Of the odds.
    pub posterior: PosteriorConstants,
    /// Of what may be left.
    pub remainder: RemainderConstants,
}

/// What noise may be, root mean square over full scale.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RemainderConstants {
    /// Of force, torque, current and speed, above the noise from sample to sample.
    pub practical: f64,
    /// Of an axial flow.
    pub practical_flow: f64,
}

/// What the search asks for.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SearchConstants {
    /// Sets within this cost of the best are fitted exactly and can be its rivals.
    pub rivals: f64,
    /// Effects of one screen that are fitted exactly at most.
    pub exact: usize,
    /// Share of the form error of what explains a mismatch with which a set is looked at once more.
    pub closer: f64,
}

/// How costs become odds.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PosteriorConstants {
    /// Odds of two sets are `exp(-difference of cost / (2 temper))` where little is explained.
    pub temper: f64,
    /// What the temper grows to as a share of what the likeliest set costs less than the baseline.
    pub form_share: f64,
    /// What leaving a name out must cost for each that stands with it, itself included, for odds of one to one that nothing
    /// which was not fitted is right in its place.
    pub surprise: f64,
    /// Power with which those odds grow.
    pub surprise_power: f64,
    /// Factor on a name in a set that needs a nameless term: the world then holds what the catalogue does not.
    pub beside_unknown: f64,
}

/// The constants' file, as it was built in: its hash names them.
pub const TEXT: &str = include_str!("../constants.toml");

impl Constants {
    /// The constants built in.
    ///
    /// # Panics
    /// Never: a test reads the file.
    pub fn built_in() -> Self {
        toml::from_str(TEXT).expect("constants.toml is read by a test")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_is_read_and_every_constant_is_positive() {
        let c = Constants::built_in();
        for value in [
            c.criterion.form_error,
            c.criterion.own_form_error,
            c.criterion.facts_a_band,
            c.criterion.timing_s,
            c.search.rivals,
            c.search.closer,
            c.posterior.temper,
            c.posterior.form_share,
            c.posterior.surprise,
            c.posterior.surprise_power,
            c.posterior.beside_unknown,
            c.remainder.practical,
            c.remainder.practical_flow,
        ] {
            assert!(value > 0.0);
        }
        assert!(c.posterior.beside_unknown < 1.0 && c.search.exact > 1);
    }
}
