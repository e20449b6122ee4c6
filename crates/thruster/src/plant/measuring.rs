//! The measuring chain: encoder, filters, and what the sensors show, once a tick.

use super::{ANGLE, Balance, Local, Plant, Sensed, Tick, died_away};
use crate::models::ModelName;
use crate::real::Real;

/// States of the measuring chain.
#[derive(Clone, Copy)]
pub(super) struct Filters<T> {
    pub(super) angle_rad: T,
    pub(super) pulled_rad: T,
    pub(super) speed_rad_s: T,
    pub(super) thrust_n: T,
    pub(super) last_thrust_n: T,
    pub(super) torque_n_m: T,
    pub(super) last_torque_n_m: T,
}

/// Angles that the encoder showed at the last ticks, the oldest in turn: its speed is their difference over a control
/// period, which may be several steps of a simulation.
pub(super) struct Counted<T> {
    angles_rad: Vec<T>,
    oldest: usize,
    span_s: f64,
}

impl<T: Real> Counted<T> {
    /// At rest at zero, over some ticks.
    pub(super) fn over(ticks: usize, tick_s: f64) -> Self {
        let ticks = ticks.max(1);
        Self { angles_rad: vec![T::ZERO; ticks], oldest: 0, span_s: ticks as f64 * tick_s }
    }

    /// As if it had come to this angle at this speed.
    pub(super) fn came_to(&mut self, angle_rad: f64, speed_rad_s: f64) {
        let tick_s = self.span_s / self.angles_rad.len() as f64;
        let ago = (1..=self.angles_rad.len()).rev();
        for (angle, ticks) in self.angles_rad.iter_mut().zip(ago) {
            *angle = T::from(angle_rad - speed_rad_s * tick_s * ticks as f64);
        }
        self.oldest = 0;
    }

    /// The mean speed over the control period that ends here, rad/s.
    #[inline(always)]
    fn speed_rad_s(&mut self, angle_rad: T) -> T {
        let Some(oldest) = self.angles_rad.get_mut(self.oldest) else { return T::ZERO };
        let by = angle_rad - *oldest;
        *oldest = angle_rad;
        self.oldest = if self.oldest + 1 < self.angles_rad.len() { self.oldest + 1 } else { 0 };
        by / self.span_s
    }

    /// The scale's zero is moved: no motion is seen.
    pub(super) fn shift(&mut self, by: T) {
        self.angles_rad.iter_mut().for_each(|angle| *angle += by);
    }
}

impl<T: Real> Plant<T> {
    /// Has the encoder differenced over this many ticks, where a control period is several steps of a simulation.
    pub fn with_control_period(mut self, ticks: usize) -> Self {
        self.counted = Counted::over(ticks, self.tick_s);
        self
    }
}

/// The way through one tick or several: where it began, and the shaft's own angle at both ends, rad.
pub(super) struct Way<T> {
    pub(super) from: Local<T>,
    pub(super) from_rad: T,
    pub(super) to_rad: T,
}

impl<T: Real> Way<T> {
    /// The shaft's angle a part of the way, with a speed that runs straight to this one.
    #[inline(always)]
    fn angle_at(&self, to_rad_s: T, part: f64, span_s: f64) -> T {
        let from_rad_s = self.from.shaft_speed_rad_s;
        let bent = (to_rad_s - from_rad_s) * (0.5 * span_s * part * (part - 1.0));
        self.from_rad + (self.to_rad - self.from_rad) * part + bent
    }
}

impl<T: Real> Filters<T> {
    /// At rest.
    pub(super) const fn still() -> Self {
        Self {
            angle_rad: T::ZERO,
            pulled_rad: T::ZERO,
            speed_rad_s: T::ZERO,
            thrust_n: T::ZERO,
            last_thrust_n: T::ZERO,
            torque_n_m: T::ZERO,
            last_torque_n_m: T::ZERO,
        }
    }
}

impl<T: Real> Plant<T> {
    /// What the sensors show now (without noise).
    pub fn sensed(&self) -> Sensed<T> {
        if self.sense_hooks.is_empty() { self.unhooked_sensed() } else { self.sensed }
    }

    /// Thrust as the stand or hull feels it now, N: the blades', and what acts beside them.
    pub fn net_thrust_n(&self) -> T {
        self.filters.last_thrust_n
    }

    /// The measuring chain, once a tick: over several ticks that were passed at once everything is taken to have run
    /// straight, the shaft's speed too.
    #[inline(always)]
    pub(super) fn observe(&mut self, ticks: &[Tick], way: &Way<T>, balance: &Balance<T>) {
        let (thrust, torque) = (balance.thrust_n + balance.stand_n, balance.blade_torque_n_m);
        if let [tick] = ticks {
            self.encode(self.x[ANGLE]);
            self.weigh(thrust, torque, 1);
            self.true_thrust_n = balance.thrust_n;
            return self.show(tick, tick.time_s + self.tick_s);
        }
        let (end, count) = (self.at, ticks.len() as f64);
        let span_s = self.tick_s * count;
        let from = (self.filters.last_thrust_n, self.filters.last_torque_n_m, self.true_thrust_n);
        let alone = self.sense_hooks.is_empty();
        for (k, tick) in ticks.iter().enumerate() {
            let part = (k as f64 + 1.0) / count;
            let mix = |a: T, b: T| a + (b - a) * part;
            self.at.shaft_speed_rad_s = mix(way.from.shaft_speed_rad_s, end.shaft_speed_rad_s);
            self.encode(way.angle_at(end.shaft_speed_rad_s, part, span_s));
            if !alone {
                self.weigh(mix(from.0, thrust), mix(from.1, torque), 1);
                self.at.axial_m_s = mix(way.from.axial_m_s, end.axial_m_s);
                self.current_a = mix(way.from.current_a, end.current_a);
                self.true_thrust_n = mix(from.2, balance.thrust_n);
                self.show(tick, tick.time_s + self.tick_s);
            }
        }
        (self.at, self.current_a, self.true_thrust_n) = (end, end.current_a, balance.thrust_n);
        if alone {
            self.weigh(thrust, torque, ticks.len());
            if let Some(last) = ticks.last() {
                self.show(last, last.time_s + self.tick_s);
            }
        }
    }

