//! What a case is made of, before anything runs.

use crate::answer::CaseKind;
use crate::controller::Controller;
use crate::dice::Dice;
use crate::excitation::{Excitation, shares};
use crate::families::{self, Family};
use crate::log::{Columns, LogPlan, Stamps};
use crate::machine::{DriveKind, Machine, Scale};
use crate::machines;
use crate::run::{Bench, Driver};
use crate::sizing::Trial;

/// Kind of machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MachineKind {
    /// A thruster.
    Thruster,
    /// A dry shaft.
    Dry,
}

/// Choices that override the draw.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Selection {
    /// Effect id of a single case.
    pub effect: Option<String>,
    /// Share of full scale.
    pub strength: Option<f64>,
    /// Several blade sections (true), one (false), or drawn.
    pub distributed: Option<bool>,
    /// Thruster, dry shaft, or drawn.
    pub machine: Option<MachineKind>,
    /// Effects that may be hidden; empty for all.
    pub families: Vec<String>,
    /// Effects that may not.
    pub without: Vec<String>,
    /// Kinds of noise that may not be drawn.
    pub without_noise: Vec<String>,
}

impl Selection {
    /// Whether this family may be hidden.
    pub fn allows(&self, family: &Family) -> bool {
        let listed = |list: &[String]| list.iter().any(|id| id == family.id);
        (self.families.is_empty() || listed(&self.families)) && !listed(&self.without)
    }
}

/// An effect to be hidden: its family, the form, the wanted share of full scale.
pub struct Wanted {
    pub family: &'static Family,
    pub form: usize,
    pub share: f64,
}

/// A case before anything runs.
pub struct Plan {
    pub machine: Machine,
    pub excitation: Excitation,
    pub log: LogPlan,
    pub closed: bool,
    pub wanted: Vec<Wanted>,
    /// Wanted share of a term outside the catalogue.
    pub outside: Option<f64>,
    pub confounded: Vec<&'static str>,
}

/// Share of cases on a dry shaft.
const DRY_SHARE: f64 = 0.3;
/// Share of the dry shafts on which a load hangs.
const LOADED_SHARE: f64 = 0.35;

/// Draws machine, excitation, log and effects of a case.
pub fn draw(kind: CaseKind, seed: u64, selection: &Selection, dice: &mut Dice) -> Plan {
    let single = (kind == CaseKind::Single).then(|| turn(seed, selection));
    let machine = machine(single, selection, dice);
    let excitation = match &single {
        // What a jump or a corner shows needs one.
        _ if dice.chance(0.55) => {
            dice.pick(&[Excitation::Full, Excitation::Staircase, Excitation::RandomLevels])
        }
        _ => dice.pick(&Excitation::DRAWN),
    };
    let closed_share = if machine.load.swings() { 0.7 } else { 0.3 };
    let closed = dice.chance(if machine.wet() { 0.12 } else { closed_share });
    let columns = columns(&machine, closed, dice);
    let stamps = if dice.chance(0.75) { Stamps::Even } else { dice.pick(&[Stamps::Jitter, Stamps::Uneven]) };
    let mut plan = Plan {
        excitation,
        log: LogPlan {
            columns,
            stamps,
            from_s: if dice.chance(0.12) { dice.between(0.5, 3.0) } else { 0.0 },
            // Where an arm hangs down is known.
            encoder_zero_rad: if machine.load.swings() {
                0.0
            } else {
                encoder_zero_rad(&mut Dice::new(seed, 300 + kind as u64))
            },
        },
        closed,
        wanted: Vec::new(),
        outside: None,
        confounded: Vec::new(),
        machine,
    };
    match kind {
        CaseKind::Clean => {}
        CaseKind::Single => {
            let level = [0.012, 0.03, 0.06, 0.12][(seed % 4) as usize];
            let family = single.expect("a single case has its family");
            plan.want(family, selection.strength.unwrap_or(level), dice);
        }
        CaseKind::Pair => plan.want_some(2, selection, dice),
        CaseKind::Several => {
            let count = 3 + dice.index(4);
            plan.want_some(count, selection, dice);
        }
        CaseKind::Confounded => crate::confounded::confound(&mut plan, seed, dice),
        CaseKind::Outside => {
            plan.outside = Some(selection.strength.unwrap_or_else(|| dice.log_between(0.025, 0.15)));
            plan.closed = false;
            plan.log.columns.command = true;
        }
    }
    plan.record_what_must_be_seen();
    plan
}

