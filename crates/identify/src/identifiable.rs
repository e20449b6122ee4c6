//! Practical identifiability: which parameters these recordings cannot fix, why, and what would.
//!
//! The information in the data alone, priors left out, is looked at in units in which one means
//! "no better than stated, or than 10 %". Directions with less information than that are weak; the
//! parameters they join are reported together, because only their combination is unknown.

use kort_thruster::models::ModelName;
use nalgebra::{DMatrix, SymmetricEigen};
use serde::Serialize;

use crate::data::{Driving, Response};
use crate::fit::Fit;
use crate::hypothesis::Target;
use crate::simulate::Problem;

/// Parameters that these recordings cannot fix together.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NotIdentifiable {
    /// Their names.
    pub parameters: Vec<String>,
    /// Why.
    pub why: String,
    /// The run or the sensor that would fix them.
    pub excitation: String,
    /// What the data alone leave open: relative standard error of the worst of them.
    pub relative_std_error: f64,
}

/// Knowledge worse than this (one sigma, relative) does not count as knowledge.
const USEFUL: f64 = 0.10;
/// A parameter belongs to a weak direction from this squared component on.
const MEMBER: f64 = 0.08;

/// Groups of parameters that the data alone leave open at a fit.
pub fn not_identifiable(problem: &Problem, fit: &Fit) -> Vec<NotIdentifiable> {
    // In units of the priors; from there to units of what counts as knowledge.
    let mut information = problem.information(fit);
    let n = fit.values.len();
    for (k, free) in fit.hypothesis.free.iter().enumerate() {
        let unit = (USEFUL * fit.values[k].abs().max(free.mean.abs()) / free.sigma).max(1.0);
        information.row_mut(k).scale_mut(unit);
        information.column_mut(k).scale_mut(unit);
    }
    let eigen = SymmetricEigen::new(information);
    let weak: Vec<usize> = (0..n).filter(|k| eigen.eigenvalues[*k] < 1.0).collect();
    // The projector on all weak directions does not depend on how they are turned.
    let mut joined = DMatrix::<f64>::zeros(n, n);
    for k in &weak {
        let direction = eigen.eigenvectors.column(*k);
        joined += direction * direction.transpose();
    }
    let least = |members: &[usize]| {
        weak.iter()
            .filter(|k| members.iter().map(|m| eigen.eigenvectors[(*m, **k)].powi(2)).sum::<f64>() > 0.5)
            .map(|k| eigen.eigenvalues[*k])
            .fold(1.0, f64::min)
    };
    // When samples are taken, and over how long, is the fit's own aid and no parameter of anybody's.
    let own = |k: &&usize| {
        !matches!(fit.hypothesis.free[**k].target, Target::Sampling { .. } | Target::Averaging { .. })
    };
    let open = |members: Vec<usize>| {
        let names: Vec<&str> = members.iter().filter(own).map(|k| fit.hypothesis.free[*k].name).collect();
        let (why, excitation) = words(problem, &names);
        (!names.is_empty()).then(|| NotIdentifiable {
            relative_std_error: (USEFUL / least(&members).max(1e-12).sqrt()).min(1e3),
            parameters: names.into_iter().map(String::from).collect(),
            why,
            excitation,
        })
    };
    groups(&joined).into_iter().filter_map(open).collect()
}

/// Parameters in the weak space, joined where a weak direction moves both.
fn groups(joined: &DMatrix<f64>) -> Vec<Vec<usize>> {
    let n = joined.nrows();
    let mut left: Vec<usize> = (0..n).filter(|k| joined[(*k, *k)] > MEMBER).collect();
    let mut out = Vec::new();
    while let Some(first) = left.first().copied() {
        let mut group = vec![first];
        left.remove(0);
        let mut at = 0;
        while at < group.len() {
            let (near, far): (Vec<usize>, Vec<usize>) =
                left.iter().partition(|k| joined[(group[at], **k)].abs() > 0.5 * MEMBER);
            group.extend(near);
            left = far;
            at += 1;
        }
        group.sort_unstable();
        out.push(group);
    }
    out
}

