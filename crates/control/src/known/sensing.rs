//! What effects add to the sensors, taken off before the observer sees it: bias, gain, eccentricity, skewed
//! clocks, slow filters.
//!
//! The catalogue's sensors run beside the plant on what the observer expects them to see; the difference
//! between what they show and what ideal ones would is what the effects add, and is taken off the measurement. For
//! a bias or a gain that is the inverse. A sensor of shaft speed or thrust that is late stays late: of whatever form, its
//! lag is made that of a first-order filter with the same mean delay, which the model holds ([`ControlModel::late`]), so that
//! observers and loops are designed for it. What the estimate had wrong comes late whatever is done to the measurement;
//! an observer that took it for prompt would correct too much and swing. The flow meter's is predicted away (Smith
//! 1957, for the sensor instead of the drive), and its doubt raised.

use kort_thruster::effects::Effect;
use kort_thruster::plant::{Sensed, Tick};
use kort_thruster::rig::Rig;

use super::built;
use crate::model::ControlModel;
use crate::signals::{Estimate, Measurement};

/// The effects on the sensors.
pub(super) struct Sensing {
    effects: Vec<Box<dyn Effect>>,
    /// Expected speed behind the rig's own filter, and behind the one that the model holds, rad/s.
    speed_rad_s: Option<[f64; 2]>,
    /// The same of the expected thrust, N.
    thrust_n: [f64; 2],
}

impl Sensing {
    pub(super) fn new(rig: &Rig, model: &ControlModel) -> Self {
        let all = built(rig, model.period_s);
        let effects = all.into_iter().filter(|(_, e)| e.hooks().sense).map(|(_, e)| e).collect();
        Self { effects, speed_rad_s: None, thrust_n: [0.0; 2] }
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
        // Behind the stated filter, which is what the effects see, and behind the whole.
        let behind = |seen: [f64; 2], input: f64, whole_s: f64, late_s: f64| {
            let step = |seen: f64, filter_s: f64| seen + (input - seen) * dt / (filter_s + dt);
            [step(seen[0], whole_s - late_s), step(seen[1], whole_s)]
        };
        let (speed, late) = (last.shaft_speed_rad_s.value, model.late);
        let seen = behind(self.speed_rad_s.unwrap_or([speed; 2]), speed, model.speed_filter_s, late.speed_s);
        self.speed_rad_s = Some(seen);
        let thrust = model.net_thrust_n(last.thrust_n.value, last.flow_m_s.value);
        self.thrust_n = behind(self.thrust_n, thrust, model.thrust_filter_s, late.thrust_s);
        let expected = Sensed {
            current_a: measured.current_a.unwrap_or(0.0),
            shaft_angle_rad: measured.shaft_angle_rad.unwrap_or(0.0),
            pulled_rad: 0.0,
            shaft_speed_rad_s: seen[0],
            thrust_n: self.thrust_n[0],
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
        let ideal = Sensed { shaft_speed_rad_s: seen[1], thrust_n: self.thrust_n[1], ..expected };
        let off = |value: Option<f64>, shown: f64, ideal: f64| {
            let added = shown - ideal;
            value.map(|v| if added.is_finite() { v - added } else { v })
        };
        Measurement {
            shaft_speed_rad_s: off(
                measured.shaft_speed_rad_s,
                shown.shaft_speed_rad_s,
                ideal.shaft_speed_rad_s,
            ),
            current_a: off(measured.current_a, shown.current_a, ideal.current_a),
            thrust_n: off(measured.thrust_n, shown.thrust_n, ideal.thrust_n),
            flow_m_s: off(measured.flow_m_s, shown.flow_m_s, ideal.flow_m_s),
            ..*measured
        }
    }
}
