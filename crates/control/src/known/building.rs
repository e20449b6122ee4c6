//! Lift that builds up as the blades travel (Wagner 1925): known effects at the blades that leave lift and drag as they
//! were once they have settled, and hold lift back until then.
//!
//! Their own states follow the last estimate. What they hold back is linear in the quasi-steady lift `w` of the moment:
//! `CL = w - h w + c`, where the share `h` that does not come at once is probed once, and `c`, what has built up of it, is
//! asked of the states at each tick. Observers predict with both, and with the slopes that follow; laws aim at what
//! will have built up when the shaft arrives.

use kort_thruster::blade::Inflow;
use kort_thruster::effects::Effect;
use kort_thruster::plant::{Balance, Foil, Local};
use kort_thruster::rig::Rig;

use super::built;
use super::design::{STATES, sections, settled};
use super::motion::bare;
use crate::model::{ControlModel, HeldLift};
use crate::signals::Estimate;

/// Angles of inflow, rad, at which an effect is asked whether it leaves lift and drag as they were once it has settled.
const ANGLES: [f64; 4] = [0.15, 0.25, -0.2, 2.9];
/// What it may change there at most, as a share of the largest lift; and what it holds back at first is more.
const SETTLED: f64 = 1e-3;

struct Held {
    effect: Box<dyn Effect>,
    own: [f64; STATES],
    /// Share of the lift of the moment that does not come at once.
    share: f64,
}

/// The effects that hold lift back.
pub(super) struct Building {
    held: Vec<Held>,
    /// Its states are those of water that went on as it is.
    begun: bool,
}

impl Building {
    pub(super) fn new(rig: &Rig, model: &ControlModel) -> Self {
        let row = model.blade.row();
        let speed_m_s = 0.7 * model.speed_max_rad_s * row.lever_m;
        let holds_back = |effect: super::Built| {
            let one = std::slice::from_ref(&effect);
            let as_it_was = ANGLES.iter().all(|angle| {
                let (plain, foil) = sections(model, &row, one, *angle, speed_m_s);
                let most = SETTLED * model.blade.lift_max;
                (foil.lift - plain.lift).abs() < most && (foil.drag - plain.drag).abs() < most
            });
            let (sin, cos) = ANGLES[0].sin_cos();
            let plain = row.section(Inflow { tangential_m_s: speed_m_s * cos, axial_m_s: speed_m_s * sin });
            let share =
                1.0 - with(effect.1.as_ref(), &[0.0; STATES], &Local::default(), plain).lift / plain.lift;
            (as_it_was && share > SETTLED).then_some(Held { effect: effect.1, own: [0.0; STATES], share })
        };
        let lags = |(_, effect): &super::Built| {
            effect.hooks().foil && effect.states() > 0 && effect.states() <= STATES && !effect.slow()
        };
        let held = built(rig, model.period_s).into_iter().filter(lags).filter_map(holds_back).collect();
        Self { held, begun: false }
    }

    pub(super) fn is_idle(&self) -> bool {
        self.held.is_empty()
    }

    /// What is held back by now, where the water is as it was estimated last.
    pub(super) fn held(
        &mut self,
        last: Option<&Estimate>,
        model: &ControlModel,
        dt_s: f64,
    ) -> Option<HeldLift> {
        let last = last.filter(|_| !self.is_idle())?;
        let at = Local {
            shaft_speed_rad_s: last.shaft_speed_rad_s.value,
            axial_m_s: last.flow_m_s.value,
            swirl_m_s: last.swirl_m_s.value,
            ..Local::default()
        };
        let inflow = model.blade.inflow(at.shaft_speed_rad_s, at.axial_m_s, at.swirl_m_s);
        let plain = model.blade.row().section(inflow);
        let mut all = HeldLift::default();
        for held in &mut self.held {
            if self.begun {
                held.advance(model, &at, plain, dt_s);
            } else {
                held.own = settled(held.effect.as_ref(), model, &at, plain);
            }
            let now = with(held.effect.as_ref(), &held.own, &at, plain);
            all.share += held.share;
            all.built_up += now.lift - (1.0 - held.share) * plain.lift;
        }
        self.begun = true;
        Some(all)
    }
}

impl Held {
    fn advance(&mut self, model: &ControlModel, at: &Local, plain: Foil, dt_s: f64) {
        let n = self.effect.states();
        // A rate is made for one tick: what lasts longer goes in steps.
        let steps = (dt_s / model.period_s).ceil().max(1.0);
        for _ in 0..steps as u32 {
            let mut rates = [0.0; STATES];
            let foil = with(self.effect.as_ref(), &self.own, at, plain);
            let mut balance = Balance { foil, ..bare(model, at) };
            self.effect.balance(at, &self.own[..n], &mut balance, &mut rates[..n]);
            for (state, rate) in self.own.iter_mut().zip(rates).filter(|(_, rate)| rate.is_finite()) {
                *state += rate * dt_s / steps;
            }
        }
    }
}

/// A section as an effect with these states leaves it.
fn with(effect: &dyn Effect, own: &[f64; STATES], at: &Local, plain: Foil) -> Foil {
    let mut foil = plain;
    effect.foil(at, &own[..effect.states()], &mut foil);
    foil
}
