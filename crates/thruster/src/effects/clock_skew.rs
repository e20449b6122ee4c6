//! One channel's clock runs behind the others.

use super::memory::History;
use super::{Available, Descriptor, Effect, Hooks, Path, Scale, Spec};
use crate::plant::{Sensed, Tick};
use crate::real::Real;
use crate::rig::Rig;

/// Longest delay, s.
const LONGEST_S: f64 = 0.5;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "clock_skew",
    path: Path::Sensor,
    what: "one instrument is logged late against the others and the command: another clock, a buffer, a slow bus",
    equation: "y(t) = y(t - d (1 + g (t - t0))), d >= 0 [s], g [1/s], for one instrument: the force cell, the encoder (speed \
               and angle), the flow meter, or a bench with a clock of its own (thrust, torque and flow)",
    signature: "one channel, or all of one instrument, is shifted by the same time at all frequencies and amplitudes, its levels fit",
    confused_with: &[
        "transport_delay",
        "thrust_sensor_lag",
        "encoder_filter_lag",
        "flowmeter_offset_lag_location",
        "amplifier_lag",
    ],
    separated_by: "channels correlated with each other at the start and at the end of the run",
    reference: "Ljung 1999, System Identification",
    commonness: 0.7,
    shifts_time: true,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[&[0], &[1], &[2], &[3], &[0, 4], &[1, 4], &[2, 4], &[3, 4]],
    parameters,
    starts: |_| [0.04, 0.12].iter().map(|delay| vec![*delay, *delay, *delay, *delay, 0.0]).collect(),
    needs,
    build: both!(|values, context| {
        Box::new(ClockSkew {
            delay_s: [values[0] + values[3], values[1], values[2] + values[3], values[1], values[3]],
            drift_1_s: values[4],
            since_s: None,
            past: std::array::from_fn(|_| History::new(LONGEST_S, context.tick_s)),
        })
    }),
};

/// Screening looks at each instrument's delay alone. A clock that runs wrong by as much as its lateness over the
/// recording is common.
fn parameters(scale: &Scale) -> Vec<Spec> {
    let delay = |name| Spec::strength(name, "s", 0.01, 0.0, LONGEST_S).sigma(0.03);
    let once = 1.0 / scale.duration_s;
    vec![
        delay("thrust_delay_s"),
        delay("encoder_delay_s"),
        delay("flow_delay_s"),
        delay("bench_delay_s"),
        Spec::shape("drift_1_s", "1/s", 0.0, -once, 5.0 * once).prior(0.0, once),
    ]
}

fn needs(_: &Rig, available: &Available) -> Result<(), &'static str> {
    let speed = !available.shaft_prescribed && available.has("shaft_speed_rad_s");
    let angle = !available.shaft_prescribed && available.has("shaft_angle_rad");
    if speed || angle || available.has("thrust_n") || available.has("flow_m_s") {
        Ok(())
    } else {
        Err("neither thrust nor shaft speed nor flow nor shaft angle is recorded as a response")
    }
}

struct ClockSkew<T> {
    /// Of thrust, shaft speed, flow, shaft angle and torque.
    delay_s: [T; 5],
    drift_1_s: T,
    since_s: Option<f64>,
    past: [History<T>; 5],
}

impl<T: Real> Effect<T> for ClockSkew<T> {
    fn hooks(&self) -> Hooks {
        Hooks::SENSE
    }

    fn sense(&mut self, tick: &Tick, sensed: &mut Sensed<T>) {
        let passed = tick.time_s - *self.since_s.get_or_insert(tick.time_s);
        let grown = (self.drift_1_s * passed + 1.0).max(T::ZERO);
        let channels = [
            &mut sensed.thrust_n,
            &mut sensed.shaft_speed_rad_s,
            &mut sensed.flow_m_s,
            &mut sensed.shaft_angle_rad,
            &mut sensed.torque_n_m,
        ];
        for ((channel, past), delay) in channels.into_iter().zip(&mut self.past).zip(self.delay_s) {
            past.push(*channel);
            *channel = past.ago(delay * grown);
        }
    }
}
