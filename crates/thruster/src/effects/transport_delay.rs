//! A dead time between command and drive: bus, scheduler, serial line.

use super::memory::History;
use super::{Descriptor, Effect, Hooks, Path, Scale, Spec, commanded};
use crate::plant::{Drive, Tick};

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
    parameters,
    starts: |_| [0.02, 0.05, 0.1].map(|delay| vec![delay]).to_vec(),
    needs: commanded,
    build: |values, context| Box::new(TransportDelay { delay_s: values[0], past: History::new(values[0], context.tick_s) }),
};

fn parameters(scale: &Scale) -> Vec<Spec> {
    vec![Spec::strength("delay_s", "s", 2.0 * scale.tick_s, 0.0, 0.2)]
}

struct TransportDelay {
    delay_s: f64,
    past: History,
}

impl Effect for TransportDelay {
    fn hooks(&self) -> Hooks {
        Hooks::DRIVE
    }

    fn drive(&mut self, _: &Tick, drive: &mut Drive) {
        self.past.push(drive.command);
        drive.command = self.past.ago(self.delay_s);
    }
}
