//! Power into the motor, and the energy it came to.

use kort_proto::signals::Signals;
use kort_thruster::rig::Rig;

use crate::windows::{Summary, Window};

/// A longer silence of the servo counts as nothing: what happened in it is not known.
const GAP_NS: u64 = 1_000_000_000;
const WINDOW_NS: u64 = 1_000_000_000;

/// What turns measured signals into power.
#[derive(Clone, Copy, Debug)]
pub struct Motor {
    torque_constant_nm_a: f64,
    /// Zero where the rig does not state it: then the power is the one at the shaft.
    winding_resistance_ohm: f64,
}

impl Motor {
    /// One of which nothing is known: its power is not either, unless a transducer measures torque.
    pub const UNKNOWN: Motor = Motor { torque_constant_nm_a: f64::NAN, winding_resistance_ohm: f64::NAN };

    /// The motor of a rig, as stated.
    pub fn of(rig: &Rig) -> Motor {
        Motor {
            torque_constant_nm_a: rig.motor.torque_constant_nm_a.value,
            winding_resistance_ohm: rig.motor.winding_resistance_ohm.map_or(0.0, |r| r.value),
        }
    }

    /// Power into the motor, W, negative when it gives power back: `kt i Om + R i^2`, or where the drive tells no
    /// current what a torque transducer measures, `Q Om`. NaN where neither is measured.
    pub fn power_w(&self, s: &Signals) -> f64 {
        if s.current_a.is_finite() {
            let back = self.torque_constant_nm_a * s.shaft_speed_rad_s * s.current_a;
            return back + self.winding_resistance_ohm * s.current_a * s.current_a;
        }
        s.torque_n_m * s.shaft_speed_rad_s
    }
}

/// Sums up power over the samples of a servo.
#[derive(Clone, Debug)]
pub struct Energy {
    motor: Motor,
    last: Option<(u64, f64)>,
    power: Window,
    /// Energy into the motor, J, and back from it, J; neither ever falls.
    pub taken_j: f64,
    /// See [`Self::taken_j`].
    pub returned_j: f64,
}

impl Energy {
    /// Nothing yet.
    pub fn new(motor: Motor) -> Energy {
        Energy { motor, last: None, power: Window::new(WINDOW_NS), taken_j: 0.0, returned_j: 0.0 }
    }

    /// The motor's figures are others from now on; what was summed up stays.
    pub fn set_motor(&mut self, motor: Motor) {
        self.motor = motor;
    }

    /// One more sample, taken at `now_ns`. The mean of two neighbours acts between them.
    pub fn add(&mut self, now_ns: u64, signals: &Signals) {
        let power_w = self.motor.power_w(signals);
        self.power.add(now_ns, power_w);
        if !power_w.is_finite() {
            return;
        }
        if let Some((before_ns, before_w)) = self.last.replace((now_ns, power_w)) {
            let dt_ns = now_ns.saturating_sub(before_ns);
            let energy_j = 0.5 * (before_w + power_w) * dt_ns as f64 * 1e-9;
            match dt_ns {
                GAP_NS.. => (),
                _ if energy_j >= 0.0 => self.taken_j += energy_j,
                _ => self.returned_j -= energy_j,
            }
        }
    }

    /// Power during the last second, W; none if it was not measured.
    pub fn power_w(&self) -> Option<Summary> {
        self.power.complete()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const MOTOR: Motor = Motor { torque_constant_nm_a: 0.5, winding_resistance_ohm: 2.0 };

    fn at(current_a: f64, shaft_speed_rad_s: f64) -> Signals {
        Signals { current_a, shaft_speed_rad_s, ..Signals::UNKNOWN }
    }

    #[test]
    fn a_constant_power_adds_up_and_a_gap_does_not() {
        let mut energy = Energy::new(MOTOR);
        for ms in 0..=3000u64 {
            energy.add(ms * 1_000_000, &at(2.0, 30.0));
        }
        // 0.5 * 2 * 30 + 2 * 4 = 38 W for 3 s.
        assert!((energy.taken_j - 114.0).abs() < 1e-6, "{}", energy.taken_j);
        assert_eq!(energy.power_w().map(|p| p.mean), Some(38.0));
        energy.add(60_000_000_000, &at(2.0, 30.0));
        assert!((energy.taken_j - 114.0).abs() < 1e-6);
    }

    #[test]
    fn without_current_the_transducer_speaks_and_without_both_nothing_is_made_up() {
        let shaft = Signals { torque_n_m: 3.0, shaft_speed_rad_s: -10.0, ..Signals::UNKNOWN };
        assert_eq!(MOTOR.power_w(&shaft), -30.0);
        assert!(MOTOR.power_w(&Signals { shaft_speed_rad_s: 10.0, ..Signals::UNKNOWN }).is_nan());
    }

    proptest! {
        #[test]
        fn what_is_taken_less_what_is_returned_is_the_integral(
            samples in prop::collection::vec((-9.0..9.0f64, -80.0..80.0f64), 2..100)
        ) {
            let mut energy = Energy::new(MOTOR);
            let (mut sum_j, mut last) = (0.0, None);
            for (n, (current, speed)) in samples.into_iter().enumerate() {
                let s = at(current, speed);
                let (taken_j, returned_j) = (energy.taken_j, energy.returned_j);
                energy.add(n as u64 * 2_000_000, &s);
                prop_assert!(energy.taken_j >= taken_j && energy.returned_j >= returned_j, "counters never fall");
                let power_w = MOTOR.power_w(&s);
                sum_j += last.map_or(0.0, |before: f64| 0.5 * (before + power_w) * 0.002);
                last = Some(power_w);
            }
            prop_assert!((energy.taken_j - energy.returned_j - sum_j).abs() < 1e-9);
        }
    }
}
