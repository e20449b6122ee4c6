//! What the record says: all that is estimated together, by `kort-identify`.

use kort_identify::data::{DataError, Series};
use kort_identify::identify::{FitReport, Options, identify};
use kort_identify::noise::Criterion;
use kort_thruster::effects;
use kort_thruster::models::ModelName;
use kort_thruster::rig::{AmplifierKind, Quantity, Rig};

use crate::facts::{ALL_INSIDE, Facts};
use crate::log::Log;
use crate::zeros::{self, Zero};

/// Rows of the record that are fitted, a second.
const ROWS_HZ: f64 = 250.0;
/// Fits from different starts.
const STARTS: usize = 4;

/// The fit, and the record it is of.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// Parameters of model and drive with standard errors.
    pub fit: FitReport,
    /// The sensors' zeros, which the fit is without.
    pub zeros: Vec<Zero>,
    /// The record as it is written: thinned, zeros left in.
    pub series: Series,
}

/// The record of a session as it is written and fitted: thinned, zeros left in.
pub fn recorded(log: &Log, period_s: f64) -> Series {
    let (time_s, columns) = log.thinned(every(period_s));
    let columns: Vec<(String, Vec<f64>)> = columns.into_iter().map(|(n, v)| (n.to_owned(), v)).collect();
    Series { name: "calibration".into(), time_s, columns }
}

/// Ticks between rows of the record.
fn every(period_s: f64) -> usize {
    (1.0 / (ROWS_HZ * period_s)).round().max(1.0) as usize
}

/// The rig with what calibration is to find left loose where the author states no tolerance: the shaft's and the
/// drive's numbers, the blades' and the flow's coefficients. Geometry and density are a ruler's and a thermometer's
/// matter, and stay as stated whatever tolerance is stated of them. So does the torque constant where nothing tells it: a
/// measured torque, or on a drive of volts its current, for the back EMF has the same constant.
pub fn loosened(rig: &Rig, torque_measured: bool, current_measured: bool) -> Rig {
    let mut rig = rig.clone();
    let loosen = |quantity: &mut Quantity, tol: f64| {
        quantity.tol.get_or_insert(tol);
    };
    loosen(&mut rig.motor.inertia_kg_m2, 1.0);
    let by_back_emf = current_measured && rig.amplifier.kind == AmplifierKind::Voltage;
    if torque_measured {
        loosen(&mut rig.motor.torque_constant_nm_a, 0.5);
    } else if !by_back_emf {
        rig.motor.torque_constant_nm_a.tol = None;
    }
    if current_measured {
        loosen(&mut rig.amplifier.time_constant_s, 1.0);
    }
    if let Some(propeller) = &mut rig.propeller {
        loosen(&mut propeller.lift_max, 0.6);
        loosen(&mut propeller.drag_max, 0.6);
        loosen(&mut rig.flow.flux_coefficient, 0.4);
        loosen(&mut rig.flow.added_mass_coefficient, 1.0);
        let measured_by_hand =
            [&mut propeller.radius_m, &mut propeller.duct_length_m, &mut propeller.pitch_rad];
        measured_by_hand.into_iter().for_each(|quantity| quantity.tol = None);
    }
    rig.flow.density_kg_m3.tol = None;
    rig
}

/// Estimates from the record of a session.
///
/// # Errors
/// [`DataError`] if the record cannot be compared with a model at all.
pub fn estimate(
    log: &Log,
    period_s: f64,
    rig: &Rig,
    facts: &Facts,
    criterion: Criterion,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<Estimate, DataError> {
    let series = recorded(log, period_s);
    let zeros = zeros::zeros(facts);
    let mut zeroed = series.clone();
    zeros::take_out(&zeros, &mut zeroed.columns);
    let current = facts.measures("current_a");
    let mut rig = loosened(rig, facts.measures("torque_n_m"), current);
    zeros::without(&zeros, &mut rig);
    // The record is of this servo's commands.
    rig.sensors.control_rate_hz = Some(1.0 / period_s);
    rig.sensors.log_rate_hz = Some(1.0 / (every(period_s) as f64 * period_s));
    let mut with = vec!["transport_delay"];
    if rig.amplifier.kind != AmplifierKind::Speed {
        with.push("direction_dependent_friction");
        if current {
            with.push("command_dead_band");
        }
    }
    let options = Options {
        model: ModelName::Model2,
        seed: 1,
        starts: STARTS,
        open_friction: false,
        with: with.into_iter().filter_map(effects::find).collect(),
        criterion,
    };
    let mut fit = identify(&[zeroed], &rig, &options, progress)?;
    with_grain(&mut fit, period_s);
    Ok(Estimate { fit, zeros, series })
}

/// A dead time is known to the servo's period: when within it commands act and sensors are read nobody writes down. Whatever
/// is stated of it, and whether it is there at all, is by this one standard error.
fn with_grain(fit: &mut FitReport, period_s: f64) {
    let parameters = fit.effects.iter_mut().flat_map(|effect| &mut effect.parameters);
    for delay in parameters.filter(|p| p.name == "delay_s") {
        delay.std_error += period_s / ALL_INSIDE;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const T200: &str = include_str!("../../../config/thrusters/t200.toml");

    #[test]
    fn geometry_stays_as_stated_and_the_torque_constant_where_nothing_tells_it() {
        let rig = Rig::from_toml(T200).unwrap();
        assert!(rig.propeller.unwrap().pitch_rad.tol.is_some(), "stated with a tolerance");
        let held = |torque, current, kind| {
            let mut rig = rig.clone();
            rig.amplifier.kind = kind;
            let loose = loosened(&rig, torque, current);
            let propeller = loose.propeller.unwrap();
            for quantity in
                [propeller.pitch_rad, propeller.duct_length_m, propeller.radius_m, loose.flow.density_kg_m3]
            {
                assert_eq!(quantity.sigma(), 0.0, "{quantity:?}");
            }
            assert!(propeller.lift_max.sigma() > 0.0 && loose.motor.inertia_kg_m2.sigma() > 0.0);
            loose.motor.torque_constant_nm_a.sigma() == 0.0
        };
        assert!(held(false, true, AmplifierKind::Current));
        assert!(held(false, false, AmplifierKind::Voltage));
        assert!(!held(false, true, AmplifierKind::Voltage), "current and volts tell it by the back EMF");
        assert!(!held(true, true, AmplifierKind::Current));
    }
}