/// The family whose turn it is with this seed.
fn turn(seed: u64, selection: &Selection) -> &'static Family {
    if let Some(family) = selection.effect.as_deref().and_then(families::find) {
        return family;
    }
    let allowed: Vec<&'static Family> =
        families::ALL.iter().copied().filter(|f| selection.allows(f)).collect();
    let list = if allowed.is_empty() { families::ALL } else { &allowed };
    list[(seed % list.len() as u64) as usize]
}

/// A machine that may have the effect.
fn machine(single: Option<&Family>, selection: &Selection, dice: &mut Dice) -> Machine {
    let mut specimen = draw_machine(selection, dice);
    for _ in 0..60 {
        if single.is_none_or(|family| (family.fits)(&specimen)) {
            break;
        }
        specimen = draw_machine(&Selection { machine: None, ..selection.clone() }, dice);
    }
    let distributed = selection.distributed.unwrap_or(dice.chance(0.3));
    if let (true, Some(blades)) = (distributed, &mut specimen.blades) {
        blades.distribute(5 + dice.index(4), 0.6, 0.8);
    }
    specimen
}

fn draw_machine(selection: &Selection, dice: &mut Dice) -> Machine {
    let dry = match selection.machine {
        Some(kind) => kind == MachineKind::Dry,
        None => dice.chance(DRY_SHARE),
    };
    if !dry {
        dice.pick(&machines::THRUSTERS)(dice)
    } else if dice.chance(LOADED_SHARE) {
        dice.pick(&machines::LOADED)(dice)
    } else {
        dice.pick(&machines::DRY)(dice)
    }
}

/// Where an encoder stands that was switched on before: some of them count from nothing.
fn encoder_zero_rad(dice: &mut Dice) -> f64 {
    if dice.chance(0.5) { 0.0 } else { dice.side() * dice.log_between(0.1, 100.0) }
}

fn columns(machine: &Machine, closed: bool, dice: &mut Dice) -> Columns {
    let voltage = machine.drive == DriveKind::Voltage;
    let wet = machine.wet();
    let measured = closed && !voltage && dice.chance(0.6);
    let current = measured || dice.chance(if voltage { 0.4 } else { 0.8 });
    Columns {
        // A loop's set-point is logged; its command only where the drive is one of voltage, or now and then.
        command: !measured,
        duty: voltage && dice.chance(0.5),
        current,
        // What a swinging weight does depends on where it is.
        angle: dice.chance(0.85) || machine.load.swings(),
        thrust: wet && dice.chance(0.9),
        torque: wet && dice.chance(0.55),
        flow: wet && dice.chance(0.75),
        supply: dice.chance(0.5),
    }
}

impl Plan {
    fn want(&mut self, family: &'static Family, share: f64, dice: &mut Dice) {
        self.wanted.push(Wanted { family, form: dice.index(family.forms.len()), share });
    }

    /// Several effects that the machine may have, no two alike.
    fn want_some(&mut self, count: usize, selection: &Selection, dice: &mut Dice) {
        let mut list: Vec<&'static Family> = families::ALL
            .iter()
            .copied()
            .filter(|family| selection.allows(family) && (family.fits)(&self.machine) && family.sized)
            .collect();
        dice.shuffle(&mut list);
        let linked = |id: &str| matches!(id, "gear_backlash" | "flexible_coupling");
        for family in list {
            if self.wanted.len() == count {
                break;
            }
            // One elastic link a machine; one of two names of the same physics.
            let clash = self.wanted.iter().any(|other| {
                other.family.same_physics.contains(&family.id)
                    || (linked(other.family.id) && linked(family.id))
            });
            if !clash {
                let share = selection.strength.unwrap_or_else(|| dice.log_between(0.012, 0.3));
                self.want(family, share, dice);
            }
        }
        // The largest first: it sets the scale beside which the others must be seen.
        self.wanted.sort_by(|a, b| b.share.total_cmp(&a.share));
    }

