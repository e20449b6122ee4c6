//! Checks of a scenario's values, as far as they need neither a rig nor a recording to replay.

use kort_thruster::effects::Scale;

use crate::run::{LONGEST_S, used};
use crate::{Excitation, NoReplays, Scenario, ScenarioError};

impl Scenario {
    /// Values that cannot be meant, whatever the rig. What a rig decides, and what is replayed, is told where it runs.
    pub fn check(&self) -> Vec<ScenarioError> {
        let mut wrong = self.values();
        for (name, segments) in [
            ("segments", &self.segments),
            ("ambient", &self.ambient),
            ("supply", &self.supply),
            ("depth", &self.depth),
            ("temperature", &self.temperature),
        ] {
            let signal = Excitation::new(name, segments, self.seed, &mut NoReplays);
            wrong.extend(signal.err().unwrap_or_default());
        }
        wrong.retain(|error| !matches!(error, ScenarioError::Replay { .. }));
        // In which range a value must lie the rig says.
        let unknown = |error: &ScenarioError| matches!(error, ScenarioError::Unknown { .. });
        wrong.extend(used(self, &Scale::ANY).err().unwrap_or_default().into_iter().filter(unknown));
        wrong
    }

    /// The same of what is no signal and no effect.
    pub(crate) fn values(&self) -> Vec<ScenarioError> {
        let value = |key: String, found: f64, allowed: &str| ScenarioError::Value {
            key,
            found: found.to_string(),
            allowed: allowed.into(),
        };
        let mut wrong = Vec::new();
        for (parameter, number) in &self.parameters {
            if !number.is_finite() || (parameter.positive() && *number < 0.0) {
                let key = format!("parameters.{}", parameter.name());
                wrong.push(value(key, *number, "a finite number, 0 or above"));
            }
        }
        if !self.noise.is_finite() || self.noise < 0.0 {
            wrong.push(value("noise".into(), self.noise, "0 (off) or a factor above 0"));
        }
        if self.segments.is_empty() {
            wrong.push(ScenarioError::Missing {
                key: "segments".into(),
                hint: "at least one, for example { kind = \"hold\", value = 0.5, duration_s = 5.0 }".into(),
            });
        }
        if let Some(duration_s) =
            self.duration_s.filter(|duration_s| !(*duration_s > 0.0 && *duration_s <= LONGEST_S))
        {
            wrong.push(value("duration_s".into(), duration_s, "above 0, at most 86400"));
        }
        if let Some(t) = &self.turbulence {
            for (key, number) in [("sigma_m_s", t.sigma_m_s), ("time_constant_s", t.time_constant_s)] {
                if !(number.is_finite() && number > 0.0) {
                    wrong.push(value(format!("turbulence.{key}"), number, "a finite number above 0"));
                }
            }
        }
        wrong
    }
}
