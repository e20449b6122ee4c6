//! Is a column what its name says? A sign the wrong way round and a unit that is another one are the commonest faults of a log,
//! and physics by any name would be fitted to them.
//!
//! Under the stated rig a response stands to its model as one number to another. A rig may be off by two, and by four in what
//! two of its numbers make; a pound of force (4.4 N) is no more than that, and is not told.

use std::f64::consts::PI;

use kort_thruster::models::ModelName;

use crate::data::{Channel, Response};
use crate::hypothesis::Hypothesis;
use crate::simulate::Problem;
use crate::thin::Thin;

/// Correlation from which a response is its model's but for one factor.
const ALIKE: f64 = 0.95;
/// Correlation the wrong way from which its sign is the other one.
const AGAINST: f64 = 0.8;
/// How far a factor may lie from a unit's, since the rig is only stated: no two of a quantity's units are so near.
const NEAR: f64 = 0.15;
/// How many times a reading that never changes its model must show for it to be a dead one.
const MOVES: f64 = 10.0;
/// Share of the largest speed by which noise takes one below zero that tells no direction.
const UNDIRECTED: f64 = 0.05;

/// What a unit in the place of SI makes of a value, by what it is and what stands in the log.
fn units(response: Response) -> &'static [(f64, &'static str)] {
    const RPM: (f64, &str) = (30.0 / PI, "rpm");
    const TURNS: (f64, &str) = (0.5 / PI, "turns a second");
    const DEGREES: (f64, &str) = (180.0 / PI, "degrees a second");
    const KRPM: (f64, &str) = (0.03 / PI, "thousands of rpm");
    match response {
        Response::ShaftSpeed => &[RPM, TURNS, DEGREES, KRPM],
        Response::Thrust => &[(1.0 / 9.806_65, "kgf"), (1e3 / 9.806_65, "gf"), (1e-3, "kN"), (1e3, "mN")],
        Response::Torque => {
            &[(1e3, "N mm"), (1.0 / 0.112_985, "lbf in"), (100.0 / 9.806_65, "kgf cm"), (1e2, "N cm")]
        }
        Response::Current => &[(1e3, "mA"), (1e2, "hundredths of an ampere"), (1e-3, "kA")],
        Response::Flow => &[(1e2, "cm/s"), (1e3, "mm/s")],
        Response::ShaftAngle => &[],
    }
}

/// A response against its model's: their correlation about zero, and how many times as large it is.
struct Likeness {
    correlation: f64,
    times: f64,
    /// Root mean square of the model's.
    model: f64,
}

impl Likeness {
    fn of(pairs: impl Iterator<Item = (f64, f64)>) -> Self {
        let (mut mm, mut ms, mut ss, mut n) = (0.0, 0.0, 0.0, 0.0);
        for (measured, simulated) in pairs {
            mm += measured * measured;
            ms += measured * simulated;
            ss += simulated * simulated;
            n += 1.0;
        }
        Self { correlation: ms / (mm * ss).sqrt(), times: ms / ss, model: (ss / f64::max(n, 1.0)).sqrt() }
    }
}

/// Every channel against the stated rig, by recording and place. A shaft that is kept with its recording goes wherever that does,
/// and coefficients of the older models stand in no rig: nothing is known of those.
fn likenesses(problem: &Problem, stated: &Hypothesis) -> Vec<(usize, usize, Likeness)> {
    if matches!(problem.model, ModelName::Model0 | ModelName::Model1) {
        return Vec::new();
    }
    let residual = problem.residual(stated, &stated.start);
    let mut all = Vec::new();
    for (r, recording) in problem.recordings.iter().enumerate() {
        if recording.second || recording.observer_rad_s != 0.0 {
            continue;
        }
        for (c, (channel, left)) in recording.channels.iter().zip(&residual[r]).enumerate() {
            // What never changes is taken for frozen and left out elsewhere.
            let used =
                (0..left.len()).filter(|k| never_changes(channel) || !problem.masked[r][channel.rows[*k]]);
            let pairs = used.map(|k| (channel.values[k], channel.values[k] - left[k]));
            all.push((r, c, Likeness::of(pairs)));
        }
    }
    all
}

fn never_changes(channel: &Channel) -> bool {
    channel.values.iter().all(|value| *value == channel.values[0])
}

/// What is to be put right in the log before anything else, if a response is nothing that the stated rig could show.
pub fn mistaken(problem: &Problem, stated: &Hypothesis) -> Option<Thin> {
    likenesses(problem, stated).into_iter().find_map(|(r, c, likeness)| {
        let recording = &problem.recordings[r];
        let why = fault(&recording.channels[c], &likeness)?;
        Some(Thin { why: format!("{}: {why}", recording.name), still: true, of_the_log: true })
    })
}

/// Turns what runs against the stated rig and is no more than a reading: transducers of force and torque, and the current's, show
/// either direction as positive. What was turned, in words.
pub fn turned(problem: &mut Problem, stated: &Hypothesis) -> Vec<String> {
    let mut words = Vec::new();
    for (r, c, likeness) in likenesses(problem, stated) {
        let recording = &mut problem.recordings[r];
        let channel = &mut recording.channels[c];
        let reading = !matches!(channel.response, Response::ShaftSpeed | Response::ShaftAngle);
        if reading && !never_changes(channel) && likeness.correlation < -AGAINST {
            channel.values.iter_mut().for_each(|value| *value = -*value);
            words.push(format!(
                "{}: {} runs against what drives (correlation {:.2} with the stated rig): its other sign is taken; put it right in the column map (sign = -1)",
                recording.name,
                channel.response.name(),
                likeness.correlation
            ));
        }
    }
    words
}

