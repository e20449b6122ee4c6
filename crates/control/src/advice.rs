//! Which controller a rig gets by default, and why: from how fast its parts are, and what it measures.
//!
//! 1. *Law.* `model2_inversion` for every rig: what it inverts follows the rig's own time scales, so that on a drive slow
//!    beside its water it is a servo on the steady map that knows the drive's lag, and on a quick drive an
//!    inversion in the present flow (docs/control.md, D4 and D5).
//! 2. *Observer.* `ekf` where anything tells of the water: a force sensor, a flow meter, a recorded ambient flow, or
//!    the motor's current (the torque) on a drive that takes torque or voltage. A speed drive without
//!    any of them shows only what it was told: `open_loop`, and no law can know the ambient flow.
//!    Without a force sensor, errors of the load are taken as lasting, so that what comes and goes is the flow: blades
//!    and friction change over minutes, currents over seconds.
//! 3. *Estimator.* `off`: adaptation pays where blades change, and is switched on by a configuration
//!    (`adaptive_model2_inversion`).

use kort_thruster::rig::{AmplifierKind, Rig};

use crate::config::ControllerConfig;
use crate::laws::LawKind;
use crate::laws::lead::Pace;
use crate::model::{ControlModel, ModelError};
use crate::observers::{ObserverKind, ObserverOptions};

/// Observer options without a force sensor: load and blades err for long, and by little.
const LASTING: ObserverOptions = ObserverOptions {
    load_std: 0.02,
    load_time_s: 300.0,
    blade_load_std: 0.05,
    blade_load_time_s: 600.0,
    ..ObserverOptions::DEFAULT
};

/// Time scales of a rig under a control period, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeScales {
    /// Drive: its first-order lag and its dead time.
    pub drive_s: f64,
    /// Between a shaft speed and its measurement: filter, what the sensor is known to be late, and one and a half
    /// periods of hold and differencing.
    pub sensing_s: f64,
    /// Shaft: from rest to top speed under all torque without load.
    pub shaft_s: f64,
    /// Shaft led by the model, with the drive's lag inverted: time constant.
    pub led_s: f64,
    /// Shaft under the plain servo: one over its crossover.
    pub servo_s: f64,
    /// Axial flow at half the largest thrust, the thrust held: time constant.
    pub flow_s: f64,
}

impl TimeScales {
    /// Of a model.
    pub fn of(model: &ControlModel) -> Self {
        let [lag_s, filter_s, delay_s] = model.loop_lags_s();
        let flux = model.flux_coefficient * model.blade.density_kg_m3 * model.blade.area_m2();
        let flow = model.map.flow_m * model.map.speed_rad_s(0.5 * model.thrust_max_n);
        let torque = model.torque_constant_nm_a * model.current_limit_a;
        Self {
            drive_s: lag_s + model.delay_s,
            sensing_s: filter_s + delay_s - model.delay_s,
            shaft_s: model.inertia_kg_m2 * model.speed_max_rad_s / torque,
            led_s: 1.0 / Pace::of(model).shaft_per_s,
            servo_s: 1.0 / model.speed_loop(56f64.to_radians()).0,
            flow_s: model.added_mass_kg / (2.0 * flux * flow),
        }
    }

    /// How much of the flow's own transient is over when a led shaft arrives, 0 to 1.
    pub fn settled(&self) -> f64 {
        1.0 - (-self.led_s / self.flow_s).exp()
    }
}

/// The controller for a rig.
#[derive(Clone, Debug, PartialEq)]
pub struct Advice {
    /// What to run.
    pub config: ControllerConfig,
    /// What it follows from.
    pub scales: TimeScales,
    /// Why, a sentence each: law, observer, estimator.
    pub reasons: [String; 3],
}

/// The default controller for a rig and a control period, with its reasons.
///
/// # Errors
/// [`ModelError`] if no controller can be designed for the rig.
pub fn advise(rig: &Rig, period_s: f64) -> Result<Advice, ModelError> {
    let model = ControlModel::from_rig(rig, period_s)?;
    let scales = TimeScales::of(&model);
    let (observer, why) = observer(rig);
    let mut config = ControllerConfig { observer, ..ControllerConfig::with_law(LawKind::Model2Inversion) };
    if !rig.sensors.thrust_sensor {
        config.observers = LASTING;
    }
    let settled = scales.settled();
    let flow = if settled > 0.9 {
        "the water has settled by then, so it aims at the steady state in the ambient flow it sees"
    } else if settled < 0.3 {
        "the water has hardly moved by then, so it inverts the present flow"
    } else {
        "the water is under way by then, so it aims at the flow that the momentum balance foretells"
    };
    let law = format!(
        "a led shaft arrives in {:.1} ms (the plain servo: {:.1} ms), the flow settles in {:.1} ms: {flow}",
        1e3 * scales.led_s,
        1e3 * scales.servo_s,
        1e3 * scales.flow_s
    );
    let estimator = "the blades are taken as stated; adaptive_model2_inversion learns them where a force sensor is fitted";
    Ok(Advice { config, scales, reasons: [law, why.into(), estimator.into()] })
}

fn observer(rig: &Rig) -> (ObserverKind, &'static str) {
    let s = &rig.sensors;
    if s.thrust_sensor {
        (ObserverKind::Ekf, "the force sensor shows the flow, and what load the model does not know")
    } else if s.flow_meter || s.ambient_flow_recorded {
        (ObserverKind::Ekf, "the flow is measured")
    } else if rig.amplifier.kind == AmplifierKind::Speed {
        (
            ObserverKind::OpenLoop,
            "a speed drive without force sensor and flow meter shows nothing of the water: the flow is only predicted, in still water",
        )
    } else {
        (
            ObserverKind::Ekf,
            "the motor's current shows the torque, and that the ambient flow; what of the load errs for long is told from it by its lasting",
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::tests::STAND;

    fn of(change: impl Fn(&str) -> String) -> Advice {
        advise(&Rig::from_toml(&change(STAND)).unwrap(), 1e-3).unwrap()
    }

    #[test]
    fn a_slow_duct_is_inverted_in_its_present_flow_and_a_short_one_in_the_steady_one() {
        let stand = of(str::to_owned);
        assert!(stand.scales.settled() < 0.2, "{:?}", stand.scales);
        // The duct's water gone, the drive slow.
        let short = of(|t| {
            t.replace("duct_length_m = 0.1271", "duct_length_m = 0.01")
                .replace("time_constant_s = 0.002", "time_constant_s = 0.05")
        });
        assert!(short.scales.settled() > 0.9, "{:?}", short.scales);
        assert_ne!(stand.reasons[0], short.reasons[0]);
    }

    #[test]
    fn what_is_measured_chooses_the_observer() {
        assert_eq!(of(str::to_owned).config.observer, ObserverKind::Ekf);
        let blind = |t: &str| t.replace("[sensors]", "[sensors]\nthrust = \"none\"\nflow = \"none\"");
        assert_eq!(of(blind).config.observer, ObserverKind::Ekf);
        let speed = of(|t| blind(t).replace("kind = \"current\"", "kind = \"speed\""));
        assert_eq!(speed.config.observer, ObserverKind::OpenLoop);
        assert!(speed.reasons[1].contains("nothing of the water"));
    }
}
