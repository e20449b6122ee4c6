//! The session: its stages in order, what they see, and when it ends.

use kort_proto::signals::Signals;

use crate::facts::Facts;
use crate::log::Log;
use crate::plan::Plan;
use crate::stages::{self, Stage, Step};
use crate::stop::Stop;

/// How long an angle is waited for, s: a shaft that has told none by then is followed by its speed.
const ANGLE_WITHIN_S: f64 = 0.5;

/// What a stage sees at a tick; values stand until the next reading.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    /// Since the session's start, s.
    pub time_s: f64,
    /// Shaft speed, rad/s; zero before the first reading.
    pub speed_rad_s: f64,
    /// Shaft angle, rad: the sensor's, or the integral of speed where it has none.
    pub angle_rad: f64,
    /// All the way that the shaft sensor showed, to and fro, rad.
    pub path_rad: f64,
    /// This tick's readings; NaN: none.
    pub fresh: Signals,
}

/// What the caller does next.
#[derive(Clone, Debug, PartialEq)]
pub enum Next {
    /// Sets this drive, in the unit of the drive.
    Drive(f64),
    /// Keeps the drive at zero, tells these words to the operator and goes on with [`Session::go_on`].
    Ask {
        /// The stage's name.
        stage: &'static str,
        /// What it is about to do, and how far the shaft will turn.
        words: String,
    },
    /// All stages are done: the drive stays at zero.
    Finished,
    /// Something was not as it should be: the drive stays at zero.
    Stopped(Stop),
}

/// A calibration session.
pub struct Session {
    plan: Plan,
    stages: Vec<Box<dyn Stage>>,
    at: usize,
    agreed: bool,
    stopped: Option<Stop>,
    /// The first tick, s.
    began_s: Option<f64>,
    seen: Option<Seen>,
    /// The shaft tells its angle; otherwise its speed is integrated.
    by_angle: bool,
    anchor_rad: f64,
    facts: Facts,
    log: Log,
}

impl Session {
    /// All stages that this plan allows, nothing done yet. `driving` is the column of the drive's commands.
    pub fn new(plan: Plan, driving: &str) -> Self {
        Self {
            plan,
            stages: stages::all(&plan),
            at: 0,
            agreed: false,
            stopped: None,
            began_s: None,
            seen: None,
            by_angle: false,
            anchor_rad: 0.0,
            facts: Facts::default(),
            log: Log::new(driving),
        }
    }

    /// The operator agrees to the stage that was asked for.
    pub fn go_on(&mut self) {
        self.agreed = true;
    }

    /// What has been found so far.
    pub fn facts(&self) -> &Facts {
        &self.facts
    }

    /// Everything that was measured.
    pub fn log(&self) -> &Log {
        &self.log
    }

    /// Its bounds.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// One tick: what was measured and what was commanded at `time_s`, and what comes next.
    pub fn tick(&mut self, time_s: f64, row: &Signals) -> Next {
        self.log.push(time_s, row);
        let seen = self.look(time_s, row);
        if let Some(stop) = &self.stopped {
            return Next::Stopped(stop.clone());
        }
        let Some(stage) = self.stages.get_mut(self.at) else { return Next::Finished };
        if !self.agreed {
            return Next::Ask { stage: stage.name(), words: stage.says(&self.plan, &self.facts) };
        }
        let Some(seen) = seen else { return Next::Drive(0.0) };
        match stage.tick(&self.plan, &seen, &mut self.facts) {
            Ok(Step::Drive(drive)) => {
                let most = self.plan.share * self.plan.drive_max;
                Next::Drive(if drive.is_finite() { drive.clamp(-most, most) } else { 0.0 })
            }
            Ok(Step::Done) => {
                self.at += 1;
                self.agreed = false;
                Next::Drive(0.0)
            }
            Err(stop) => {
                self.stopped = Some(stop.clone());
                Next::Stopped(stop)
            }
        }
    }

