//! The controller's tick allocates nothing, whatever law, observer or estimator runs.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use kort_control::{ControllerConfig, EstimatorKind, LawKind};
use kort_controller::tick::{Revision, Tick};
use kort_proto::messages::{Header, Setpoint, SetpointKind, Telemetry};
use kort_proto::signals::Signals;
use kort_thruster::rig::Rig;

struct Counting;

thread_local! {
    static COUNT: Cell<u64> = const { Cell::new(0) };
}

// SAFETY: hands everything to the system's allocator; the counter is a plain thread-local.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.with(|c| c.set(c.get() + 1));
        // SAFETY: the caller's promise.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise.
        unsafe { System.dealloc(at, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn no_law_allocates_in_its_tick() {
    let rig = Rig::from_toml(include_str!("../../../config/thrusters/whitcomb-yoerger-1999.toml")).unwrap();
    let known = "\n[[effects]]\neffect = \"coulomb_friction\"\ncoulomb_torque_n_m = 0.3\n\
        [[effects]]\neffect = \"amplifier_lag\"\nextra_lag_s = 0.01\n";
    let text = include_str!("../../../config/thrusters/whitcomb-yoerger-1999.toml").to_owned() + known;
    let revised = Rig::from_toml(&text).unwrap();
    const PERIOD: u64 = 4_000_000;
    for law in LawKind::ALL {
        let config = ControllerConfig { estimator: EstimatorKind::Rls, ..ControllerConfig::with_law(law) };
        let mut now = 1_000_000_000;
        let mut tick = Tick::new(&rig, &config, PERIOD, now).unwrap();
        // Designed beside the tick, taken over in it.
        let mut revision = Revision::new(&revised, PERIOD, 2).unwrap();
        let before = COUNT.with(Cell::get);
        let mut driven = false;
        for i in 1..500u64 {
            now += PERIOD;
            let header = Header { sequence: i, stamp_ns: now, session: 900_000_000 };
            let speed = 30.0 + (i as f64 * 0.05).sin();
            let signals = Signals {
                shaft_speed_rad_s: speed,
                current_a: 2.0,
                thrust_n: 30.0,
                supply_v: 120.0,
                ..Signals::UNKNOWN
            };
            tick.take_telemetry(
                &Telemetry {
                    header,
                    signals,
                    armed: u32::from(i > 2),
                    armed_at_ns: 1_000_000_000,
                    drive_max: 9.0,
                    ..Telemetry::default()
                },
                now,
            );
            tick.take_setpoint(
                &Setpoint {
                    header,
                    generation: 1,
                    given_at_ns: 1_000_000_001,
                    lease_until_ns: u64::MAX,
                    kind: SetpointKind::Thrust as u32,
                    value: 50.0,
                    ..Setpoint::default()
                },
                now,
            );
            if i % 100 == 0 {
                tick.adopt(&mut revision).unwrap();
            }
            driven |= tick.tick(now).drive != 0.0;
            let _ = std::hint::black_box(tick.state());
        }
        assert_eq!(COUNT.with(Cell::get) - before, 0, "{}", law.name());
        assert!(driven, "{} never drove", law.name());
    }
}
