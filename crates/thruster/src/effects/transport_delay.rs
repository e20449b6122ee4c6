//! A dead time between command and drive: bus, scheduler, serial line.

use super::{Available, Descriptor, Effect, Hooks, Path, Scale, Spec, one_start};
use crate::plant::{Drive, Tick};
use crate::rig::Rig;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "transport_delay",
    path: Path::Drive,
    what: "dead time between command and drive, from a bus or a scheduler",
    equation: "i* = u(t - td); td [s]",
    signature: "nothing moves until td after each edge, at every amplitude; phase falls linearly with frequency",
    confused_with: &["amplifier_lag", "clock_skew", "encoder_filter_lag"],
    separated_by: "steps cross-correlated channel by channel; a chirp (phase slope against roll-off)",
    reference: "physics.md C2",
    parameters,
    starts: one_start,
    needs: commanded,
    build: |values, context| Box::new(TransportDelay { delay_s: values[0].max(0.0), tick_s: context.tick_s, past: Vec::new() }),
};

fn parameters(scale: &Scale) -> Vec<Spec> {
    vec![Spec::strength("delay_s", "s", 2.0 * scale.tick_s, 0.0, 0.2)]
}

/// Needs a command: a recorded current or speed that drives the model has the delay behind it.
pub(super) fn commanded(_: &Rig, available: &Available) -> Result<(), &'static str> {
    if available.current_prescribed || available.shaft_prescribed {
        Err("a recorded response drives the model, so what lies between command and that response is not seen")
    } else {
        Ok(())
    }
}

struct TransportDelay {
    delay_s: f64,
    tick_s: f64,
    past: Vec<f64>,
}

impl Effect for TransportDelay {
    fn hooks(&self) -> Hooks {
        Hooks::DRIVE
    }

    /// The delay is rounded up to ticks by mixing the two neighbours, so that the response is
    /// continuous in the delay.
    fn drive(&mut self, _: &Tick, drive: &mut Drive) {
        let ticks = self.delay_s / self.tick_s;
        let whole = ticks.floor() as usize;
        if self.past.is_empty() {
            self.past = vec![drive.command; whole + 2];
        }
        self.past.rotate_right(1);
        self.past[0] = drive.command;
        let part = ticks - whole as f64;
        drive.command = self.past[whole] * (1.0 - part) + self.past[whole + 1] * part;
    }
}
