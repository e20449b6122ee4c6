//! One controller: observer, estimator, law and limits, ticked together.

mod drive;

use kort_thruster::rig::Rig;

use crate::config::ControllerConfig;
use crate::estimators::{Adapted, Estimator, EstimatorInput};
use crate::known::Known;
use crate::laws::{Law, LawInput, LawKind, RotationalFlowOptions};
use crate::limits::{Bumpless, Limit, LimitSet, RateLimiter};
use crate::mismatch::{Mismatch, Monitor};
use crate::model::{ControlModel, ModelError, Swirl};
use crate::observers::{Observer, ObserverInput};
use crate::signals::{DriveCommand, Estimate, Measurement, Reference};

/// What one tick gives.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Output {
    /// What the drive is told.
    pub command: DriveCommand,
    /// What the observer says.
    pub estimate: Estimate,
    /// Limits in force.
    pub limits: LimitSet,
    /// Thrust reference after its limits, N; `None` under a speed reference or at rest.
    pub thrust_reference_n: Option<f64>,
    /// Shaft speed the law aims at, rad/s.
    pub speed_target_rad_s: f64,
}

/// Rate of false alarms that the monitor of mismatch is set to: one in thirty days of driving.
pub const FALSE_ALARMS_PER_DAY: f64 = 1.0 / 30.0;
/// Commands that are kept for a drive that answers late.
const SENT: usize = 256;

/// A running controller. A tick neither allocates nor blocks nor panics.
#[derive(Debug)]
pub struct Controller {
    config: ControllerConfig,
    /// As the rig states it.
    stated: ControlModel,
    /// As the law was designed: with friction of the configuration and swirl where the law has it.
    nominal: ControlModel,
    /// As adapted.
    model: ControlModel,
    observer: Observer,
    /// What the observer said last; `None` before the first tick.
    estimate: Option<Estimate>,
    estimator: Estimator,
    law: Law,
    /// Serves speed references whatever the law.
    speed_law: Law,
    adapted: Adapted,
    /// Stands between the ideal plant of laws and observers and the one the rig is known to be.
    known: Known,
    stated_supply_v: Option<f64>,
    monitor: Monitor,
    mode: Mode,
    thrust_rate: RateLimiter,
    current_rate: RateLimiter,
    /// Carries the law's current over a switch, ahead of the limits.
    bumpless: Bumpless,
    /// Carries over what else stands between law and drive: the inverse of what the rig is known to have.
    drive_bumpless: Bumpless,
    /// Last command, as the drive takes it: A, V or rad/s.
    commanded: f64,
    /// Last current in the ideal motor's terms, A.
    current_a: f64,
    /// Last currents asked of the drive, A: a ring, and the place of the newest.
    sent_a: [f64; SENT],
    newest: usize,
    drive_a: f64,
    last_speed_rad_s: f64,
    gated: u64,
    limited: bool,
}

/// Which kind of reference ran last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    Off,
    Thrust,
    Speed,
}

impl Controller {
    /// A controller at rest.
    ///
    /// # Errors
    /// [`ModelError`] if the rig has no propeller or the period is out of range.
    pub fn new(rig: &Rig, config: &ControllerConfig, period_s: f64) -> Result<Self, ModelError> {
        let stated = ControlModel::from_rig(rig, period_s)?;
        let nominal = design_model(&stated, config);
        let servo = ControllerConfig { law: LawKind::VelocityServo, ..*config };
        Ok(Self {
            config: *config,
            stated,
            nominal,
            model: nominal,
            observer: Observer::new(config.observer, &nominal, &config.observers),
            estimate: None,
            estimator: Estimator::new(config.estimator, &nominal, &config.adaptation),
            law: Law::new(config.law, &nominal, &config.laws),
            speed_law: Law::new(servo.law, &nominal, &config.laws),
            adapted: Adapted::default(),
            known: Known::new(rig, &nominal),
            stated_supply_v: rig.amplifier.supply_v,
            monitor: Monitor::new(&nominal, FALSE_ALARMS_PER_DAY),
            mode: Mode::Off,
            thrust_rate: RateLimiter::default(),
            current_rate: RateLimiter::default(),
            bumpless: Bumpless::default(),
            drive_bumpless: Bumpless::default(),
            commanded: 0.0,
            current_a: 0.0,
            sent_a: [0.0; SENT],
            newest: 0,
            drive_a: 0.0,
            last_speed_rad_s: 0.0,
            gated: 0,
            limited: false,
        })
    }

    /// A controller for another revision of the rig that goes on where this one is.
    ///
    /// # Errors
    /// [`ModelError`] as of [`Controller::new`]; this one then stays as it is.
    pub fn revised(&self, rig: &Rig, period_s: f64) -> Result<Self, ModelError> {
        let mut next = Self::new(rig, &self.config, period_s)?;
        next.go_on_from(self);
        Ok(next)
    }

