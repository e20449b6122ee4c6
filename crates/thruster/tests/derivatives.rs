//! Derivatives that a simulation carries along, against differences of simulations: for every effect of
//! the catalogue and every parameter of every model.

#[path = "common/bench.rs"]
mod bench;

use bench::{Bench, Which, by_every_value};
use kort_thruster::effects;
use kort_thruster::models::ModelName;
use kort_thruster::parameters::{Parameter as P, Parameters};
use kort_thruster::rig::{AmplifierKind, Load, Quantity};

#[test]
fn by_every_parameter_of_every_model() {
    for kind in [AmplifierKind::Current, AmplifierKind::Voltage, AmplifierKind::Speed] {
        let bench = Bench::new(kind);
        let mut stated = Parameters::stated(&bench.rig);
        stated.set(P::ViscousFrictionNmS, 0.01);
        for model in ModelName::ALL {
            // What hangs on the shaft has a test of its own.
            for p in P::ALL.into_iter().filter(|p| stated.get(*p) != 0.0) {
                let value = stated.get(p);
                let what = format!("{kind:?} {model} {}", p.name());
                bench.check(&what, model, (&stated, &Vec::new()), Which::Parameter(p), (value, value), false);
            }
        }
    }
}

#[test]
fn by_every_parameter_of_every_load() {
    let of = Quantity::exact;
    for load in [
        Load::Pendulum { mass_kg: of(2.0), length_m: of(0.1) },
        Load::TwoMass { inertia_kg_m2: of(0.005), stiffness_nm_rad: of(20.0), damping_nm_s: of(0.05) },
        Load::Fan { fan_coefficient_nm_s2: of(1e-3) },
        Load::Slide { mass_kg: of(50.0), lead_m_rev: of(0.05), incline_rad: of(0.3) },
    ] {
        let mut bench = Bench::new(AmplifierKind::Current);
        bench.rig.load = load;
        let stated = Parameters::stated(&bench.rig);
        for p in P::ALL.into_iter().filter(|p| p.name().starts_with("load_") || p.name().starts_with("fan_"))
        {
            let value = stated.get(p);
            if value != 0.0 {
                let (at, which) = ((&stated, &Vec::new()), Which::Parameter(p));
                bench.check(p.name(), ModelName::Model2, at, which, (value, value), false);
            }
        }
    }
}

#[test]
fn by_every_value_of_every_effect() {
    for effect in effects::ALL {
        let model = if effect.id == "axial_flow_dynamics" { ModelName::Model0 } else { ModelName::Model2 };
        let of_voltage = ["supply_sag", "drive_freewheels"].contains(&effect.id);
        let kind = if of_voltage { AmplifierKind::Voltage } else { AmplifierKind::Current };
        by_every_value(effect, model, kind);
    }
}
