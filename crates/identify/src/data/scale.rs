//! Sizes in use, and what recordings offer to effects.

use kort_thruster::effects::{ANGLE_KNOWN, Available, EXTRA, Scale};
use kort_thruster::models::ModelName;
use kort_thruster::rig::{AmplifierKind, Rig};

use super::{Driving, Prepared, Response, Series};

/// Sizes in use over all recordings, for the scale of the effects' parameters.
pub fn scale(all: &[Prepared], rig: &Rig) -> Scale {
    let full = |r: Response| {
        all.iter()
            .flat_map(|p| &p.channels)
            .filter(|c| c.response == r)
            .map(|c| c.full_scale)
            .fold(0.0, f64::max)
    };
    let stated = kort_thruster::parameters::Parameters::stated(rig);
    let kt = rig.motor.torque_constant_nm_a.value;
    let command = largest(asked(all));
    let under = |name: &str| largest(all.iter().filter(|p| p.driving.column() == name));
    let (ct, cq) = if rig.propeller.is_some() { stated.bollard_coefficients() } else { (0.0, 0.0) };
    let driving = under("current_cmd_a").max(under("current_a"));
    let current = if driving > 0.0 { driving } else { full(Response::Current) };
    let mut speed = full(Response::ShaftSpeed);
    if speed == 0.0 {
        // The rate of an angle that is recorded alone.
        speed = full(Response::ShaftAngle);
    }
    speed = speed.max(under("shaft_speed_rad_s")).max(under("speed_cmd_rad_s"));
    if speed == 0.0 && cq > 0.0 {
        speed = (kt * current / cq).sqrt();
    }
    let thrust = Some(full(Response::Thrust)).filter(|t| *t > 0.0).unwrap_or(ct * speed * speed);
    let flux = stated.get(kort_thruster::parameters::Parameter::FluxCoefficient)
        * stated.get(kort_thruster::parameters::Parameter::DensityKgM3)
        * stated.area_m2();
    let ohm = stated.get(kort_thruster::parameters::Parameter::WindingResistanceOhm);
    let inertia_kg_m2 = rig.motor.inertia_kg_m2.value + kort_thruster::plant::load_inertia_kg_m2(rig);
    let torque = if current > 0.0 {
        kt * current
    } else if cq > 0.0 {
        cq * speed * speed
    } else if ohm > 0.0 && rig.amplifier.kind == AmplifierKind::Voltage {
        // A dry shaft without a current: what the largest voltage gives at standstill.
        kt * command / ohm
    } else {
        // ... or what brings it to speed within a second.
        inertia_kg_m2 * speed
    };
    // Where no current is known, the one that makes the torque: effects in amperes need a size.
    let current = if current > 0.0 { current } else { torque / kt };
    Scale {
        shaft_speed_rad_s: speed.max(1e-6),
        torque_n_m: torque.max(1e-9),
        thrust_n: thrust.max(1e-9),
        flow_m_s: if flux > 0.0 { (thrust / flux).sqrt() } else { 1.0 },
        current_a: current.max(1e-9),
        command: command.max(1e-9),
        supply_v: rig.amplifier.supply_v.unwrap_or(0.0),
        current_limit_a: rig.amplifier.current_limit_a,
        winding_resistance_ohm: rig.motor.winding_resistance_ohm.map_or(0.0, |r| r.value),
        inertia_kg_m2,
        tick_s: all.first().map_or(0.002, |p| p.tick_s),
        duration_s: all.iter().map(Prepared::duration_s).fold(0.0, f64::max),
        clock_s: [
            all.iter().map(|p| p.time_s[0]).fold(f64::INFINITY, f64::min),
            all.iter().map(|p| p.time_s[p.time_s.len() - 1]).fold(f64::NEG_INFINITY, f64::max),
        ],
        reverses: goes_astern(all, speed, command),
        angle_known: angle_known(all),
        turned_rad: turned_rad(all),
        angle_rad: ends_rad(all).filter(|_| angle_known(all)).unwrap_or([0.0; 2]),
    }
}

/// The recordings under a command, or all where nobody asked for anything: a speed drive's current may drive beside its
/// command.
fn asked(all: &[Prepared]) -> impl Iterator<Item = &Prepared> {
    let commanded = |p: &Prepared| matches!(p.driving, Driving::Command(_));
    let nobody = !all.iter().any(commanded);
    all.iter().filter(move |p| nobody || commanded(p))
}

/// The largest size of what drives these.
fn largest<'a>(these: impl Iterator<Item = &'a Prepared>) -> f64 {
    these.flat_map(|p| &p.command).fold(0.0_f64, |m, c| m.max(c.abs()))
}

/// Whether the torque on the shaft is given: by a recorded current or power.
fn torque_given(recording: &Prepared) -> bool {
    matches!(recording.driving, Driving::Current | Driving::Power)
}

/// Whether every recording holds the shaft angle, or a speed that it was counted from.
fn angle_known(all: &[Prepared]) -> bool {
    all.iter().all(|p| p.stimulus.ticks.iter().any(|t| t.shaft_angle_rad.is_some()))
}

/// Least and greatest angle of the shaft, rad, where it is known.
fn ends_rad<'a>(these: impl IntoIterator<Item = &'a Prepared>) -> Option<[f64; 2]> {
    let ticks = these.into_iter().flat_map(|p| &p.stimulus.ticks);
    let angles = ticks.filter_map(|t| t.shaft_angle_rad.map(|(at, _)| at));
    angles.map(|q| [q, q]).reduce(|[a, b], [c, d]| [a.min(c), b.max(d)])
}