/// What a response must be put right in, if it must.
fn fault(channel: &Channel, likeness: &Likeness) -> Option<String> {
    let name = channel.response.name();
    if never_changes(channel) && likeness.model > (MOVES * channel.values[0].abs()).max(1e-6) {
        return Some(format!(
            "{name} reads {:.3} in every row while the stated rig would show {:.3} r.m.s.: its sensor, its column or the drive is dead",
            channel.values[0], likeness.model
        ));
    }
    // A speed without a direction is a sensor of its own kind.
    let most = channel.values.iter().fold(0.0_f64, |most, value| most.max(*value));
    let undirected = channel.values.iter().all(|value| *value >= -UNDIRECTED * most);
    if channel.response == Response::ShaftSpeed && likeness.correlation < -AGAINST && !undirected {
        return Some(format!(
            "{name} runs against what drives (correlation {:.2} with the stated rig): its sign is the other way round, or the command's is. Put it right in the column map (sign = -1) or at the sensor",
            likeness.correlation
        ));
    }
    let alike = likeness.correlation > ALIKE;
    let of = |unit: &&(f64, &str)| (likeness.times / unit.0).ln().abs() < NEAR.ln_1p();
    let (factor, unit) = units(channel.response).iter().filter(|_| alike).find(of)?;
    Some(format!(
        "{name} is {:.3} times what the stated rig shows, throughout (correlation {:.2}): it looks like {unit}, {factor:.3} to one in SI. Say its unit in the column map",
        likeness.times, likeness.correlation
    ))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use kort_thruster::models::ModelName;
    use kort_thruster::rig::Rig;

    use crate::data::Series;
    use crate::noise::Criterion;
    use crate::setup::Setup;

    /// Why a log of a motor under a voltage whose speed is read so tells nothing, if it does not; the rig
    /// states this friction, of 0.1 N m s.
    fn why_of(read: impl Fn(f64) -> f64, stated_nm_s: f64) -> Option<String> {
        said(read, 1.0, stated_nm_s).0
    }

    /// The same, and how many notes speak of a sign, where the current is read so many times.
    fn said(read: impl Fn(f64) -> f64, times: f64, stated_nm_s: f64) -> (Option<String>, usize) {
        let rig = format!(
            "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = {{ value = 0.01, tol = 0.3 }}\n\
             torque_constant_nm_a = {{ value = 0.5, tol = 0.1 }}\nwinding_resistance_ohm = 1.0\n\
             viscous_friction_nm_s = {{ value = {stated_nm_s}, tol = 0.3 }}\n[amplifier]\nkind = \"voltage\"\n"
        );
        let rig = Rig::from_toml(&rig).unwrap();
        let (mut speed, mut commands, mut speeds, mut currents) =
            (0.0_f64, Vec::new(), Vec::new(), Vec::new());
        for row in 0..2000 {
            let command = ((row / 60 * 7919) % 13) as f64 / 2.0 - 3.0;
            commands.push(command);
            speeds.push(read(speed));
            currents.push(times * (command - 0.5 * speed));
            (0..10).for_each(|_| speed += (0.5 * (command - 0.5 * speed) - 0.1 * speed) / 0.01 * 0.001);
        }
        let names = ["voltage_cmd_v", "shaft_speed_rad_s", "current_a"].map(String::from);
        let columns = names.into_iter().zip([commands, speeds, currents]).collect();
        let time_s = (0..2000).map(|k| 0.01 * f64::from(k)).collect();
        let series = Series { name: "log".into(), time_s, columns };
        let criterion =
            Criterion { form_error: 0.01, own_form_error: 0.2, facts_a_band: 10.0, timing_s: 0.001 };
        let setup = Setup::new(&[series], &rig, ModelName::Model2, criterion).unwrap();
        let turned = setup.notes.iter().filter(|note| note.contains("other sign is taken")).count();
        (setup.thin.filter(|thin| thin.of_the_log).map(|thin| thin.why), turned)
    }

    fn why(times: f64, stated_nm_s: f64) -> Option<String> {
        why_of(|speed| times * speed, stated_nm_s)
    }

    #[test]
    fn signs_and_units_are_told_and_rough_rigs_are_none() {
        const RPM: f64 = 30.0 / PI;
        assert_eq!((why(1.0, 0.1), why(1.0, 0.4)), (None, None));
        assert!(why(-1.0, 0.1).unwrap().contains("sign"));
        assert_eq!(why_of(f64::abs, 0.1), None, "of an unsigned speed");
        assert!(why(RPM, 0.1).unwrap().contains("rpm"));
        assert_eq!(why(RPM, 0.4), None, "nearly twice as much as a unit makes of it");
        assert!(why(0.0, 0.1).unwrap().contains("dead"));
        assert_eq!(said(|speed| speed, 1.0, 0.1), (None, 0));
        assert_eq!(said(|speed| speed, -1.0, 0.1), (None, 1));
    }
}
