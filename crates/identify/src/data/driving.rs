//! What drives the model, and what there is where nothing can be compared.

use kort_thruster::rig::{AmplifierKind, Rig};

use super::fill::filled;
use super::start::starts_from_rest;
use super::{Driving, FEWEST_ROWS, Response, Series};

/// The driving column, by preference: a command that fits the drive, then measured current, then speed; and
/// electrical power where nothing but the speed could answer. Where nothing moves at all, the command that says so.
pub(super) fn choose_driving(series: &Series, rig: &Rig, speed_driven: bool) -> Option<Driving> {
    let varies = |name: &str| {
        series.column(name).is_some_and(|c| {
            let first = c.iter().copied().find(|v| v.is_finite());
            c.iter().any(|v| v.is_finite() && Some(*v) != first)
        })
    };
    if speed_driven && varies("shaft_speed_rad_s") {
        return Some(Driving::Speed);
    }
    let commands: &[&'static str] = match rig.amplifier.kind {
        AmplifierKind::Current => &["current_cmd_a"],
        AmplifierKind::Voltage => &["voltage_cmd_v", "duty_cmd"],
        AmplifierKind::Speed => &["speed_cmd_rad_s"],
    };
    if let Some(command) = commands.iter().find(|c| varies(c)) {
        return Some(Driving::Command(command));
    }
    // A command that is held all the while drives where nothing else tells more.
    let held =
        |name: &&&str| series.column(name).is_some_and(|c| c.iter().any(|v| v.is_finite() && *v != 0.0));
    if varies("current_a") && varies("shaft_speed_rad_s")
        || varies("current_a") && rig.amplifier.kind != AmplifierKind::Speed
    {
        // Noise of its sensor never turned the shaft: what makes it weaker would pass for physics. And a command that is held
        // from a shaft at rest on is a step.
        let noise = series.column("current_a").is_some_and(is_noise);
        return Some(match commands.iter().find(held) {
            Some(command) if noise || starts_from_rest(series) => Driving::Command(command),
            _ => Driving::Current,
        });
    }
    // What a shaft that follows its record shows: the propeller's load on a stand.
    let answered = rig.propeller.is_some() && ["thrust_n", "torque_n_m", "flow_m_s"].into_iter().any(varies);
    let powered = rig.motor.winding_resistance_ohm.is_some() && electrical_power(series).is_some();
    if !varies("shaft_speed_rad_s") {
        // One steady speed is too little to tell anything, and is said to be; it is no broken log. An angle alone tells a dry
        // shaft's speed as well.
        let told = series.column("shaft_speed_rad_s").is_some()
            || rig.propeller.is_none() && varies("shaft_angle_rad");
        let recorded = |name: &&&str| series.column(name).is_some_and(|c| c.iter().any(|v| v.is_finite()));
        let command = commands.iter().find(held).or_else(|| commands.iter().find(recorded));
        return command.filter(|_| told).map(|command| Driving::Command(command));
    }
    Some(match commands.iter().find(held) {
        _ if answered => Driving::Speed,
        _ if powered => Driving::Power,
        Some(command) => Driving::Command(command),
        None => Driving::Speed,
    })
}