/// The longest way of a recording's shaft between its furthest ends, rad.
fn turned_rad(all: &[Prepared]) -> f64 {
    let way = |p: &Prepared| ends_rad([p]).map_or(f64::INFINITY, |[from, to]| to - from);
    all.iter().map(way).fold(0.0, f64::max)
}

/// Whether command or shaft speed ever went astern by more than a trifle.
fn goes_astern(all: &[Prepared], speed_rad_s: f64, command: f64) -> bool {
    let speeds = all
        .iter()
        .flat_map(|p| p.channels.iter().filter(|c| c.response == Response::ShaftSpeed))
        .flat_map(|channel| &channel.values);
    let commands = asked(all).flat_map(|p| &p.command);
    speeds.copied().any(|v| v < -TRIFLE * speed_rad_s) || commands.copied().any(|c| c < -TRIFLE * command)
}

/// Whether every recording holds a shaft speed with its sign, and all of them together one sign.
fn one_way(series: &[Series]) -> bool {
    let speeds = series.iter().map(|s| s.column("shaft_speed_rad_s")).collect::<Option<Vec<_>>>();
    let Some(speeds) = speeds.filter(|_| !series.iter().any(crate::checks::is_unsigned_speed)) else {
        return false;
    };
    let all = || speeds.iter().copied().flatten().copied().filter(|v| v.is_finite());
    let most = all().fold(0.0_f64, |most, v| most.max(v.abs()));
    !(all().any(|v| v < -TRIFLE * most) && all().any(|v| v > TRIFLE * most))
}

/// Share of the largest size below which a sign says nothing.
const TRIFLE: f64 = 0.02;

/// What the recordings offer, for the effects' `needs`.
pub fn available(model: ModelName, series: &[Series], all: &[Prepared]) -> Available {
    let mut columns: Vec<String> = series
        .iter()
        .flat_map(|s| s.columns.iter().filter(|c| s.column(&c.0).is_some()).map(|c| c.0.clone()))
        .collect();
    if all.iter().any(|p| p.extra.is_some()) {
        columns.push(EXTRA.into());
    }
    if angle_known(all) {
        columns.push(ANGLE_KNOWN.into());
    }
    columns.sort();
    columns.dedup();
    Available {
        columns,
        shaft_prescribed: all.iter().all(|p| p.driving == Driving::Speed),
        current_prescribed: all.iter().all(torque_given),
        torque_given: all.iter().any(torque_given),
        axial_flow_modelled: !matches!(model, ModelName::Model0 | ModelName::Model1),
        turned_rad: angle_known(all).then(|| turned_rad(all)),
        speed_unsigned: series.iter().any(crate::checks::is_unsigned_speed),
        one_way: one_way(series),
        supply_sag_share: series
            .iter()
            .map(|s| crate::checks::supply_sag(s).map(|sag| sag.share()))
            .collect::<Option<Vec<f64>>>()
            .map(|shares| shares.into_iter().fold(0.0, f64::max)),
    }
}

#[cfg(test)]
mod tests {
    use crate::noise::Criterion;
    use crate::setup::Setup;
    use kort_thruster::rig::Rig;

    use super::*;

    const CRITERION: Criterion =
        Criterion { form_error: 0.005, own_form_error: 0.2, facts_a_band: 10.0, timing_s: 0.001 };

    fn of(rig: &str, command: &str, size: f64, response: &str) -> Scale {
        let wave = |k: usize| (k as f64 * 0.1).sin();
        let series = [Series {
            name: "log".into(),
            time_s: (0..400).map(|k| 0.01 * k as f64).collect(),
            columns: vec![
                (command.into(), (0..400).map(|k| size * wave(k)).collect()),
                (response.into(), (0..400).map(|k| 40.0 * wave(k + 3)).collect()),
            ],
        }];
        let rig = Rig::from_toml(rig).unwrap();
        Setup::new(&series, &rig, ModelName::Model2, CRITERION).unwrap().problem.scale
    }

    #[test]
    fn a_drive_whose_current_nobody_logs_has_the_current_that_makes_its_torque() {
        let dry = "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 0.1\n\
                   winding_resistance_ohm = 0.5\n[amplifier]\nkind = \"voltage\"\nsupply_v = 12\n";
        let dry = of(dry, "voltage_cmd_v", 10.0, "shaft_speed_rad_s");
        let stall_a = 10.0 / 0.5;
        assert!((dry.current_a / stall_a - 1.0).abs() < 1e-3, "{}", dry.current_a);
        let stand = include_str!("../../../../config/thrusters/whitcomb-yoerger-1999.toml");
        let speed_drive = stand.replace("kind = \"current\"", "kind = \"speed\"");
        let wet = of(&speed_drive, "speed_cmd_rad_s", 40.0, "shaft_speed_rad_s");
        let kt = Rig::from_toml(stand).unwrap().motor.torque_constant_nm_a.value;
        assert!((wet.current_a * kt / wet.torque_n_m - 1.0).abs() < 1e-9);
        assert!(wet.current_a > 0.1, "{}", wet.current_a);
    }

    #[test]
    fn a_shaft_of_which_the_angle_alone_is_logged_has_the_speed_of_its_rate() {
        let rig = "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 0.1\n";
        // The wave of 10 rad/s: 40 rad turn at 400 rad/s.
        let speed = of(rig, "current_cmd_a", 2.0, "shaft_angle_rad").shaft_speed_rad_s;
        assert!((speed / 400.0 - 1.0).abs() < 0.02, "{speed}");
    }
}
