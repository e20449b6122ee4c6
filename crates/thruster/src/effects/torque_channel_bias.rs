//! Constant offsets of torque and current: drive zero, current sensor, torque transducer.

use super::{Descriptor, Effect, Hooks, OF_THE_COMMAND, Path, Scale, Spec, always, one_start};
use crate::plant::{Balance, Drive, Local, Sensed, Tick};
use crate::real::Real;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "torque_channel_bias",
    path: Path::Sensor,
    what: "torque is off by a constant: the zero of the command, of the drive's torque or current measurement, or of the \
           torque transducer",
    equation: "shaft: kt im + b; measured: im + c, Q + d; command: u + e; b, d [N m], c [A], e in the command's unit",
    signature: "a constant in the torque balance with the same sign in both directions (dry friction changes sign); a \
                measured current or torque is off also at rest",
    confused_with: &[
        "coulomb_friction",
        "ambient_axial_flow",
        "command_dead_band",
        "forward_reverse_asymmetry",
    ],
    separated_by: "a staircase in both directions; the zeros before and after the run",
    reference: "Doebelin, Measurement Systems",
    commonness: 3.0,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[&[0], &[1], &[2], &[0, 1], &[0, 2], &[0, 1, 2], &[3]],
    parameters,
    starts: one_start,
    needs: always,
    build: both!(|values, _| Box::new(TorqueChannelBias {
        shaft_n_m: values[0],
        current_a: values[1],
        transducer_n_m: values[2],
        command: values[3]
    })),
};

fn parameters(scale: &Scale) -> Vec<Spec> {
    let (torque, current) = (scale.torque_n_m, scale.current_a);
    vec![
        Spec::strength("shaft_torque_bias_n_m", "N m", 0.02 * torque, -0.5 * torque, 0.5 * torque)
            .sigma(0.05 * torque),
        Spec::strength("current_offset_a", "A", 0.02 * current, -0.5 * current, 0.5 * current)
            .sigma(0.05 * current),
        Spec::strength("transducer_offset_n_m", "N m", 0.02 * torque, -0.5 * torque, 0.5 * torque)
            .sigma(0.05 * torque),
        Spec::strength(
            "command_offset",
            OF_THE_COMMAND,
            0.02 * scale.command,
            -0.5 * scale.command,
            0.5 * scale.command,
        )
        .sigma(0.05 * scale.command),
    ]
}

struct TorqueChannelBias<T> {
    shaft_n_m: T,
    current_a: T,
    transducer_n_m: T,
    command: T,
}

impl<T: Real> Effect<T> for TorqueChannelBias<T> {
    fn hooks(&self) -> Hooks {
        Hooks { drive: true, balance: true, sense: true, ..Hooks::NONE }
    }

    fn drive(&mut self, _: &Tick, drive: &mut Drive<T>) {
        drive.command += self.command;
    }

    /// A drive that regulates a current measured with a wrong zero does give this torque; where a
    /// recorded current drives the model, its wrong zero appears as one.
    fn balance(&self, _: &Local<T>, _: &[T], balance: &mut Balance<T>, _: &mut [T]) {
        balance.shaft_torque_n_m += self.shaft_n_m;
    }

    fn sense(&mut self, _: &Tick, sensed: &mut Sensed<T>) {
        sensed.current_a += self.current_a;
        sensed.torque_n_m += self.transducer_n_m;
    }
}
