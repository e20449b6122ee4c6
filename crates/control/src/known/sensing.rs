//! What effects add to the sensors, taken off before the observer sees it: bias, gain, eccentricity, skewed
//! clocks, slow filters.
//!
//! The catalogue's sensors run beside the plant on what the observer expects them to see; the difference
//! between what they show and what they saw is what the effects add, and is taken off the measurement. For a
//! bias or a gain that is the inverse; for a lag or a delay it is a prediction by the model, which
//! amplifies no noise (Smith 1957, for the sensor instead of the drive).

use kort_thruster::effects::Effect;
use kort_thruster::plant::{Sensed, Tick};
use kort_thruster::rig::Rig;

use super::built;
use crate::model::ControlModel;
use crate::signals::{Estimate, Measurement};

/// The effects on the sensors.
pub(super) struct Sensing {
    effects: Vec<Box<dyn Effect>>,
    /// Expected speed behind the rig's own filter, rad/s.
    seen_rad_s: Option<f64>,
    /// Expected thrust behind the rig's own filter, N.
    seen_n: f64,
}

impl Sensing {
    pub(super) fn new(rig: &Rig, model: &ControlModel) -> Self {
        let all = built(rig, model.period_s);
        let effects = all.into_iter().filter(|(_, e)| e.hooks().sense).map(|(_, e)| e).collect();
        Self { effects, seen_rad_s: None, seen_n: 0.0 }
    }

    pub(super) fn is_idle(&self) -> bool {
        self.effects.is_empty()
    }

    pub(super) fn corrected(
        &mut self,
        measured: &Measurement,
        last: Option<&Estimate>,
        model: &ControlModel,
    ) -> Measurement {
        let Some(last) = last else { return *measured };
        let dt = model.period_s;
        let behind = |seen: f64, input: f64, filter_s: f64| seen + (input - seen) * dt / (filter_s + dt);
        let speed = last.shaft_speed_rad_s.value;
        let seen = behind(self.seen_rad_s.unwrap_or(speed), speed, model.speed_filter_s);
        self.seen_rad_s = Some(seen);
        let thrust = model.net_thrust_n(last.thrust_n.value, last.flow_m_s.value);
        self.seen_n = behind(self.seen_n, thrust, model.thrust_filter_s);
        let expected = Sensed {
            current_a: measured.current_a.unwrap_or(0.0),
            shaft_angle_rad: measured.shaft_angle_rad.unwrap_or(0.0),
            pulled_rad: 0.0,
            shaft_speed_rad_s: seen,
            thrust_n: self.seen_n,
            torque_n_m: 0.0,
            flow_m_s: last.flow_m_s.value,
            since_mean_rad_s2: None,
            // Without an angle, what follows it is not known and nothing is taken off for it.
            true_speed_rad_s: if measured.shaft_angle_rad.is_some() { speed } else { 0.0 },
            true_thrust_n: thrust,
            supply_v: measured.supply_v.unwrap_or(0.0),
        };
        let mut shown = expected;
        for effect in &mut self.effects {
            effect.sense(&Tick::default(), &mut shown);
        }
        let off = |value: Option<f64>, shown: f64, expected: f64| {
            let added = shown - expected;
            value.map(|v| if added.is_finite() { v - added } else { v })
        };
        Measurement {
            shaft_speed_rad_s: off(
                measured.shaft_speed_rad_s,
                shown.shaft_speed_rad_s,
                expected.shaft_speed_rad_s,
            ),
            current_a: off(measured.current_a, shown.current_a, expected.current_a),
            thrust_n: off(measured.thrust_n, shown.thrust_n, expected.thrust_n),
            flow_m_s: off(measured.flow_m_s, shown.flow_m_s, expected.flow_m_s),
            ..*measured
        }
    }
}
