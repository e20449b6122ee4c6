//! What the record says: all that is estimated together, by `kort-identify`.

use kort_identify::data::{DataError, Series};
use kort_identify::identify::{FitReport, Options, identify};
use kort_identify::noise::Criterion;
use kort_thruster::effects;
use kort_thruster::models::ModelName;
use kort_thruster::rig::{AmplifierKind, Quantity, Rig};

use crate::facts::Facts;
use crate::log::Log;

/// Rows of the record that are fitted, a second.
const ROWS_HZ: f64 = 250.0;
/// Fits from different starts.
const STARTS: usize = 4;

/// The fit, and the record it is of.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// Parameters of model and drive with standard errors.
    pub fit: FitReport,
    /// Period of the servo, s.
    pub period_s: f64,
    /// The record as it is written: thinned, zeros left in.
    pub series: Series,
}

/// The rig with what calibration is to find left loose where the author states no tolerance: the shaft's and the
/// drive's numbers, the blades' and the flow's coefficients. Geometry and density are a ruler's and a thermometer's
/// matter. The torque constant is loose only where something measures torque.
pub fn loosened(rig: &Rig, torque_measured: bool, current_measured: bool) -> Rig {
    let mut rig = rig.clone();
    let loosen = |quantity: &mut Quantity, tol: f64| {
        quantity.tol.get_or_insert(tol);
    };
    loosen(&mut rig.motor.inertia_kg_m2, 1.0);
    if torque_measured {
        loosen(&mut rig.motor.torque_constant_nm_a, 0.5);
    }
    if current_measured {
        loosen(&mut rig.amplifier.time_constant_s, 1.0);
    }
    if let Some(propeller) = &mut rig.propeller {
        loosen(&mut propeller.lift_max, 0.6);
        loosen(&mut propeller.drag_max, 0.6);
        loosen(&mut rig.flow.flux_coefficient, 0.4);
        loosen(&mut rig.flow.added_mass_coefficient, 1.0);
    }
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
    let every = (1.0 / (ROWS_HZ * period_s)).round().max(1.0) as usize;
    let (time_s, columns) = log.thinned(every);
    let columns: Vec<(String, Vec<f64>)> = columns.into_iter().map(|(n, v)| (n.to_owned(), v)).collect();
    let series = Series { name: "calibration".into(), time_s, columns };
    let mut zeroed = series.clone();
    for (name, values) in &mut zeroed.columns {
        if matches!(name.as_str(), "thrust_n" | "flow_m_s" | "torque_n_m" | "current_a") {
            let zero = facts.at_rest(name).mean;
            values.iter_mut().for_each(|v| *v -= zero);
        }
    }
    let current = facts.measures("current_a");
    let mut rig = loosened(rig, facts.measures("torque_n_m"), current);
    // The record is of this servo's commands.
    rig.sensors.control_rate_hz = Some(1.0 / period_s);
    rig.sensors.log_rate_hz = Some(1.0 / (every as f64 * period_s));
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
    let fit = identify(&[zeroed], &rig, &options, progress)?;
    Ok(Estimate { fit, period_s, series })
}
