//! The working range: levels ahead and astern that grow, each held until it settles, and quick steps among them.

use super::direction::contradiction;
use super::{Stage, Step, hear, unit};
use crate::facts::{ALL_INSIDE, Facts, Level, WITNESSES};
use crate::plan::Plan;
use crate::session::Seen;
use crate::stop::Stop;

/// Levels as shares of the plan's share.
const LEVELS: [f64; 5] = [0.15, 0.3, 0.5, 0.75, 1.0];
/// Half of full level is held this long, lower ones longer, for slow water settles slowly; averaged is the last part, s.
const HOLDS_S: f64 = 2.4;
const AVERAGED_S: f64 = 0.8;
/// Rest after a level, s.
const RESTS_S: f64 = 0.8;
/// Length of a quick step and how many there are.
const QUICK_S: f64 = 0.12;
const QUICK: usize = 50;
/// Shaft speed below which a level shows no direction, rad/s.
const STANDS_RAD_S: f64 = 1.0;
/// Share of the servo's speed limit up to which levels are raised.
const SPEED_SHARE: f64 = 0.9;

/// What is held, and for how long.
#[derive(Clone, Copy, Debug)]
struct Hold {
    /// Share of the plan's share.
    share: f64,
    lasts_s: f64,
    averaged: bool,
}

/// The sequence, and where it stands.
#[derive(Default)]
pub struct WorkingRange {
    holds: Vec<Hold>,
    at: usize,
    from_s: Option<f64>,
    /// Halves of the averaged part: count and sum of speed, thrust and current.
    halves: [[(u32, f64); 3]; 2],
    /// Largest share that keeps the shaft below the servo's speed limit.
    cap: f64,
}

impl WorkingRange {
    fn sequence() -> Vec<Hold> {
        let mut holds = Vec::new();
        for level in LEVELS {
            let lasts_s = HOLDS_S * (0.5 / level).max(1.0).powf(0.75);
            for share in [level, -level] {
                holds.push(Hold { share, lasts_s, averaged: true });
                holds.push(Hold { share: 0.0, lasts_s: RESTS_S, averaged: false });
            }
        }
        // Quick steps to levels by chance (a linear congruence, the same each time), of one to four lengths.
        let mut dice: u32 = 7;
        let mut throw = || {
            dice = dice.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(dice >> 8) / f64::from(1 << 24)
        };
        for _ in 0..QUICK {
            let share = 1.6 * throw() - 0.8;
            let lasts_s = QUICK_S * (0.5 + (4.0 * throw()).floor() * 0.5);
            holds.push(Hold { share, lasts_s, averaged: false });
        }
        holds.push(Hold { share: 0.0, lasts_s: 2.0 * RESTS_S, averaged: false });
        holds
    }
}

impl Stage for WorkingRange {
    fn name(&self) -> &'static str {
        "working_range"
    }

    fn says(&self, plan: &Plan, _: &Facts) -> String {
        let lasts: f64 = Self::sequence().iter().map(|h| h.lasts_s).sum();
        let fastest = match SPEED_SHARE * plan.speed_max_rad_s {
            most if most.is_finite() => format!("up to {most:.0} rad/s"),
            _ => "as fast as that drives it".to_owned(),
        };
        format!(
            "{} levels ahead and astern up to {:.3} {}, then quick steps among them, {lasts:.0} s in all; the shaft turns {fastest}: THE THRUSTER PUSHES",
            LEVELS.len(),
            plan.share * plan.drive_max,
            unit(plan.kind),
        )
    }

    fn tick(&mut self, plan: &Plan, seen: &Seen, facts: &mut Facts) -> Result<Step, Stop> {
        if self.holds.is_empty() {
            self.holds = Self::sequence();
            self.cap = 1.0;
        }
        let Some(hold) = self.holds.get(self.at).copied() else { return Ok(Step::Done) };
        let from_s = *self.from_s.get_or_insert(seen.time_s);
        let since_s = seen.time_s - from_s;
        // Ticks are of one length: a hold ends at the tick nearest to its end.
        if since_s >= hold.lasts_s - 0.5 * plan.period_s {
            if hold.averaged {
                self.settled(plan, facts, hold.share)?;
            }
            self.at += 1;
            self.from_s = Some(seen.time_s);
            let next = self.holds.get(self.at).map_or(0.0, |h| h.share);
            return Ok(Step::Drive(self.drive(plan, next)));
        }
        if hold.averaged {
            hear(seen, facts, hold.share.signum());
            // What did not answer to pulses answers now, and is judged as there, at once, for the thruster pushes: one
            // witness alone does not tell whether it or the whole thruster is the wrong way round.
            contradiction(facts)?;
            let left_s = hold.lasts_s - since_s;
            if left_s <= AVERAGED_S {
                let row = &seen.fresh;
                let half = &mut self.halves[usize::from(left_s <= 0.5 * AVERAGED_S)];
                for (sum, value) in half.iter_mut().zip([row.shaft_speed_rad_s, row.thrust_n, row.current_a])
                {
                    if value.is_finite() {
                        *sum = (sum.0 + 1, sum.1 + value);
                    }
                }
            }
        }
        Ok(Step::Drive(self.drive(plan, hold.share)))
    }
}

