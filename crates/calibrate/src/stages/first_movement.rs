//! The first movement: pulses that grow until the shaft sensor moves.

use super::{Stage, Step, hear, unit};
use crate::facts::{Facts, SURE, WITNESSES};
use crate::plan::Plan;
use crate::pulse::{Course, Pulse};
use crate::session::Seen;
use crate::stop::Stop;

/// Shares of the largest drive, one after another.
const SHARES: [f64; 7] = [0.005, 0.01, 0.02, 0.04, 0.08, 0.16, 0.32];
/// A free shaft of the stated inertia turns this far by a pulse, rad.
const PULSE_RAD: f64 = 0.08;
/// Pause between the halves of a pulse, s: longer than the dead time of any drive.
const PAUSE_S: f64 = 0.05;
/// More than this is no pulse any more, rad.
const RAN_ON_RAD: f64 = 1.0;

/// Pulses ahead and astern in turn.
#[derive(Default)]
pub struct FirstMovement {
    level: usize,
    pulse: Option<Pulse>,
    /// Drive and movement of the first pulse that moved the shaft.
    moved: Option<(f64, f64)>,
}

impl Stage for FirstMovement {
    fn name(&self) -> &'static str {
        "first_movement"
    }

    fn says(&self, plan: &Plan, _: &Facts) -> String {
        let unit = unit(plan.kind);
        format!(
            "pulses ahead and astern from {:.3} {unit}, growing to {:.3} {unit} at most, until the shaft sensor moves; the shaft turns by some {PULSE_RAD} rad a pulse, less than a quarter of a turn in all",
            SHARES[0] * plan.drive_max,
            SHARES[SHARES.len() - 1].min(plan.share) * plan.drive_max,
        )
    }

    fn tick(&mut self, plan: &Plan, seen: &Seen, facts: &mut Facts) -> Result<Step, Stop> {
        // Ahead and astern in turn; once it moved, the same the other way.
        let drive = match self.moved {
            Some((drive, _)) => -drive,
            None => {
                let side = if self.level.is_multiple_of(2) { 1.0 } else { -1.0 };
                side * SHARES[self.level].min(plan.share) * plan.drive_max
            }
        };
        let pulse = self.pulse.get_or_insert_with(|| Pulse::new(plan, drive, PULSE_RAD, PAUSE_S));
        let drive = pulse.drive();
        let course = pulse.tick(plan, seen);
        let (moved_rad, furthest_rad) = match course {
            Course::Under { drive: now, telling } => {
                if telling {
                    hear(seen, facts, drive.signum());
                }
                return Ok(Step::Drive(now));
            }
            Course::Over { by_first_rad, furthest_rad } => (by_first_rad, furthest_rad),
        };
        self.pulse = None;
        if furthest_rad.abs() > RAN_ON_RAD {
            return Err(Stop::RanOn { angle_rad: furthest_rad.abs(), allowed_rad: RAN_ON_RAD });
        }
        let moves = moved_rad.abs() > plan.angle_step_rad;
        match self.moved {
            Some((first, before_rad)) if moves => {
                if before_rad * moved_rad > 0.0 {
                    return Err(Stop::OneWay);
                }
                facts.first_drive = first.abs();
                facts.side = (before_rad * first).signum();
                // From here on readings weigh by speed, which is another unit, and these had hardly any.
                facts.answers = Default::default();
                facts.pushed = (0.0, seen.time_s);
                Ok(Step::Done)
            }
            // It moved one way and not the other: more is needed for both.
            Some(_) => {
                self.moved = None;
                self.louder(plan, facts)
            }
            None if moves => {
                self.moved = Some((drive, moved_rad));
                Ok(Step::Drive(0.0))
            }
            None => self.louder(plan, facts),
        }
    }
}

impl FirstMovement {
    fn louder(&mut self, plan: &Plan, facts: &Facts) -> Result<Step, Stop> {
        let now = SHARES[self.level];
        self.level += 1;
        if self.level < SHARES.len() && now < plan.share {
            return Ok(Step::Drive(0.0));
        }
        let answers = |k: usize| facts.answers[k].significance(&facts.at_rest(WITNESSES[k])).abs() > SURE;
        let seen =
            if answers(0) || answers(1) { "; thrust or flow answered, so it is the sensor" } else { "" };
        Err(Stop::NoMotion { drive: now.min(plan.share) * plan.drive_max, unit: unit(plan.kind), seen })
    }
}
