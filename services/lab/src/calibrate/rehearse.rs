//! The rehearsal: sessions on stands whose thruster is concealed, and how many of the stated quantities hold.

use kort_calibrate::{Next, Plan, Session, Stated, StepReport, Stop, steps};
use kort_proto::faults::Names;
use kort_servo::drives::kind_of;
use kort_thruster::models::ModelName;
use kort_thruster::parameters::Parameter;
use kort_thruster::plant::{Plant, Tick};
use kort_thruster::rig::Rig;
use rayon::prelude::*;
use serde::Serialize;

use super::concealed::{Concealed, Trouble};
use super::conclude::estimated;
use super::stand::{PERIOD_NS, Stand, limits};
use crate::failure::Failure;

/// Longest session, ticks.
const TICKS_MAX: u64 = 300_000;
/// Time after which a thruster's thrust is steady, s.
const STEADY_S: f64 = 12.0;

/// How a session on virtual time ended.
pub struct Ended {
    /// The session with its record.
    pub session: Session,
    /// Why it stopped, if it did.
    pub stopped: Option<Stop>,
    /// All the way of the shaft until then, rad.
    pub way_rad: f64,
}

/// Runs a session on a stand.
///
/// # Errors
/// The servo went off, with its faults.
pub fn session(rig: &Rig, concealed: &Concealed, share: f64, seed: u64) -> Result<Ended, Failure> {
    let (drive_max, speed_max) = limits(rig);
    let mut stand = Stand::new(rig, concealed.clone(), drive_max, speed_max, seed);
    let period_s = PERIOD_NS as f64 * 1e-9;
    let plan = Plan::new(rig, drive_max, speed_max, period_s, share);
    let mut session = Session::new(plan, kind_of(rig).name());
    for _ in 0..4 {
        stand.tick(0.0);
    }
    stand.arm();
    let mut drive = 0.0;
    for _ in 0..TICKS_MAX {
        let (time_s, row) = stand.tick(drive);
        drive = match session.tick(time_s, &row) {
            Next::Drive(drive) => drive,
            Next::Ask { .. } => {
                session.go_on();
                0.0
            }
            Next::Finished => return Ok(Ended { session, stopped: None, way_rad: stand.way_rad() }),
            Next::Stopped(stop) => {
                return Ok(Ended { session, stopped: Some(stop), way_rad: stand.way_rad() });
            }
        };
        if !stand.armed() {
            let words = format!("the servo went off: {}", Names(stand.faults()));
            return Err(Failure::failed(words));
        }
    }
    Err(Failure::failed("the session did not end"))
}

/// A stated quantity beside the truth.
#[derive(Clone, Debug, Serialize)]
pub struct Judged {
    /// Its name.
    pub name: String,
    /// What was stated.
    pub value: f64,
    /// Stated tolerance.
    pub tolerance: f64,
    /// What was concealed.
    pub truth: f64,
    /// Whether it lies inside.
    pub inside: bool,
}

/// A rig of the rehearsal.
#[derive(Clone, Debug, Serialize)]
pub struct Rehearsed {
    /// Seed of what was concealed.
    pub seed: u64,
    /// Why the session stopped, where it did.
    pub stopped: Option<String>,
    /// Every quantity that was stated.
    pub quantities: Vec<Judged>,
}

/// A trouble of the rehearsal.
#[derive(Clone, Debug, Serialize)]
pub struct Found {
    /// Seed of the stand.
    pub seed: u64,
    /// What was wrong.
    pub trouble: &'static str,
    /// What the session said.
    pub said: String,
    /// Whether that is it.
    pub found: bool,
    /// How far the shaft had turned, rad.
    pub way_rad: f64,
}

