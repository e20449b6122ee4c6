//! What a recording and a rig offer to an effect: whether it can be fitted at all, and if not why.

use crate::rig::{AmplifierKind, Rig};

/// Which signals a recording (or a run) offers to an effect as drivers and to a fit as responses.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Available {
    /// Columns with data, by their contract names.
    pub columns: Vec<String>,
    /// The shaft speed is prescribed (a recorded speed drives the model).
    pub shaft_prescribed: bool,
    /// The current is prescribed (a recorded current or electrical power drives the model).
    pub current_prescribed: bool,
    /// Of one recording at least, where of others a command may.
    pub torque_given: bool,
    /// The baseline model has the axial flow as a state.
    pub axial_flow_modelled: bool,
    /// Only the size of the shaft speed was recorded: it is never negative although the drive reverses.
    pub speed_unsigned: bool,
    /// A signed shaft speed was recorded, and it has one sign throughout.
    pub one_way: bool,
    /// Way of the shaft between its furthest ends, rad, where its angle is known in every recording: the longest of them.
    pub turned_rad: Option<f64>,
    /// Share of the supply lost at the largest load, where every recording holds the supply.
    pub supply_sag_share: Option<f64>,
}

impl Available {
    /// Is this column there?
    pub fn has(&self, name: &str) -> bool {
        self.columns.iter().any(|c| c == name)
    }
}

/// Name under which [`Available`] lists that a column of the log is laid into [`Tick::extra`].
pub const EXTRA: &str = "a column of its own";

/// Name under which [`Available`] lists that the shaft angle is known: recorded, or counted from the recorded speed.
pub const ANGLE_KNOWN: &str = "shaft angle";

/// Can always be fitted.
pub fn always(_: &Rig, _: &Available) -> Result<(), &'static str> {
    Ok(())
}

/// Needs a propeller in water.
pub fn wet(rig: &Rig, _: &Available) -> Result<(), &'static str> {
    if rig.propeller.is_some() { Ok(()) } else { Err("a dry shaft has no blades and no water") }
}

/// Needs the shaft's torque balance: the shaft must be driven by current, voltage or torque.
pub fn free_shaft(rig: &Rig, available: &Available) -> Result<(), &'static str> {
    if available.shaft_prescribed {
        Err("the recorded shaft speed drives the model, so the shaft's torque balance is not seen")
    } else if rig.amplifier.kind == AmplifierKind::Speed && !available.torque_given {
        Err(
            "a speed drive holds the shaft and its current is not recorded, so the torque balance is not seen",
        )
    } else {
        Ok(())
    }
}

/// Needs a command: a recorded current, power or speed that drives the model has the drive behind it.
pub fn commanded(_: &Rig, available: &Available) -> Result<(), &'static str> {
    if available.current_prescribed || available.shaft_prescribed {
        Err(
            "a recorded response drives the model, so what lies between command and that response is not seen",
        )
    } else {
        Ok(())
    }
}

/// Needs a measured thrust.
pub fn thrust_measured(_: &Rig, available: &Available) -> Result<(), &'static str> {
    if available.has("thrust_n") { Ok(()) } else { Err("thrust is not recorded") }
}

/// Needs a measured axial flow.
pub fn flow_measured(_: &Rig, available: &Available) -> Result<(), &'static str> {
    if available.has("flow_m_s") { Ok(()) } else { Err("axial flow is not recorded") }
}

/// Needs a measured shaft speed as a response.
pub fn speed_measured(_: &Rig, available: &Available) -> Result<(), &'static str> {
    if available.shaft_prescribed {
        Err("the recorded shaft speed drives the model and is no response")
    } else if !available.has("shaft_speed_rad_s") {
        Err("shaft speed is not recorded")
    } else {
        Ok(())
    }
}

/// Needs the shaft angle, or a recorded speed to count it from: an integrated model speed loses the phase within
/// seconds.
pub fn angle_known(_: &Rig, available: &Available) -> Result<(), &'static str> {
    if available.has(ANGLE_KNOWN) {
        Ok(())
    } else {
        Err(
            "the shaft angle is not recorded and cannot be counted from a recorded speed, so what follows the angle \
             cannot be kept in phase",
        )
    }
}

/// Needs a whole turn of a shaft whose angle is known: of what was not seen through a whole wave nothing tells that it comes
/// again, and a weight, a spring or a gear that rubs by its load does the same.
pub fn turns_round(_: &Rig, available: &Available) -> Result<(), &'static str> {
    match available.turned_rad {
        Some(turned_rad) if turned_rad < std::f64::consts::TAU => {
            Err("the shaft made no whole turn, so nothing tells that what follows its angle comes again")
        }
        _ => Ok(()),
    }
}

/// What a rig's name or class calls that which lies between motor and load.
const GEARS: [&str; 12] = [
    "gear",
    "belt",
    "screw",
    "worm",
    "servo",
    "actuator",
    "reduction",
    "harmonic",
    "planetary",
    "transmission",
    "joint",
    "winch",
];

/// Whether a rig's name or class speaks of a gear, a belt or a screw between motor and load.
pub fn speaks_of_a_gear(rig: &Rig) -> bool {
    let words = format!("{} {}", rig.name, rig.class).to_lowercase();
    GEARS.iter().any(|gear| words.contains(gear))
}

/// Needs a gear, a belt or a screw between motor and load: the rig's name or class speaks of one.
pub fn geared(rig: &Rig, available: &Available) -> Result<(), &'static str> {
    free_shaft(rig, available)?;
    if speaks_of_a_gear(rig) {
        Ok(())
    } else {
        Err("neither name nor class of the rig speaks of a gear, belt or screw: it passes for direct drive")
    }
}

#[cfg(test)]
mod tests {
    use super::{ANGLE_KNOWN, Available, speaks_of_a_gear, turns_round};
    use crate::effects::find;
    use crate::rig::Rig;

    #[test]
    fn a_gear_is_spoken_of_in_name_or_class() {
        let speaks = |head: &str| {
            let rest =
                "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 1.0\n";
            speaks_of_a_gear(&Rig::from_toml(&format!("[rig]\n{head}\n{rest}")).unwrap())
        };
        assert!(speaks("name = \"Geared motor\""));
        assert!(speaks("name = \"axis 3\"\nclass = \"linear axis on a ball screw\""));
        assert!(!speaks("name = \"axis 3\"\nclass = \"dry brushless motor\""));
    }

    #[test]
    fn what_follows_the_angle_needs_a_whole_turn_of_it() {
        let rig = Rig::from_toml(
            "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 1.0\n\
             [amplifier]\nkind = \"current\"\n[sensors]\n",
        )
        .unwrap();
        let turned = |turned_rad| Available {
            columns: vec![ANGLE_KNOWN.into(), "shaft_speed_rad_s".into()],
            turned_rad,
            ..Available::default()
        };
        assert!(turns_round(&rig, &turned(None)).is_ok(), "an unknown angle is another matter");
        for id in ["encoder_eccentricity", "position_dependent_friction"] {
            let needs = find(id).unwrap().needs;
            assert!(needs(&rig, &turned(Some(7.0))).is_ok(), "{id}");
            let why = needs(&rig, &turned(Some(5.0))).unwrap_err();
            assert!(why.contains("no whole turn"), "{id}: {why}");
        }
    }
}
