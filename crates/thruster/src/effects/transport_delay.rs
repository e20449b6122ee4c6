//! A dead time between command and drive: bus, scheduler, serial line.

use super::memory::History;
use super::{Context, Descriptor, Effect, Hooks, Path, Scale, Spec, commanded};
use crate::plant::{Drive, Tick};
use crate::real::Real;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "transport_delay",
    path: Path::Drive,
    what: "dead time between command and drive, from a bus or a scheduler",
    equation: "i* = u(t - td); td [s]",
    signature: "nothing moves until td after each edge, at every amplitude; phase falls linearly with frequency",
    confused_with: &["amplifier_lag", "clock_skew", "encoder_filter_lag"],
    separated_by: "steps cross-correlated channel by channel; a chirp (phase slope against roll-off)",
    reference: "Ljung 1999, System Identification",
    commonness: 3.0,
    shifts_time: true,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[],
    parameters,
    starts: |_| [0.02, 0.05, 0.1].map(|delay| vec![delay]).to_vec(),
    needs: commanded,
    build: both!(build),
};

fn parameters(scale: &Scale) -> Vec<Spec> {
    vec![Spec::strength("delay_s", "s", 2.0 * scale.tick_s, 0.0, 0.2).sigma(0.03)]
}

fn build<T: Real>(values: &[T], context: &Context<T>) -> Box<dyn Effect<T>> {
    Box::new(TransportDelay { delay_s: values[0], past: History::new(values[0].re(), context.tick_s) })
}

struct TransportDelay<T> {
    delay_s: T,
    past: History<T>,
}

impl<T: Real> Effect<T> for TransportDelay<T> {
    fn brisk(&self) -> bool {
        true
    }

    fn hooks(&self) -> Hooks {
        Hooks::DRIVE
    }

    /// The command is held from tick to tick, so the mix of two neighbouring ticks is its mean over this one: the
    /// response goes over smoothly from one whole number of ticks to the next.
    fn drive(&mut self, _: &Tick, drive: &mut Drive<T>) {
        self.past.push(drive.command);
        drive.command = self.past.ago(self.delay_s);
    }
}
