//! The composed plant from outside: dry friction, stiff rigs, the observer, a released drive.

mod delay;
mod drive;
mod effects;
mod friction;
mod load;
mod observer;
mod stiff;

use kort_thruster::effects::{Descriptor, find};
use kort_thruster::models::ModelName;
use kort_thruster::parameters::Parameters;
use kort_thruster::plant::Plant;
use kort_thruster::rig::Rig;

/// A dry shaft under a current drive: 1 N m/A, 0.01 kg m^2, nothing else.
fn dry() -> Rig {
    Rig::from_toml(
        "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 1.0\n",
    )
    .expect("a rig")
}

/// The same, its speed read through a filter of 20 ms.
fn dry_filtered() -> Rig {
    let mut rig = dry();
    rig.sensors.speed_filter_time_constant_s = Some(0.02);
    rig
}

/// A plant with effects by name.
fn plant(rig: &Rig, effects: &[(&str, &[f64])], tick_s: f64) -> Plant {
    let effects: Vec<(&Descriptor, &[f64])> =
        effects.iter().map(|(id, values)| (find(id).expect("an effect"), *values)).collect();
    Plant::new(ModelName::Model2, rig, &Parameters::stated(rig), &effects, tick_s)
}
