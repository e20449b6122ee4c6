//! A pulse and its opposite: the shaft turns a little and stands again.

use crate::plan::Plan;
use crate::session::Seen;

/// How long is looked on after a pulse before it is judged, s.
const SETTLES_S: f64 = 0.25;

/// What has become of a pulse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Course {
    /// This drive now. `telling`: what instruments show now is an answer to it.
    Under {
        /// Drive, in the unit of the drive.
        drive: f64,
        /// Whether thrust shown now is an answer.
        telling: bool,
    },
    /// Over.
    Over {
        /// How far the shaft sensor had moved when the second half began, with its sign, rad.
        by_first_rad: f64,
        /// The furthest that it moved, with its sign, rad.
        furthest_rad: f64,
    },
}

/// Drive one way, a pause, then the other way, then a brake by what is shown.
///
/// What moves before the second half begins was moved by the first: a shaft that rubs less one way may stand under
/// the first and yield to the second. With a dead sensor, too, it ends: a free shaft of the stated inertia turns by the angle it was made for, one
/// with friction by less.
#[derive(Clone, Copy, Debug)]
pub struct Pulse {
    drive: f64,
    lasts_s: f64,
    /// The second half's share of the first's length.
    opposite: f64,
    began: Option<(f64, f64)>,
    furthest_rad: f64,
    pause_s: f64,
    half_rad: f64,
    /// How far it had moved when the second half began, rad.
    by_first_rad: f64,
    /// When the first half ended and when the second began.
    ended_s: Option<f64>,
    turned_s: Option<f64>,
}

impl Pulse {
    /// A pulse of this drive under which a free shaft turns this far; the pause between its halves adds to it.
    pub fn new(plan: &Plan, drive: f64, angle_rad: f64, pause_s: f64) -> Self {
        Self {
            drive,
            lasts_s: plan.pulse_s(drive, angle_rad),
            opposite: 1.0,
            began: None,
            furthest_rad: 0.0,
            pause_s,
            half_rad: 0.5 * angle_rad,
            by_first_rad: 0.0,
            ended_s: None,
            turned_s: None,
        }
    }

    /// A pulse without a pause whose first half lasts this long, or until the shaft has gone half this angle.
    pub fn lasting(plan: &Plan, lasts_s: f64, drive: f64, angle_rad: f64) -> Self {
        Self { lasts_s, opposite: plan.opposite(lasts_s), ..Self::new(plan, drive, angle_rad, 0.0) }
    }

    /// Its drive.
    pub fn drive(&self) -> f64 {
        self.drive
    }

    /// Goes on by a tick.
    pub fn tick(&mut self, plan: &Plan, seen: &Seen) -> Course {
        let (from_s, from_rad) = *self.began.get_or_insert((seen.time_s, seen.angle_rad));
        let (since_s, moved_rad) = (seen.time_s - from_s, seen.angle_rad - from_rad);
        if moved_rad.abs() > self.furthest_rad.abs() {
            self.furthest_rad = moved_rad;
        }
        let moves = self.furthest_rad.abs() > plan.angle_step_rad;
        let far = moved_rad.abs() >= self.half_rad;
        let under = |drive| Course::Under { drive, telling: true };
        if self.ended_s.is_none() && (since_s >= self.lasts_s || far) {
            self.ended_s = Some(since_s);
        }
        let Some(ended_s) = self.ended_s else { return under(self.drive) };
        if self.turned_s.is_none() && (since_s >= ended_s + self.pause_s || far) {
            self.turned_s = Some(since_s);
            self.by_first_rad = moved_rad;
        }
        let Some(turned_s) = self.turned_s else { return under(0.0) };
        // Its share the other way, or until it stands.
        let side = (self.furthest_rad * self.drive).signum();
        let ahead = seen.speed_rad_s * side * self.drive.signum();
        let ends_s = turned_s + self.opposite * ended_s;
        if since_s < ends_s && !(moves && ahead <= 0.0) {
            return under(-self.drive);
        }
        // What is left of speed is braked by what is shown.
        if since_s < ends_s + SETTLES_S {
            let drive = if moves { plan.brake(side, seen.speed_rad_s, self.drive.abs()) } else { 0.0 };
            return Course::Under { drive, telling: false };
        }
        Course::Over { by_first_rad: self.by_first_rad, furthest_rad: self.furthest_rad }
    }
}
