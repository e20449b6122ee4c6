//! Thruster classes, what is true of one specimen, and what its rig file states.

use crate::effects::Stated;
use crate::stand::{THRUST_BITS, THRUST_FILTER_HZ, TORQUE_FILTER_HZ};
use crate::thruster::{Section, Thruster};
use rand::Rng;
use std::fmt::Write;

/// Size class of a thruster.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// About 1 kW, 0.26 m duct, 9 A at 120 V.
    Work,
    /// 0.15 m duct, 20 A at 48 V.
    Medium,
    /// 76 mm duct, 34 A at 14.8 V.
    Small,
}

impl Class {
    /// A specimen: parameters drawn within the class.
    pub fn specimen(self, rng: &mut impl Rng) -> Thruster {
        let (class, radius, length, inertia, constant, resistance, limit, supply) = match self {
            Class::Work => {
                ("ducted work-class", 0.13, 0.1271, (0.0085, 0.0115), (1.12, 1.28), 2.2, 9.0, 120.0)
            }
            Class::Medium => {
                ("ducted survey-class", 0.075, 0.08, (7e-4, 9.5e-4), (0.17, 0.21), 0.45, 20.0, 48.0)
            }
            Class::Small => {
                ("small brushless", 0.038, 0.04, (5.2e-5, 6.8e-5), (0.0158, 0.0182), 0.11, 34.0, 14.8)
            }
        };
        let (lift, drag) =
            if self == Class::Work { ((0.48, 0.62), (1.05, 1.35)) } else { ((0.62, 0.88), (0.75, 1.0)) };
        let mut within = |(low, high): (f64, f64)| rng.random_range(low..high);
        let pitch_rad = within((0.37, 0.43));
        Thruster {
            class,
            radius_m: radius,
            duct_length_m: length,
            pitch_rad,
            lift_max: within(lift),
            drag_max: within(drag),
            density_kg_m3: 998.0,
            flux_coefficient: within((1.8, 2.05)),
            added_mass_coefficient: within((1.7, 2.3)),
            inertia_kg_m2: within(inertia),
            torque_constant_nm_a: within(constant),
            winding_resistance_ohm: resistance,
            amplifier_time_constant_s: 0.002,
            current_limit_a: limit,
            supply_v: supply,
            sections: vec![Section { radius_ratio: 0.7, share: 1.0, pitch_rad }],
            section_gain: (1.0, 1.0),
        }
    }

    /// Full scale of the force converter, N.
    pub fn thrust_full_scale_n(self) -> f64 {
        match self {
            Class::Work => 890.0,
            Class::Medium => 400.0,
            Class::Small => 200.0,
        }
    }
}

/// One stated quantity: a factor on the true value, and the tolerance that the file gives.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Claim {
    factor: f64,
    tol: f64,
}

/// What the rig file states.
#[derive(Clone, Debug, PartialEq)]
pub struct RigFile {
    /// Name of the case.
    pub name: String,
    /// TOML text.
    pub text: String,
    /// Two-sigma tolerances of pitch, lift, drag, flux, added mass, inertia, torque constant.
    pub tolerances: [f64; 7],
}

/// States the rig of `truth` with errors of 10 to 20 % and close values for `anchors`.
pub fn state(
    truth: &Thruster,
    class: Class,
    name: &str,
    anchors: &[Stated],
    torque: bool,
    rng: &mut impl Rng,
) -> RigFile {
    let mut claim = |stated: Option<Stated>| -> Claim {
        let sign = if rng.random::<bool>() { 1.0 } else { -1.0 };
        match stated {
            None => Claim { factor: 1.0 + sign * rng.random_range(0.02..0.07), tol: 0.10 },
            Some(quantity) if anchors.contains(&quantity) => {
                Claim { factor: 1.0 + sign * rng.random_range(0.0..0.006), tol: 0.01 }
            }
            Some(_) => Claim { factor: 1.0 + sign * rng.random_range(0.10..0.20), tol: 0.25 },
        }
    };
    let claims = [
        claim(None),
        claim(Some(Stated::Lift)),
        claim(Some(Stated::Drag)),
        claim(Some(Stated::Flux)),
        claim(Some(Stated::AddedMass)),
        claim(Some(Stated::Inertia)),
        claim(Some(Stated::TorqueConstant)),
    ];
    let [pitch, lift, drag, flux, mass, inertia, constant] = claims;
    let mut text = String::from(
        "# stated rig description; \"tol\" is the stated relative uncertainty (about 2 sigma) of each nominal value\n",
    );
    let quantity = |key: &str, value: f64, claim: Claim, digits: usize| {
        format!("{key} = {{ value = {:.digits$}, tol = {:.3} }}\n", value * claim.factor, claim.tol)
    };
    let small = class == Class::Small;
    let _ = write!(text, "[rig]\nname = \"{name}\"\nclass = \"{}\"\n[propeller]\n", truth.class);
    let _ = write!(text, "radius_m = {:.4}\nduct_length_m = {:.4}\n", truth.radius_m, truth.duct_length_m);
    text += &quantity("pitch_rad", truth.pitch_rad, pitch, 5);
    text += &quantity("lift_max", truth.lift_max, lift, 5);
    text += &quantity("drag_max", truth.drag_max, drag, 5);
    let _ = write!(text, "[flow]\ndensity_kg_m3 = {:.1}\n", truth.density_kg_m3);
    text += &quantity("flux_coefficient", truth.flux_coefficient, flux, 5);
    text += &quantity("added_mass_coefficient", truth.added_mass_coefficient, mass, 5);
    text += "[motor]\n";
    text += &quantity("inertia_kg_m2", truth.inertia_kg_m2, inertia, if small { 11 } else { 9 });
    text +=
        &quantity("torque_constant_nm_a", truth.torque_constant_nm_a, constant, if small { 7 } else { 5 });
    let _ = writeln!(text, "winding_resistance_ohm = {}", truth.winding_resistance_ohm);
    let _ = write!(
        text,
        "[amplifier]\nkind = \"current\"\ntime_constant_s = {:.4}\ncurrent_limit_a = {:.3}\nsupply_v = {:.2}\n",
        truth.amplifier_time_constant_s, truth.current_limit_a, truth.supply_v
    );
    let _ = write!(
        text,
        "[sensors]\nlog_rate_hz = 100.0\ncontrol_rate_hz = 500.0\nencoder_counts_per_rev = 4096\n\
         speed_filter_time_constant_s = 0.010\nthrust_filter_hz = {THRUST_FILTER_HZ:.1}\nthrust_full_scale_n = {:.1}\n\
         thrust_bits = {THRUST_BITS}\ntorque_filter_hz = {TORQUE_FILTER_HZ:.1}\nflow_rate_hz = 20.0\n\
         torque = \"{}\"\nambient_flow = \"not recorded\"\n[run]\nwater = \"tank\"\n",
        class.thrust_full_scale_n(),
        if torque { "propeller-side transducer" } else { "none" },
    );
    RigFile { name: name.to_owned(), text, tolerances: claims.map(|claim| claim.tol) }
}
