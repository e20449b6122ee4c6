//! Which way everything counts: command, shaft sensor, thrust, flow and blade torque held against each other.

use super::{Stage, Step, hear, unit};
use crate::facts::{Facts, WITNESSES};
use crate::plan::Plan;
use crate::pulse::{Course, Pulse};
use crate::session::Seen;
use crate::stop::Stop;

/// Largest pulse as a share of the largest drive.
const SHARE: f64 = 0.32;
/// A free shaft of the stated inertia turns this far by a pulse, rad.
const PULSE_RAD: f64 = 0.2;
/// The whole way of the shaft since the session's start at which no further pulse begins, rad: within half a turn.
const WAY_RAD: f64 = 2.4;
/// Most pulses, where the sensor's way does not tell.
const PULSES: u32 = 12;

/// Short pulses with which the thruster pushes a little.
#[derive(Default)]
pub struct Direction {
    pulses: u32,
    pulse: Option<Pulse>,
}

impl Stage for Direction {
    fn name(&self) -> &'static str {
        "direction"
    }

    fn says(&self, plan: &Plan, facts: &Facts) -> String {
        format!(
            "pulses ahead and astern up to {:.3} {}, until it is sure which way thrust and flow go; the shaft turns by some {PULSE_RAD} rad a pulse, less than half a turn since the beginning{}",
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
            if sure && self.pulses >= 2 || seen.path_rad > WAY_RAD || self.pulses >= PULSES {
                contradiction(facts)?;
                self.leave_out(seen, facts);
                return Ok(Step::Done);
            }
            let side = if self.pulses.is_multiple_of(2) { 1.0 } else { -1.0 };
            // Twice what moved it first, and twice again every other pulse.
            let grown = 2.0 * facts.first_drive * f64::from(1 << (self.pulses / 2).min(6));
            let drive = grown.min(SHARE.min(plan.share) * plan.drive_max);
            self.pulses += 1;
            self.pulse = Some(Pulse::new(plan, side * drive, PULSE_RAD, 0.0));
        }
        let Some(pulse) = &mut self.pulse else { return Ok(Step::Drive(0.0)) };
        let drive = pulse.drive();
        match pulse.tick(plan, seen) {
            Course::Under { drive: now, telling } => {
                if telling {
                    hear(seen, facts, drive.signum());
                }
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
        (t, f) if t < 0.0 && f < 0.0 => return Err(Stop::PushesAstern { witness, or: "" }),
        (t, _) if t < 0.0 => {
            let or = "; if it does push ahead, `thrust_n` has the wrong sign: `scale = -1.0` for it";
            return Err(Stop::PushesAstern { witness, or });
        }
        (_, f) if f < 0.0 => {
            let or = "; if it does push ahead, `flow_m_s` has the wrong sign: `scale = -1.0` for it";
            return Err(Stop::PushesAstern { witness, or });
        }
        _ => (),
    }
    if torque < 0.0 {
        return Err(against("torque_n_m", ""));
    }
    Ok(())
}