/// Why a group cannot be fixed, and what would fix it.
fn words(problem: &Problem, names: &[&str]) -> (String, String) {
    let measured =
        |r: Response| problem.recordings.iter().any(|p| p.channels.iter().any(|c| c.response == r));
    let has = |name: &str| names.contains(&name);
    let among = |list: &[&str]| names.iter().all(|n| list.contains(n));
    let say = |why: &str, excitation: &str| (why.to_string(), excitation.to_string());
    let gauge = [
        "inertia_kg_m2",
        "torque_constant_nm_a",
        "viscous_friction_nm_s",
        "winding_resistance_ohm",
        "lift_max",
        "drag_max",
        "flux_coefficient",
        "added_mass_coefficient",
        "swirl_flux_coefficient",
        "swirl_mass_coefficient",
        "density_kg_m3",
    ];
    let shaft = has("inertia_kg_m2") || has("torque_constant_nm_a");
    let water = has("lift_max") || has("drag_max") || has("flux_coefficient");
    if names.len() >= 3 && shaft && water && among(&gauge) {
        return say(
            "scaled by one factor together, they leave shaft speed and flow as they are and scale only thrust and torque; nothing here measures an absolute force or torque well enough",
            "record thrust_n or torque_n_m (calibrated), or state inertia or torque constant to 1 % (a free swing of the dry shaft, a stalled-torque weighing), and fit again",
        );
    }
    let unseen_flow = !measured(Response::Flow);
    match names {
        ["inertia_kg_m2"] => say(
            "the shaft speed hardly shows an acceleration that inertia alone explains",
            "steps of the command from rest, both signs and several sizes, logged at 100 Hz or more",
        ),
        ["drag_max"] => say(
            "drag matters at large angles of attack, which this run hardly has",
            "start from rest at full command and crash reversals from full ahead to full astern",
        ),
        ["time_constant_s"] => say(
            "the drive is faster than this log can see",
            "record current_a at several times the drive's bandwidth during steps",
        ),
        ["viscous_friction_nm_s"] => say(
            "friction is small beside the blades' torque",
            "a coast-down with the drive off, or a run with the propeller taken off",
        ),
        ["added_mass_coefficient"] | ["added_mass_coefficient", "duct_length_m"] => say(
            "the water's inertia only shows while the flow changes",
            "steps between rest and full command held for a second each, thrust_n and flow_m_s recorded",
        ),
        _ if among(&["inertia_kg_m2", "added_mass_coefficient", "duct_length_m"]) => say(
            "the inertias of shaft and water both only slow the response, and this run does not part them",
            "steps from rest (shaft first) and steps at running flow, thrust_n and flow_m_s recorded",
        ),
        _ if among(&["torque_constant_nm_a", "winding_resistance_ohm", "viscous_friction_nm_s"]) => say(
            "at this drive they enter the shaft torque in one combination",
            "record current_a beside the voltage, and a stalled or slow run beside a fast one",
        ),
        _ if unseen_flow && (has("flux_coefficient") || has("added_mass_coefficient")) => say(
            "without a flow measurement the water's speed is only seen through the load",
            "record flow_m_s, or command steps and reversals at several levels",
        ),
        _ if problem.model == ModelName::Model0 || problem.model == ModelName::Model1 => say(
            "the model's response has fewer independent quantities than parameters",
            "state one of them exactly, or measure thrust_n and torque_n_m together",
        ),
        _ if has("pitch_rad") || has("lift_max") || has("drag_max") => say(
            "settled in still water every level meets the blades at one inflow angle, where they enter in one combination",
            "vary the inflow: crash reversals, starts from rest, or tow the thruster with ambient_m_s recorded; torque_n_m helps too",
        ),
        _ if has("swirl_flux_coefficient") || has("swirl_mass_coefficient") => say(
            "the swirl's strength and its build-up time act together on the blade torque",
            "record torque_n_m, with steps and settled levels in one run",
        ),
        _ if problem.recordings.iter().all(|r| r.driving == Driving::Speed) => say(
            "with the shaft speed given, thrust shows only their combination",
            "drive with steps of speed; record torque_n_m and flow_m_s",
        ),
        _ => say(
            "the recorded channels change almost alike when any of them changes",
            "a run with steps from rest, settled levels of both signs and crash reversals; state one of them better",
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_on_one_weak_direction_form_one_group() {
        // Weak: (1, 1, 0, 0)/sqrt 2 and (0, 0, 0, 1).
        let mut joined = DMatrix::<f64>::zeros(4, 4);
        for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            joined[(i, j)] = 0.5;
        }
        joined[(3, 3)] = 1.0;
        assert_eq!(groups(&joined), vec![vec![0, 1], vec![3]]);
    }

    #[test]
    fn nothing_weak_no_group() {
        assert!(groups(&DMatrix::zeros(5, 5)).is_empty());
    }
}
