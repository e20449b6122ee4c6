//! Is the loop fast enough for its law on this rig?
//!
//! Some laws lead a model of the shaft, one explicit step a period. Beside its steady load a shaft that comes from rest to top
//! speed in `t` under all torque settles at the rate `2 / t` at top speed (the load goes with the square of the speed: its slope
//! there is twice the torque over the speed). A step of `T` takes `2 T / t` of what is left: beyond one it overshoots, beyond
//! two the model runs away, and the thrust swings with it. Drive and sensors come on top, so a third of `t` is taken for the
//! most: under the default law the thrust of the shipped rigs then swings by 4 % of the largest at worst, by 29 % at two thirds
//! (`tests/slow_loop.rs`). A drive with a speed loop of its own steps no shaft.

use kort_control::advice::TimeScales;
use kort_control::model::ControlModel;
use kort_control::{ControllerConfig, LawKind};
use kort_proto::config::Thruster;
use kort_thruster::rig::{AmplifierKind, Rig};

/// Longest period, share of the time in which the shaft comes from rest to top speed.
pub const LONGEST_PERIOD: f64 = 1.0 / 3.0;

/// Does a law lead a model of the shaft?
const fn leads(law: LawKind) -> bool {
    match law {
        LawKind::Model2Inversion
        | LawKind::RotationalFlowInversion
        | LawKind::TrimmedModel2Inversion
        | LawKind::LookAhead => true,
        LawKind::StaticMap
        | LawKind::VelocityServo
        | LawKind::Model1Inversion
        | LawKind::Model3Inversion
        | LawKind::TorqueControl
        | LawKind::PowerControl
        | LawKind::CombinedAntiSpin
        | LawKind::ThrustPi => false,
    }
}

/// What is to be said of a loop that is too slow for its law, from the key on.
pub fn too_slow(id: &str, thruster: &Thruster, rig: &Rig, law: &ControllerConfig) -> Option<String> {
    if !leads(law.law) || rig.amplifier.kind == AmplifierKind::Speed {
        return None;
    }
    let period_s = thruster.controller_period_ns() as f64 * 1e-9;
    let shaft_s = TimeScales::of(&ControlModel::from_rig(rig, period_s).ok()?).shaft_s;
    let longest_s = LONGEST_PERIOD * shaft_s;
    if period_s <= longest_s {
        return None;
    }
    let servo_hz = thruster.servo.rate_hz;
    let ticks = (servo_hz * longest_s).floor().max(1.0);
    let (asked, least) = (thruster.controller.rate_hz, (1.0 / longest_s).ceil());
    let default = if thruster.controller.takes_default() { ", the default here" } else { "" };
    Some(format!(
        "`thrusters.{id}.controller.rate_hz` = {asked} is too slow for `{}`{default}: in {:.0} ms the shaft of this rig gets too far for a model of it to be led \
         (it comes to top speed in {:.0} ms, and a period of a third of that is the longest); the thrust swings; allowed are {least} and more\n\
         hint: rate_hz = {}, or law = \"velocity_servo\", which leads no model",
        law.law.name(),
        1e3 * period_s,
        1e3 * shaft_s,
        servo_hz / ticks,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use kort_proto::config::Config;

    const RIG: &str = include_str!("../../../config/thrusters/whitcomb-yoerger-1999.toml");

    #[test]
    fn a_loop_that_is_too_slow_for_its_law_is_told_with_one_that_is_not() {
        let rig = Rig::from_toml(RIG).unwrap();
        let said = |hz: f64, law: LawKind, rig: &Rig| {
            let text = format!(
                "[thrusters.t1]\nrig = \"r\"\namplifier = \"simulated\"\ncontroller = {{ rate_hz = {hz:?} }}\n"
            );
            let config = Config::parse(&text, None).unwrap();
            too_slow("t1", config.thruster("t1").unwrap(), rig, &ControllerConfig::with_law(law))
        };
        let words = said(10.0, LawKind::Model2Inversion, &rig).unwrap();
        let way_out = words.split("hint: rate_hz = ").nth(1).and_then(|rest| rest.split(',').next());
        let hz: f64 = way_out.unwrap().parse().unwrap();
        assert!(words.contains("the default here") && words.contains("top speed in 61 ms"), "{words}");
        assert_eq!(said(hz, LawKind::Model2Inversion, &rig), None, "{words}");
        assert_eq!(said(250.0, LawKind::LookAhead, &rig), None);
        assert_eq!(said(10.0, LawKind::VelocityServo, &rig), None);
        let speed = RIG.replace("kind = \"current\"", "kind = \"speed\"");
        assert_eq!(said(10.0, LawKind::Model2Inversion, &Rig::from_toml(&speed).unwrap()), None);
    }
}
