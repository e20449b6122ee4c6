//! Which control law runs on a thruster, and its switch.

use std::time::Instant;

use kort_control::{EstimatorKind, ObserverKind};
use kort_proto::events::EventKind;
use kort_proto::messages::{ControllerState, PARAMETERS, Parameter, Process, RequestKind};
use kort_proto::text::Text;

use super::{Thruster, finite, request};
use crate::problem::{Kind, Problem};
use crate::routes::{ControllerRequest, ControllerView, LawParameter};

impl Thruster {
    /// The control law that runs.
    pub fn controller(&self) -> Result<ControllerView, Problem> {
        let heard = self.heard();
        let Some(state) = heard.controller(Instant::now()) else {
            return Err(Problem::new(Kind::NotReady, format!("the controller of {} is not heard", self.id)));
        };
        Ok(ControllerView {
            controller: state.law.as_str().to_owned(),
            observer: state.observer.as_str().to_owned(),
            estimator: state.estimator.as_str().to_owned(),
            parameters: (0..state.law_parameter_count as usize)
                .filter_map(|index| state.law_parameters.get(index))
                .map(|p| LawParameter {
                    name: p.name.as_str().to_owned(),
                    value: finite(p.value),
                    unit: p.unit.as_str().to_owned(),
                    low: finite(p.low),
                    high: finite(p.high),
                })
                .collect(),
            available: state
                .laws
                .iter()
                .take(state.law_count as usize)
                .map(|law| law.as_str().to_owned())
                .collect(),
            observers: ObserverKind::ALL.map(ObserverKind::name).to_vec(),
            estimators: EstimatorKind::ALL.map(EstimatorKind::name).to_vec(),
        })
    }

    /// Switches the control law, or changes its parameters.
    pub async fn set_controller(
        &self,
        who: &str,
        lease: Option<&str>,
        wanted: &ControllerRequest,
    ) -> Result<(), Problem> {
        self.desk().may(lease, Instant::now())?;
        let now = self.controller()?;
        if let Some(name) = &wanted.controller
            && !now.available.contains(name)
        {
            return Err(Problem::new(Kind::UnknownController, format!("there is no control law {name:?}"))
                .hint(format!("choose one of {}", now.available.join(", ")))
                .allowed(now.available));
        }
        if wanted.parameters.len() > PARAMETERS {
            return Err(Problem::new(
                Kind::OutOfRange,
                format!(
                    "parameters has {} entries; at most {PARAMETERS} are allowed",
                    wanted.parameters.len()
                ),
            ));
        }
        let mut message = request(RequestKind::SetController);
        for (field, slot, name) in [
            ("controller", &mut message.law, &wanted.controller),
            ("observer", &mut message.observer, &wanted.observer),
            ("estimator", &mut message.estimator, &wanted.estimator),
        ] {
            let Some(name) = name else { continue };
            *slot = Text::new(name);
            if name.is_empty() || slot.as_str() != name {
                return Err(Problem::new(
                    Kind::OutOfRange,
                    format!("{field} = {name:?} must have 1 to 32 bytes"),
                )
                .hint("leave it out to keep the present one"));
            }
        }
        message.parameter_count = wanted.parameters.len() as u32;
        for (slot, (name, value)) in message.parameters.iter_mut().zip(&wanted.parameters) {
            if Text::<32>::new(name).as_str() != name {
                return Err(Problem::new(
                    Kind::InvalidField,
                    format!("parameters names {name:?}, which no law has"),
                ));
            }
            *slot = Parameter { name: Text::new(name), value: *value, ..Parameter::default() };
        }
        self.ask(message, &[Process::Controller], Kind::Refused).await?;
        // The answer tells what is in force: not before it is heard of.
        self.settle(|heard, now| heard.controller(now).is_some_and(|state| follows(state, wanted))).await;
        let parts = [
            ("controller", wanted.controller.as_deref()),
            ("observer", wanted.observer.as_deref()),
            ("estimator", wanted.estimator.as_deref()),
        ];
        let mut changed: Vec<String> =
            parts.into_iter().filter_map(|(part, name)| Some(format!("{part} = {}", name?))).collect();
        changed.extend(wanted.parameters.iter().map(|(name, value)| format!("{name} = {value}")));
        if !changed.is_empty() {
            self.did(who, lease, EventKind::ControllerChanged, &format!("set {}", changed.join(", ")));
        }
        Ok(())
    }
}

/// Whether a controller runs what was wanted of it.
fn follows(state: &ControllerState, wanted: &ControllerRequest) -> bool {
    let parts = [
        (&state.law, &wanted.controller),
        (&state.observer, &wanted.observer),
        (&state.estimator, &wanted.estimator),
    ];
    let set = |(name, value): (&String, &f64)| {
        let mut table = state.law_parameters.iter(state.law_parameter_count);
        table.any(|p| p.name.as_str() == name && p.value == *value)
    };
    parts.into_iter().all(|(runs, wanted)| wanted.as_ref().is_none_or(|wanted| runs.as_str() == wanted))
        && wanted.parameters.iter().all(set)
}
