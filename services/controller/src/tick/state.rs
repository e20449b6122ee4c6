//! What the controller tells of itself.

use kort_control::{EstimatorKind, LawKind, TUNABLES};
use kort_proto::messages::{ControllerState, LAWS, Parameter, SetpointKind};
use kort_proto::signals::Estimates;
use kort_proto::text::Text;

use super::Tick;

impl Tick {
    /// The state for the gateway, without header and timing.
    pub fn state(&self) -> ControllerState {
        let mut state = ControllerState {
            law: Text::new(self.config.law.name()),
            observer: Text::new(self.config.observer.name()),
            estimator: Text::new(self.config.estimator.name()),
            setpoint_kind: SetpointKind::Zero as u32,
            setpoint_value: self.in_force,
            estimates: Estimates {
                thrust_n: self.output.estimate.thrust_n.value,
                flow_m_s: self.output.estimate.flow_m_s.value,
                ambient_m_s: self.output.estimate.ambient_m_s.value,
            },
            estimator_frozen: u32::from(
                self.config.estimator != EstimatorKind::Off && self.controller.adapted().frozen.is_some(),
            ),
            faults: self.latched,
            limits: self.limits,
            thrust_max_n: self.controller.model().thrust_max_n,
            speed_max_rad_s: self.controller.model().speed_max_rad_s,
            setpoints_invalid: self.invalid,
            rig_revision: self.rig_revision,
            ..ControllerState::default()
        };
        let mismatch = self.controller.mismatch();
        state.mismatch_level = if mismatch.learning { [f64::NAN; 5] } else { mismatch.level };
        state.mismatch_path = mismatch.alarm.map_or(0, |path| path as u32 + 1);
        state.mismatch_since_s = mismatch.since_s;
        state.mismatch_lately = mismatch.lately.map(|share| share.unwrap_or(f64::NAN));
        if let Some(setpoint) = self.setpoint {
            state.setpoint_kind = setpoint.kind as u32;
            state.setpoint_accepted = setpoint.value;
            state.setpoint_session = setpoint.session;
            state.setpoint_generation = setpoint.generation;
        }
        for (i, tunable) in TUNABLES.iter().enumerate() {
            let Some(slot) = state.law_parameters.get_mut(i) else { break };
            *slot = Parameter {
                name: Text::new(tunable.name),
                unit: Text::new(tunable.unit),
                value: (tunable.get)(&self.config),
                std_error: f64::NAN,
                low: tunable.least,
                high: tunable.most,
            };
            state.law_parameter_count += 1;
        }
        for (slot, law) in state.laws.iter_mut().zip(LawKind::ALL) {
            *slot = Text::new(law.name());
        }
        state.law_count = LawKind::ALL.len().min(LAWS) as u32;
        self.put_estimated(&mut state);
        state
    }

    /// The adapted coefficients, and what the observer believes with its doubt.
    fn put_estimated(&self, state: &mut ControllerState) {
        let (adapted, nominal) = (self.controller.adapted(), self.controller.nominal());
        let coefficients = kort_control::estimators::NAMES.iter().enumerate().map(|(i, name)| {
            let (value, std_error) = adapted.coefficient(i, nominal);
            (*name, "1", value, std_error)
        });
        let believed = &self.output.estimate;
        let rest = [
            ("load_torque_n_m", "N m", believed.load_torque_n_m),
            ("swirl_m_s", "m/s", believed.swirl_m_s),
            ("thrust_n", "N", believed.thrust_n),
            ("flow_m_s", "m/s", believed.flow_m_s),
            ("ambient_m_s", "m/s", believed.ambient_m_s),
        ]
        .map(|(name, unit, of)| (name, unit, of.value, of.std_error));
        for ((name, unit, value, std_error), slot) in coefficients.chain(rest).zip(&mut state.parameters) {
            let std_error = if std_error.is_finite() { std_error } else { f64::NAN };
            *slot = Parameter {
                name: Text::new(name),
                unit: Text::new(unit),
                value,
                std_error,
                low: f64::NAN,
                high: f64::NAN,
            };
            state.parameter_count += 1;
        }
    }
}
