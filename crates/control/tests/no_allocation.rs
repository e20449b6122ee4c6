//! A tick allocates nothing, under any law, observer and estimator.

mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use common::rigs;
use kort_control::{
    Controller, ControllerConfig, EstimatorKind, LawKind, Measurement, ObserverKind, Reference,
};
use kort_thruster::rig::Rig;

struct Counting;

thread_local! {
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: passes every call on to the system allocator; counting touches no memory of its own.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.with(|c| c.set(c.get() + 1));
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn the_counter_counts() {
    let before = COUNT.with(Cell::get);
    std::hint::black_box(Box::new(1));
    assert!(COUNT.with(Cell::get) > before);
}

/// One effect for each way of using one: friction, angle, slow state, command, delay, supply, sensors, blades.
const EFFECTS: &str = r#"
[[effects]]
effect = "coulomb_friction"
coulomb_torque_n_m = 0.3
[[effects]]
effect = "position_dependent_friction"
mean_friction_n_m = 0.1
[[effects]]
effect = "command_dead_band"
half_width = 0.2
[[effects]]
effect = "transport_delay"
delay_s = 0.02
[[effects]]
effect = "thrust_sensor_lag"
thrust_lag_s = 0.02
[[effects]]
effect = "thrust_bias_gain_hysteresis"
gain_error = 0.05
[[effects]]
effect = "forward_reverse_asymmetry"
reverse_lift_error = -0.1
"#;

#[test]
fn no_tick_allocates() {
    let plain = rigs().swap_remove(0);
    for rig in [Rig::from_toml(&format!("{}{EFFECTS}", common::STAND)).unwrap(), plain] {
        no_tick_allocates_on(&rig);
    }
}

fn no_tick_allocates_on(rig: &Rig) {
    for law in LawKind::ALL {
        for observer in ObserverKind::ALL {
            for estimator in EstimatorKind::ALL {
                let config = ControllerConfig { law, observer, estimator, ..Default::default() };
                let mut c = Controller::new(rig, &config, 0.001).unwrap();
                let other = ControllerConfig { law: LawKind::StaticMap, ..config };
                let before = COUNT.with(Cell::get);
                for k in 0..300 {
                    let x = f64::from(k) * 0.1;
                    let measured = Measurement {
                        shaft_speed_rad_s: (k % 7 != 0).then_some(x),
                        current_a: Some(0.1 * x),
                        thrust_n: (k % 5 != 0).then_some(x),
                        flow_m_s: Some(0.02 * x),
                        ambient_m_s: None,
                        supply_v: Some(120.0),
                        shaft_angle_rad: Some(x),
                    };
                    let reference = match k % 100 {
                        0..40 => Reference::Thrust(50.0),
                        40..60 => Reference::Speed(20.0),
                        60..70 => Reference::Off,
                        _ => Reference::Thrust(f64::NAN),
                    };
                    std::hint::black_box(c.tick(&measured, reference, 0.001));
                    if k == 150 {
                        c.configure(&other);
                    }
                }
                assert_eq!(
                    COUNT.with(Cell::get),
                    before,
                    "{} {} {}",
                    law.name(),
                    observer.name(),
                    estimator.name()
                );
            }
        }
    }
}
