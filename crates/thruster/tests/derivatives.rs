//! Derivatives that a simulation carries along, against differences of simulations: for every effect of
//! the catalogue and every parameter of every model.

#[path = "common/bench.rs"]
mod bench;

use bench::{Bench, Which, by_every_value};
use kort_thruster::effects;
use kort_thruster::models::ModelName;
use kort_thruster::parameters::{Parameter as P, Parameters};
use kort_thruster::rig::AmplifierKind;

#[test]
fn by_every_parameter_of_every_model() {
    for kind in [AmplifierKind::Current, AmplifierKind::Voltage, AmplifierKind::Speed] {
        let bench = Bench::new(kind);
        let mut stated = Parameters::stated(&bench.rig);
        stated.set(P::ViscousFrictionNmS, 0.01);
        for model in ModelName::ALL {
            for p in P::ALL {
                let value = stated.get(p);
                let what = format!("{kind:?} {model} {}", p.name());
                bench.check(&what, model, (&stated, &Vec::new()), Which::Parameter(p), (value, value), false);
            }
        }
    }
}

#[test]
fn by_every_value_of_every_effect() {
    for effect in effects::ALL {
        let model = if effect.id == "axial_flow_dynamics" { ModelName::Model0 } else { ModelName::Model2 };
        let kind = if effect.id == "supply_sag" { AmplifierKind::Voltage } else { AmplifierKind::Current };
        by_every_value(effect, model, kind);
    }
}