/// The report of `kort calibrate --rehearse`, schema `kort.calibration-rehearsal/1`.
#[derive(Clone, Debug, Serialize)]
pub struct Rehearsal {
    /// `kort.calibration-rehearsal/1`
    pub schema: &'static str,
    /// Rigs by chance.
    pub rigs: Vec<Rehearsed>,
    /// Stated quantities inside their tolerance, and all.
    pub inside: [usize; 2],
    /// Troubles.
    pub troubles: Vec<Found>,
    /// Troubles found before the shaft had turned half a turn, and all.
    pub found: [usize; 2],
}

/// Rehearses `rigs` calibrations, and every trouble on as many stands.
///
/// # Errors
/// A session that could not be run.
pub fn rehearse(
    rig: &Rig,
    rigs: u64,
    seed: u64,
    share: f64,
    done: &(dyn Fn() + Sync),
) -> Result<Rehearsal, Failure> {
    let (drive_max, _) = limits(rig);
    let rehearsed: Vec<Rehearsed> = (0..rigs)
        .into_par_iter()
        .map(|k| {
            let one = calibrated(&fitted_out(rig, k), seed + k, drive_max, share);
            done();
            one
        })
        .collect::<Result<_, _>>()?;
    // What a rig has no cell of cannot have the wrong sign.
    let may_be = |trouble: &Trouble| *trouble != Trouble::ThrustReversed || rig.sensors.thrust_sensor;
    let troubles: Vec<Found> = (0..rigs)
        .flat_map(|k| Trouble::ALL.map(|trouble| (k, trouble)))
        .filter(|(_, trouble)| may_be(trouble))
        .collect::<Vec<_>>()
        .into_par_iter()
        .map(|(k, trouble)| found(&fitted_out(rig, k), seed + k, drive_max, share, trouble))
        .collect::<Result<_, _>>()?;
    let all = || rehearsed.iter().flat_map(|r| &r.quantities);
    let inside = [all().filter(|q| q.inside).count(), all().count()];
    let half = std::f64::consts::PI;
    let found = [troubles.iter().filter(|t| t.found && t.way_rad < half).count(), troubles.len()];
    Ok(Rehearsal { schema: "kort.calibration-rehearsal/1", inside, found, rigs: rehearsed, troubles })
}

/// Every other rig has a torque transducer.
fn fitted_out(rig: &Rig, k: u64) -> Rig {
    let mut rig = rig.clone();
    rig.sensors.torque_transducer |= k % 2 == 1;
    rig
}

fn calibrated(rig: &Rig, seed: u64, drive_max: f64, share: f64) -> Result<Rehearsed, Failure> {
    let concealed = Concealed::by_chance(rig, drive_max, seed);
    let ended = session(rig, &concealed, share, seed)?;
    if let Some(stop) = ended.stopped {
        return Ok(Rehearsed { seed, stopped: Some(stop.to_string()), quantities: Vec::new() });
    }
    let period_s = PERIOD_NS as f64 * 1e-9;
    let facts = ended.session.facts();
    let estimate = estimated(ended.session.log(), period_s, rig, facts, &|_| ())?;
    let levels: Vec<f64> = facts.levels.iter().map(|l| steady_thrust_n(rig, &concealed, l.drive)).collect();
    let quantities =
        steps(facts, Some(&estimate)).iter().flat_map(|step| judged(step, &concealed, &levels)).collect();
    Ok(Rehearsed { seed, stopped: None, quantities })
}

/// The quantities of a step beside the truth.
fn judged(step: &StepReport, concealed: &Concealed, levels: &[f64]) -> Vec<Judged> {
    let one = |(k, q): (usize, &Stated)| {
        let truth =
            if step.name == "working_range" { levels.get(k).copied() } else { truth_of(&q.name, concealed) };
        truth.map(|truth| Judged {
            name: q.name.clone(),
            value: q.value,
            tolerance: q.tolerance,
            truth,
            inside: (q.value - truth).abs() <= q.tolerance,
        })
    };
    step.quantities.iter().enumerate().filter_map(one).collect()
}

