//! Rows are missing from the log.

use super::{Available, Context, Descriptor, Effect, Hooks, Path, one_start};
use crate::real::Real;
use crate::rig::Rig;

/// Catalogue entry. No physics: the time stamps tell it, nothing is fitted.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "log_gaps",
    path: Path::Sensor,
    what: "the log misses rows, often just after something happens, and what is late in the log looks late in the thruster",
    equation: "time from row to row far above the usual; the model runs across, only what was sampled is compared",
    signature: "time stamps more than a few usual steps apart; where the gaps follow the commands, the response seems slower, \
                or slower one way than the other",
    confused_with: &["transport_delay", "amplifier_lag", "clock_skew"],
    separated_by: "the time stamps themselves: a gap is counted, not inferred",
    reference: "measured: gaps of 90 ms after most large steps up in one logger imitate an asymmetry of up and down",
    commonness: 1.0,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[],
    parameters: |_| Vec::new(),
    starts: one_start,
    needs,
    build: both!(|values, context| Box::new(Nothing::new(values, context))),
};

fn needs(_: &Rig, _: &Available) -> Result<(), &'static str> {
    Err("the checks count gaps from the time stamps; there is nothing to fit")
}

struct Nothing;

impl Nothing {
    fn new<T: Real>(_: &[T], _: &Context<T>) -> Self {
        Self
    }
}

impl<T: Real> Effect<T> for Nothing {
    fn hooks(&self) -> Hooks {
        Hooks::NONE
    }
}