impl WorkingRange {
    fn drive(&self, plan: &Plan, share: f64) -> f64 {
        share.clamp(-self.cap, self.cap) * plan.share * plan.drive_max
    }

    /// Notes a level that settled, and looks whether the next may be higher.
    fn settled(&mut self, plan: &Plan, facts: &mut Facts, share: f64) -> Result<(), Stop> {
        let [early, late] = std::mem::take(&mut self.halves);
        let mean = |k: usize| (early[k].1 + late[k].1) / f64::from(early[k].0 + late[k].0);
        let drift = |k: usize| late[k].1 / f64::from(late[k].0) - early[k].1 / f64::from(early[k].0);
        let rest = facts.at_rest("thrust_n");
        let noise = rest.sigma * (rest.memory / f64::from((early[1].0 + late[1].0).max(1))).sqrt();
        let drive = self.drive(plan, share);
        let speed = mean(0);
        facts.levels.push(Level {
            drive,
            shaft_speed_rad_s: speed,
            thrust_n: mean(1) - rest.mean,
            thrust_tolerance_n: (ALL_INSIDE * noise).hypot(rest.tolerance()) + 2.0 * drift(1).abs(),
            current_a: mean(2) - facts.at_rest("current_a").mean,
        });
        // One that stands under a low level shows its noise.
        if drive * speed < 0.0 && speed.abs() > STANDS_RAD_S {
            return Err(Stop::OneWay);
        }
        let unsure = |k: &usize| facts.measures(WITNESSES[*k]) && facts.sign_of(*k) == 0.0;
        if let Some(k) = (0..3).find(unsure).filter(|_| share.abs() >= LEVELS[1]) {
            return Err(Stop::Silent { signal: WITNESSES[k] });
        }
        // Speed grows with the square root of torque at most as with torque itself.
        let most = SPEED_SHARE * plan.speed_max_rad_s;
        let reach = share.abs() * most / speed.abs().max(1e-9);
        if reach < self.cap && speed.abs() > 0.5 * most {
            self.cap = reach.max(share.abs().min(self.cap));
            let words = format!(
                "levels above {:.3} {}: the shaft would come near the servo's limits.speed_rad_s",
                self.cap * plan.share * plan.drive_max,
                unit(plan.kind)
            );
            facts.left_out.push(("working_range", words));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use kort_proto::signals::{SIGNALS, Signals};
    use kort_thruster::rig::Rig;

    use super::*;
    use crate::facts::{Answer, RestReading};

    /// A drive without a shaft sensor of its own turns motor and speed together when two of its wires are swapped: then
    /// the force cell, which answers late, is right.
    #[test]
    fn a_thrust_that_goes_astern_at_the_first_level_may_be_the_thrusters_or_the_cells() {
        let rig = include_str!("../../../../config/thrusters/whitcomb-yoerger-1999.toml");
        let plan = Plan::new(&Rig::from_toml(rig).unwrap(), 9.0, 80.0, 1e-3, 0.5);
        let rest = RestReading { count: 2000, sigma: 0.1, memory: 1.0, ..RestReading::default() };
        let rest = SIGNALS.iter().map(|s| if s.name == "thrust_n" { rest } else { RestReading::default() });
        let mut facts = Facts { rest: rest.collect(), side: 1.0, ..Facts::default() };
        let mut stage = WorkingRange::default();
        let mut stopped = None;
        for k in 0..10_000 {
            let fresh = Signals { shaft_speed_rad_s: 20.0, thrust_n: -30.0, ..Signals::UNKNOWN };
            let time_s = f64::from(k) * 1e-3;
            let seen = Seen { time_s, speed_rad_s: 20.0, angle_rad: 0.0, path_rad: 0.0, fresh };
            if let Err(stop) = stage.tick(&plan, &seen, &mut facts) {
                stopped = Some((time_s, stop));
                break;
            }
        }
        let (time_s, stop) = stopped.unwrap();
        // At once, not when the level has been held: it pushes meanwhile.
        assert!(time_s < 0.01, "{time_s}");
        let words = stop.to_string();
        assert!(words.starts_with("`thrust_n` or the thruster is reversed"), "{words}");
        assert!(
            words.contains("`scale = -1.0` for `thrust_n`") && words.contains("`reversed = true`"),
            "{words}"
        );
        assert_eq!(facts.answers[1], Answer::default());
    }
}
