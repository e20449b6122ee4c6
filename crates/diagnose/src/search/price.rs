//! What sets cost: by their fits, and before any data.

use kort_identify::fit::Fit;

use super::{Search, Set};
use crate::flexible::{TERMS, is_term};
use crate::posterior;

impl Search<'_, '_> {
    /// Cost of a set: of its fit, and of the prior odds of each effect.
    pub fn cost(&self, set: &Set) -> f64 {
        self.fits.get(set).map_or(f64::INFINITY, |fit| self.cost_of(fit) + self.prior(set))
    }

    pub(super) fn prior(&self, set: &Set) -> f64 {
        set.iter().map(|id| self.price_of(id)).sum()
    }

    /// What speaks against a set before any data, as a natural logarithm.
    pub fn rarity(&self, set: &Set) -> f64 {
        set.iter().map(|id| self.rarity_of(id)).sum()
    }

    /// An effect is one of the catalogue, more or less common. What has no name is rarer than all of them together, and
    /// at one of the places where it may be.
    fn rarity_of(&self, id: &str) -> f64 {
        let commonness = self.descriptor(id).map_or(1.0, |d| d.commonness);
        let alike = if is_term(id) { TERMS.len() } else { self.effects.len().max(1) };
        (alike as f64 / commonness).ln()
    }

    /// What a choice among the ways in which an effect may act costs, on the scale on which a fit prices its numbers:
    /// an order of the shaft's angle is a number that happens to be whole.
    fn choice_of(&self, id: &str) -> f64 {
        let place = self.effects.iter().position(|e| e.id == id);
        2.0 * place.and_then(|k| self.ways.get(k)).map_or(0.0, |ways| (*ways as f64).ln())
    }

    /// What one more member adds to a cost before any data. Costs are tempered as a whole where they become
    /// odds, so the logarithm of its prior odds counts that much more among them.
    pub fn price_of(&self, id: &str) -> f64 {
        2.0 * self.temper() * self.rarity_of(id) + self.choice_of(id)
    }

    /// How far costs count as odds, as far as is known by now.
    pub fn temper(&self) -> f64 {
        let baseline = self.fits.get(&Set::new()).map_or(f64::NAN, Fit::cost);
        let least = self.fits.values().map(Fit::cost).fold(f64::INFINITY, f64::min);
        posterior::temper(&self.odds, baseline - least)
    }
}
