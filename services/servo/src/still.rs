//! How long the shaft has shown no motion.

use kort_proto::signals::Signals;

/// A shaft angle that stays within this is still, rad: an encoder's last digit goes to and fro.
const STILL_RAD: f64 = 0.01;

/// The angle tells; a measured speed is never quite still, and is asked only where no angle comes.
#[derive(Clone, Copy, Debug)]
pub struct Stillness {
    since_angle_s: f64,
    angle_rad: f64,
    speed_rad_s: f64,
    still_s: f64,
}

impl Stillness {
    /// Nothing seen yet.
    pub fn new() -> Self {
        Self { since_angle_s: f64::INFINITY, angle_rad: f64::NAN, speed_rad_s: f64::NAN, still_s: 0.0 }
    }

    /// How long it has been still while the motor pulled, s; an angle that comes less often than every `told_s` does not count.
    pub fn while_pulled(&mut self, measured: &Signals, pulls: bool, told_s: f64, dt_s: f64) -> f64 {
        let (angle, speed) = (measured.shaft_angle_rad, measured.shaft_speed_rad_s);
        self.since_angle_s = if angle.is_finite() { 0.0 } else { self.since_angle_s + dt_s };
        let moved = if self.since_angle_s < told_s {
            (angle - self.angle_rad).abs() > STILL_RAD
        } else {
            speed.is_finite() && speed != self.speed_rad_s
        };
        if angle.is_finite() && (moved || self.angle_rad.is_nan()) {
            self.angle_rad = angle;
        }
        if speed.is_finite() {
            self.speed_rad_s = speed;
        }
        self.still_s = if pulls && !moved { self.still_s + dt_s } else { 0.0 };
        self.still_s
    }
}
