//! What observer, estimator and the monitor of mismatch said over time, as columns: of the last minutes, and of a recording.

use std::collections::{BTreeMap, VecDeque};
use std::path::Path;
use std::sync::Arc;

use kort_proto::messages::{ControllerState, PATHS};
use kort_proto::signals::ESTIMATES;
use kort_recording::{Recording, RecordingError};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;

use crate::thin::Due;
use crate::view::ParameterEstimate;

/// Estimates over time.
#[derive(Debug, Default, Serialize, ToSchema)]
pub struct Estimates {
    /// Instants, on the time of the rows beside them, s.
    time_s: Vec<f64>,
    /// By name: `estimated_` before what observer and estimator give, `_std_error` behind it for its standard error, `mismatch_`
    /// before a path whose level it is.
    columns: BTreeMap<String, EstimateColumn>,
}

/// An estimate over time.
#[derive(Debug, Serialize, ToSchema)]
struct EstimateColumn {
    /// SI unit.
    #[schema(example = "m/s")]
    unit: String,
    /// A value an instant; null where there was none.
    values: Vec<Option<f64>>,
}

/// Name and unit of each value of an instant.
type Names = Vec<(String, String)>;

impl Estimates {
    fn push(&mut self, time_s: f64, names: &Names, values: impl Iterator<Item = Option<f64>>) {
        let before = self.time_s.len();
        self.time_s.push(time_s);
        for ((name, unit), value) in names.iter().zip(values) {
            if !self.columns.contains_key(name) {
                let column = EstimateColumn { unit: unit.clone(), values: vec![None; before] };
                self.columns.insert(name.clone(), column);
            }
            if let Some(column) = self.columns.get_mut(name) {
                column.values.push(value);
            }
        }
        for column in self.columns.values_mut() {
            column.values.resize(before + 1, None); // what it no longer says
        }
    }

    /// Without what never had a value.
    fn whole(mut self) -> Self {
        self.columns.retain(|_, column| column.values.iter().any(Option::is_some));
        self
    }

    /// Those of a recording, so many a second at most.
    pub fn of_recording(path: &Path, hz: f64) -> Result<Self, RecordingError> {
        let (mut all, mut next_s) = (Self::default(), f64::NEG_INFINITY);
        Recording::states(path, |time_s, json| {
            // The law's own parameters stand between the states, and are none.
            let Some(state) = serde_json::from_slice::<Told>(json).ok().filter(|_| time_s >= next_s) else {
                return;
            };
            next_s = time_s + 0.9 / hz;
            let (names, values) = state.estimated.named(&state.mismatch.unwrap_or_default());
            all.push(time_s, &names, values.into_iter());
        })?;
        Ok(all.whole())
    }
}

/// What is read of a state.
#[derive(Deserialize)]
struct Told {
    estimated: Believed,
    mismatch: Option<Levels>,
}

#[derive(Deserialize)]
struct Believed {
    parameters: Vec<ParameterEstimate>,
    #[serde(flatten)]
    values: BTreeMap<String, Value>,
}

#[derive(Default, Deserialize)]
struct Levels {
    paths: Vec<Level>,
}

#[derive(Deserialize)]
struct Level {
    path: String,
    level: Option<f64>,
}

impl Believed {
    fn of(state: &ControllerState) -> Self {
        let value = |x: f64| serde_json::Number::from_f64(x).map_or(Value::Null, Value::Number);
        Self {
            parameters: crate::thruster::estimates(state),
            values: ESTIMATES
                .iter()
                .map(|row| (row.name.to_owned(), value((row.get)(&state.estimates))))
                .collect(),
        }
    }

    fn named(&self, levels: &Levels) -> (Names, Vec<Option<f64>>) {
        let mut named: Vec<(String, String, Option<f64>)> = Vec::new();
        for row in ESTIMATES.iter() {
            let value = self.values.get(row.name).and_then(Value::as_f64);
            named.push((format!("estimated_{}", row.name), row.unit.to_owned(), value));
        }
        for ParameterEstimate { name, value, unit, std_error } in &self.parameters {
            if !ESTIMATES.iter().any(|row| row.name == name) {
                named.push((format!("estimated_{name}"), unit.clone(), *value));
            }
            named.push((format!("estimated_{name}_std_error"), unit.clone(), *std_error));
        }
        for Level { path, level } in &levels.paths {
            named.push((format!("mismatch_{path}"), "1".to_owned(), *level));
        }
        named.into_iter().map(|(name, unit, value)| ((name, unit), value)).unzip()
    }
}

