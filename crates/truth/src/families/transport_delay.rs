//! Dead time between command and drive: bus, scheduler, polling.

use super::{Family, any};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::physics::{Now, Path, Physics};

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Drive,
    forms: &["constant", "a bus that polls", "jitter"],
    fits: any,
    draw,
    ..Family::new("transport_delay")
};

enum Form {
    /// The same for all.
    Constant,
    /// The command is taken over only every so often, a share of the delay.
    Polling(f64),
    /// Each message takes a time of its own.
    Jitter(Box<Dice>),
}

struct Dead {
    form: Form,
    most_s: f64,
    delay_s: f64,
    now_s: f64,
    next_s: f64,
}

fn draw(form: usize, machine: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let form = match form {
        0 => Form::Constant,
        1 => Form::Polling(dice.between(0.3, 0.8)),
        _ => Form::Jitter(Box::new(dice.fork())),
    };
    let most_s = if machine.wet() { 0.25 } else { 0.12 };
    Box::new(Dead { form, most_s, delay_s: 0.0, now_s: 0.0, next_s: 0.0 })
}

impl Physics for Dead {
    fn set(&mut self, strength: f64) {
        self.delay_s = self.most_s * strength;
    }

    fn rest(&mut self) {
        (self.now_s, self.next_s) = (self.delay_s, 0.0);
    }

    fn lateness_s(&self, now: &Now) -> f64 {
        match self.form {
            Form::Constant => self.delay_s,
            Form::Polling(share) => {
                let cycle = share * self.delay_s;
                // Mean of the wait is half a cycle.
                let waited = if cycle > 1e-4 { now.time_s.rem_euclid(cycle) } else { 0.0 };
                self.delay_s - 0.5 * cycle + waited
            }
            Form::Jitter(_) => self.now_s,
        }
    }

    fn advance(&mut self, now: &Now, _: f64) {
        if let Form::Jitter(dice) = &mut self.form
            && now.time_s >= self.next_s
        {
            self.now_s = self.delay_s * dice.between(0.75, 1.25);
            self.next_s = now.time_s + 0.02;
        }
    }
}
