//! Sensors that lie on a sound wire: reversed, in a wrong unit, or the same for ever. Each ends at zero torque at the motor with its
//! own fault latched, and costs a factor in thrust until then.

use std::time::{Duration, Instant};

use kort_emulators::vesc::Make;
use kort_emulators::{Bench as Emulator, Mischief, Printer, Vesc};
use kort_proto::faults::Fault;

use crate::common::{Site, Stack, in_real_time, wait};
use crate::link::{Case, rig};

/// What is asked for, N, and the most that any lie may make of it: twice, and what the shaft shoots over.
const ASKED_N: f64 = 40.0;
const MOST_N: f64 = 2.5 * ASKED_N;
/// A contradiction must last for 2 s, after it has grown to be one.
const CELL: Duration = Duration::from_secs(15);

fn vesc() -> Emulator {
    Emulator::start(Vesc::new(Make::default(), &rig("whitcomb-yoerger-1999"))).unwrap()
}

fn site(emulator: &Emulator, cell: Option<&Emulator>) -> Site {
    let site = Case::new("vesc", "pole_pairs = 7").site(emulator).with_a_fast_controller();
    if let Some(cell) = cell {
        let text = std::fs::read_to_string(site.config()).unwrap();
        let text = text.replace("law = \"velocity_servo\"", "law = \"thrust_pi\"");
        assert!(text.contains("thrust_pi"), "{text}");
        std::fs::write(site.config(), text).unwrap();
        let keys = format!(
            "kind = \"serial_line\", port = {:?}, required = true, signals = {{ thrust_n = {{ column = 2, unit = \"N\" }} }}",
            cell.port()
        );
        site.add("[thrusters.t1]", &format!("sensors = {{ force = {{ {keys} }} }}"));
    }
    site
}

/// The thruster is at rest, disarmed, with this fault; until then it never thrust more than `most_n`.
fn ends_at_zero(stack: &Stack, emulator: &Emulator, fault: Fault, most_n: f64, within: Duration) {
    let (began, mut largest_n) = (Instant::now(), 0.0f64);
    wait("the servo to trip", || {
        largest_n = largest_n.max(emulator.truth().thrust_n.abs());
        (stack.state()?["armed"] == false).then_some(())
    });
    let took = began.elapsed();
    wait("zero at the motor", || (emulator.truth().command == 0.0).then_some(()));
    let faults = stack.state().expect("a state")["faults"].to_string();
    println!("{faults} after {} ms, at most {largest_n} N", took.as_millis());
    assert!(faults.contains(fault.name()), "{faults} is not {}", fault.name());
    assert!(largest_n <= most_n, "{largest_n} N beyond {most_n} N");
    assert!(took < within, "{took:?} beyond {within:?}");
}

/// The law closes its loop on the cell: what the cell makes of the thrust is what it drives by.
#[test]
fn a_force_cell_that_lies_ends_at_zero() {
    in_real_time(|| {
        let emulator = vesc();
        let watched = emulator.watched();
        let cell = Emulator::start(Printer::of(move || watched().thrust_n, "N", 50.0)).unwrap();
        let mut stack = Stack::start_at(site(&emulator, Some(&cell)));
        for mischief in [Mischief::Reversed, Mischief::Scaled(10), Mischief::Multiplied(10), Mischief::Frozen]
        {
            println!("{mischief:?}");
            stack.thrust_by_state(ASKED_N, 60_000);
            std::thread::sleep(Duration::from_secs(1));
            if mischief == Mischief::Frozen {
                // Where it stands just right nothing is wrong: the next setpoint shows it.
                cell.spoil(mischief);
                stack.expect("PUT", "/setpoint", Some(serde_json::json!({"thrust_n": 2.0 * ASKED_N})));
                ends_at_zero(&stack, &emulator, Fault::SensorImplausible, 2.0 * MOST_N, CELL);
            } else {
                cell.spoil(mischief);
                ends_at_zero(&stack, &emulator, Fault::SensorImplausible, MOST_N, CELL);
            }
            cell.spoil(Mischief::None);
        }
    });
}

/// A number beyond what the cell can be is no reading: never shown, and a cell that gives no other is lost.
#[test]
fn a_number_that_cannot_be_is_no_reading() {
    in_real_time(|| {
        let emulator = vesc();
        let watched = emulator.watched();
        let cell = Emulator::start(Printer::of(move || watched().thrust_n, "N", 50.0)).unwrap();
        let mut stack = Stack::start_at(site(&emulator, Some(&cell)));
        stack.thrust_by_state(ASKED_N, 60_000);
        cell.spoil(Mischief::Multiplied(200));
        ends_at_zero(&stack, &emulator, Fault::SensorLost, MOST_N, CELL);
        let shown = stack.state().expect("a state")["measured"]["thrust_n"].as_f64().unwrap_or(0.0);
        assert!(shown.abs() < 1112.0, "{shown} N is shown");
    });
}

/// Shaft speed told the wrong way round, or seven times too low from the start, as with 49 pole pairs for 7.
#[test]
fn a_shaft_speed_in_a_wrong_unit_ends_at_zero() {
    in_real_time(|| {
        for (mischief, fault) in
            [(Mischief::Scaled(7), Fault::ShaftSlow), (Mischief::Reversed, Fault::SensorReversed)]
        {
            println!("{mischief:?}");
            let emulator = vesc();
            emulator.spoil(mischief);
            let mut stack = Stack::start_at(site(&emulator, None));
            stack.command(ASKED_N, 60_000);
            // The whole thrust, until the second is over that it takes.
            ends_at_zero(&stack, &emulator, fault, 1.1 * 176.0, CELL);
        }
    });
}
