//! What a rig file states of a machine: values that are wrong, with honest tolerances.

use std::fmt::Write;

use crate::dice::Dice;
use crate::load::Load;
use crate::machine::{DriveKind, Machine};

/// Quantities that a rig states and a fit may move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// `pitch_rad`
    Pitch,
    /// `lift_max`
    Lift,
    /// `drag_max`
    Drag,
    /// `flux_coefficient`
    Flux,
    /// `added_mass_coefficient`
    AddedMass,
    /// `inertia_kg_m2`
    Inertia,
    /// `torque_constant_nm_a`
    TorqueConstant,
    /// `viscous_friction_nm_s`
    Viscous,
    /// `winding_resistance_ohm`
    Resistance,
    /// `mass_kg` of a load, or the coefficient of a fan
    LoadSize,
}

impl Quantity {
    /// Those of a machine.
    pub fn of(machine: &Machine) -> Vec<Quantity> {
        use Quantity::*;
        let mut list = vec![Inertia, TorqueConstant];
        if machine.wet() {
            list.extend([Pitch, Lift, Drag, Flux, AddedMass]);
        } else {
            list.push(Viscous);
        }
        if machine.drive == DriveKind::Voltage {
            list.push(Resistance);
        }
        if machine.load != Load::None {
            list.push(Quantity::LoadSize);
        }
        list
    }

    /// The machine with this quantity scaled.
    pub fn scaled(self, machine: &Machine, factor: f64) -> Machine {
        let mut machine = machine.clone();
        if let Some(blades) = &mut machine.blades {
            match self {
                Quantity::Pitch => blades.sections.iter_mut().for_each(|section| section.pitch_rad *= factor),
                Quantity::Lift => blades.section_gain.0 *= factor,
                Quantity::Drag => blades.section_gain.1 *= factor,
                Quantity::Flux => blades.flux_coefficient *= factor,
                Quantity::AddedMass => blades.added_mass_coefficient *= factor,
                _ => {}
            }
        }
        match self {
            Quantity::Inertia => {
                let load = machine.load.inertia_kg_m2();
                machine.inertia_kg_m2 = load + factor * (machine.inertia_kg_m2 - load);
            }
            Quantity::LoadSize => {
                let own = machine.inertia_kg_m2 - machine.load.inertia_kg_m2();
                machine.load = machine.load.scaled(factor);
                machine.inertia_kg_m2 = own + machine.load.inertia_kg_m2();
            }
            Quantity::TorqueConstant => machine.torque_constant_nm_a *= factor,
            Quantity::Viscous => machine.viscous_nm_s *= factor,
            Quantity::Resistance => machine.winding_resistance_ohm *= factor,
            _ => {}
        }
        machine
    }
}

/// One statement: a factor on the true value, and the tolerance (two sigma, relative) beside it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Claim {
    /// Of what.
    pub quantity: Quantity,
    /// Stated over true.
    pub factor: f64,
    /// Tolerance.
    pub tol: f64,
}

/// How well an owner knows a rig: one sigma of the logarithm.
const CARE: [f64; 6] = [0.03, 0.08, 0.08, 0.13, 0.2, 0.33];

/// States a machine; `close` quantities within a percent. Nothing is off by more than a factor of two.
pub fn claims(machine: &Machine, close: &[Quantity], dice: &mut Dice) -> Vec<Claim> {
    let care = dice.pick(&CARE);
    let mut claim = |quantity: Quantity| {
        let sigma = match quantity {
            _ if close.contains(&quantity) => 0.004,
            Quantity::Pitch => 0.3 * care.min(0.15),
            Quantity::Flux => 0.5 * care,
            // A scale and a rule are at hand; a fan is as well known as the rest.
            Quantity::LoadSize if machine.load.inertia_kg_m2() > 0.0 => 0.015,
            _ => care,
        };
        let error = (sigma * dice.normal()).clamp(-1.9 * sigma, 1.9 * sigma);
        let factor = error.clamp(-2f64.ln(), 2f64.ln()).exp();
        // Two sigma, as seen from the stated value.
        Claim { quantity, factor, tol: (2.0 * sigma).exp() - 1.0 }
    };
    Quantity::of(machine).into_iter().map(&mut claim).collect()
}