    /// What shows an effect is recorded; what gives it away is not.
    fn record_what_must_be_seen(&mut self) {
        let hidden = |id: &str| self.wanted.iter().any(|wanted| wanted.family.id == id);
        let columns = &mut self.log.columns;
        if self.wanted.iter().any(|w| w.family.id.starts_with("thrust") || w.family.id == "stand_resonance") {
            columns.thrust = true;
        }
        if hidden("flowmeter_offset_lag_location") || hidden("clock_skew") && self.machine.wet() {
            columns.flow = true;
            columns.thrust = true;
        }
        if hidden("supply_sag") && self.machine.drive == DriveKind::Voltage {
            columns.supply = false;
        }
        // Behind a measured current the drive before it cannot be seen.
        if self.closed
            && !columns.command
            && self.wanted.iter().any(|w| w.family.path == crate::physics::Path::Drive)
        {
            columns.command = true;
        }
        if hidden("unsigned_speed_sensor") {
            // A loop around such a sensor would run away.
            self.closed = false;
            columns.command = true;
            columns.angle = false;
        }
    }

    /// Time in which the machine answers, s.
    pub fn quick_s(&self) -> f64 {
        let m = &self.machine;
        match &m.blades {
            Some(blades) => 0.25 * (blades.radius_m / 0.13).powf(0.7),
            None => {
                let emf = if m.drive == DriveKind::Voltage {
                    m.torque_constant_nm_a.powi(2) / m.winding_resistance_ohm
                } else {
                    0.0
                };
                (1.5 * m.inertia_kg_m2 / (m.viscous_nm_s + emf)).clamp(0.06, 0.4)
            }
        }
    }

    /// The command or the set-point of the run, and its loop.
    pub fn trial(&self, dice: &mut Dice) -> Trial {
        let sensors = &self.machine.sensors;
        let row_s = sensors.tick_s * sensors.ticks_per_row as f64;
        let quick_s = self.quick_s();
        let seconds = if self.machine.wet() {
            dice.between(110.0, 240.0) * quick_s
        } else {
            (dice.between(60.0, 150.0) * quick_s).min(8000.0 * row_s)
        };
        let seconds = seconds.clamp(8.0, 66.0).min(7500.0 * row_s);
        let list = shares(self.excitation, seconds, quick_s, sensors.tick_s, dice);
        if !self.closed {
            let limit = self.machine.command_limit();
            let top = match self.machine.drive {
                // Over the top is nothing to try open loop.
                _ if self.machine.load.swings() => {
                    let held = self.machine.load.largest_weight_n_m() / self.machine.torque_limit_n_m();
                    limit * (dice.between(0.5, 0.8) * held).min(1.0)
                }
                DriveKind::Voltage => limit,
                DriveKind::Current => limit * dice.between(0.85, 1.0),
            };
            return Trial {
                asked: list.iter().map(|s| (s * top * 1e5).round() / 1e5).collect(),
                controller: None,
            };
        }
        let (top, controller) = self.close(quick_s, dice);
        Trial {
            asked: list.iter().map(|s| (s * top * 1e4).round() / 1e4).collect(),
            controller: Some(controller),
        }
    }

    /// A loop for the machine, and the largest set-point.
    fn close(&self, quick_s: f64, dice: &mut Dice) -> (f64, Controller) {
        let m = &self.machine;
        // Command per rad/s of crossover and rad/s of error, on an inertia alone.
        let per = match m.drive {
            DriveKind::Current => m.inertia_kg_m2 / m.torque_constant_nm_a,
            DriveKind::Voltage => m.inertia_kg_m2 * m.winding_resistance_ohm / m.torque_constant_nm_a,
        };
        let slow_s = m.drive_lag_s + m.sensors.speed_filter_s + 2.0 * m.sensors.tick_s;
        let crossover = (0.4 / slow_s).min(6.0 / quick_s);
        if !m.wet() && (m.load.swings() || dice.chance(0.4)) {
            let natural = 0.35 * crossover;
            let law =
                Controller::Angle { proportional: natural * natural * per, damping: 1.6 * natural * per };
            let top = if m.load.swings() { dice.between(0.6, 2.5) } else { dice.between(1.0, 6.0) };
            return (top, law);
        }
        let bench = Bench { machine: m, full: Scale::default(), step_s: m.coarse_step_s(), quantise: false };
        let ticks = (12.0 * quick_s / m.sensors.tick_s) as usize;
        let open = bench.run(Driver::Command(&vec![m.command_limit(); ticks]), &mut []);
        let fastest = open.speed_rad_s.last().copied().unwrap_or(1.0);
        let proportional = crossover * per;
        let law =
            Controller::Speed { proportional, integral: proportional * dice.between(0.1, 0.3) * crossover };
        (dice.between(0.4, 0.8) * fastest, law)
    }
}
