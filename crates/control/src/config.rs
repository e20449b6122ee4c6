//! A controller's configuration: `config/controllers/NAME.toml`.
//!
//! ```toml
//! law = "model2_inversion"
//! observer = "ekf"
//! estimator = "rls"
//! [laws.servo]
//! phase_margin_deg = 56
//! ```
//! Every key has a default; an unknown one is an error. [`TUNABLES`] is the table of what may be
//! changed while running: the service's `PUT …/controller` and the suites read it.

use kort_thruster::place;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::estimators::{AdaptationOptions, EstimatorKind};
use crate::laws::{LawKind, LawOptions};
use crate::observers::{ObserverKind, ObserverOptions};

/// Why a configuration cannot be used.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum ConfigError {
    /// Not TOML, an unknown key or a value of the wrong kind; the words name line or key.
    #[error("{message}\nhint: {hint}")]
    Syntax {
        /// The parser's words.
        message: String,
        /// The kinds there are of what was meant, or where the keys stand.
        hint: String,
    },
    /// A parameter that is not tunable.
    #[error("`{name}` is not a parameter of a controller\nhint: {hint}")]
    UnknownParameter {
        /// What was asked for.
        name: String,
        /// Nearest known one, or the list.
        hint: String,
    },
    /// A value outside its range.
    #[error("`{name}` = {found} is outside what is allowed: {least} to {most} ({unit})\nhint: {what}")]
    Range {
        /// The parameter.
        name: &'static str,
        /// What was asked for.
        found: f64,
        /// Least value allowed.
        least: f64,
        /// Largest value allowed.
        most: f64,
        /// Unit.
        unit: &'static str,
        /// What it means.
        what: &'static str,
    },
}

fn syntax(message: String) -> ConfigError {
    let of = |kind: &str, names: &[&str]| {
        let found = message.strip_prefix(&format!("`{kind}` = \""))?.split('"').next()?;
        let near = place::near(found, names.iter().copied());
        let near = near.map(|near| format!("did you mean `{near}`? ")).unwrap_or_default();
        Some(format!("{near}kinds of {kind}: {}", names.join(", ")))
    };
    let hint = of("law", &LawKind::ALL.map(LawKind::name))
        .or_else(|| of("observer", &ObserverKind::ALL.map(ObserverKind::name)))
        .or_else(|| of("estimator", &EstimatorKind::ALL.map(EstimatorKind::name)))
        .unwrap_or_else(|| "config/controllers/ has examples; docs/control.md tells the keys".into());
    ConfigError::Syntax { message, hint }
}

/// Limits a controller keeps besides the rig's own.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LimitOptions {
    /// Fastest change of current, full currents a second.
    pub current_rate_per_s: f64,
    /// Fastest change of the thrust reference, full thrusts a second.
    pub thrust_rate_per_s: f64,
    /// Shaft speed above which driving torque is taken back, as a multiple of steady top speed.
    pub overspeed: f64,
    /// Time over which a switch of law fades in, s.
    pub fade_s: f64,
}

impl Default for LimitOptions {
    fn default() -> Self {
        Self { current_rate_per_s: 200.0, thrust_rate_per_s: 1000.0, overspeed: 1.3, fade_s: 0.1 }
    }
}

/// A controller's configuration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ControllerConfig {
    /// Which law.
    pub law: LawKind,
    /// Which observer.
    pub observer: ObserverKind,
    /// Which estimator.
    pub estimator: EstimatorKind,
    /// Coulomb friction that the laws and observers reckon with, share of the largest motor torque.
    pub coulomb_friction: f64,
    /// Options of the laws.
    pub laws: LawOptions,
    /// Options of the observers.
    pub observers: ObserverOptions,
    /// Options of the estimators.
    pub adaptation: AdaptationOptions,
    /// Limits.
    pub limits: LimitOptions,
}

impl ControllerConfig {
    /// The defaults with a law.
    pub fn with_law(law: LawKind) -> Self {
        Self { law, ..Self::default() }
    }

