//! Excitations under which several names give the same recording.

use crate::dice::Dice;
use crate::excitation::Excitation;
use crate::families;
use crate::load::Load;
use crate::log::Stamps;
use crate::machines;
use crate::plan::{Plan, Wanted};

/// Turns a plan into a confounded one; which rivals, the seed says.
pub fn confound(plan: &mut Plan, seed: u64, dice: &mut Dice) {
    plan.closed = false;
    plan.log.columns.command = true;
    plan.log.stamps = Stamps::Even;
    plan.log.from_s = 0.0;
    let wet = |plan: &mut Plan, dice: &mut Dice| {
        if !plan.machine.wet() {
            plan.machine = dice.pick(&machines::THRUSTERS[..3])(dice);
            plan.log.columns.thrust = true;
            plan.log.columns.flow = true;
        }
    };
    // Rivals, each with the form that cannot be told from the others', and the size.
    let (rivals, share): (&[(&str, usize)], f64) = match seed % 5 {
        0 => {
            // A weight turns the shaft back, where friction and an offset differ.
            if plan.machine.load != Load::None {
                plan.machine = dice.pick(&machines::DRY)(dice);
            }
            plan.excitation = Excitation::OneSided;
            (&[("coulomb_friction", 0), ("torque_channel_bias", 0)], dice.between(0.02, 0.08))
        }
        1 => {
            wet(plan, dice);
            plan.excitation = Excitation::SlowSines;
            plan.log.columns.current = false;
            (&[("transport_delay", 0), ("amplifier_lag", 0)], dice.between(0.004, 0.006))
        }
        2 => {
            wet(plan, dice);
            plan.excitation = Excitation::Full;
            (&[("entrained_water_inertia", 0), ("rotor_inertia_error", 0)], dice.between(0.02, 0.04))
        }
        3 => {
            plan.machine = dice.pick(&machines::DRY)(dice);
            plan.excitation = Excitation::OneSpeed;
            // The start from rest would tell: the log begins when the speed stands.
            plan.log.from_s = 3.0;
            plan.log.columns =
                crate::log::Columns { thrust: false, torque: false, flow: false, ..plan.log.columns };
            let list = &[
                ("coulomb_friction", 0),
                ("viscous_friction", 0),
                ("windage_drag", 0),
                ("torque_channel_bias", 0),
            ];
            (list, dice.between(0.05, 0.2))
        }
        _ => {
            wet(plan, dice);
            plan.excitation = Excitation::SlowSines;
            plan.log.columns.thrust = true;
            (&[("thrust_sensor_lag", 0), ("clock_skew", 0)], dice.between(0.006, 0.01))
        }
    };
    let (id, form) = dice.pick(rivals);
    let family = families::find(id).expect("rivals are families");
    plan.wanted.push(Wanted { family, form, share });
    plan.confounded = rivals.iter().map(|(id, _)| *id).collect();
}
