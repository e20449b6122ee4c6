//! What was set of the control law outlives the controller that runs it: one that begins anew begins with the deployment's own.

use std::sync::Arc;
use std::time::{Duration, Instant};

use kort_proto::events::EventKind;
use kort_proto::messages::{ControllerState, PARAMETERS};

use super::Thruster;
use super::law::follows;
use crate::problem::{Kind, Problem};
use crate::routes::ControllerRequest;

/// How often it is looked for whether another controller runs.
const LOOK_EVERY: Duration = Duration::from_millis(250);

/// What was set, and what runs.
#[derive(Debug, Default)]
pub struct KeptLaw {
    /// What was set since this gateway started, each the last of its kind.
    set: ControllerRequest,
    /// Session of the controller heard last, and what it ran.
    ran: Option<(u64, ControllerRequest)>,
}

impl KeptLaw {
    /// Something was set, beside what was set before.
    pub fn set(&mut self, wanted: &ControllerRequest) {
        let ControllerRequest { controller, observer, estimator, parameters } = wanted.clone();
        self.set.controller = controller.or(self.set.controller.take());
        self.set.observer = observer.or(self.set.observer.take());
        self.set.estimator = estimator.or(self.set.estimator.take());
        self.set.parameters.extend(parameters);
    }

    /// The controller that runs; what another ran before it, if there was one.
    fn replaced(&self, state: &ControllerState) -> Option<ControllerRequest> {
        let (session, before) = self.ran.as_ref()?;
        (*session != state.header.session).then(|| before.clone())
    }
}

/// All that a controller runs.
fn runs(state: &ControllerState) -> ControllerRequest {
    let table = state.law_parameters.iter(state.law_parameter_count);
    ControllerRequest {
        controller: Some(state.law.as_str().to_owned()),
        observer: Some(state.observer.as_str().to_owned()),
        estimator: Some(state.estimator.as_str().to_owned()),
        parameters: table.map(|p| (p.name.as_str().to_owned(), p.value)).collect(),
    }
}

/// Each part and parameter with its value, in words.
pub fn parts(of: &ControllerRequest) -> Vec<(&str, String)> {
    let ControllerRequest { controller, observer, estimator, parameters } = of;
    let kinds = [("controller", controller), ("observer", observer), ("estimator", estimator)];
    let kinds = kinds.into_iter().filter_map(|(part, name)| Some((part, name.clone()?)));
    kinds.chain(parameters.iter().map(|(name, value)| (name.as_str(), value.to_string()))).collect()
}

/// The same for the event log.
pub fn words(of: &ControllerRequest) -> String {
    parts(of).into_iter().map(|(part, value)| format!("{part} = {value}")).collect::<Vec<_>>().join(", ")
}

/// What of it nobody has set again.
fn fallen_back(before: &ControllerRequest, now: &ControllerRequest, set: &ControllerRequest) -> Vec<String> {
    let (before, set) = (parts(before), parts(set));
    let was = |part: &str| before.iter().find(|(of, _)| *of == part).map(|(_, value)| value.as_str());
    parts(now)
        .into_iter()
        .filter(|(part, _)| !set.iter().any(|(of, _)| of == part))
        .filter_map(|(part, value)| {
            let was = was(part).filter(|was| *was != value)?;
            Some(format!("{part} = {value} (it was {was})"))
        })
        .collect()
}

impl Thruster {
    /// Sees to it that a controller that began anew runs what was set on the one before, and says what it does not.
    pub async fn keep_law(self: Arc<Self>) {
        loop {
            tokio::time::sleep(LOOK_EVERY).await;
            let mut kept = self.law.lock().await;
            let Some(state) = self.heard().controller(Instant::now()).copied() else { continue };
            if let Some(before) = kept.replaced(&state) {
                match self.set_again(&kept.set, &state).await {
                    // One that is not there yet is asked again, and so is one that was not asked.
                    Err(problem) if problem.is(Kind::NotReady) || problem.is(Kind::Overloaded) => continue,
                    Err(problem) => {
                        let words = format!("the controller began anew without {}", words(&kept.set));
                        tracing::error!(thruster = self.id, ?problem, "{words}");
                        self.desk().note(EventKind::ControllerChanged, "gateway", words);
                    }
                    Ok(()) => (),
                }
                let fallen = fallen_back(&before, &runs(&state), &kept.set);
                if !fallen.is_empty() {
                    let words = format!("the controller began anew with {}", fallen.join(", "));
                    self.desk().note(EventKind::ControllerChanged, "gateway", words);
                }
            }
            // What was found holds of this controller; one that began anew meanwhile is looked at in its turn.
            let now = self.heard().controller(Instant::now()).copied();
            let same = now.filter(|now| now.header.session == state.header.session);
            kept.ran = same.map(|now| (now.header.session, runs(&now))).or(kept.ran.take());
        }
    }

    async fn set_again(&self, set: &ControllerRequest, state: &ControllerState) -> Result<(), Problem> {
        if follows(state, set) {
            return Ok(());
        }
        // A message holds so many parameters; kinds go with the first.
        let parameters: Vec<_> = set.parameters.iter().map(|(name, value)| (name.clone(), *value)).collect();
        let (first, more) = parameters.split_at(parameters.len().min(PARAMETERS));
        let of = |part: &[(String, f64)]| part.iter().cloned().collect();
        let more = more
            .chunks(PARAMETERS)
            .map(|part| ControllerRequest { parameters: of(part), ..ControllerRequest::default() });
        for request in std::iter::once(ControllerRequest { parameters: of(first), ..set.clone() }).chain(more)
        {
            self.ask_law(&request).await?;
        }
        let words = format!("set {} again: the controller had begun anew", words(set));
        self.did("gateway", None, EventKind::ControllerChanged, &words);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(law: Option<&str>, parameters: &[(&str, f64)]) -> ControllerRequest {
        ControllerRequest {
            controller: law.map(str::to_owned),
            parameters: parameters.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect(),
            ..ControllerRequest::default()
        }
    }

    #[test]
    fn the_last_of_each_is_kept_and_what_nobody_set_here_is_told() {
        let mut kept = KeptLaw::default();
        kept.set(&request(Some("thrust_pi"), &[("a", 1.0), ("b", 2.0)]));
        kept.set(&request(None, &[("b", 3.0)]));
        assert_eq!(kept.set, request(Some("thrust_pi"), &[("a", 1.0), ("b", 3.0)]));
        let before = request(Some("thrust_pi"), &[("a", 1.0), ("b", 3.0), ("c", 4.0), ("d", 5.0)]);
        let now = request(Some("velocity_servo"), &[("a", 0.0), ("b", 0.0), ("c", 0.0), ("d", 5.0)]);
        assert_eq!(fallen_back(&before, &now, &kept.set), ["c = 0 (it was 4)"]);
    }
}