    /// Reads a configuration; ranges are checked.
    ///
    /// # Errors
    /// [`ConfigError`] names line or key, value and what is allowed; of several the first.
    pub fn from_toml(text: &str) -> Result<Self, ConfigError> {
        // There is at least one where there is no configuration.
        let nothing = || syntax(String::new());
        Self::from_toml_with_all(text).map_err(|wrong| wrong.into_iter().next().unwrap_or_else(nothing))
    }

    /// As [`Self::from_toml`], with everything that is wrong: what cannot be read, else all that is out of range.
    ///
    /// # Errors
    /// What is wrong; at least one.
    pub fn from_toml_with_all(text: &str) -> Result<Self, Vec<ConfigError>> {
        let config: Self = place::from_toml_with_all(text)
            .map_err(|said| said.into_iter().map(syntax).collect::<Vec<_>>())?;
        let wrong: Vec<_> =
            TUNABLES.iter().filter_map(|tunable| tunable.check((tunable.get)(&config)).err()).collect();
        if wrong.is_empty() { Ok(config) } else { Err(wrong) }
    }

    /// The configuration as a file of `config/controllers/` that [`ControllerConfig::from_toml`] reads back, every key
    /// written out, so that other defaults of a later version do not change it.
    ///
    /// # Errors
    /// [`ConfigError::Syntax`] if a value has no form in TOML; no configuration that was read or set has one.
    pub fn to_toml(&self) -> Result<String, ConfigError> {
        toml::to_string(self).map_err(|e| syntax(e.to_string()))
    }

    /// The same with every [`Tunable`] of another configuration: what is left differs in what cannot change while
    /// running.
    #[must_use]
    pub fn tuned_as(mut self, other: &Self) -> Self {
        (self.law, self.observer, self.estimator) = (other.law, other.observer, other.estimator);
        for tunable in TUNABLES {
            (tunable.set)(&mut self, (tunable.get)(other));
        }
        self
    }

    /// Changes one parameter by name.
    ///
    /// # Errors
    /// [`ConfigError`] if the name is unknown or the value out of range; nothing is changed then.
    pub fn set(&mut self, name: &str, value: f64) -> Result<(), ConfigError> {
        let tunable = TUNABLES.iter().find(|t| t.name == name).ok_or_else(|| {
            let near = TUNABLES.iter().max_by(|a, b| {
                strsim::jaro_winkler(a.name, name).total_cmp(&strsim::jaro_winkler(b.name, name))
            });
            ConfigError::UnknownParameter {
                name: name.into(),
                hint: near.map_or_else(String::new, |t| format!("did you mean `{}`?", t.name)),
            }
        })?;
        tunable.check(value)?;
        (tunable.set)(self, value);
        Ok(())
    }
}

/// A parameter that may change while running.
#[derive(Clone, Copy, Debug)]
pub struct Tunable {
    /// Stable name, unit last where it has one.
    pub name: &'static str,
    /// Unit; "1" for a bare number.
    pub unit: &'static str,
    /// Least value allowed.
    pub least: f64,
    /// Largest value allowed.
    pub most: f64,
    /// What it means.
    pub what: &'static str,
    /// Reads it.
    pub get: fn(&ControllerConfig) -> f64,
    /// Writes it.
    pub set: fn(&mut ControllerConfig, f64),
}

impl Tunable {
    /// Whether it does anything under this configuration.
    pub fn applies(&self, config: &ControllerConfig) -> bool {
        let law = config.law;
        match self.name {
            n if n.starts_with("thrust_pi") => law == LawKind::ThrustPi,
            n if n.starts_with("trim") => law == LawKind::TrimmedModel2Inversion,
            n if n.starts_with("anti_spin") => law == LawKind::CombinedAntiSpin,
            n if n.starts_with("swirl") => law == LawKind::RotationalFlowInversion,
            n if n.starts_with("look_ahead") => law == LawKind::LookAhead,
            n if n.starts_with("adaptation") => config.estimator != EstimatorKind::Off,
            "ambient_std_m_s" | "ambient_time_s" | "load_std" | "load_time_s" | "blade_load_std"
            | "blade_load_time_s" | "thrust_std" | "flow_std_m_s" => {
                config.observer != ObserverKind::OpenLoop
            }
            _ => true,
        }
    }

