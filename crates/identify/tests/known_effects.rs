//! What a rig is known to have is free about what is stated of it, whatever its sign.

use std::sync::Arc;

use kort_identify::hypothesis::{Hypothesis, Inputs};
use kort_thruster::effects::{self, Scale};
use kort_thruster::models::ModelName;
use kort_thruster::rig::Rig;

const RIG: &str = include_str!("../../../config/thrusters/whitcomb-yoerger-1999.toml");

#[test]
fn every_effect_may_be_stated_to_any_tolerance_on_either_side_of_zero() {
    let mut negative = 0;
    for effect in effects::ALL.iter().filter(|effect| !effect.nonparametric) {
        for sign in [1.0, -1.0] {
            let values = (effect.parameters)(&Scale::ANY).into_iter().filter(|spec| !spec.held).map(|spec| {
                let size = if spec.mean != 0.0 { spec.mean.abs() } else { spec.sigma.abs() };
                let value = if spec.low < 0.0 { sign * size } else { size };
                negative += usize::from(value < 0.0);
                format!("{} = {{ value = {value:?}, tol = 0.05 }}\n", spec.name)
            });
            let known = format!("[[effects]]\neffect = \"{}\"\n{}", effect.id, values.collect::<String>());
            // Not every form has every shape.
            let Ok(rig) = Rig::from_toml(&format!("{RIG}\n{known}")) else { continue };
            let inputs = Arc::new(Inputs::late(&[]));
            let baseline = Hypothesis::baseline(ModelName::Model2, &rig, false, inputs);
            let with = baseline.with_known(&rig, &Scale::ANY);
            for (free, start) in with.free.iter().zip(&with.start) {
                assert!(
                    free.low < free.mean && free.mean < free.high && *start == free.mean,
                    "{free:?}\n{known}"
                );
            }
        }
    }
    assert!(negative > 20, "{negative}");
}
