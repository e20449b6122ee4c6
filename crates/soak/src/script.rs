//! The script of a run: what is asked and what water and supply do, tick by tick, from a seed.

use kort_thruster::plant::Tick;

use crate::reference::Player;
use crate::run::{Prepared, stream};
use crate::sea::{Now, STEP_S, Sea};

/// A script that is played.
pub struct Script<'a> {
    player: Player<'a>,
    sea: Sea<'a>,
    dt_s: f64,
    thrust_max_n: f64,
    from: Now,
    to: Now,
    since_s: f64,
}

/// One instant of it.
#[derive(Clone, Copy, Debug)]
pub struct Moment {
    /// Time, s.
    pub time_s: f64,
    /// Thrust asked for, N.
    pub reference_n: f64,
    /// The sea at the beginning of the stretch that this instant lies in.
    pub sea: Now,
    to: Now,
    part: f64,
    dt_s: f64,
}

impl<'a> Script<'a> {
    /// From the beginning.
    pub fn new(prepared: &'a Prepared<'a>, seed: u64) -> Self {
        let scenario = prepared.scenario;
        let player = Player::new(&scenario.references, prepared.replayed, stream(seed, 1));
        let supply_v = prepared.rig.amplifier.supply_v;
        let (ambient, sags) = (&scenario.ambient, &scenario.supply_sags);
        let mut sea = Sea::new(ambient, scenario.depth, sags, supply_v, stream(seed, 2));
        let to = sea.at(0.0);
        Self {
            player,
            sea,
            dt_s: 1.0 / scenario.control_rate_hz,
            thrust_max_n: prepared.thrust_max_n,
            from: Now::default(),
            to,
            since_s: -STEP_S,
        }
    }

    /// The next instant; call once a tick, with its time.
    pub fn next(&mut self, time_s: f64) -> Moment {
        if time_s >= self.since_s + STEP_S {
            self.since_s += STEP_S;
            self.from = self.to;
            self.to = self.sea.at(self.since_s + STEP_S);
        }
        Moment {
            time_s,
            reference_n: self.thrust_max_n * self.player.next(self.dt_s),
            sea: self.from,
            to: self.to,
            part: (time_s - self.since_s) / STEP_S,
            dt_s: self.dt_s,
        }
    }
}

impl Moment {
    /// What drives the plant over this tick: a command, and the water's straight line between two instants.
    pub fn drive(&self, command: f64) -> Tick {
        let (from, to, part) = (&self.sea, &self.to, self.part);
        let next = part + self.dt_s / STEP_S;
        let mix = |p: f64| from.ambient_m_s + (to.ambient_m_s - from.ambient_m_s) * p.min(1.0);
        Tick {
            time_s: self.time_s,
            command,
            ambient_m_s: (mix(part), mix(next)),
            supply_v: from.supply_v,
            depth_m: from.depth_m.zip(to.depth_m).map(|(a, b)| a + (b - a) * part),
            ..Tick::default()
        }
    }
}
