//! Breakaway: slow ramps from rest until the shaft begins to turn, each way three times.

use super::{Stage, Step, unit};
use crate::facts::{Breakaway, Facts};
use crate::plan::Plan;
use crate::session::Seen;
use crate::stop::Stop;

/// Ramps each way.
const RAMPS: usize = 3;
/// What three sigma of a normal are for a mean of three: more, for their scatter is known from three only
/// (Student's t for two degrees of freedom, at 99 %).
const FEW: f64 = 9.9;
/// Time from zero to the drive that moved the shaft first, s.
const RAMP_S: f64 = 2.0;
/// It turns when it has turned this far, rad.
const TURNS_RAD: f64 = 0.03;
/// Rest before a ramp, brake included, s.
const RESTS_S: f64 = 0.6;
/// Further than the first movement's drive, by this factor, is no breakaway.
const FURTHEST: f64 = 4.0;

/// Ramps, ahead and astern in turn.
#[derive(Default)]
pub struct BreakawayRamps {
    ramp: usize,
    /// When the phase began, and the angle there.
    from: Option<(f64, f64)>,
    ramping: bool,
    /// Drive and current when it last stood where it began.
    onset: (f64, f64),
    /// Mean current over some 50 ms, A.
    current_a: f64,
    /// Torque at the onset and its bound, by side.
    torques: [Vec<(f64, f64)>; 2],
}

impl Stage for BreakawayRamps {
    fn name(&self) -> &'static str {
        "breakaway"
    }

    fn says(&self, plan: &Plan, facts: &Facts) -> String {
        format!(
            "slow ramps of {:.3} {} a second, {RAMPS} ahead and {RAMPS} astern in turn, each until the shaft has turned by {TURNS_RAD} rad; it is braked then",
            facts.first_drive / RAMP_S,
            unit(plan.kind)
        )
    }

    fn tick(&mut self, plan: &Plan, seen: &Seen, facts: &mut Facts) -> Result<Step, Stop> {
        let (from_s, from_rad) = *self.from.get_or_insert((seen.time_s, seen.angle_rad));
        let since_s = seen.time_s - from_s;
        let zero_a = facts.at_rest("current_a").mean;
        if seen.fresh.current_a.is_finite() {
            let share = (plan.period_s / 0.05).min(1.0);
            self.current_a += (seen.fresh.current_a - zero_a - self.current_a) * share;
        }
        if !self.ramping {
            if since_s < RESTS_S {
                // The brake ends well before the next ramp.
                let brake = if since_s < 0.5 * RESTS_S && self.ramp > 0 {
                    plan.brake(facts.side, seen.speed_rad_s, facts.first_drive)
                } else {
                    0.0
                };
                return Ok(Step::Drive(brake));
            }
            if self.ramp == 2 * RAMPS {
                facts.breakaway = [0, 1].map(|k| summed(&self.torques[k]));
                return Ok(Step::Done);
            }
            self.ramping = true;
            self.from = Some((seen.time_s, seen.angle_rad));
            self.onset = (0.0, 0.0);
            self.current_a = 0.0;
            return Ok(Step::Drive(0.0));
        }
        let (astern, rate) = (self.ramp % 2, facts.first_drive / RAMP_S);
        let side = if astern == 1 { -1.0 } else { 1.0 };
        let moved_rad = (seen.angle_rad - from_rad).abs();
        if moved_rad <= 0.5 * plan.angle_step_rad {
            self.onset = (rate * since_s, self.current_a * side);
        }
        let drive = rate * since_s;
        if moved_rad < TURNS_RAD.max(2.0 * plan.angle_step_rad) {
            if drive > FURTHEST * facts.first_drive {
                let words = format!(
                    "no breakaway {} within {drive:.3} {}",
                    ["ahead", "astern"][astern],
                    unit(plan.kind)
                );
                facts.left_out.push(("breakaway", words));
                self.next(seen);
                return Ok(Step::Drive(0.0));
            }
            return Ok(Step::Drive(side * drive));
        }
        // From breaking away to the first step of the encoder the torque grew on: with nothing to hold the shaft it
        // turns by a t^3/6, a the growth of its acceleration.
        let growth = rate * plan.torque_per_drive;
        let unseen_s = (6.0 * 0.5 * plan.angle_step_rad * plan.inertia_kg_m2 / growth).cbrt();
        // The smoothed current is as late as its filter.
        let torque = if facts.measures("current_a") {
            plan.torque_constant_nm_a
                * (self.onset.1 + 0.05 * rate * plan.torque_per_drive / plan.torque_constant_nm_a)
        } else {
            plan.torque_per_drive * self.onset.0
        };
        let late = growth * unseen_s;
        self.torques[astern].push((torque - 0.5 * late, 0.5 * late));
        self.next(seen);
        Ok(Step::Drive(plan.brake(facts.side, seen.speed_rad_s, facts.first_drive)))
    }
}

impl BreakawayRamps {
    fn next(&mut self, seen: &Seen) {
        self.ramp += 1;
        self.ramping = false;
        self.from = Some((seen.time_s, seen.angle_rad));
    }
}

/// Mean of some ramps: scatter, and what the onset may be late.
fn summed(ramps: &[(f64, f64)]) -> Option<Breakaway> {
    if ramps.len() < 2 {
        return None;
    }
    let n = ramps.len() as f64;
    let mean = ramps.iter().map(|r| r.0).sum::<f64>() / n;
    let late = ramps.iter().map(|r| r.1).sum::<f64>() / n;
    let variance = ramps.iter().map(|r| (r.0 - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let scatter = FEW * (variance / n).sqrt();
    Some(Breakaway { torque_n_m: mean.max(0.0), tolerance_n_m: scatter.hypot(late) + late })
}
