//! What the interface shows of a fit.

use kort_thruster::parameters::{Parameter, Parameters};
use kort_thruster::rig::{Quantity, Rig};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;

use super::{Analysis, AnalysisKind, JobInfo};

/// A fit, running or past.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct FitInfo {
    #[serde(flatten)]
    pub job: JobInfo,
    /// Model whose parameters were fitted; null until it is done.
    #[serde(default)]
    #[schema(example = "model2")]
    pub model: Option<String>,
    /// What was fitted, beside what the rig description states of it.
    #[serde(default)]
    pub parameters: Vec<FittedView>,
    /// What the fitted model leaves of each channel on rows that it was not fitted to.
    #[serde(default)]
    pub heldout: Vec<HeldOutView>,
    /// Groups of parameters that this recording cannot fix.
    #[serde(default)]
    pub not_identifiable: Vec<OpenView>,
    /// Values that no thruster has, or that are far from what is stated, and what that tells.
    #[serde(default)]
    pub symptoms: Vec<String>,
    /// What was noticed in the data, and what was taken where the rig description states nothing.
    #[serde(default)]
    pub notes: Vec<String>,
}

/// A number that was fitted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct FittedView {
    /// Effect that it belongs to; null for one of the model's own.
    pub effect: Option<String>,
    /// Its name, as in a rig description.
    #[schema(example = "lift_max")]
    pub name: String,
    /// SI unit; 1 if it has none.
    #[schema(example = "1")]
    pub unit: String,
    /// What the rig description states, in `unit`; null if nothing.
    pub stated: Option<f64>,
    /// Stated relative uncertainty, two sigma; null if none is stated.
    #[schema(minimum = 0)]
    pub stated_tol: Option<f64>,
    /// Fitted value, in `unit`.
    pub value: Option<f64>,
    /// Its standard error, in `unit`, what is stated being part of the knowledge.
    #[schema(minimum = 0)]
    pub std_error: Option<f64>,
    /// It stands at the edge of what is allowed: a symptom, not a value.
    pub at_bound: bool,
}

/// What is left of a channel, root mean square over full scale.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct HeldOutView {
    /// The channel, as in a recording.
    #[schema(example = "shaft_speed_rad_s")]
    pub channel: String,
    /// Error on rows held out, by a fit without them; null if it is no number.
    pub nrmse: Option<f64>,
    /// What measurement noise alone would give.
    pub noise_floor: Option<f64>,
    /// Is what is left white, without a structure that a model could have?
    pub white: bool,
}

/// Parameters that a recording cannot fix together.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct OpenView {
    /// Their names.
    pub parameters: Vec<String>,
    /// Why.
    pub why: String,
    /// The run or the sensor that would fix them.
    pub excitation: String,
}

impl From<JobInfo> for FitInfo {
    fn from(job: JobInfo) -> FitInfo {
        FitInfo {
            job,
            model: None,
            parameters: Vec::new(),
            heldout: Vec::new(),
            not_identifiable: Vec::new(),
            symptoms: Vec::new(),
            notes: Vec::new(),
        }
    }
}

impl Analysis for FitInfo {
    const KIND: AnalysisKind = AnalysisKind::Fit;

    fn done(job: JobInfo, report: &Value, rig: &str) -> FitInfo {
        let rig = Rig::from_toml(rig).ok();
        let mut parameters = fitted(&report["parameters"], None, rig.as_ref());
        for effect in each(&report["effects"]) {
            parameters.extend(fitted(&effect["parameters"], effect["effect"].as_str(), rig.as_ref()));
        }
        let channels = report["channels"].as_object().into_iter().flatten();
        FitInfo {
            job,
            model: report["model"].as_str().map(str::to_owned),
            parameters,
            heldout: channels
                .map(|(channel, left)| HeldOutView {
                    channel: channel.clone(),
                    nrmse: left["nrmse_heldout"].as_f64(),
                    noise_floor: left["noise_floor"].as_f64(),
                    white: left["white"] == true,
                })
                .collect(),
            not_identifiable: each(&report["not_identifiable"])
                .map(|open| OpenView {
                    parameters: each(&open["parameters"]).map(text).collect(),
                    why: text(&open["why"]),
                    excitation: text(&open["excitation"]),
                })
                .collect(),
            symptoms: each(&report["symptoms"]).map(text).collect(),
            notes: each(&report["notes"]).map(text).collect(),
        }
    }

    fn job(&self) -> &JobInfo {
        &self.job
    }

    fn words(&self) -> String {
        let open: Vec<&str> =
            self.not_identifiable.iter().flat_map(|group| &group.parameters).map(String::as_str).collect();
        let values =
            format!("{} values of {}", self.parameters.len(), self.model.as_deref().unwrap_or("no model"));
        if open.is_empty() { values } else { format!("{values}; it cannot fix {}", open.join(", ")) }
    }
}

fn each(list: &Value) -> impl Iterator<Item = &Value> {
    list.as_array().into_iter().flatten()
}

fn text(value: &Value) -> String {
    value.as_str().unwrap_or_default().to_owned()
}

/// The model's own numbers, or those of an effect.
fn fitted(list: &Value, effect: Option<&str>, rig: Option<&Rig>) -> Vec<FittedView> {
    each(list)
        .map(|fitted| {
            let name = text(&fitted["name"]);
            let stated = rig.and_then(|rig| stated(rig, effect, &name));
            FittedView {
                effect: effect.map(str::to_owned),
                unit: text(&fitted["unit"]),
                stated: stated.map(|quantity| quantity.value),
                stated_tol: stated.and_then(|quantity| quantity.tol),
                value: fitted["value"].as_f64(),
                std_error: fitted["std_error"].as_f64(),
                at_bound: fitted["at_bound"] == true,
                name,
            }
        })
        .collect()
}

/// What a rig description states of a number.
fn stated(rig: &Rig, effect: Option<&str>, name: &str) -> Option<Quantity> {
    let Some(effect) = effect else {
        let parameter = Parameter::ALL.into_iter().find(|parameter| parameter.name() == name)?;
        return Parameters::quantity(rig, parameter);
    };
    let known = rig.effects.iter().find(|known| known.effect == effect)?;
    known.parameters.iter().find(|(known, _)| *known == name).map(|(_, quantity)| *quantity)
}
