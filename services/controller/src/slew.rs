//! How fast an operator's setpoint may move: a step of the setpoint is what a thruster overshoots on.
//!
//! The rate is the rig's full setpoint in a rise time, which depends on the law: one that closes a loop around
//! shaft speed or thrust is given time for it, one without a loop needs none but its thruster's.

use kort_control::LawKind;
use kort_proto::messages::SetpointKind;

/// Time from zero to the largest setpoint when the deployment names none, s.
///
/// Chosen by how fast each law follows; the overshoot of a step has not been measured for every one.
pub fn rise_s(law: LawKind) -> f64 {
    match law {
        // Current follows thrust by a map: the shaft alone is the dynamics.
        LawKind::StaticMap | LawKind::TorqueControl | LawKind::PowerControl => 0.5,
        // A loop around shaft speed overshoots while the flow is still building up.
        LawKind::VelocityServo => 1.5,
        _ => 1.0,
    }
}

/// A setpoint on its way to the one asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Slew {
    kind: Option<SetpointKind>,
    value: f64,
}

impl Slew {
    /// Back to zero: disarmed, or nothing is asked for.
    pub fn reset(&mut self) {
        *self = Self::default();
    }

    /// The setpoint acted on last.
    pub fn value(&self) -> f64 {
        self.value
    }

    /// Goes on from another value of the same kind: something else led it there.
    pub fn goes_on_from(&mut self, value: f64) {
        self.value = value;
    }

    /// The setpoint to act on now, and whether it still moves. `full` is the largest of its kind; `from` where
    /// the thruster is, from which another kind of setpoint starts.
    pub fn step(
        &mut self,
        kind: SetpointKind,
        target: f64,
        full: f64,
        rise_s: f64,
        from: f64,
        dt_s: f64,
    ) -> (f64, bool) {
        if self.kind != Some(kind) {
            let known = self.kind.is_some() && from.is_finite();
            *self = Self { kind: Some(kind), value: if known { from.clamp(-full, full) } else { 0.0 } };
        }
        let most = if rise_s > 0.0 { full / rise_s * dt_s.max(0.0) } else { f64::INFINITY };
        let wanted = target - self.value;
        // Written so that a rig without a largest value is not held back for ever.
        let moving = wanted.abs() > most;
        self.value = if moving { self.value + most.copysign(wanted) } else { target };
        (self.value, moving)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_step_takes_its_share_of_the_rise_time() {
        let mut slew = Slew::default();
        let steps = (1..)
            .find(|_| !slew.step(SetpointKind::Thrust, 50.0, 100.0, 1.0, f64::NAN, 0.004).1)
            .expect("it arrives");
        assert!((120..=130).contains(&steps), "{steps}");
    }

    #[test]
    fn another_kind_starts_from_where_the_shaft_is() {
        let mut slew = Slew::default();
        slew.step(SetpointKind::Thrust, 50.0, 100.0, 0.0, 0.0, 0.004);
        let (value, moving) = slew.step(SetpointKind::Speed, 30.0, 80.0, 1.0, 40.0, 0.004);
        assert!((value - 39.68).abs() < 1e-9 && moving, "{value}");
    }

    proptest! {
        #[test]
        fn never_faster_than_its_rate_and_never_beyond_its_target(
            targets in prop::collection::vec(-100.0..100.0f64, 1..20), rise_s in 0.1..3.0f64
        ) {
            let (mut slew, mut last) = (Slew::default(), 0.0f64);
            for target in targets {
                for _ in 0..20 {
                    let (value, _) = slew.step(SetpointKind::Thrust, target, 100.0, rise_s, f64::NAN, 0.004);
                    prop_assert!((value - last).abs() <= 100.0 / rise_s * 0.004 * (1.0 + 1e-9));
                    prop_assert!((value - target).abs() <= (last - target).abs());
                    last = value;
                }
            }
        }
    }
}
