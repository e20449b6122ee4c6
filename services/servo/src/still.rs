//! How long the shaft has shown no motion, and whether it is said to turn all the same.

use kort_proto::signals::Signals;

/// A shaft angle that stays within this is still, rad: an encoder's last digit goes to and fro.
const STILL_RAD: f64 = 0.01;
/// Two turns, rad.
const TURNS_RAD: f64 = 2.0 * std::f64::consts::TAU;
/// Share of the largest speed from which on a told one is no mere zero of its sensor.
const TURNS_SHARE: f64 = 0.05;

/// The angle tells; a measured speed is never quite still, and is asked only where no angle comes.
#[derive(Clone, Copy, Debug)]
pub struct Stillness {
    since_angle_s: f64,
    angle_rad: f64,
    speed_rad_s: f64,
    still_s: f64,
    denied_s: f64,
    denied_rad: f64,
}

impl Stillness {
    /// Nothing seen yet.
    pub fn new() -> Self {
        Self {
            since_angle_s: f64::INFINITY,
            angle_rad: f64::NAN,
            speed_rad_s: f64::NAN,
            still_s: 0.0,
            denied_s: 0.0,
            denied_rad: 0.0,
        }
    }

    /// How long it has been still while the motor pulled, s; an angle that comes less often than every `told_s` does not
    /// count. The largest speed is `most_rad_s`.
    pub fn while_pulled(
        &mut self,
        measured: &Signals,
        pulls: bool,
        told_s: f64,
        most_rad_s: f64,
        dt_s: f64,
    ) -> f64 {
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
        // Any encoder or counter shows two turns.
        let denies =
            self.since_angle_s < told_s && !moved && self.speed_rad_s.abs() > TURNS_SHARE * most_rad_s;
        (self.denied_s, self.denied_rad) = if denies {
            (self.denied_s + dt_s, self.denied_rad + self.speed_rad_s.abs() * dt_s)
        } else {
            (0.0, 0.0)
        };
        self.still_s
    }

    /// How long the angle has stood while the speed told of turning, s; zero before that would have been two turns.
    pub fn denied_s(&self) -> f64 {
        if self.denied_rad > TURNS_RAD { self.denied_s } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// For how long the angle denies the speed, each told every third tick of 1 ms, at a largest speed of 80 rad/s.
    fn denied_s(ticks: u32, shown: impl Fn(f64) -> (f64, f64)) -> f64 {
        let mut still = Stillness::new();
        for tick in 0..ticks {
            let (angle, speed) = shown(f64::from(tick) * 1e-3);
            let told = |value: f64| if tick % 3 == 0 { value } else { f64::NAN };
            let measured =
                Signals { shaft_angle_rad: told(angle), shaft_speed_rad_s: told(speed), ..Signals::UNKNOWN };
            still.while_pulled(&measured, false, 0.5, 80.0, 1e-3);
        }
        still.denied_s()
    }

    #[test]
    fn a_shaft_that_is_told_to_turn_and_to_stand_does_not() {
        assert!(denied_s(2000, |_| (1.0, 10.0)) > 1.5);
        assert!(denied_s(2000, |_| (1.0, -60.0)) > 1.5);
        assert_eq!(denied_s(1000, |_| (1.0, 10.0)), 0.0, "a counter of one pulse a turn");
        assert_eq!(denied_s(60_000, |t| ((t * 4.5 / std::f64::consts::TAU).floor(), 4.5)), 0.0, "likewise");
        assert_eq!(denied_s(60_000, |_| (1.0, 3.0)), 0.0, "the zero of a tachometer");
        assert_eq!(denied_s(60_000, |t| (1.0, 20.0 * (t * 300.0).sin())).min(0.1), 0.0, "noise about zero");
        assert_eq!(denied_s(60_000, |t| (t * 10.0, 10.0)), 0.0);
        assert_eq!(denied_s(60_000, |_| (f64::NAN, 10.0)), 0.0, "no angle");
    }
}
