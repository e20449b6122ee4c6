//! Which way everything counts: command, shaft sensor, thrust, flow and blade torque held against each other.

use super::{Stage, Step, hear, unit};
use crate::facts::{Facts, WITNESSES};
use crate::plan::Plan;
use crate::pulse::{Course, Pulse};
use crate::session::Seen;
use crate::stop::Stop;

/// Largest pulse as a share of the largest drive.
const SHARE: f64 = 0.32;
/// A free shaft of the stated inertia turns this far by a pulse while the drive grows, rad.
const PULSE_RAD: f64 = 0.05;
/// The drive grows so from pulse to pulse: over the same way to twice the speed.
const GROWS: f64 = 4.0;
/// The whole way of the shaft since the session's start that pulses may take, rad: within half a turn, with room for
/// one that goes further than the last one promised.
const WAY_RAD: f64 = 2.4;
/// Shares of what is left of it that the second pulse at the largest drive takes, and further ones: with friction and a
/// lag a long one goes further than by the square of its length.
const SHARES: [f64; 2] = [0.4, 0.9];
/// The most by which they last longer than the one before, likewise, and the longest, s.
const LONGER: [f64; 2] = [4.0, 1.5];
const LONGEST_S: f64 = 0.5;
/// Most pulses, where the sensor's way does not tell.
const PULSES: u32 = 12;

/// Pulses with which the thruster pushes a little: short ones while the drive grows, then the rest of the way at one
/// drive in few long ones. Thrust goes with speed squared and noise with the root of time, so a way in one piece tells
/// more than the same way in many: it counts with its power of 5/4, and N pieces of it add up with their root.
#[derive(Default)]
pub struct Direction {
    pulses: u32,
    pulse: Option<Pulse>,
    /// How long the halves of the last pulse lasted, s, and where the way stood before it, rad.
    last: (f64, f64),
    /// Pulses at the largest drive.
    loud: u32,
}

impl Stage for Direction {
    fn name(&self) -> &'static str {
        "direction"
    }

    fn says(&self, plan: &Plan, facts: &Facts) -> String {
        format!(
            "pulses ahead and astern up to {:.3} {}, until it is sure which way thrust and flow go; the shaft turns by some {PULSE_RAD} rad a pulse, then by what is left of half a turn since the beginning, in two or a few{}",
            SHARE.min(plan.share) * plan.drive_max,
            unit(plan.kind),
            if facts.side < 0.0 {
                " (driven ahead, the shaft sensor shows astern: this finds out why)"
            } else {
                ""
            }
        )
    }

    fn tick(&mut self, plan: &Plan, seen: &Seen, facts: &mut Facts) -> Result<Step, Stop> {
        if self.pulse.is_none() {
            let sure = (0..3).all(|k| !facts.measures(WITNESSES[k]) || facts.sign_of(k) != 0.0);
            if sure && self.pulses >= 2 || seen.path_rad > WAY_RAD - PULSE_RAD || self.pulses >= PULSES {
                contradiction(facts)?;
                self.leave_out(seen, facts);
                return Ok(Step::Done);
            }
            self.pulse = Some(self.next(plan, seen, facts));
        }
        let Some(pulse) = &mut self.pulse else { return Ok(Step::Drive(0.0)) };
        let drive = pulse.drive();
        match pulse.tick(plan, seen) {
            Course::Under { drive: now, .. } => {
                // All of it tells, the brake too: a drive with a lag turns the shaft when the pulse is over.
                hear(seen, facts, drive.signum());
                Ok(Step::Drive(now))
            }
            Course::Over { .. } => {
                self.pulse = None;
                Ok(Step::Drive(0.0))
            }
        }
    }
}

impl Direction {
    /// The next pulse, ahead and astern in turn.
    fn next(&mut self, plan: &Plan, seen: &Seen, facts: &Facts) -> Pulse {
        let side = if self.pulses.is_multiple_of(2) { 1.0 } else { -1.0 };
        let most = SHARE.min(plan.share) * plan.drive_max;
        // Twice what moved it first, either way, and more from then on.
        let grown = 2.0 * facts.first_drive * GROWS.powf(f64::from(self.pulses.saturating_sub(1)));
        let drive = grown.min(most);
        let (lasted_s, from_rad) = self.last;
        let (lasts_s, angle_rad) = if self.loud == 0 {
            (plan.pulse_at_once_s(drive, PULSE_RAD), PULSE_RAD)
        } else {
            let went_rad = (seen.path_rad - from_rad).max(plan.angle_step_rad);
            let then = usize::from(self.loud > 1);
            let wanted_rad = (WAY_RAD - seen.path_rad) * SHARES[then];
            // A way grows with the square of a pulse's length, without friction.
            let longer = (wanted_rad / went_rad).sqrt().min(LONGER[then]);
            ((lasted_s * longer).clamp(2.0 * plan.period_s, LONGEST_S), wanted_rad)
        };
        self.pulses += 1;
        self.loud += u32::from(drive >= most);
        self.last = (lasts_s, seen.path_rad);
        Pulse::lasting(plan, lasts_s, side * drive, angle_rad)
    }

    /// Notes what gave no sure answer.
    fn leave_out(&self, seen: &Seen, facts: &mut Facts) {
        let why = if self.pulses == 0 {
            format!("no pulse was given, for the shaft had turned by {:.2} rad already", seen.path_rad)
        } else {
            "no answer within half a turn".to_owned()
        };
        for (k, signal) in WITNESSES.iter().enumerate() {
            if facts.measures(signal) && facts.sign_of(k) == 0.0 {
                let words = format!("{signal}: {why}; the first level of the working range tells");
                facts.left_out.push(("direction", words));
            }
        }
    }
}

/// Who is wrong, if anybody.
pub(super) fn contradiction(facts: &Facts) -> Result<(), Stop> {
    let (thrust, flow, torque) = (facts.sign_of(0), facts.sign_of(1), facts.sign_of(2));
    let words = |sign: f64, what: &str| match sign {
        s if s > 0.0 => Some(format!("{what} goes ahead")),
        s if s < 0.0 => Some(format!("{what} goes astern")),
        _ => None,
    };
    let told = [words(thrust, "thrust"), words(flow, "flow")];
    let witness = told.into_iter().flatten().collect::<Vec<_>>().join(" and ");
    let votes = thrust + flow;
    if facts.side < 0.0 {
        return Err(match votes {
            v if v > 0.0 => Stop::EncoderReversed { witness },
            v if v < 0.0 => Stop::MotorReversed { witness },
            _ => Stop::MotorOrEncoderReversed,
        });
    }
    let against = |signal, other: &str| Stop::SignalReversed {
        signal,
        witness: format!("driven ahead the shaft turns ahead{other}, and it goes astern"),
    };
    match (thrust, flow) {
        (t, f) if t < 0.0 && f > 0.0 => return Err(against("thrust_n", " and flow goes ahead")),
        (t, f) if t > 0.0 && f < 0.0 => return Err(against("flow_m_s", " and thrust goes ahead")),
        (t, f) if t < 0.0 && f < 0.0 => return Err(Stop::PushesAstern { witness }),
        (t, _) if t < 0.0 => return Err(Stop::SignalOrThrusterReversed { signal: "thrust_n", witness }),
        (_, f) if f < 0.0 => return Err(Stop::SignalOrThrusterReversed { signal: "flow_m_s", witness }),
        _ => (),
    }
    if torque < 0.0 {
        return Err(against("torque_n_m", ""));
    }
    Ok(())
}
