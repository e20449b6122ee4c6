//! Examples in the user's pages are read as they stand, and shipped rigs say where each number is from and how sure it is.

use kort_thruster::parameters::{Parameter, Parameters};
use kort_thruster::rig::{Load, Rig};

const PAGE: &str = include_str!("../../../docs/recordings.md");
const DRY: &str = r#"
[propeller]
kind = "none"
[motor]
inertia_kg_m2 = 0.0015
torque_constant_nm_a = 0.354
"#;

/// Rigs of the page's examples that hold a table.
fn examples(table: &str) -> Vec<Rig> {
    let blocks = PAGE.split("```toml\n").skip(1).filter_map(|rest| rest.split("```").next());
    let rigs = blocks.filter(|block| block.starts_with(table));
    rigs.map(|block| Rig::from_toml(&format!("{DRY}{block}")).unwrap()).collect()
}

#[test]
fn every_kind_of_load_is_documented_with_all_its_keys() {
    let loads: Vec<Load> = examples("[load]").iter().map(|rig| rig.load).collect();
    assert_eq!(loads.len(), 4);
    assert!(matches!(loads[0], Load::Pendulum { mass_kg, .. } if mass_kg.tol == Some(0.05)));
    assert!(matches!(loads[1], Load::TwoMass { stiffness_nm_rad, .. } if stiffness_nm_rad.value == 20.0));
    assert!(matches!(loads[2], Load::Fan { .. }));
    assert!(matches!(loads[3], Load::Slide { lead_m_rev, .. } if lead_m_rev.value == 0.005));
}

#[test]
fn known_effects_are_documented_as_they_are_read() {
    let rigs = examples("[[effects]]");
    assert_eq!(rigs.len(), 1);
    let names: Vec<&str> = rigs[0].effects.iter().map(|known| known.effect).collect();
    assert_eq!(names, ["coulomb_friction", "gear_load_friction"]);
    assert!((rigs[0].effects[0].value("coulomb_torque_n_m") - 0.08).abs() < 1e-12);
}

/// A word behind it, or a comment above it, for each number; a tolerance for each that the program takes one of.
#[test]
fn shipped_rigs_state_each_number_with_source_and_tolerance() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/thrusters");
    let mut bare = Vec::new();
    for file in std::fs::read_dir(folder).unwrap().map(|file| file.unwrap().path()) {
        let text = std::fs::read_to_string(&file).unwrap();
        let rig = Rig::from_toml(&text).unwrap();
        let mut above = "";
        for line in text.lines() {
            let (stated, source) = line.split_once('#').unwrap_or((line, ""));
            let is_number = stated.split_once('=').is_some_and(|(_, value)| {
                value.trim().starts_with(|c: char| c.is_ascii_digit() || "{-+".contains(c))
            });
            if is_number && source.trim().is_empty() && !above.starts_with('#') {
                bare.push(format!("{}: no source: {line}", rig.name));
            }
            above = line;
        }
        for parameter in Parameter::ALL {
            let stands = text
                .lines()
                .any(|line| line.split('=').next().is_some_and(|key| key.trim() == parameter.name()));
            let unsure = Parameters::quantity(&rig, parameter).is_some_and(|stated| stated.tol.is_none());
            if stands && unsure {
                bare.push(format!("{}: no tolerance: {}", rig.name, parameter.name()));
            }
        }
    }
    assert!(bare.is_empty(), "{}", bare.join("\n"));
}