/// What is recorded, as far as the rig file says it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Recorded {
    /// Propeller-side torque transducer.
    pub torque: bool,
    /// Rows of the log have no even rate.
    pub irregular: bool,
}

/// The rig file's text.
pub fn rig_toml(machine: &Machine, name: &str, claims: &[Claim], recorded: Recorded) -> String {
    let claimed = |quantity: Quantity, value: f64| {
        claims.iter().find(|claim| claim.quantity == quantity).map_or_else(
            || significant(value, 5),
            |claim| format!("{{ value = {}, tol = {:.3} }}", significant(value * claim.factor, 5), claim.tol),
        )
    };
    let mut text =
        String::from("# What the owner states; `tol` is the relative uncertainty of a value, two sigma.\n");
    let _ = writeln!(text, "[rig]\nname = \"{name}\"\nclass = \"{}\"\n\n[propeller]", machine.class);
    if let Some(b) = &machine.blades {
        let _ = writeln!(
            text,
            "radius_m = {}\nduct_length_m = {}",
            significant(b.radius_m, 4),
            significant(b.duct_length_m, 4)
        );
        let _ = writeln!(text, "pitch_rad = {}", claimed(Quantity::Pitch, b.pitch_rad));
        let _ = writeln!(text, "lift_max = {}", claimed(Quantity::Lift, b.lift_max));
        let _ = writeln!(text, "drag_max = {}", claimed(Quantity::Drag, b.drag_max));
        let _ = writeln!(text, "\n[flow]\ndensity_kg_m3 = {:.1}", b.density_kg_m3);
        let _ = writeln!(text, "flux_coefficient = {}", claimed(Quantity::Flux, b.flux_coefficient));
        let _ = writeln!(
            text,
            "added_mass_coefficient = {}",
            claimed(Quantity::AddedMass, b.added_mass_coefficient)
        );
    } else {
        text += "kind = \"none\"\n";
    }
    let _ = writeln!(
        text,
        "\n[motor]\ninertia_kg_m2 = {}",
        claimed(Quantity::Inertia, machine.inertia_kg_m2 - machine.load.inertia_kg_m2())
    );
    let _ = writeln!(
        text,
        "torque_constant_nm_a = {}",
        claimed(Quantity::TorqueConstant, machine.torque_constant_nm_a)
    );
    let _ = writeln!(
        text,
        "winding_resistance_ohm = {}",
        claimed(Quantity::Resistance, machine.winding_resistance_ohm)
    );
    if machine.viscous_nm_s > 0.0 {
        let _ =
            writeln!(text, "viscous_friction_nm_s = {}", claimed(Quantity::Viscous, machine.viscous_nm_s));
    }
    let kind = if machine.drive == DriveKind::Current { "current" } else { "voltage" };
    let _ = writeln!(text, "\n[amplifier]\nkind = \"{kind}\"");
    if machine.drive == DriveKind::Current {
        let _ = writeln!(text, "time_constant_s = {}", significant(machine.drive_lag_s, 3));
    }
    let _ = writeln!(
        text,
        "current_limit_a = {}\nsupply_v = {}",
        machine.current_limit_a,
        significant(machine.supply_v, 4)
    );
    match machine.load {
        Load::None => {}
        Load::Arm { mass_kg, length_m } => {
            let _ = write!(
                text,
                "\n[load]\nkind = \"pendulum\"\nmass_kg = {}\nlength_m = {length_m}\n",
                claimed(Quantity::LoadSize, mass_kg)
            );
        }
        Load::Fan { drag_nm_s2 } => {
            let _ = write!(
                text,
                "\n[load]\nkind = \"fan\"\nfan_coefficient_nm_s2 = {}\n",
                claimed(Quantity::LoadSize, drag_nm_s2)
            );
        }
        Load::Carriage { mass_kg, lead_m_rev, incline_rad } => {
            let _ = write!(
                text,
                "\n[load]\nkind = \"slide\"\nmass_kg = {}\nlead_m_rev = {lead_m_rev}\nincline_rad = {incline_rad}\n",
                claimed(Quantity::LoadSize, mass_kg)
            );
        }
    }
    let s = &machine.sensors;
    text += "\n[sensors]\n";
    if !recorded.irregular {
        let _ = writeln!(text, "log_rate_hz = {}", significant(1.0 / (s.tick_s * s.ticks_per_row as f64), 6));
    }
    let _ = writeln!(text, "control_rate_hz = {}", significant(1.0 / s.tick_s, 6));
    if s.tachometer_noise == 0.0 {
        let _ = writeln!(text, "encoder_counts_per_rev = {}", s.encoder_counts);
    }
    let _ = writeln!(text, "speed_filter_time_constant_s = {}", significant(s.speed_filter_s, 3));
    if machine.wet() {
        let _ = write!(
            text,
            "thrust_filter_hz = {}\nthrust_full_scale_n = {}\nthrust_bits = {}\ntorque_filter_hz = {}\n\
             flow_rate_hz = {}\ntorque = \"{}\"\nambient_flow = \"not recorded\"\n\n[run]\nwater = \"tank\"\n",
            s.thrust_filter_hz,
            s.thrust_full_scale_n,
            s.thrust_bits,
            s.torque_filter_hz,
            s.flow_rate_hz,
            if recorded.torque { "propeller-side transducer" } else { "none" },
        );
    }
    text
}

