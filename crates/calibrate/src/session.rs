//! The session: its stages in order, what they see, and when it ends.

use kort_proto::signals::Signals;

use crate::facts::Facts;
use crate::log::Log;
use crate::plan::Plan;
use crate::stages::{self, Stage, Step};
use crate::stop::Stop;

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
    seen: Option<Seen>,
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
            seen: None,
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

    fn look(&mut self, time_s: f64, row: &Signals) -> Seen {
        let before = self.seen.unwrap_or(Seen {
            time_s,
            speed_rad_s: 0.0,
            angle_rad: if row.shaft_angle_rad.is_finite() { row.shaft_angle_rad } else { 0.0 },
            path_rad: 0.0,
            fresh: *row,
        });
        let speed =
            if row.shaft_speed_rad_s.is_finite() { row.shaft_speed_rad_s } else { before.speed_rad_s };
        let told = row.shaft_angle_rad.is_finite()
            || self.log.rows.iter().take(50).any(|r| r.shaft_angle_rad.is_finite());
        let angle = match row.shaft_angle_rad {
            angle if angle.is_finite() => angle,
            _ if told => before.angle_rad,
            _ => before.angle_rad + speed * (time_s - before.time_s),
        };
        if self.seen.is_none() {
            self.anchor_rad = angle;
        }
        // The last digit, going to and fro, is no way.
        let mut path_rad = before.path_rad;
        if (angle - self.anchor_rad).abs() > self.plan.angle_step_rad {
            path_rad += (angle - self.anchor_rad).abs();
            self.anchor_rad = angle;
        }
        let seen = Seen { time_s, speed_rad_s: speed, angle_rad: angle, path_rad, fresh: *row };
        self.seen = Some(seen);
        seen
    }
}