    /// Goes on where another revision's controller is: its configuration, the command, what its observer believes, and
    /// the reference's ramp; coefficients are learnt anew. Neither allocates nor blocks.
    pub fn go_on_from(&mut self, before: &Self) {
        if self.config != before.config {
            self.configure(&before.config);
        }
        if let Some(last) = &before.estimate {
            self.observer = Observer::after(self.config.observer, &self.model, &self.config.observers, last);
            self.estimate = Some(*last);
        }
        self.mode = before.mode;
        (self.thrust_rate, self.current_rate) = (before.thrust_rate, before.current_rate);
        (self.current_a, self.drive_a) = (before.current_a, before.drive_a);
        self.commanded = before.commanded;
        (self.sent_a, self.newest) = (before.sent_a, before.newest);
        (self.last_speed_rad_s, self.gated) = (before.last_speed_rad_s, 0);
        self.carry_over();
    }

    /// The next command is the last one, and fades to what law and rig then ask for.
    fn carry_over(&mut self) {
        self.bumpless.arm();
        self.drive_bumpless.arm();
    }

    /// The configuration in force.
    pub fn config(&self) -> &ControllerConfig {
        &self.config
    }

    /// The model the law runs on now.
    pub fn model(&self) -> &ControlModel {
        &self.model
    }

    /// The model as designed, before adaptation.
    pub fn nominal(&self) -> &ControlModel {
        &self.nominal
    }

    /// The adapted coefficients.
    pub fn adapted(&self) -> &Adapted {
        &self.adapted
    }

    /// Which path of the thruster is off against the rig as stated.
    pub fn mismatch(&self) -> Mismatch {
        self.monitor.mismatch()
    }

    /// Changes law, options, observer or estimator while running. The command goes on from where it
    /// is; the estimator keeps what it knows unless its own part changed, and another observer
    /// goes on from where the last one was.
    pub fn configure(&mut self, config: &ControllerConfig) {
        let old = std::mem::replace(&mut self.config, *config);
        let nominal = design_model(&self.stated, config);
        let model_changed = nominal != self.nominal;
        self.nominal = nominal;
        if config.estimator != old.estimator || config.adaptation != old.adaptation || model_changed {
            self.estimator = Estimator::new(config.estimator, &nominal, &config.adaptation);
            self.adapted = Adapted::default();
        }
        self.model = nominal;
        self.adapted.apply(&nominal, &mut self.model);
        if config.observer != old.observer || config.observers != old.observers || model_changed {
            let (kind, options) = (config.observer, &config.observers);
            self.observer = match &self.estimate {
                Some(last) => Observer::after(kind, &self.model, options, last),
                None => Observer::new(kind, &self.model, options),
            };
        }
        self.law = Law::new(config.law, &self.model, &config.laws);
        self.speed_law = Law::new(LawKind::VelocityServo, &self.model, &config.laws);
        self.carry_over();
    }

    /// One tick: measurements and reference in, drive command out. `dt_s` is the time since the last
    /// tick; it is held between a fifth and five times the design period.
    pub fn tick(&mut self, measured: &Measurement, reference: Reference, dt_s: f64) -> Output {
        let period = self.stated.period_s;
        let dt = if dt_s.is_finite() { dt_s.clamp(0.2 * period, 5.0 * period) } else { period };
        // Whoever is told when something began looks at a clock that nothing holds.
        self.monitor.passes(if dt_s.is_finite() { dt_s.max(0.0) } else { dt });
        let m = &self.stated;
        let measured = measured.sane(3.0 * m.speed_max_rad_s, 3.0 * m.current_limit_a, 4.0 * m.thrust_max_n);
        let (measured, supply_v, current_a) = self.ideal(&measured, dt);
        let held_lift = self.known.held_lift(self.estimate.as_ref(), &self.model, dt);
        let building = held_lift.map(|held| self.model.holding(held));
        let estimate = self.observer.tick(&ObserverInput {
            model: building.as_ref().unwrap_or(&self.model),
            measured: &measured,
            current_a,
            dt_s: dt,
        });
        self.estimate = Some(estimate);
        self.adapt(&measured, &estimate, current_a, dt);

        let mut limits = LimitSet::default();
        let reference = finite(reference);
        let wanted = match reference {
            Reference::Off => Mode::Off,
            Reference::Thrust(_) => Mode::Thrust,
            Reference::Speed(_) => Mode::Speed,
        };
        self.enter(wanted);
        let speed = measured.shaft_speed_rad_s.unwrap_or(estimate.shaft_speed_rad_s.value);
        let (demand, thrust_n) = match reference {
            Reference::Off => {
                (self.current_a, self.commanded) = (0.0, 0.0);
                self.send(0.0);
                self.current_rate.reset(0.0);
                self.limited = false;
                self.last_speed_rad_s = speed;
                return Output {
                    command: DriveCommand::off(self.stated.amplifier),
                    estimate: self.felt(estimate),
                    limits,
                    thrust_reference_n: None,
                    speed_target_rad_s: 0.0,
                };
            }
            Reference::Thrust(thrust) => {
                let thrust = self.limit_thrust(thrust, dt, &mut limits);
                let input = LawInput {
                    model: &self.model,
                    measured: &measured,
                    estimate: &estimate,
                    thrust_n: self.model.blade_thrust_n(thrust, estimate.flow_m_s.value),
                    dt_s: dt,
                };
                (self.law.tick(&input), Some(thrust))
            }
            Reference::Speed(target) => {
                let cap = self.model.speed_max_rad_s;
                if target.abs() > cap {
                    limits.set(Limit::ShaftSpeed);
                }
                let target = target.clamp(-cap, cap);
                let thrust = self.model.map.thrust_n(target);
                let input = LawInput {
                    model: &self.model,
                    measured: &measured,
                    estimate: &estimate,
                    thrust_n: thrust,
                    dt_s: dt,
                };
                (self.speed_law.tick(&input), None)
            }
        };
        limits.0 |= demand.limits.0;
        let kt = self.model.torque_constant_nm_a;
        let asked = if demand.torque_n_m.is_finite() { demand.torque_n_m / kt } else { 0.0 };
        let blended = self.bumpless.step(asked, self.current_a, self.config.limits.fade_s, dt);
        let wanted = self.known.actual_a(&self.model, blended);
        let actual = self.limit_current(wanted, speed, &measured, dt, &mut limits);
        let applied = if actual == wanted { blended } else { self.known.ideal_a(&self.model, actual) };
        // The law follows what was applied of its own demand, the fading difference left out.
        let own = if applied == blended { asked } else { applied - (blended - asked) };
        match reference {
            Reference::Speed(_) => self.speed_law.settle(kt * own, dt),
            _ => self.law.settle(kt * own, dt),
        }
        self.current_a = applied;
        self.limited = limits.contains(Limit::Current)
            || limits.contains(Limit::Voltage)
            || limits.contains(Limit::AntiSpin);
        self.last_speed_rad_s = speed;
        let command = self.command(actual, demand.speed_rad_s, &measured, supply_v, dt, &mut limits);
        Output {
            command,
            estimate: self.felt(estimate),
            limits,
            thrust_reference_n: thrust_n,
            speed_target_rad_s: demand.speed_rad_s,
        }
    }

