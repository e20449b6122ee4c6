//! Families of forms: each has several, they differ, and each vanishes with its strength.

use kort_truth::dice::Dice;
use kort_truth::families::{self, Family};
use kort_truth::machine::{Machine, Scale};
use kort_truth::machines;
use kort_truth::physics::{Path, Physics};
use kort_truth::run::{Bench, Driver, Trace};

/// A machine that may have the effect, the same each time.
fn machine(family: &Family) -> Machine {
    let all = machines::THRUSTERS.iter().chain(&machines::DRY);
    all.map(|specimen| specimen(&mut Dice::new(5, 1))).find(|machine| (family.fits)(machine)).unwrap()
}

/// Both ways, at several levels, with rests, then a sine that grows: 3 s.
fn command(machine: &Machine) -> Vec<f64> {
    let ticks = (3.0 / machine.sensors.tick_s) as usize;
    let levels = [0.0, 1.0, 0.2, -0.8, 0.03, 0.6, -0.3, 0.9];
    let share = |tick: usize| match 4 * tick / ticks {
        0..3 => levels[tick * 4 * levels.len() / (3 * ticks)],
        _ => (12.0 * std::f64::consts::TAU * tick as f64 / ticks as f64).sin() * 0.6,
    };
    (0..ticks).map(|tick| share(tick) * machine.command_limit()).collect()
}

fn run(machine: &Machine, full: Scale, physics: Option<Box<dyn Physics>>) -> Trace {
    let bench = Bench { machine, full, step_s: machine.fine_step_s(), quantise: false };
    bench.run(Driver::Command(&command(machine)), &mut physics.into_iter().collect::<Vec<_>>())
}

fn scale(trace: &Trace) -> Scale {
    let top = |pick: fn(&kort_truth::physics::Reading) -> f64| {
        trace.readings.iter().map(pick).fold(1e-9, |top: f64, value| top.max(value.abs()))
    };
    Scale {
        speed_rad_s: top(|r| r.speed_rad_s),
        flow_m_s: top(|r| r.flow_m_s),
        thrust_n: top(|r| r.thrust_n),
        torque_n_m: trace.torque_n_m.iter().fold(1e-9, |top: f64, value| top.max(value.abs())),
        current_a: top(|r| r.current_a),
        command: trace.command.iter().fold(1e-9, |top: f64, value| top.max(value.abs())),
        duration_s: 3.0,
    }
}

/// Largest difference of any channel, over its scale.
fn apart(a: &Trace, b: &Trace, full: &Scale) -> f64 {
    a.readings.iter().zip(&b.readings).fold(0.0, |top: f64, (a, b)| {
        let list = [
            (a.speed_rad_s - b.speed_rad_s) / full.speed_rad_s,
            (a.flow_m_s - b.flow_m_s) / full.flow_m_s,
            (a.thrust_n - b.thrust_n) / full.thrust_n,
            (a.current_a - b.current_a) / full.current_a,
        ];
        list.into_iter().fold(top, |top, x| top.max(x.abs()))
    })
}

#[test]
fn every_family_has_at_least_three_forms_that_act_and_differ() {
    for family in families::ALL {
        assert!(family.forms.len() >= 3, "{}: {:?}", family.id, family.forms);
        let machine = machine(family);
        let clean = run(&machine, Scale { speed_rad_s: 1.0, duration_s: 3.0, ..Scale::default() }, None);
        let full = scale(&clean);
        let mut traces: Vec<Trace> = Vec::new();
        for form in 0..family.forms.len() {
            let mut physics = (family.draw)(form, &machine, &full, &mut Dice::new(9, 2));
            physics.set(0.2);
            let trace = run(&machine, full, Some(physics));
            assert!(!trace.broken, "{} [{}] runs away", family.id, family.forms[form]);
            let act = apart(&trace, &clean, &full);
            assert!(act > 1e-4, "{} [{}] does nothing: {act}", family.id, family.forms[form]);
            for (other, before) in traces.iter().enumerate() {
                let differ = apart(&trace, before, &full);
                assert!(differ > 1e-6, "{}: forms {other} and {form} do the same", family.id);
            }
            traces.push(trace);
        }
    }
}

#[test]
fn an_effect_without_strength_is_hardly_there() {
    // A link of two masses and play keep their stiffness; a converter's supply its head room.
    let stays =
        ["flexible_coupling", "gear_backlash", "supply_sag", "voltage_limit_backemf", "unsteady_lift_lag"];
    for family in families::ALL.iter().filter(|family| !stays.contains(&family.id)) {
        let machine = machine(family);
        let clean = run(&machine, Scale { speed_rad_s: 1.0, duration_s: 3.0, ..Scale::default() }, None);
        let full = scale(&clean);
        for form in 0..family.forms.len() {
            let mut physics = (family.draw)(form, &machine, &full, &mut Dice::new(3, 2));
            physics.set(0.0);
            let act = apart(&run(&machine, full, Some(physics)), &clean, &full);
            assert!(act < 0.01, "{} [{}] acts without strength: {act}", family.id, family.forms[form]);
        }
    }
}

#[test]
fn sensor_effects_leave_the_machine_alone() {
    for family in families::ALL.iter().filter(|family| family.path == Path::Sensor) {
        // A wrong zero of the drive's torque is called a sensor's, and does turn the shaft.
        if family.id == "torque_channel_bias" {
            continue;
        }
        let machine = machine(family);
        let clean = run(&machine, Scale { speed_rad_s: 1.0, duration_s: 3.0, ..Scale::default() }, None);
        let full = scale(&clean);
        for form in 0..family.forms.len() {
            let mut physics = (family.draw)(form, &machine, &full, &mut Dice::new(3, 2));
            physics.set(0.2);
            let trace = run(&machine, full, Some(physics));
            assert!(trace.speed_rad_s == clean.speed_rad_s, "{} moves the shaft", family.id);
        }
    }
}