/// A command that is recorded for a drive of another kind than the rig's, and the rig's kind, where the log has none of its
/// own.
pub(super) fn other_drive(series: &Series, rig: &Rig) -> Option<(&'static str, &'static str)> {
    let all = [
        (AmplifierKind::Current, "current", &["current_cmd_a"][..]),
        (AmplifierKind::Voltage, "voltage", &["voltage_cmd_v", "duty_cmd"]),
        (AmplifierKind::Speed, "speed", &["speed_cmd_rad_s"]),
    ];
    let recorded = |columns: &[&'static str]| columns.iter().copied().find(|c| series.column(c).is_some());
    let (_, kind, own) = all.iter().find(|(kind, ..)| *kind == rig.amplifier.kind)?;
    let others = all.iter().filter(|(kind, ..)| *kind != rig.amplifier.kind);
    if recorded(own).is_some() {
        None
    } else {
        Some((others.filter_map(|(.., c)| recorded(c)).next()?, *kind))
    }
}

/// Whether samples hold nothing from one to the next: the mean square of their differences is twice their variance, to
/// three standard deviations of white noise (von Neumann 1941, Annals of Mathematical Statistics 12:367).
fn is_noise(column: &[f64]) -> bool {
    let samples: Vec<f64> = column.iter().copied().filter(|v| v.is_finite()).collect();
    let n = samples.len() as f64;
    let mean = samples.iter().sum::<f64>() / n;
    let variance = samples.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
    let differences = samples.windows(2).map(|pair| (pair[1] - pair[0]).powi(2)).sum::<f64>() / (n - 1.0);
    differences >= 2.0 * variance * (1.0 - 3.0 / n.sqrt())
}

/// Electrical power into the motor, W: recorded, or the supply's voltage times its current.
fn electrical_power(series: &Series) -> Option<Vec<f64>> {
    if let Some(power) = series.column("power_w") {
        return Some(power.to_vec());
    }
    let (supply, current) = (series.column("supply_v")?, series.column("supply_current_a")?);
    Some(supply.iter().zip(current).map(|(v, a)| v * a).collect())
}

/// The power that drives, W: with the sign of the recorded speed, since power does not tell the direction; what
/// flows back into the supply drives nothing.
pub(super) fn driving_power(series: &Series) -> Vec<f64> {
    let power = filled(&electrical_power(series).unwrap_or_default());
    let speed = filled(series.column("shaft_speed_rad_s").unwrap_or(&[]));
    power.iter().zip(speed).map(|(p, s)| p.max(0.0) * if s < 0.0 { -1.0 } else { 1.0 }).collect()
}

/// What a recording without a usable response holds.
pub(super) fn instead(series: &Series, rig: &Rig, driving: &str) -> String {
    let few = Response::ALL.into_iter().filter(|r| r.name() != driving).find_map(|r| {
        let samples = series.column(r.name())?.iter().filter(|v| v.is_finite()).count();
        (samples < FEWEST_ROWS)
            .then(|| format!("{} has {samples} samples, at least {FEWEST_ROWS} are needed", r.name()))
    });
    if let Some(few) = few {
        return few;
    }
    let others: Vec<&str> =
        series.columns.iter().map(|c| c.0.as_str()).filter(|n| *n != driving && *n != "time_s").collect();
    if rig.motor.winding_resistance_ohm.is_none() && electrical_power(series).is_some() {
        return "electrical power, which drives the model where the rig states motor.winding_resistance_ohm"
            .into();
    }
    let mut found = if others.is_empty() { "nothing else is in it".into() } else { others.join(", ") };
    if let Some(sag) = crate::checks::supply_sag(series).and_then(|sag| sag.words()) {
        found.push_str(&format!("\nnote: {sag}"));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn driving(command: f64, with_thrust: bool) -> Option<Driving> {
        let rig =
            Rig::from_toml(include_str!("../../../../config/thrusters/whitcomb-yoerger-1999.toml")).unwrap();
        let wave = |k: usize| (k as f64 * 0.1).sin();
        let mut columns = vec![
            ("current_cmd_a".into(), vec![command; 200]),
            ("shaft_speed_rad_s".into(), (0..200).map(wave).collect()),
        ];
        if with_thrust {
            columns.push(("thrust_n".into(), (0..200).map(wave).collect()));
        }
        let time_s = (0..200).map(|k| 0.01 * k as f64).collect();
        choose_driving(&Series { name: "log".into(), time_s, columns }, &rig, false)
    }

    #[test]
    fn a_command_that_is_held_drives_where_nothing_but_the_speed_can_answer() {
        assert_eq!(driving(3.0, false), Some(Driving::Command("current_cmd_a")));
        assert_eq!(driving(3.0, true), Some(Driving::Speed));
        assert_eq!(driving(0.0, false), Some(Driving::Speed), "a drive that is off drives nothing");
    }

    #[test]
    fn a_held_command_drives_where_the_measured_current_is_noise_about_it() {
        let rig =
            Rig::from_toml(include_str!("../../../../config/thrusters/whitcomb-yoerger-1999.toml")).unwrap();
        let mut seed = 1_u64;
        let noise: Vec<f64> = (0..2000)
            .map(|_| {
                seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (seed >> 33) as f64 / f64::from(1_u32 << 31) - 0.5
            })
            .collect();
        let of = |command: f64, wander_a: f64| {
            let current =
                noise.iter().enumerate().map(|(k, e)| 3.0 + 0.02 * e + wander_a * (0.01 * k as f64).sin());
            let columns = vec![
                ("current_cmd_a".into(), vec![command; 2000]),
                ("current_a".into(), current.collect()),
                ("shaft_speed_rad_s".into(), noise.iter().map(|e| 40.0 + e).collect()),
            ];
            let time_s = (0..2000).map(|k| 0.01 * k as f64).collect();
            choose_driving(&Series { name: "log".into(), time_s, columns }, &rig, false)
        };
        assert_eq!(of(3.0, 0.0), Some(Driving::Command("current_cmd_a")));
        assert_eq!(of(3.0, 0.02), Some(Driving::Current), "a current that wanders turned the shaft");
        assert_eq!(of(0.0, 0.0), Some(Driving::Current), "no command is known");
    }

    #[test]
    fn a_command_that_is_held_from_rest_on_is_a_step() {
        let rig =
            Rig::from_toml(include_str!("../../../../config/thrusters/whitcomb-yoerger-1999.toml")).unwrap();
        let of = |first_rad_s: f64| {
            let settles = |k: usize| (-0.02 * k as f64).exp();
            let columns = vec![
                ("current_cmd_a".into(), vec![3.0; 500]),
                ("current_a".into(), (0..500).map(|k| 3.0 - settles(k)).collect()),
                (
                    "shaft_speed_rad_s".into(),
                    (0..500).map(|k| 40.0 - (40.0 - first_rad_s) * settles(k)).collect(),
                ),
            ];
            let time_s = (0..500).map(|k| 0.01 * k as f64).collect();
            choose_driving(&Series { name: "log".into(), time_s, columns }, &rig, false)
        };
        assert_eq!(of(0.0), Some(Driving::Command("current_cmd_a")));
        assert_eq!(of(9.0), Some(Driving::Current), "what turned it before is not known");
    }

    #[test]
    fn a_held_command_beside_a_speed_that_stands_drives() {
        let rig =
            Rig::from_toml(include_str!("../../../../config/thrusters/whitcomb-yoerger-1999.toml")).unwrap();
        let of = |command: f64| {
            let columns = vec![
                ("current_cmd_a".into(), vec![command; 200]),
                ("shaft_speed_rad_s".into(), vec![9.0; 200]),
            ];
            let time_s = (0..200).map(|k| 0.01 * k as f64).collect();
            choose_driving(&Series { name: "log".into(), time_s, columns }, &rig, false)
        };
        assert_eq!(of(3.0), Some(Driving::Command("current_cmd_a")));
        assert_eq!(
            of(0.0),
            Some(Driving::Command("current_cmd_a")),
            "nothing drives, which is what there is to say"
        );
    }
}