fn truth_of(name: &str, concealed: &Concealed) -> Option<f64> {
    let c = concealed;
    Some(match name {
        "zero_of_thrust_n" => c.zero_n,
        "zero_of_flow_m_s" => c.zero_m_s,
        "zero_of_torque_n_m" => c.zero_n_m,
        "zero_of_current_a" => 0.0,
        "breakaway_ahead_n_m" | "dry_ahead_n_m" => c.friction[0],
        "breakaway_astern_n_m" | "dry_astern_n_m" => c.friction[1],
        "viscous_ahead_nm_s" => c.friction[2],
        "viscous_astern_nm_s" => c.friction[3],
        "delay_s" => c.delay_s,
        "half_width" => c.band[0],
        "centre" => c.band[1],
        "kept_outside" => c.band[2],
        name => c.parameters.get(*Parameter::ALL.iter().find(|p| p.name() == name)?),
    })
}

/// Thrust under a drive that is held, N.
fn steady_thrust_n(rig: &Rig, concealed: &Concealed, drive: f64) -> f64 {
    let tick_s = PERIOD_NS as f64 * 1e-9;
    let mut plant = Plant::new(ModelName::Model2, rig, &concealed.parameters, &concealed.effects(), tick_s);
    for k in 0..(STEADY_S / tick_s) as u64 {
        plant.step(&Tick { time_s: k as f64 * tick_s, command: drive, ..Tick::default() });
    }
    plant.truth().thrust_n
}

fn found(rig: &Rig, seed: u64, drive_max: f64, share: f64, trouble: Trouble) -> Result<Found, Failure> {
    let concealed = Concealed { trouble: Some(trouble), ..Concealed::by_chance(rig, drive_max, seed) };
    let ended = session(rig, &concealed, share, seed)?;
    let is_it = match (&ended.stopped, trouble) {
        (Some(Stop::EncoderReversed { .. }), Trouble::EncoderReversed)
        | (Some(Stop::MotorReversed { .. }), Trouble::MotorReversed)
        | (Some(Stop::NoMotion { .. }), Trouble::DeadSensor | Trouble::BlockedShaft)
        | (Some(Stop::SignalReversed { signal: "thrust_n", .. }), Trouble::ThrustReversed) => true,
        // Without a flow meter that answers so early nothing else tells the cell from the whole thruster.
        (Some(Stop::SignalOrThrusterReversed { signal, .. }), Trouble::ThrustReversed) => {
            *signal == "thrust_n"
        }
        _ => false,
    };
    let said = ended.stopped.map_or_else(|| "nothing".to_owned(), |stop| stop.to_string());
    Ok(Found { seed, trouble: trouble.words(), said, found: is_it, way_rad: ended.way_rad })
}

#[cfg(test)]
mod tests {
    use super::*;

    const RIG: &str = include_str!("../../../../config/thrusters/whitcomb-yoerger-1999.toml");

    /// Every wiring fault is found, by its name, before half a turn; nothing else is taken for one; and what is
    /// stated of a thruster that is not as its rig says lies inside its tolerance but for one in twenty at most.
    #[test]
    fn concealed_thrusters_are_calibrated_and_wiring_faults_found_before_half_a_turn() {
        let rig = Rig::from_toml(RIG).unwrap();
        let rehearsal = rehearse(&rig, 2, 1, 0.5, &|| ()).unwrap();
        assert_eq!(rehearsal.found, [10, 10], "{:#?}", rehearsal.troubles);
        assert!(rehearsal.rigs.iter().all(|r| r.stopped.is_none()), "{:#?}", rehearsal.rigs);
        let [inside, all] = rehearsal.inside;
        assert!(all >= 56 && inside * 20 >= all * 19, "{inside} of {all}: {:#?}", rehearsal.rigs);
        // A tolerance that says nothing would hold too.
        let inertia = rehearsal.rigs[0].quantities.iter().find(|q| q.name == "inertia_kg_m2").unwrap();
        assert!(inertia.tolerance < 0.1 * inertia.truth, "{inertia:?}");
    }
}