    /// The encoder over one tick to where the shaft's angle is this.
    #[inline(always)]
    fn encode(&mut self, angle_rad: T) {
        let angle = self.encoded(angle_rad);
        let f = &mut self.filters;
        f.angle_rad = angle;
        f.pulled_rad = self.pulled_rad;
        // Angle differenced at the control rate, then a first-order filter.
        let raw = self.counted.speed_rad_s(angle);
        f.speed_rad_s = match self.decays.speed {
            Some(left) => died_away(raw + (f.speed_rad_s - raw) * left),
            _ if self.sensors.encoder_counts_per_rev.is_some() => raw,
            _ => self.at.shaft_speed_rad_s,
        };
    }

    /// The filters of thrust and torque over some ticks through which both run straight to these.
    #[inline(always)]
    fn weigh(&mut self, thrust_n: T, torque_n_m: T, ticks: usize) {
        let span_s = self.tick_s * ticks as f64;
        let over = |filter: Option<(f64, f64)>| match ticks {
            1 => filter,
            _ => filter.map(|(tau, left)| (tau, left.powi(ticks as i32))),
        };
        let (of_thrust, of_torque) = (over(self.decays.thrust), over(self.decays.torque));
        let f = &mut self.filters;
        f.thrust_n = first_order(f.thrust_n, f.last_thrust_n, thrust_n, span_s, of_thrust);
        f.torque_n_m = first_order(f.torque_n_m, f.last_torque_n_m, torque_n_m, span_s, of_torque);
        f.last_thrust_n = thrust_n;
        f.last_torque_n_m = torque_n_m;
    }

    /// An angle as the encoder counts it.
    pub(super) fn encoded(&self, angle_rad: T) -> T {
        match self.sensors.encoder_counts_per_rev {
            Some(counts) if self.quantise_encoder => {
                let quantum = std::f64::consts::TAU / counts;
                T::from((angle_rad.re() / quantum).floor() * quantum)
            }
            _ => angle_rad,
        }
    }

    /// What the sensors show at an instant, the end of a tick, with the effects on them.
    #[inline(always)]
    pub(super) fn show(&mut self, tick: &Tick, time_s: f64) {
        self.time_s = time_s;
        self.supply_v = tick.supply_v.unwrap_or(self.nominal_supply_v);
        if !self.sense_hooks.is_empty() {
            let mut sensed = self.unhooked_sensed();
            let now = Tick { time_s: self.time_s, ..*tick };
            for i in &self.sense_hooks {
                let hooked = &mut self.effects[*i];
                hooked.effect.arrive(&self.at, &self.x[hooked.own.clone()]);
                hooked.effect.sense(&now, &mut sensed);
            }
            self.sensed = sensed;
        }
    }

    /// What the sensors show where no effect is at work on them.
    fn unhooked_sensed(&self) -> Sensed<T> {
        let f = &self.filters;
        Sensed {
            current_a: self.current_a,
            shaft_angle_rad: f.angle_rad,
            pulled_rad: f.pulled_rad,
            shaft_speed_rad_s: f.speed_rad_s,
            thrust_n: f.thrust_n,
            torque_n_m: f.torque_n_m,
            flow_m_s: match self.model {
                ModelName::Model1 => self.constants.yoerger_slip_m * self.at.shaft_speed_rad_s,
                _ => self.at.axial_m_s,
            },
            true_speed_rad_s: self.at.shaft_speed_rad_s,
            true_thrust_n: self.true_thrust_n,
            supply_v: T::from(self.supply_v),
            since_mean_rad_s2: self
                .shows_a_bare_difference()
                .then(|| (self.at.shaft_speed_rad_s - f.speed_rad_s) / (0.5 * self.counted.span_s)),
        }
    }

    /// Whether the shown speed is the encoder's angle differenced over a control period, with no filter behind.
    fn shows_a_bare_difference(&self) -> bool {
        self.decays.speed.is_none() && self.sensors.encoder_counts_per_rev.is_some()
    }
}

/// Exact first-order low pass over a time in which its input runs straight from `u0` to `u1`.
fn first_order<T: Real>(y: T, u0: T, u1: T, dt: f64, filter: Option<(f64, f64)>) -> T {
    let Some((tau, left)) = filter else { return u1 };
    let slope = (u1 - u0) / dt;
    u1 - slope * tau + (y - u0 + slope * tau) * left
}