    fn check(&self, value: f64) -> Result<(), ConfigError> {
        if value >= self.least && value <= self.most {
            return Ok(());
        }
        let Self { name, unit, least, most, what, .. } = *self;
        Err(ConfigError::Range { name, found: value, least, most, unit, what })
    }
}

macro_rules! tunables {
    ($($name:literal [$unit:literal] $least:literal .. $most:literal $what:literal => $($path:ident).+;)*) => {
        &[$(Tunable {
            name: $name, unit: $unit, least: $least, most: $most, what: $what,
            get: |c| c.$($path).+, set: |c, v| c.$($path).+ = v,
        }),*]
    };
}

/// Every parameter that may change while running.
pub const TUNABLES: &[Tunable] = tunables! {
    "phase_margin_deg" ["deg"] 30.0..85.0 "phase margin the speed loop's crossover is chosen for" => laws.servo.phase_margin_deg;
    "integral_fraction" ["1"] 0.0..0.5 "corner of the speed loop's integral over its crossover" => laws.servo.integral_fraction;
    "thrust_pi_bandwidth_ratio" ["1"] 0.05..2.0 "bandwidth of the thrust PI over the plant's slow pole" => laws.thrust_pi.bandwidth_ratio;
    "trim_bandwidth_fraction" ["1"] 0.0..0.2 "bandwidth of the thrust trim over the servo's crossover" => laws.trim.bandwidth_fraction;
    "trim_authority" ["1"] 0.0..1.0 "largest trim over the largest thrust" => laws.trim.authority;
    "anti_spin_weight_k" ["1"] 0.0..100.0 "k of the weight between torque and power" => laws.anti_spin.weight_k;
    "anti_spin_weight_r" ["1"] 0.1..10.0 "r of the weight between torque and power" => laws.anti_spin.weight_r;
    "anti_spin_loss_threshold" ["1"] 0.05..0.9 "share of expected load below which water counts as lost" => laws.anti_spin.loss_threshold;
    "anti_spin_release_threshold" ["1"] 0.1..1.0 "share of expected load above which water counts as back" => laws.anti_spin.release_threshold;
    "anti_spin_cap_share" ["1"] 0.5..2.0 "speed cap without water over the expected speed" => laws.anti_spin.cap_share;
    "anti_spin_release_rate_per_s" ["1/s"] 0.01..100.0 "how fast the cap is let go, top speeds a second" => laws.anti_spin.release_rate_per_s;
    "swirl_drag" ["1"] 0.1..20.0 "drag coefficient of the swirl, dbr" => laws.rotational_flow.drag;
    "swirl_inertia" ["1"] 0.01..20.0 "inertia ratio of the swirl, gr" => laws.rotational_flow.inertia;
    "look_ahead_horizon" ["rad"] 0.2..10.0 "horizon in multiples of one over the servo's crossover" => laws.look_ahead.horizon;
    "look_ahead_effort" ["1"] 0.000001..10.0 "weight on the change of current" => laws.look_ahead.effort;
    "coulomb_friction" ["1"] 0.0..0.5 "Coulomb friction over the largest motor torque" => coulomb_friction;
    "ambient_std_m_s" ["m/s"] 0.001..3.0 "ambient flow expected before anything is measured" => observers.ambient_std_m_s;
    "ambient_time_s" ["s"] 0.1..1000000.0 "time over which ambient flow forgets itself" => observers.ambient_time_s;
    "load_std" ["1"] 0.00001..1.0 "unexplained load over the largest motor torque" => observers.load_std;
    "load_time_s" ["s"] 0.1..1000000.0 "time over which unexplained load forgets itself" => observers.load_time_s;
    "blade_load_std" ["1"] 0.00001..1.0 "error of the blades' torque at top speed over the largest motor torque" => observers.blade_load_std;
    "blade_load_time_s" ["s"] 0.1..1000000.0 "time over which that error forgets itself" => observers.blade_load_time_s;
    "thrust_std" ["1"] 0.00001..10.0 "noise of force sensor and thrust model over the largest thrust" => observers.thrust_std;
    "flow_std_m_s" ["m/s"] 0.0001..100.0 "noise of one flow meter reading" => observers.flow_std_m_s;
    "adaptation_gain_per_s" ["1/s"] 0.0..50.0 "gain of the gradient" => adaptation.gain_per_s;
    "adaptation_memory_s" ["s"] 0.5..100000.0 "memory of the least squares" => adaptation.memory_s;
    "adaptation_dead_zone" ["1"] 0.0..0.5 "residual over full scale that is taken for noise" => adaptation.dead_zone;
    "adaptation_box_factor" ["1"] 1.0..10.0 "factor within which a coefficient stays" => adaptation.box_factor;
    "adaptation_excitation_min" ["1"] 0.0..1.0 "least eigenvalue of the Gram matrix for learning" => adaptation.excitation_min;
    "current_rate_per_s" ["1/s"] 1.0..100000.0 "fastest change of current, full currents a second" => limits.current_rate_per_s;
    "thrust_rate_per_s" ["1/s"] 0.01..100000.0 "fastest change of the thrust reference, full thrusts a second" => limits.thrust_rate_per_s;
    "overspeed" ["1"] 1.0..3.0 "speed above which torque is taken back, over steady top speed" => limits.overspeed;
    "fade_s" ["s"] 0.0..10.0 "time over which a switch of law fades in" => limits.fade_s;
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_lie_in_their_ranges_and_come_back_from_toml() {
        assert_eq!(ControllerConfig::from_toml("").unwrap(), ControllerConfig::default());
        let text = ControllerConfig::default().to_toml().unwrap();
        assert_eq!(ControllerConfig::from_toml(&text).unwrap(), ControllerConfig::default());
    }

    #[test]
    fn what_cannot_change_while_running_is_what_tuning_leaves() {
        let other = "law = \"look_ahead\"\nobserver = \"luenberger\"\n[laws.servo]\nphase_margin_deg = 51\n";
        let tuned = ControllerConfig::from_toml(other).unwrap();
        assert_eq!(ControllerConfig::default().tuned_as(&tuned), tuned);
        let fixed = ControllerConfig::from_toml(&format!("{other}[observers]\nuse_flow = false\n")).unwrap();
        assert_ne!(ControllerConfig::default().tuned_as(&fixed), fixed);
        assert_eq!(ControllerConfig::from_toml(&fixed.to_toml().unwrap()).unwrap(), fixed);
    }

    #[test]
    fn errors_name_what_is_allowed() {
        let err = ControllerConfig::from_toml("law = \"velocity_srevo\"").unwrap_err().to_string();
        assert!(err.contains("did you mean `velocity_servo`? kinds of law: "), "{err}");
        for (key, hint) in
            [("observer", "kinds of observer: open_loop, "), ("estimator", "kinds of estimator: off, ")]
        {
            let err = ControllerConfig::from_toml(&format!("{key} = \"kalmann\"")).unwrap_err().to_string();
            assert!(err.contains(hint) && !err.contains("kinds of law"), "{err}");
        }
        let mut config = ControllerConfig::default();
        let err = config.set("phase_margin_deg", f64::NAN).unwrap_err().to_string();
        assert!(err.contains("30 to 85"), "{err}");
        let err = config.set("phase_margin", 50.0).unwrap_err().to_string();
        assert!(err.contains("did you mean `phase_margin_deg`?"), "{err}");
        assert_eq!(config, ControllerConfig::default());
    }

    #[test]
    fn every_tunable_reads_what_it_wrote() {
        for t in TUNABLES {
            let mut config = ControllerConfig::default();
            let value = 0.5 * (t.least + t.most);
            config.set(t.name, value).unwrap();
            assert_eq!((t.get)(&config), value, "{}", t.name);
        }
    }
}
