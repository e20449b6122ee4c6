//! Bare steps against the current limit: how near `look_ahead` comes to the least error that any law
//! could have there. `cargo test -p kort-control --test reversal -- --nocapture` prints both.

mod common;

use common::{Loop, rigs};
use kort_control::{ControlModel, ControllerConfig, LawKind, ObserverKind, Reference};

/// Levels of soak-crash-reversals.toml, held two seconds each.
const LEVELS: [f64; 10] = [0.8, -0.8, 0.4, -0.4, 0.0, 0.8, -0.4, 0.4, -0.8, 0.0];
const HOLD_S: f64 = 2.0;

/// Root mean square of the error that the drive alone leaves: all its current, behind its own slew and
/// lag, from the step until thrust is there, and no error from then on. Thrust rises strictly with
/// shaft speed at a given flow, and speed with current: nothing gets there sooner.
fn least_rms_n(model: &ControlModel, rate_a_s: f64) -> f64 {
    let h = 2e-5;
    let (mut speed, mut flow, mut current, mut asked) = (0.0, 0.0, 0.0, 0.0);
    let (mut squares, mut time) = (0.0, 0.0);
    for level in LEVELS {
        let target = level * model.thrust_max_n;
        let away = |speed: f64, flow: f64| target - model.load(speed, flow, 0.0).thrust_n;
        let towards = away(speed, flow).signum();
        let mut there = false;
        for k in 0..(HOLD_S / h) as usize {
            let error = away(speed, flow);
            there |= error * towards <= 0.0;
            // As the loop is scored: at the end of each tick.
            if k > 0 && k % 50 == 0 && !there {
                squares += error * error * 50.0 * h;
            }
            let load = model.load(speed, flow, 0.0);
            if there {
                speed = model.speed_for_thrust_rad_s(target, flow, 0.0, speed);
                current = load.torque_n_m / model.torque_constant_nm_a;
                asked = current;
            } else {
                asked += (towards * model.current_limit_a - asked).clamp(-rate_a_s * h, rate_a_s * h);
                current += (asked - current) * h / model.amplifier_lag_s;
                speed += h * (model.torque_constant_nm_a * current - load.torque_n_m) / model.inertia_kg_m2;
            }
            flow += h * model.flow_acceleration(load.thrust_n, flow, 0.0);
        }
        time += HOLD_S;
    }
    (squares / time).sqrt()
}

#[test]
fn look_ahead_is_near_what_the_drive_allows() {
    let rig = &rigs()[0];
    let model = ControlModel::from_rig(rig, 1e-3).unwrap();
    let rms = |law: LawKind, observer: ObserverKind| {
        let config = ControllerConfig { law, observer, ..ControllerConfig::default() };
        let mut l = Loop::new(rig, &config, 1e-3);
        let (mut squares, mut n) = (0.0, 0.0);
        for level in LEVELS {
            for _ in 0..2000 {
                l.tick(Reference::Thrust(level * model.thrust_max_n));
                squares += (l.thrust() - level * model.thrust_max_n).powi(2);
                n += 1.0;
            }
        }
        (squares / n).sqrt()
    };
    let options = ControllerConfig::default().limits;
    let least = least_rms_n(&model, options.current_rate_per_s * model.current_limit_a);
    let (ahead, plain) =
        (rms(LawKind::LookAhead, ObserverKind::Ekf), rms(LawKind::VelocityServo, ObserverKind::OpenLoop));
    println!("least {least:.2} N, look_ahead {ahead:.2} N, velocity_servo {plain:.2} N RMS");
    println!("of the servo: least {:.3}, look_ahead {:.3}", least / plain, ahead / plain);
    assert!(0.999 * least <= ahead && ahead < 1.05 * least, "{least} {ahead}");
    assert!(ahead < plain, "{ahead} {plain}");
}
