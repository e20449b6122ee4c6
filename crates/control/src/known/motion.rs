//! Torque that effects make beyond a function of shaft speed: what follows the current (iron that saturates, a
//! magnet that warms up), the shaft angle (ripple, cogging, a bent shaft), the load (gears), or a slow state.
//!
//! With `B(i)` the torque of current and effects at the estimated state, and `F(Om)` the friction curve that laws
//! and observers reckon with themselves, an ideal motor has the current `(B(i) + F)/kt`; the current for a wanted
//! torque is found by correcting with what is missing, a fixed number of times.

use std::ops::Range;

use kort_thruster::effects::Effect;
use kort_thruster::plant::{Balance, Local};
use kort_thruster::rig::Rig;

use super::built;
use crate::model::ControlModel;
use crate::signals::{Estimate, Measurement};

/// Room for slow states.
const STATES: usize = 16;
/// Corrections of a current.
const STEPS: u32 = 6;

struct Moving {
    effect: Box<dyn Effect>,
    own: Range<usize>,
    /// It says nothing without a shaft angle.
    follows_angle: bool,
}

/// The effects at the shaft.
pub(super) struct Motion {
    effects: Vec<Moving>,
    own: [f64; STATES],
    at: Local,
    angle_known: bool,
    torque_constant_nm_a: f64,
    /// Largest change of current that is made for them, A.
    most_a: f64,
    /// Whether anything here is more than the friction curve.
    live: bool,
    ambient_m_s: f64,
}

/// Whether an effect's part in the balance can be followed: at once, or by slow states.
pub(super) fn followed(effect: &dyn Effect) -> bool {
    effect.hooks().balance && (effect.states() == 0 || effect.slow())
}

/// What an effect adds to the shaft's torque, N m; positive accelerates ahead. `turning` is the smoothed sign of
/// the shaft's speed.
pub(super) fn torque_n_m(balance: &Balance, turning: f64) -> f64 {
    let rub = if turning < 0.0 { balance.friction_astern_n_m } else { balance.friction_ahead_n_m };
    balance.motor_torque_n_m + balance.shaft_torque_n_m - rub * turning
}

/// A balance with nothing but the motor and the water.
pub(super) fn bare(model: &ControlModel, at: &Local) -> Balance {
    Balance {
        motor_torque_n_m: model.torque_constant_nm_a * at.current_a,
        blade_torque_n_m: at.blade_torque_n_m,
        thrust_n: at.thrust_n,
        inertia_kg_m2: model.inertia_kg_m2,
        added_mass_kg: model.added_mass_kg,
        flux_kg_m: model.flux_coefficient * model.blade.density_kg_m3 * model.blade.area_m2(),
        ..Balance::default()
    }
}

/// Whether what an effect does to the shaft depends on its angle.
pub(super) fn follows_angle(effect: &dyn Effect, model: &ControlModel) -> bool {
    let own = [0.0; STATES];
    let torque = |angle: f64| {
        let at = Local {
            shaft_speed_rad_s: 0.5 * model.speed_max_rad_s,
            current_a: 0.5 * model.current_limit_a,
            shaft_angle_rad: angle,
            ..Local::default()
        };
        let mut balance = bare(model, &at);
        effect.balance(&at, &own[..effect.states()], &mut balance, &mut [0.0; STATES][..effect.states()]);
        torque_n_m(&balance, 1.0)
    };
    let first = torque(0.0);
    (1..24).any(|k| (torque(0.27 * f64::from(k)) - first).abs() > 1e-9 * (1.0 + first.abs()))
}

impl Motion {
    pub(super) fn new(rig: &Rig, model: &ControlModel) -> Self {
        let mut next = 0;
        let mut effects = Vec::new();
        for (_, effect) in built(rig, model.period_s) {
            let own = next..next + effect.states();
            if followed(effect.as_ref()) && own.end <= STATES {
                next = own.end;
                let follows_angle = follows_angle(effect.as_ref(), model);
                effects.push(Moving { effect, own, follows_angle });
            }
        }
        let mut motion = Self {
            effects,
            own: [0.0; STATES],
            at: Local::default(),
            angle_known: true,
            torque_constant_nm_a: model.torque_constant_nm_a,
            most_a: 0.5 * model.current_limit_a,
            live: true,
            ambient_m_s: 0.0,
        };
        motion.live = motion.is_more_than_friction(model);
        if !motion.live {
            motion.effects.clear();
        }
        motion
    }

