//! Noise, a kind a file: what every recording has and no report should make a finding of. A few
//! kinds are small effects with a name; a report that gives it is not wrong ([`Kind::names`]).

use crate::dice::Dice;
use crate::log::Table;
use crate::machine::{Machine, Scale};
use crate::physics::Physics;

macro_rules! kinds {
    ($($name:ident),* $(,)?) => {
        $(mod $name;)*
        /// Every kind.
        pub const ALL: &[&Kind] = &[$(&$name::KIND),*];
    };
}

kinds!(white, turbulence, drift, turn_ripple, quantisation, dropouts, outliers, rig_resonance, warm_up, gaps,);

/// Noise at work.
pub enum Noise {
    /// In the machine or its sensors.
    Physical(Box<dyn Physics>),
    /// In the log.
    Logged(Box<dyn Spoil>),
}

/// What happens to rows and cells on the way into the file.
pub trait Spoil {
    /// Spoils a table; `full` gives each column's full scale.
    fn spoil(&mut self, table: &mut Table, dice: &mut Dice);
}

/// A kind of noise.
pub struct Kind {
    /// Name.
    pub name: &'static str,
    /// Catalogue ids that name it rightly.
    pub names: &'static [&'static str],
    /// How often it is there.
    pub share: f64,
    /// Whether a machine may have it.
    pub fits: fn(&Machine) -> bool,
    /// Draws its level.
    pub draw: fn(&Machine, &Scale, &mut Dice) -> Noise,
}

/// Largest magnitude of a column's cells, outliers left out.
fn full_scale(cells: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = cells.iter().filter(|cell| cell.is_finite()).map(|cell| cell.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    sizes.get(sizes.len().saturating_sub(1 + sizes.len() / 200)).copied().unwrap_or(0.0)
}

/// A command or a set-point: known, not measured.
fn commanded(name: &str) -> bool {
    name.contains("_cmd")
}