/// Estimates of the last minutes, bounded.
#[derive(Debug, Default)]
pub struct KeptEstimates {
    rows: VecDeque<(u64, Arc<Names>, Box<[f32]>)>,
}

impl KeptEstimates {
    /// Takes what a controller says at the servo's time; keeps so long.
    pub fn take(&mut self, time_ns: u64, state: &ControllerState, span_ns: u64) {
        // A servo on another clock than the one before: what was kept has no place beside it.
        if self.rows.back().is_some_and(|(last, ..)| time_ns <= *last) {
            self.rows.clear();
        }
        while self.rows.front().is_some_and(|(first, ..)| time_ns - first > span_ns) {
            self.rows.pop_front();
        }
        let level = |(path, level): (&&str, f64)| Level {
            path: (*path).to_owned(),
            level: Some(level).filter(|level| level.is_finite()),
        };
        let levels = Levels { paths: PATHS.iter().zip(state.mismatch_level).map(level).collect() };
        let (names, values) = Believed::of(state).named(&levels);
        let names = match self.rows.back() {
            Some((_, before, _)) if **before == names => Arc::clone(before),
            _ => Arc::new(names),
        };
        let values = values.into_iter().map(|value| value.map_or(f32::NAN, |value| value as f32)).collect();
        self.rows.push_back((time_ns, names, values));
    }

    /// Those from an instant on, so many a second at most.
    pub fn since(&self, from_ns: u64, hz: f64) -> Estimates {
        let (mut all, mut due) = (Estimates::default(), Due::new(hz));
        for (time_ns, names, values) in &self.rows {
            if *time_ns >= from_ns && due.is(*time_ns) {
                let finite = |value: &f32| Some(f64::from(*value)).filter(|value| value.is_finite());
                all.push(*time_ns as f64 * 1e-9, names, values.iter().map(finite));
            }
        }
        all.whole()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use kort_proto::messages::Parameter;
    use kort_proto::text::Text;

    #[test]
    fn what_is_kept_has_doubt_levels_and_the_names_of_its_time() {
        let mut kept = KeptEstimates::default();
        let mut state = ControllerState { parameter_count: 1, ..ControllerState::default() };
        state.estimates.thrust_n = 20.0;
        for second in 1..=30_u64 {
            let name = if second <= 20 { "lift_max" } else { "swirl_m_s" };
            state.parameters[0] =
                Parameter { name: Text::new(name), value: 0.5, std_error: 0.25, ..Parameter::default() };
            state.mismatch_level = [0.5; 5];
            kept.take(second * 1_000_000_000, &state, 15_000_000_000);
        }
        let seconds = |all: &Estimates| all.time_s.iter().map(|s| s.round() as u64).collect::<Vec<_>>();
        let all = kept.since(0, 10.0);
        assert_eq!(seconds(&all), (15..=30).collect::<Vec<_>>());
        assert!(all.columns.values().all(|column| column.values.len() == 16));
        let column = |name: &str| &all.columns[name].values;
        assert_eq!(column("estimated_thrust_n")[0], Some(20.0));
        assert_eq!((column("estimated_lift_max")[5], column("estimated_lift_max")[6]), (Some(0.5), None));
        assert_eq!((column("estimated_swirl_m_s")[5], column("estimated_swirl_m_s")[6]), (None, Some(0.5)));
        assert_eq!(column("estimated_swirl_m_s_std_error")[15], Some(0.25));
        assert_eq!(column("mismatch_shaft")[0], Some(0.5));
        assert!(!all.columns.contains_key("estimated_flow_m_s"), "it never had a value");
        assert_eq!(seconds(&kept.since(20_000_000_000, 0.2)), [20, 25, 30]);
    }
}