/// A number with so many significant digits, as TOML reads it.
fn significant(value: f64, digits: usize) -> String {
    let text = format!("{value:.*e}", digits - 1);
    let value: f64 = text.parse().unwrap_or(value);
    if (1e-4..1e6).contains(&value.abs()) { format!("{value}") } else { format!("{value:e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_stated_is_wrong_but_honest() {
        let mut widest: f64 = 1.0;
        for seed in 0..300 {
            let mut dice = Dice::new(seed, 3);
            let machine = crate::machines::THRUSTERS[dice.index(6)](&mut dice);
            for claim in claims(&machine, &[Quantity::Lift], &mut dice) {
                let off = 1.0 / claim.factor - 1.0;
                assert!(off.abs() <= 1.01 * claim.tol, "{claim:?}: the truth lies {off} off");
                if claim.quantity == Quantity::Lift {
                    assert!(off.abs() < 0.01, "{claim:?}");
                }
                widest = widest.max(claim.factor.max(1.0 / claim.factor));
            }
        }
        assert!(widest > 1.6 && widest <= 2.0, "{widest}");
    }

    #[test]
    fn a_load_is_stated_beside_the_motor_s_own_inertia() {
        let machine = crate::machines::LOADED[0](&mut Dice::new(3, 1));
        let own = machine.inertia_kg_m2 - machine.load.inertia_kg_m2();
        let recorded = Recorded { torque: false, irregular: false };
        let text = rig_toml(&machine, "arm", &[], recorded);
        assert!(text.contains(&format!("inertia_kg_m2 = {}", significant(own, 5))), "{text}");
        assert!(text.contains("[load]\nkind = \"pendulum\""), "{text}");
        // More inertia of the motor is no heavier weight, and the other way round.
        let other = Quantity::Inertia.scaled(&machine, 1.5);
        assert!((other.inertia_kg_m2 - other.load.inertia_kg_m2() - 1.5 * own).abs() < 1e-12);
        let other = Quantity::LoadSize.scaled(&machine, 1.5);
        assert!((other.inertia_kg_m2 - other.load.inertia_kg_m2() - own).abs() < 1e-12);
    }

    #[test]
    fn numbers_keep_their_digits() {
        assert_eq!(significant(0.012345678, 3), "0.0123");
        assert_eq!(significant(5.2e-6, 3), "5.2e-6");
        assert_eq!(significant(500.0, 6), "500");
    }
}
