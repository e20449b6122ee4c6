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
    what: "one channel is logged late against the others and the command: another clock, a buffer, a slow bus",
    equation: "y_c(t) = y_c(t - d_c), d_c >= 0 [s] for thrust, shaft speed, flow and shaft angle; a channel logged early shows as the others late",
    signature: "one channel is shifted by the same time at all frequencies and amplitudes, its levels fit",
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
    forms: &[&[0], &[1], &[2], &[3], &[0, 1], &[0, 2], &[0, 3], &[1, 2], &[1, 3], &[2, 3], &[0, 1, 2, 3]],
    parameters,
    starts: |_| vec![vec![0.04; 4], vec![0.12; 4]],
    needs,
    build: both!(|values, context| {
        let past = || History::new(LONGEST_S, context.tick_s);
        Box::new(ClockSkew {
            delay_s: [values[0], values[1], values[2], values[3]],
            past: [past(), past(), past(), past()],
        })
    }),
};

/// Screening looks at each channel's delay alone.
fn parameters(_: &Scale) -> Vec<Spec> {
    let delay = |name| Spec::strength(name, "s", 0.01, 0.0, LONGEST_S).sigma(0.03);
    vec![delay("thrust_delay_s"), delay("speed_delay_s"), delay("flow_delay_s"), delay("angle_delay_s")]
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
    delay_s: [T; 4],
    past: [History<T>; 4],
}

impl<T: Real> Effect<T> for ClockSkew<T> {
    fn hooks(&self) -> Hooks {
        Hooks::SENSE
    }

    fn sense(&mut self, _: &Tick, sensed: &mut Sensed<T>) {
        let channels = [
            &mut sensed.thrust_n,
            &mut sensed.shaft_speed_rad_s,
            &mut sensed.flow_m_s,
            &mut sensed.shaft_angle_rad,
        ];
        for ((channel, past), delay) in channels.into_iter().zip(&mut self.past).zip(self.delay_s) {
            past.push(*channel);
            *channel = past.ago(delay);
        }
    }
}