    /// Probed over speed, current, angle and load; and what has states is more.
    fn is_more_than_friction(&mut self, model: &ControlModel) -> bool {
        if self.effects.iter().any(|m| m.effect.states() > 0) {
            return true;
        }
        let limit = model.current_limit_a;
        let mut more = false;
        for k in 0..60_u32 {
            let share = |by: u32| f64::from(k.wrapping_mul(by) % 61) / 30.0 - 1.0;
            self.at = Local {
                shaft_speed_rad_s: share(7) * model.speed_max_rad_s,
                shaft_angle_rad: 3.0 * share(11),
                blade_torque_n_m: share(13) * limit * model.torque_constant_nm_a,
                ..Local::default()
            };
            let i = share(17) * limit;
            more |= (self.ideal_a(model, i) - i).abs() > 2e-4 * limit;
        }
        self.at = Local::default();
        more
    }

    pub(super) fn is_idle(&self) -> bool {
        !self.live
    }

    pub(super) fn ambient_m_s(&self) -> f64 {
        self.ambient_m_s
    }

    /// Takes the last estimate for where shaft and water are, and lets slow states go on.
    pub(super) fn advance(
        &mut self,
        measured: &Measurement,
        last: Option<&Estimate>,
        current_a: f64,
        dt_s: f64,
    ) {
        let last = last.copied().unwrap_or_default();
        self.angle_known = measured.shaft_angle_rad.is_some();
        self.at = Local {
            time_s: self.at.time_s + dt_s,
            shaft_speed_rad_s: last.shaft_speed_rad_s.value,
            shaft_angle_rad: measured.shaft_angle_rad.unwrap_or(0.0),
            axial_m_s: last.flow_m_s.value,
            swirl_m_s: last.swirl_m_s.value,
            current_a,
            thrust_n: last.thrust_n.value,
            blade_torque_n_m: last.blade_torque_n_m,
            ..Local::default()
        };
        let mut rates = [0.0; STATES];
        let mut balance = Balance { thrust_n: self.at.thrust_n, ..Balance::default() };
        for m in self.effects.iter().filter(|m| self.angle_known || !m.follows_angle) {
            m.effect.balance(&self.at, &self.own[m.own.clone()], &mut balance, &mut rates[m.own.clone()]);
        }
        self.ambient_m_s = balance.ambient_m_s;
        for (state, rate) in self.own.iter_mut().zip(rates) {
            let next = *state + rate * dt_s;
            if next.is_finite() {
                *state = next;
            }
        }
    }

    /// Torque of a current with the effects and the friction curve taken back, as current of an ideal motor, A.
    pub(super) fn ideal_a(&self, model: &ControlModel, current_a: f64) -> f64 {
        let at = Local { current_a, ..self.at };
        let mut balance = bare(model, &at);
        let mut rates = [0.0; STATES];
        for m in self.effects.iter().filter(|m| self.angle_known || !m.follows_angle) {
            m.effect.balance(&at, &self.own[m.own.clone()], &mut balance, &mut rates[m.own.clone()]);
        }
        let turning = model.turning(at.shaft_speed_rad_s);
        let torque = torque_n_m(&balance, turning) + model.known_friction_n_m(at.shaft_speed_rad_s);
        let change = torque / self.torque_constant_nm_a - current_a;
        if change.is_finite() { current_a + change.clamp(-self.most_a, self.most_a) } else { current_a }
    }

    /// The current whose torque an ideal motor would give with this one, A.
    pub(super) fn actual_a(&self, model: &ControlModel, ideal_a: f64) -> f64 {
        let mut current = ideal_a;
        for _ in 0..STEPS {
            let missing = ideal_a - self.ideal_a(model, current);
            current += missing.clamp(-self.most_a, self.most_a);
        }
        current.clamp(ideal_a - self.most_a, ideal_a + self.most_a)
    }
}
