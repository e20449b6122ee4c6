//! Dry friction, implicitly: after the step that all else makes, the shaft's speed shrinks by what the
//! friction can take in the time, and to zero where that is more than there is.
//!
//! Where the shaft turns, this is a constant torque against it; at rest it is exact, whatever the step:
//! a torque below the friction moves nothing. The derivative is that of the branch taken: none while the
//! shaft is held.

use super::Balance;
use crate::real::Real;

/// Deceleration by dry friction, rad/s^2: against turning ahead, against turning astern.
#[derive(Clone, Copy)]
pub(super) struct Rub<T> {
    ahead: T,
    astern: T,
}

impl<T: Real> Rub<T> {
    /// No friction.
    pub(super) const NONE: Self = Self { ahead: T::ZERO, astern: T::ZERO };

    /// What acts at one instant.
    #[inline(always)]
    pub(super) fn of(balance: &Balance<T>) -> Self {
        Self {
            ahead: balance.friction_ahead_n_m / balance.inertia_kg_m2,
            astern: balance.friction_astern_n_m / balance.inertia_kg_m2,
        }
    }

    /// Half way between this and another instant's.
    #[inline(always)]
    pub(super) fn mean(self, other: Self) -> Self {
        Self { ahead: (self.ahead + other.ahead) * 0.5, astern: (self.astern + other.astern) * 0.5 }
    }

    /// Whether nothing rubs.
    #[inline(always)]
    pub(super) fn is_none(self) -> bool {
        self.largest() == 0.0
    }

    /// The stronger of both sides, rad/s^2.
    #[inline(always)]
    pub(super) fn largest(self) -> f64 {
        self.ahead.re().max(self.astern.re())
    }

    /// The shaft speed that is left of `speed` after friction acted for `time_s`.
    #[inline(always)]
    pub(super) fn slow(self, speed: T, time_s: T) -> T {
        let (ahead, astern) = (self.ahead * time_s, self.astern * time_s);
        if speed > ahead {
            speed - ahead
        } else if speed < -astern {
            speed + astern
        } else if ahead == T::ZERO && astern == T::ZERO {
            speed
        } else {
            T::ZERO
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dual::Dual;

    const RUB: Rub<f64> = Rub { ahead: 10.0, astern: 20.0 };

    #[test]
    fn shrinks_by_its_side_and_holds_what_is_slower() {
        assert_eq!(RUB.slow(1.0, 0.01), 0.9);
        assert_eq!(RUB.slow(-1.0, 0.01), -0.8);
        assert_eq!(RUB.slow(0.09, 0.01), 0.0);
        assert_eq!(RUB.slow(-0.19, 0.01), 0.0);
        assert_eq!(Rub::NONE.slow(0.3, 0.01), 0.3);
    }

    #[test]
    fn what_is_held_has_no_slope_and_what_turns_has_both() {
        let rub = Rub { ahead: Dual::parameter(10.0, 0), astern: Dual::from(10.0) };
        let slopes = |speed: f64| rub.slow(Dual::parameter(speed, 1), Dual::from(0.01)).slopes();
        assert_eq!(slopes(1.0)[..2], [-0.01, 1.0]);
        assert_eq!(slopes(0.05)[..2], [0.0, 0.0]);
        assert_eq!(slopes(-1.0)[..2], [0.0, 1.0]);
    }
}
