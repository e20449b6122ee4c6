//! Derivatives that a simulation carries along, against differences of simulations: for every term without
//! a name.

#[path = "../../thruster/tests/common/bench.rs"]
#[expect(dead_code, reason = "a part of the bench is for the thruster's own tests")]
mod bench;

use bench::by_every_value;
use kort_diagnose::flexible::TERMS;
use kort_thruster::models::ModelName;
use kort_thruster::rig::AmplifierKind;

#[test]
fn by_every_value_of_every_term() {
    for term in TERMS {
        by_every_value(term, ModelName::Model2, AmplifierKind::Current);
    }
}
