//! One channel's clock is behind the others'.

use super::{Family, any};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::memory::Past;
use crate::physics::{Now, Path, Physics, Reading};

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Sensor,
    forms: &["constant", "drifting apart", "later after a jump"],
    fits: any,
    draw,
    ..Family::new("clock_skew")
};

#[derive(Clone, Copy)]
enum Channel {
    Thrust,
    Flow,
    Speed,
}

struct Skew {
    form: usize,
    channel: Channel,
    /// Share of the lateness at the start, and the instant of a jump over the run.
    shape: f64,
    most_s: f64,
    late_s: f64,
    past: [Past; 2],
}

fn draw(form: usize, machine: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let channel = if machine.wet() {
        dice.pick(&[Channel::Thrust, Channel::Flow, Channel::Speed])
    } else {
        Channel::Speed
    };
    let most_s = if machine.wet() { 0.25 } else { 0.12 };
    Box::new(Skew { form, channel, shape: dice.between(0.3, 0.7), most_s, late_s: 0.0, past: Default::default() })
}

impl Physics for Skew {
    fn set(&mut self, strength: f64) {
        self.late_s = self.most_s * strength;
    }

    fn rest(&mut self) {
        self.past.iter_mut().for_each(Past::clear);
    }

    fn sense(&mut self, now: &Now, reading: &mut Reading, tick_s: f64) {
        let passed = now.time_s / now.full.duration_s;
        let late = self.late_s
            * match self.form {
                0 => 1.0,
                1 => self.shape + 2.0 * (1.0 - self.shape) * passed,
                _ if passed < self.shape => 0.6,
                _ => 1.4,
            };
        let most = (1.5 * self.most_s / tick_s) as usize + 2;
        let shown = |value: &mut f64, past: &mut Past| {
            past.push(*value, most);
            *value = past.ago(late / tick_s);
        };
        match self.channel {
            Channel::Thrust => shown(&mut reading.thrust_n, &mut self.past[0]),
            Channel::Flow => shown(&mut reading.flow_m_s, &mut self.past[0]),
            Channel::Speed => {
                shown(&mut reading.speed_rad_s, &mut self.past[0]);
                shown(&mut reading.angle_rad, &mut self.past[1]);
            }
        }
    }
}
