//! What is asked of the controller, and its answers.

use kort_control::{EstimatorKind, LawKind, ObserverKind};
use kort_proto::messages::{ASIDE_NS, Outcome, Process, REQUEST_LIFE_NS, Reply, Request, RequestKind};

use super::Tick;
use super::end::Ending;

impl Tick {
    /// Is a request meant for now, and for this controller?
    pub fn is_for_now(&self, request: &Request, now_ns: u64) -> bool {
        let sent = request.header.stamp_ns;
        sent >= self.started_ns && now_ns.saturating_sub(sent) <= REQUEST_LIFE_NS
    }

    /// Acts on a request; `None` if it is not for the controller. One that is too old to be meant for now is refused, but
    /// for a disarming: that is always meant. Another revision of the rig is designed beside the tick, and comes by
    /// [`Tick::adopt`].
    pub fn request(&mut self, request: &Request, now_ns: u64) -> Option<Reply> {
        let answer = |outcome, words: std::fmt::Arguments| {
            Some(Reply::to(request, Process::Controller, outcome, words))
        };
        match RequestKind::from_u32(request.kind)? {
            RequestKind::Arm => None,
            RequestKind::Disarm => {
                self.forget();
                answer(Outcome::Done, format_args!("setpoint forgotten"))
            }
            _ if !self.is_for_now(request, now_ns) => {
                answer(Outcome::Refused, format_args!("it was given too long ago; hint: ask again"))
            }
            RequestKind::SetRig => None,
            RequestKind::StandAside if self.armed && !self.aside(now_ns) => {
                answer(Outcome::Refused, format_args!("the drive is armed; hint: disarm first"))
            }
            RequestKind::StandAside => {
                self.forget();
                self.aside_until_ns = now_ns + ASIDE_NS;
                answer(Outcome::Done, format_args!("stands aside"))
            }
            RequestKind::Rest => {
                let since_ns = self.ending.map_or(now_ns, |ending| ending.since_ns);
                self.ending = Some(Ending { since_ns, cause: None, hold: true });
                answer(Outcome::Done, format_args!("going to zero"))
            }
            RequestKind::ClearFaults => {
                self.latched = 0;
                self.forget();
                answer(Outcome::Done, format_args!("no faults"))
            }
            RequestKind::SetController => match self.configure(request) {
                Ok(()) => answer(Outcome::Done, format_args!("{} runs", self.config.law.name())),
                Err(words) => answer(Outcome::Invalid, format_args!("{words}")),
            },
        }
    }

    /// Does somebody else command the servo?
    pub fn aside(&self, now_ns: u64) -> bool {
        now_ns < self.aside_until_ns
    }

    /// Switches law, observer, estimator and parameters, all or nothing.
    fn configure(&mut self, request: &Request) -> Result<(), String> {
        let mut config = self.config;
        let unknown = |what: &str, name: &str, known: &[&str]| {
            format!("`{name}` is no {what}; hint: known are {}", known.join(", "))
        };
        if !request.law.is_empty() {
            let name = request.law.as_str();
            config.law = LawKind::from_name(name)
                .ok_or_else(|| unknown("control law", name, &LawKind::ALL.map(LawKind::name)))?;
        }
        if !request.observer.is_empty() {
            let name = request.observer.as_str();
            config.observer = ObserverKind::from_name(name)
                .ok_or_else(|| unknown("observer", name, &ObserverKind::ALL.map(ObserverKind::name)))?;
        }
        if !request.estimator.is_empty() {
            let name = request.estimator.as_str();
            config.estimator = EstimatorKind::from_name(name)
                .ok_or_else(|| unknown("estimator", name, &EstimatorKind::ALL.map(EstimatorKind::name)))?;
        }
        for parameter in request.parameters.iter().take(request.parameter_count as usize) {
            config
                .set(parameter.name.as_str(), parameter.value)
                .map_err(|e| e.to_string().replace('\n', "; "))?;
        }
        self.config = config;
        self.controller.configure(&config);
        Ok(())
    }
}
