//! Which control law runs on a thruster, and its switch.

use std::time::Instant;

use kort_control::{ConfigError, ControllerConfig, EstimatorKind, ObserverKind};
use kort_proto::events::EventKind;
use kort_proto::messages::{ControllerState, PARAMETERS, Parameter, Process, Request, RequestKind};
use kort_proto::text::Text;

use super::kept_law::words;
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
        // First of all: another switch may hold it longer than the lease lives.
        let mut kept = self.law.lock().await;
        self.desk().may(lease, Instant::now())?;
        let now = self.controller()?;
        if let Some(name) = &wanted.controller
            && !now.available.contains(name)
        {
            return Err(Problem::new(Kind::UnknownController, format!("there is no control law {name:?}"))
                .hint(format!("choose one of {}", now.available.join(", ")))
                .allowed(now.available));
        }
        self.ask_law(wanted).await?;
        kept.set(wanted);
        match words(wanted) {
            nothing if nothing.is_empty() => self.desk().done(lease, Instant::now()),
            changed => self.did(who, lease, EventKind::ControllerChanged, &format!("set {changed}")),
        }
        Ok(())
    }

    /// Has the controller run this, and waits until it says so itself.
    pub async fn ask_law(&self, wanted: &ControllerRequest) -> Result<(), Problem> {
        self.ask(message(wanted)?, &[Process::Controller], Kind::Refused).await?;
        // The answer tells what is in force: not before it is heard of.
        self.settle(|heard, now| heard.controller(now).is_some_and(|state| follows(state, wanted))).await;
        Ok(())
    }
}

/// What the controller is asked.
fn message(wanted: &ControllerRequest) -> Result<Request, Problem> {
    if wanted.parameters.len() > PARAMETERS {
        let words =
            format!("parameters has {} entries; at most {PARAMETERS} are allowed", wanted.parameters.len());
        return Err(Problem::new(Kind::OutOfRange, words).hint("send the others with another request"));
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
        ControllerConfig::default().set(name, *value).map_err(|error| not_tunable(&error))?;
        *slot = Parameter { name: Text::new(name), value: *value, ..Parameter::default() };
    }
    Ok(message)
}

/// A parameter that no law has, or a value that it must not have.
fn not_tunable(error: &ConfigError) -> Problem {
    let kind = match error {
        ConfigError::Range { .. } => Kind::OutOfRange,
        ConfigError::UnknownParameter { .. } | ConfigError::Syntax { .. } => Kind::InvalidField,
    };
    let words = error.to_string();
    match words.split_once("\nhint: ") {
        Some((detail, hint)) => Problem::new(kind, detail).hint(hint),
        None => Problem::new(kind, words),
    }
}

/// Whether a controller runs what was wanted of it.
pub fn follows(state: &ControllerState, wanted: &ControllerRequest) -> bool {
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
