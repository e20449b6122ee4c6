//! The stages of a session, a file each.

mod breakaway;
mod direction;
mod first_movement;
mod working_range;
mod zeros;

use kort_thruster::rig::AmplifierKind;

use crate::facts::Facts;
use crate::plan::Plan;
use crate::session::Seen;
use crate::stop::Stop;

/// What a stage wants at a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Step {
    /// This drive, in the unit of the drive.
    Drive(f64),
    /// It has what it was for.
    Done,
}

/// A stage of a session.
pub trait Stage: Send {
    /// Its name.
    fn name(&self) -> &'static str;

    /// What it is about to do, and how far the shaft will turn.
    fn says(&self, plan: &Plan, facts: &Facts) -> String;

    /// One tick.
    ///
    /// # Errors
    /// [`Stop`]: something is not as it should be.
    fn tick(&mut self, plan: &Plan, seen: &Seen, facts: &mut Facts) -> Result<Step, Stop>;
}

/// Names of all stages, in their order.
pub const ALL: [&str; 5] = ["zeros", "first_movement", "direction", "breakaway", "working_range"];

/// The stages for a plan: a drive with a speed loop of its own hides friction.
pub fn all(plan: &Plan) -> Vec<Box<dyn Stage>> {
    let mut stages: Vec<Box<dyn Stage>> = vec![
        Box::new(zeros::Zeros::default()),
        Box::new(first_movement::FirstMovement::default()),
        Box::new(direction::Direction::default()),
    ];
    if plan.kind != AmplifierKind::Speed {
        stages.push(Box::new(breakaway::BreakawayRamps::default()));
    }
    stages.push(Box::new(working_range::WorkingRange::default()));
    stages
}

/// Unit of a drive.
pub fn unit(kind: AmplifierKind) -> &'static str {
    match kind {
        AmplifierKind::Current => "A",
        AmplifierKind::Voltage => "V",
        AmplifierKind::Speed => "rad/s",
    }
}

/// How long water flows on about, s.
const FLOWS_ON_S: f64 = 1.0;

/// Gathers what thrust, flow and blade torque answer. What pushes goes with speed squared, so a reading weighs as much:
/// those of a shaft that hardly turns are noise. Before it is known which way the shaft sensor counts, and whether it
/// counts at all, the sign of the drive is all there is.
fn hear(seen: &Seen, facts: &mut Facts, side: f64) {
    let row = &seen.fresh;
    let speed = seen.speed_rad_s * facts.side;
    let weight = if facts.side == 0.0 { side } else { speed * speed.abs() };
    // Water takes up what pushes it late and keeps it for a while: after a pulse ahead it may flow ahead all through one
    // astern.
    let kept = (-(seen.time_s - facts.pushed.1) / FLOWS_ON_S).exp();
    facts.pushed = (facts.pushed.0 * kept + weight * (1.0 - kept), seen.time_s);
    let weights = [weight, if facts.side == 0.0 { side } else { facts.pushed.0 }, weight];
    let zero = |signal: &str| facts.at_rest(signal).mean;
    let above = [
        row.thrust_n - zero("thrust_n"),
        row.flow_m_s - zero("flow_m_s"),
        row.torque_n_m - zero("torque_n_m"),
    ];
    let told = above.into_iter().zip(weights);
    facts.answers.iter_mut().zip(told).for_each(|(answer, (value, weight))| answer.take(value, weight));
}
