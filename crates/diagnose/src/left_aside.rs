//! What was given and not used, and what was not looked for, in words.

use kort_identify::data::{Driving, Series};
use kort_identify::simulate::Problem;
use kort_thruster::effects::speaks_of_a_gear;
use kort_thruster::rig::{AmplifierKind, Rig};

use crate::report::Verdict;

/// Columns that were not used, and what was not looked for.
pub fn left_aside(
    series: &[Series],
    problem: &Problem,
    verdict: Verdict,
    rig: &Rig,
) -> impl Iterator<Item = String> + use<> {
    let commanded = problem.recorded().any(|r| matches!(r.driving, Driving::Command(_)));
    let not_looked_for = [
        gearless(verdict, rig),
        swinging(verdict, problem),
        (commanded && verdict != Verdict::NoMismatch).then(|| unlimited(rig)).flatten(),
    ];
    unused(series, problem).into_iter().chain(not_looked_for.into_iter().flatten())
}

/// What is not looked for since the shaft made no whole turn, where something is left.
fn swinging(verdict: Verdict, problem: &Problem) -> Option<String> {
    let whole = problem.scale.turned_rad >= std::f64::consts::TAU;
    (!whole && verdict != Verdict::NoMismatch).then(|| {
        "an eccentric encoder and friction by position are not looked for: the shaft made no whole turn, so nothing tells that what follows its angle comes again. Record whole turns if it may turn; if an arm swings on it instead, see that the rig states its weight as [load]".into()
    })
}

/// What is not looked for because nobody speaks of it, where a dry shaft leaves something.
fn gearless(verdict: Verdict, rig: &Rig) -> Option<String> {
    let dry = rig.propeller.is_none() && verdict != Verdict::NoMismatch;
    (dry && !speaks_of_a_gear(rig)).then(|| {
        "play and load-dependent friction of a gear are not looked for: neither name nor class of the rig speaks of a gear, belt or screw. If there is one, say so in rig.class".into()
    })
}

/// What is not looked for because the rig does not state what a drive can push.
fn unlimited(rig: &Rig) -> Option<String> {
    let unstated = [
        ("amplifier.supply_v", rig.amplifier.supply_v.is_none()),
        ("motor.winding_resistance_ohm", rig.motor.winding_resistance_ohm.is_none()),
    ];
    let unstated: Vec<&str> =
        unstated.iter().filter(|(_, missing)| *missing).map(|(name, _)| *name).collect();
    (rig.amplifier.kind == AmplifierKind::Current && !unstated.is_empty()).then(|| {
        format!(
            "a speed that the supply's voltage caps is not looked for: the rig does not state {}. What a drive cannot push may be named as a curve of its command or as a load",
            unstated.join(" and ")
        )
    })
}

/// Columns that were not used.
fn unused(series: &[Series], problem: &Problem) -> Option<String> {
    let mut used: Vec<&str> = vec![
        "time_s",
        "torque_enable",
        "ambient_m_s",
        "shaft_angle_rad",
        "supply_v",
        "depth_m",
        "temperature_c",
    ];
    for recording in &problem.recordings {
        used.push(recording.driving.column());
        used.extend(recording.channels.iter().map(|c| c.response.name()));
        used.extend(recording.extra.as_deref());
        used.extend(recording.is_loaded().then_some("torque_n_m"));
    }
    let mut left: Vec<&str> = series
        .iter()
        .flat_map(|s| s.columns.iter().map(|c| c.0.as_str()))
        .filter(|name| !used.contains(name))
        .collect();
    left.sort_unstable();
    left.dedup();
    (!left.is_empty()).then(|| format!("columns not used: {}", left.join(", ")))
}

#[cfg(test)]
mod tests {
    use kort_thruster::rig::Rig;

    use super::unlimited;

    #[test]
    fn a_current_drive_whose_supply_is_not_stated_is_told_of() {
        let rig = |more: &str| {
            let text = format!(
                "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 1.0\n{more}"
            );
            unlimited(&Rig::from_toml(&text).unwrap())
        };
        let both = rig("[amplifier]\nkind = \"current\"\n").unwrap();
        assert!(both.contains("amplifier.supply_v and motor.winding_resistance_ohm"), "{both}");
        let supply = rig("winding_resistance_ohm = 0.1\n[amplifier]\nkind = \"current\"\n").unwrap();
        assert!(supply.contains("state amplifier.supply_v. "), "{supply}");
        assert_eq!(
            rig("winding_resistance_ohm = 0.1\n[amplifier]\nkind = \"current\"\nsupply_v = 24\n"),
            None
        );
        assert_eq!(
            rig("winding_resistance_ohm = 0.1\n[amplifier]\nkind = \"voltage\"\nsupply_v = 24\n"),
            None
        );
    }
}
