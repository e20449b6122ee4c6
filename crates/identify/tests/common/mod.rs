//! A work-class thruster under levels of its current, logged at 100 Hz.

use kort_identify::data::Series;
use kort_identify::noise::Criterion;
use kort_thruster::effects::Descriptor;
use kort_thruster::models::ModelName;
use kort_thruster::parameters::Parameters;
use kort_thruster::plant::{Plant, Tick};
use kort_thruster::rig::Rig;
use rand::{Rng as _, SeedableRng};

pub const CRITERION: Criterion =
    Criterion { form_error: 0.01, own_form_error: 0.1, facts_a_band: 100.0, timing_s: 0.001 };
pub const RIG: &str = include_str!("../../../../config/thrusters/whitcomb-yoerger-1999.toml");
const TICK_S: f64 = 0.002;

/// A recording of the thruster with these effects, at levels of its current (until when, s, and how much, A), with this
/// noise of speed, rad/s, and thrust, N.
pub fn recording(
    rig: &Rig,
    effects: &[(&Descriptor, &[f64])],
    levels: &[(f64, f64)],
    noise: [f64; 2],
) -> Series {
    let mut plant = Plant::new(ModelName::Model2, rig, &Parameters::stated(rig), effects, TICK_S);
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
    let mut drawn = |size: f64| size * ((0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0);
    let (mut time_s, mut columns) = (Vec::new(), vec![Vec::new(); 3]);
    for k in 0_u32.. {
        let time = f64::from(k) * TICK_S;
        let Some((_, command)) = levels.iter().find(|(until, _)| time < *until) else { break };
        let at = *plant.truth();
        if k % 5 == 0 {
            time_s.push(time);
            let row = [*command, at.shaft_speed_rad_s + drawn(noise[0]), at.thrust_n + drawn(noise[1])];
            row.iter().zip(&mut columns).for_each(|(value, column)| column.push(*value));
        }
        plant.step(&Tick { time_s: time, command: *command, ..Tick::default() });
    }
    let names = ["current_cmd_a", "shaft_speed_rad_s", "thrust_n"].map(str::to_owned);
    Series { name: "levels".into(), time_s, columns: names.into_iter().zip(columns).collect() }
}