    fn adapt(&mut self, measured: &Measurement, estimate: &Estimate, current_a: f64, dt: f64) {
        let suspect = self.limited || estimate.gated != self.gated || self.mode == Mode::Off;
        self.gated = estimate.gated;
        let input =
            EstimatorInput { nominal: &self.nominal, measured, estimate, current_a, suspect, dt_s: dt };
        if let Some(adapted) = self.estimator.tick(&input) {
            let moved = adapted.ratio != self.adapted.ratio;
            self.adapted = adapted;
            if moved {
                adapted.apply(&self.nominal, &mut self.model);
            }
        }
    }

    /// A change of mode starts the law afresh and goes on from the present command; from rest there is none, and
    /// nothing is held back.
    fn enter(&mut self, wanted: Mode) {
        if wanted == self.mode {
            return;
        }
        let at_rest = self.mode == Mode::Off;
        match wanted {
            Mode::Off => {}
            Mode::Thrust => {
                self.law = Law::new(self.config.law, &self.model, &self.config.laws);
                let now = if at_rest { 0.0 } else { self.model.map.thrust_n(self.last_speed_rad_s) };
                self.thrust_rate.reset(now);
            }
            Mode::Speed => {
                self.speed_law = Law::new(LawKind::VelocityServo, &self.model, &self.config.laws);
            }
        }
        if at_rest || wanted == Mode::Off {
            self.bumpless.clear();
            self.drive_bumpless.clear();
        } else {
            self.bumpless.arm();
        }
        self.mode = wanted;
    }

    fn limit_thrust(&mut self, thrust_n: f64, dt: f64, limits: &mut LimitSet) -> f64 {
        let most = self.stated.thrust_max_n;
        if thrust_n.abs() > most {
            limits.set(Limit::ThrustReference);
        }
        let rate = self.config.limits.thrust_rate_per_s * most;
        let (thrust, limited) = self.thrust_rate.step(thrust_n.clamp(-most, most), rate, dt);
        if limited {
            limits.set(Limit::ThrustReferenceRate);
        }
        thrust
    }
}

/// A reference that is not finite is none.
fn finite(reference: Reference) -> Reference {
    match reference {
        Reference::Thrust(x) | Reference::Speed(x) if !x.is_finite() => Reference::Off,
        other => other,
    }
}

fn design_model(stated: &ControlModel, config: &ControllerConfig) -> ControlModel {
    let mut model = *stated;
    model.current_rate_a_s = config.limits.current_rate_per_s * model.current_limit_a;
    model.coulomb_friction_n_m = config.coulomb_friction * model.torque_constant_nm_a * model.current_limit_a;
    if config.law == LawKind::RotationalFlowInversion {
        let RotationalFlowOptions { drag, inertia } = config.laws.rotational_flow;
        model = model.with_swirl(Swirl { drag, inertia });
    }
    model
}
