//! The machine itself: energy, measuring chain, what dry friction must do.

use std::f64::consts::TAU;

use kort_truth::dice::Dice;
use kort_truth::families;
use kort_truth::load::Load;
use kort_truth::machine::{Machine, Scale};
use kort_truth::machines;
use kort_truth::run::{Bench, Driver};
use proptest::prelude::*;

const UNIT: Scale = Scale {
    speed_rad_s: 1.0,
    flow_m_s: 1.0,
    thrust_n: 1.0,
    torque_n_m: 1.0,
    current_a: 1.0,
    command: 1.0,
    duration_s: 1.0,
};

fn bench(machine: &Machine, quantise: bool) -> Bench<'_> {
    Bench { machine, full: UNIT, step_s: machine.fine_step_s(), quantise }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    /// Without drive and with water at rest a machine only loses energy.
    #[test]
    fn a_dry_shaft_takes_no_more_energy_than_the_motor_gives(which in 0usize..8, seed in 0u64..50, level in 0.1..1.0f64) {
        let specimen = machines::DRY.iter().chain(&machines::LOADED).nth(which).unwrap();
        let machine = specimen(&mut Dice::new(seed, 1));
        let tick_s = machine.sensors.tick_s;
        let command = vec![level * machine.command_limit(); (1.0 / tick_s) as usize];
        let trace = bench(&machine, false).run(Driver::Command(&command), &mut []);
        let (mut given, last) = (0.0, trace.speed_rad_s.len() - 1);
        for tick in 0..last {
            // Torque over the tick before the next reading, at the mean speed.
            given += trace.torque_n_m[tick + 1] * 0.5 * (trace.speed_rad_s[tick] + trace.speed_rad_s[tick + 1]) * tick_s;
        }
        let kinetic = 0.5 * machine.inertia_kg_m2 * trace.speed_rad_s[last].powi(2);
        // What the weight was lifted by; it may have sunk.
        let angle = trace.readings[last].angle_rad;
        let lifted = machine.load.largest_weight_n_m() * match machine.load {
            Load::Arm { .. } => 1.0 - angle.cos(),
            _ => angle,
        };
        prop_assert!(kinetic + lifted <= given + 0.02 * (given.abs() + lifted.abs()) + 1e-9, "{kinetic} J and {lifted} J of {given} J");
        prop_assert!(kinetic > 0.0);
    }

    /// Reversed commands give reversed motion: the plain machine has no side.
    #[test]
    fn the_plain_machine_has_no_side(which in 0usize..6, seed in 0u64..50) {
        let machine = machines::THRUSTERS[which](&mut Dice::new(seed, 1));
        let ticks = (0.5 / machine.sensors.tick_s) as usize;
        let ahead = bench(&machine, false).run(Driver::Command(&vec![0.6 * machine.command_limit(); ticks]), &mut []);
        let astern = bench(&machine, false).run(Driver::Command(&vec![-0.6 * machine.command_limit(); ticks]), &mut []);
        for (a, b) in ahead.speed_rad_s.iter().zip(&astern.speed_rad_s) {
            prop_assert!((a + b).abs() < 1e-9 * (1.0 + a.abs()));
        }
    }
}

#[test]
fn angles_come_in_counts_and_forces_in_steps() {
    let machine = machines::THRUSTERS[0](&mut Dice::new(1, 1));
    let command = vec![5.0; 500];
    let trace = bench(&machine, true).run(Driver::Command(&command), &mut []);
    let count = TAU / machine.sensors.encoder_counts;
    let step = machine.sensors.thrust_full_scale_n / 2048.0;
    for reading in &trace.readings {
        assert!((reading.angle_rad / count - (reading.angle_rad / count).round()).abs() < 1e-6);
        assert!((reading.thrust_n / step - (reading.thrust_n / step).round()).abs() < 1e-6);
    }
    assert!(trace.readings.last().unwrap().thrust_n > 10.0 * step, "the thruster pushes");
}

#[test]
fn a_row_shows_the_command_that_starts_and_the_state_before_it_acts() {
    let machine = machines::THRUSTERS[0](&mut Dice::new(1, 1));
    let command: Vec<f64> = (0..40).map(|tick| if tick < 20 { 0.0 } else { 5.0 }).collect();
    let trace = bench(&machine, false).run(Driver::Command(&command), &mut []);
    assert_eq!((trace.command[19], trace.command[20]), (0.0, 5.0));
    assert!(trace.readings[20].current_a.abs() < 1e-9, "the current has had no time");
    // Five ticks of 2 ms later a lag of 2 ms has followed to 99.3 %.
    let share = trace.readings[25].current_a / 5.0;
    assert!((share - (1.0 - (-5.0_f64).exp())).abs() < 5e-3, "{share}");
}

#[test]
fn a_shaft_below_its_breakaway_does_not_move() {
    let machine = machines::DRY[0](&mut Dice::new(1, 1));
    let family = families::find("coulomb_friction").unwrap();
    let full = Scale { speed_rad_s: 100.0, duration_s: 1.0, ..UNIT };
    for form in [0, 1, 2, 4] {
        let mut physics = vec![(family.draw)(form, &machine, &full, &mut Dice::new(4, 1))];
        physics[0].set(0.2);
        // Friction is 0.14 of the torque at the limit; a command of a tenth of it does not move it.
        let still = vec![0.1 * machine.current_limit_a; 400];
        let trace = Bench { full, ..bench(&machine, false) }.run(Driver::Command(&still), &mut physics);
        assert!(trace.speed_rad_s.iter().all(|speed| *speed == 0.0), "{}", family.forms[form]);
        let moving = vec![0.5 * machine.current_limit_a; 400];
        let trace = Bench { full, ..bench(&machine, false) }.run(Driver::Command(&moving), &mut physics);
        assert!(*trace.speed_rad_s.last().unwrap() > 1.0, "{}", family.forms[form]);
    }
}

#[test]
fn an_arm_rests_where_its_weight_holds_the_motor() {
    let machine = machines::LOADED[0](&mut Dice::new(1, 1));
    let (weight, stalled) = (machine.load.largest_weight_n_m(), machine.torque_limit_n_m());
    let volts = 0.5 * weight / stalled * machine.supply_v;
    let ticks = (20.0 / machine.sensors.tick_s) as usize;
    let trace = bench(&machine, false).run(Driver::Command(&vec![volts; ticks]), &mut []);
    let last = trace.readings.last().unwrap();
    assert!(last.speed_rad_s.abs() < 1e-3, "{last:?}");
    assert!((last.angle_rad.sin() - 0.5).abs() < 0.01, "half of the weight's torque: {last:?}");
}

#[test]
fn a_blower_turns_as_fast_as_its_torque_allows() {
    let machine = machines::LOADED[2](&mut Dice::new(1, 1));
    let Load::Fan { drag_nm_s2 } = machine.load else { panic!("{machine:?}") };
    let ticks = (60.0 / machine.sensors.tick_s) as usize;
    let command = vec![machine.current_limit_a; ticks];
    let trace = bench(&machine, false).run(Driver::Command(&command), &mut []);
    let speed = *trace.speed_rad_s.last().unwrap();
    let taken = drag_nm_s2 * speed * speed + machine.viscous_nm_s * speed;
    assert!((taken / machine.torque_limit_n_m() - 1.0).abs() < 1e-3, "{taken} N m at {speed} rad/s");
}
