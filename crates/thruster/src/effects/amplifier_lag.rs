//! The drive follows its command more slowly than stated.

use super::memory::{FirstOrder, SecondOrder};
use super::{Descriptor, Effect, Hooks, Path, Scale, Spec, commanded};
use crate::plant::{Drive, Tick};
use crate::real::Real;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "amplifier_lag",
    path: Path::Drive,
    what: "the drive's loop of current or speed, or a speed controller's firmware, follows the command with a longer lag than stated, or \
           swings over",
    equation: "im' = (sat(i*) - im)/(ta + e); ta stated, e [s]: the current loop; or u' = (u* - u)/tc, tc [s]: the command \
               itself, ahead of what the amplifier makes of it; or one after the other, a lag of second order; or a loop that closes with \
               Tl [s] and swings: Tl^2 u'' + 2 z Tl u' + u = u* + b 2 z Tl u*', z, b [1], b = 1 for a loop without its integral part",
    signature: "every response to a command is late and rounded by a fixed time, at all amplitudes and speeds; \
                a recorded current shows the lag itself",
    confused_with: &[
        "transport_delay",
        "encoder_filter_lag",
        "entrained_water_inertia",
        "clock_skew",
        "flexible_coupling",
    ],
    separated_by: "a chirp: phase slope against roll-off; the recorded current",
    reference: "Whitcomb & Yoerger, Comparative Experiments in the Dynamics and Model-Based Control of Marine Thrusters (their current amplifier: 2 ms)",
    commonness: 3.0,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[&[0], &[1], &[0, 1], &[2, 3, 4], &[0, 2, 3, 4]],
    parameters,
    starts: |scale| {
        [0.005_f64, 0.015, 0.05]
            .map(|lag| lag.max(scale.tick_s))
            .map(|lag| vec![lag, lag, lag, 0.7, 0.5])
            .to_vec()
    },
    needs: commanded,
    build: both!(|values, context| Box::new(AmplifierLag {
        extra_s: values[0],
        command_lag_s: values[1],
        command: FirstOrder::new(),
        // A loop much faster than a tick is none.
        closed: (values[2] > 0.1 * context.tick_s).then(|| SecondOrder::new(
            values[2],
            values[3],
            context.tick_s
        )),
        lead_s: values[4] * values[3] * values[2] * 2.0,
        tick_s: context.tick_s,
    })),
};

/// The first is negative where the drive is faster than stated; a tenth of the stated lag stays.
fn parameters(scale: &Scale) -> Vec<Spec> {
    vec![
        Spec::strength("extra_lag_s", "s", 2.0 * scale.tick_s, -0.9 * scale.tick_s, 0.5).sigma(0.02),
        Spec::strength("command_lag_s", "s", 2.0 * scale.tick_s, 0.0, 0.5).sigma(0.02),
        Spec::strength("loop_time_s", "s", 0.03_f64.max(scale.tick_s), 0.0, 0.5).sigma(0.03),
        Spec::shape("loop_damping_ratio", "1", 0.7, 0.1, 0.98).prior(0.7, 0.25),
        Spec::shape("loop_lead_share", "1", 0.5, 0.0, 1.0).prior(0.5, 0.3),
    ]
}

struct AmplifierLag<T> {
    extra_s: T,
    command_lag_s: T,
    command: FirstOrder<T>,
    closed: Option<SecondOrder<T>>,
    lead_s: T,
    tick_s: f64,
}

impl<T: Real> Effect<T> for AmplifierLag<T> {
    fn brisk(&self) -> bool {
        true
    }

    fn hooks(&self) -> Hooks {
        Hooks::DRIVE
    }

    fn drive(&mut self, _: &Tick, drive: &mut Drive<T>) {
        drive.time_constant_s = (drive.time_constant_s + self.extra_s).max(drive.time_constant_s * 0.1);
        drive.command = self.command.mean_of_held(drive.command, self.command_lag_s, self.tick_s);
        if let Some(closed) = &mut self.closed {
            let [position, rate] = closed.step(drive.command);
            drive.command = position + self.lead_s * rate;
        }
    }
}