    /// What the stages see; nothing until the shaft has told where it is.
    fn look(&mut self, time_s: f64, row: &Signals) -> Option<Seen> {
        let began_s = *self.began_s.get_or_insert(time_s);
        let told = |value: f64, else_: f64| if value.is_finite() { value } else { else_ };
        let Some(before) = self.seen else {
            self.by_angle = row.shaft_angle_rad.is_finite();
            if self.by_angle || time_s - began_s >= ANGLE_WITHIN_S {
                // Where it is when it is first seen is no way that it went.
                let angle_rad = told(row.shaft_angle_rad, 0.0);
                let speed_rad_s = told(row.shaft_speed_rad_s, 0.0);
                self.anchor_rad = angle_rad;
                self.seen = Some(Seen { time_s, speed_rad_s, angle_rad, path_rad: 0.0, fresh: *row });
            }
            return self.seen;
        };
        let speed_rad_s = told(row.shaft_speed_rad_s, before.speed_rad_s);
        let angle_rad = if self.by_angle {
            told(row.shaft_angle_rad, before.angle_rad)
        } else {
            before.angle_rad + speed_rad_s * (time_s - before.time_s)
        };
        // The last digit, going to and fro, is no way.
        let mut path_rad = before.path_rad;
        if (angle_rad - self.anchor_rad).abs() > self.plan.angle_step_rad {
            path_rad += (angle_rad - self.anchor_rad).abs();
            self.anchor_rad = angle_rad;
        }
        self.seen = Some(Seen { time_s, speed_rad_s, angle_rad, path_rad, fresh: *row });
        self.seen
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use kort_thruster::rig::Rig;

    const RIG: &str = include_str!("../../../config/thrusters/whitcomb-yoerger-1999.toml");

    /// A session over a shaft at rest, told by these readings, tick by tick; which stage it got to.
    fn at_rest(told: impl Fn(u32) -> Signals) -> (Session, Next) {
        let rig = Rig::from_toml(RIG).unwrap();
        let mut session = Session::new(Plan::new(&rig, 9.0, 80.0, 1e-3, 0.5), "current_cmd_a");
        let mut next = Next::Drive(0.0);
        for k in 0..6000 {
            next = session.tick(f64::from(k) * 1e-3, &told(k));
            match &next {
                Next::Ask { stage: "zeros", .. } => session.go_on(),
                Next::Ask { .. } | Next::Stopped(_) => break,
                Next::Drive(_) | Next::Finished => (),
            }
        }
        (session, next)
    }

    /// A drive on a wire shows nothing at most ticks, the first ones among them, and its shaft stands anywhere.
    #[test]
    fn where_the_shaft_stands_at_the_beginning_is_no_way_that_it_went() {
        let every = |n: u32, k: u32, s: Signals| if k % n == n - 1 { s } else { Signals::UNKNOWN };
        let still = Signals { shaft_speed_rad_s: 0.0, ..Signals::UNKNOWN };
        let (session, next) = at_rest(|k| every(5, k, Signals { shaft_angle_rad: 50.0, ..still }));
        assert!(matches!(next, Next::Ask { stage: "first_movement", .. }), "{next:?}");
        assert_eq!(session.seen.map(|s| (s.angle_rad, s.path_rad)), Some((50.0, 0.0)));
        // An encoder beside the drive, slower than it.
        let (session, next) = at_rest(|k| {
            let shaft_angle_rad = if k % 100 == 99 { 50.0 } else { f64::NAN };
            every(5, k, Signals { shaft_angle_rad, ..still })
        });
        assert!(matches!(next, Next::Ask { stage: "first_movement", .. }), "{next:?}");
        assert_eq!(session.seen.map(|s| (s.angle_rad, s.path_rad)), Some((50.0, 0.0)));
        // A shaft that tells speed only, and one that tells nothing.
        let (_, next) = at_rest(|k| every(5, k, still));
        assert!(matches!(next, Next::Ask { stage: "first_movement", .. }), "{next:?}");
        let (_, next) = at_rest(|_| Signals::UNKNOWN);
        assert_eq!(next, Next::Stopped(Stop::Silent { signal: "shaft_speed_rad_s" }));
    }
}
