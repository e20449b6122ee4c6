//! The composed plant: drive, motor, shaft, blades, axial flow and the measuring chain, with any
//! omitted effects hooked in. One `step` is one control tick; the same step runs in the live
//! simulated stand, in soak tests, in `kort simulate` and inside a fit.

mod measuring;
mod run;
mod state;
#[cfg(test)]
mod tests;

pub use run::{Response, Stimulus, simulate, simulate_each};
pub use state::{Balance, Course, Drive, Driven, Foil, Local, Sensed, Tick};

use measuring::Filters;

use crate::blade::Inflow;
use crate::effects::{Context, Descriptor, Effect};
use crate::models::ModelName;
use crate::parameters::{Parameter as P, Parameters};
use crate::real::Real;
use crate::rig::{AmplifierKind, Rig, Sensors};

/// Square of the speed through the water below which the blades do nothing, m^2/s^2: its square is still
/// a number, as the derivative of a quotient wants it.
const STILL_M2_S2: f64 = 1e-60;
/// Most continuous states of a plant: speed, flow, angle, swirl and those of the effects.
const STATES: usize = 12;
const SPEED: usize = 0;
const FLOW: usize = 1;
const ANGLE: usize = 2;
const SWIRL: usize = 3;
const OWN: usize = 4;
/// Most states of the usual plant with an effect that has states.
const FEW: usize = OWN + 2;

/// An effect at work, with the place of its states.
struct Hooked<T> {
    effect: Box<dyn Effect<T>>,
    own: std::ops::Range<usize>,
}

/// A thruster on its stand.
pub struct Plant<T = f64> {
    model: ModelName,
    parameters: Parameters<T>,
    sensors: Sensors,
    amplifier: AmplifierKind,
    current_limit_a: f64,
    nominal_supply_v: f64,
    tick_s: f64,
    effects: Vec<Hooked<T>>,
    drive_hooks: Vec<usize>,
    inflow_hooks: Vec<usize>,
    foil_hooks: Vec<usize>,
    balance_hooks: Vec<usize>,
    sense_hooks: Vec<usize>,
    used_states: usize,
    constants: Constants<T>,
    decays: Decays<T>,
    x: [T; STATES],
    current_a: T,
    time_s: f64,
    filters: Filters<T>,
    /// What the sensors show, where effects are at work on them.
    sensed: Sensed<T>,
    supply_v: f64,
    true_thrust_n: T,
    at: Local<T>,
    /// Rates at the end of the last tick, which the next one starts with where no input jumps, and
    /// at its start.
    last_rates: [[T; STATES]; 2],
    /// Whether there was a last tick.
    moving: bool,
    /// Whether those rates can hold at all: no effect keeps a memory that changes between ticks
    /// and acts on the rates.
    rates_may_hold: bool,
    /// Whether all states are slow beside a tick, so that two ticks' rates foretell the next.
    slow: bool,
    quantise_encoder: bool,
}

/// Products of parameters that the inner loop needs.
#[derive(Clone, Copy)]
struct Constants<T> {
    sin_pitch: T,
    cos_pitch: T,
    lever_m: T,
    half_area_m2: T,
    density_kg_m3: T,
    lift_max: T,
    drag_max: T,
    added_mass_kg: T,
    flux_kg_m: T,
    inertia_kg_m2: T,
    torque_constant_nm_a: T,
    resistance_ohm: T,
    viscous_nm_s: T,
    swirl_mass_kg: T,
    swirl_flux_kg_m: T,
    yoerger_slip_m: T,
    dry: bool,
}

/// Decay factors of the first-order filters over one tick.
#[derive(Clone, Copy)]
struct Decays<T> {
    /// Stated lag of the drive, and its decay over half a tick and a whole one.
    drive: (T, T, T),
    speed: Option<f64>,
    thrust: Option<(f64, f64)>,
    torque: Option<(f64, f64)>,
}

impl<T: Real> Decays<T> {
    fn new(time_constant_s: T, sensors: &Sensors, tick_s: f64) -> Self {
        let corner = |hz: Option<f64>| {
            hz.map(|hz| {
                let tau = 1.0 / (std::f64::consts::TAU * hz);
                (tau, (-tick_s / tau).exp())
            })
        };
        Self {
            drive: (
                time_constant_s,
                (T::from(-0.5 * tick_s) / time_constant_s).exp(),
                (T::from(-tick_s) / time_constant_s).exp(),
            ),
            speed: sensors.speed_filter_time_constant_s.filter(|t| *t > 0.0).map(|t| (-tick_s / t).exp()),
            thrust: corner(sensors.thrust_filter_hz),
            torque: corner(sensors.torque_filter_hz),
        }
    }
}

impl<T: Real> Plant<T> {
    /// Sets a plant up at rest. `effects` are pairs of a catalogue entry and its parameter values.
    ///
    /// # Panics
    /// If the effects together have more than eight continuous states, or an effect is given the
    /// wrong number of values: errors of the program, not of its input.
    pub fn new(
        model: ModelName,
        rig: &Rig,
        parameters: &Parameters<T>,
        effects: &[(&Descriptor, &[T])],
        tick_s: f64,
    ) -> Self {
        let context = Context { parameters, rig, tick_s };
        let mut next = OWN;
        let effects: Vec<Hooked<T>> = effects
            .iter()
            .map(|(descriptor, values)| {
                let effect = T::build(descriptor, values, &context);
                let own = next..next + effect.states();
                next = own.end;
                assert!(next <= STATES, "too many effect states");
                Hooked { effect, own }
            })
            .collect();
        let (mut model, mut parameters) = (model, *parameters);
        effects.iter().for_each(|e| e.effect.amend(&mut model, &mut parameters));
        let hooked = |used: fn(&crate::effects::Hooks) -> bool| -> Vec<usize> {
            (0..effects.len()).filter(|i| used(&effects[*i].effect.hooks())).collect()
        };
        let changes_between_ticks = |e: &Hooked<T>| {
            let h = e.effect.hooks();
            (h.drive || h.sense) && (h.inflow || h.foil || h.balance)
        };
        Self {
            model,
            rates_may_hold: !effects.iter().any(changes_between_ticks),
            slow: effects.iter().all(|e| e.effect.slow()) && model != ModelName::RotationalFlow,
            parameters,
            sensors: rig.sensors,
            amplifier: rig.amplifier.kind,
            current_limit_a: rig.amplifier.current_limit_a,
            nominal_supply_v: rig.amplifier.supply_v.unwrap_or(f64::INFINITY),
            tick_s,
            drive_hooks: hooked(|h| h.drive),
            inflow_hooks: hooked(|h| h.inflow),
            foil_hooks: hooked(|h| h.foil),
            balance_hooks: hooked(|h| h.balance),
            sense_hooks: hooked(|h| h.sense),
            effects,
            used_states: next,
            constants: Constants::new(&parameters, rig.propeller.is_none()),
            decays: Decays::new(parameters.get(P::TimeConstantS), &rig.sensors, tick_s),
            x: [T::ZERO; STATES],
            current_a: T::ZERO,
            time_s: 0.0,
            filters: Filters {
                angle_rad: T::ZERO,
                last_angle_rad: T::ZERO,
                speed_rad_s: T::ZERO,
                thrust_n: T::ZERO,
                last_thrust_n: T::ZERO,
                torque_n_m: T::ZERO,
                last_torque_n_m: T::ZERO,
            },
            sensed: Sensed::default(),
            supply_v: 0.0,
            true_thrust_n: T::ZERO,
            at: Local::default(),
            last_rates: [[T::ZERO; STATES]; 2],
            moving: false,
            quantise_encoder: false,
        }
    }

    /// Turns encoder quantisation on (a live or simulated stand) or off (a fit, where the
    /// quantum is noise and the response must be smooth in the parameters).
    pub fn with_encoder_quantised(mut self, on: bool) -> Self {
        self.quantise_encoder = on;
        self
    }

    /// Starts from a moving state instead of rest.
    pub fn start(
        &mut self,
        time_s: f64,
        shaft_speed_rad_s: f64,
        axial_m_s: f64,
        current_a: f64,
        angle_rad: f64,
    ) {
        self.time_s = time_s;
        self.moving = false;
        self.x[SPEED] = T::from(shaft_speed_rad_s);
        self.x[FLOW] = T::from(axial_m_s);
        self.x[ANGLE] = T::from(angle_rad);
        self.current_a = T::from(current_a);
        self.filters.last_angle_rad = T::from(angle_rad - shaft_speed_rad_s * self.tick_s);
        self.filters.speed_rad_s = T::from(shaft_speed_rad_s);
        self.at = self.local(T::ZERO, &Tick::default());
        let mut balance = Balance::default();
        self.rates::<true, true, STATES>(&self.x, &self.at, &mut balance);
        self.filters.last_thrust_n = balance.thrust_n + balance.stand_n;
        self.filters.thrust_n = balance.thrust_n + balance.stand_n;
        self.filters.last_torque_n_m = balance.blade_torque_n_m;
        self.filters.torque_n_m = balance.blade_torque_n_m;
        self.observe(&Tick { time_s, ..Tick::default() }, &balance, false);
    }

    /// The true state and loads now.
    pub fn truth(&self) -> &Local<T> {
        &self.at
    }

    /// How fast a disturbance of shaft speed and axial flow dies here at most, 1/s: the larger eigenvalue of
    /// the rates' derivative.
    pub fn fastest_decay_1_s(&self) -> f64 {
        let rates = |place: usize, by: f64| {
            let mut x = self.x;
            x[place] += T::from(by);
            let at = Local { shaft_speed_rad_s: x[SPEED], axial_m_s: x[FLOW], ..self.at };
            let rates = self.rates::<true, true, STATES>(&x, &at, &mut Balance::default());
            [rates[SPEED].re(), rates[FLOW].re()]
        };
        let here = rates(SPEED, 0.0);
        let [[a, c], [b, d]] = [SPEED, FLOW].map(|place| {
            let by = 1e-6 * self.x[place].re().abs().max(1e-3);
            let there = rates(place, by);
            [(there[0] - here[0]) / by, (there[1] - here[1]) / by]
        });
        let (mean, det) = (0.5 * (a + d), a * d - b * c);
        let root = mean * mean - det;
        if root < 0.0 { det.sqrt() } else { mean.abs() + root.sqrt() }
    }

    /// The model's name.
    pub fn model(&self) -> ModelName {
        self.model
    }

    /// One control tick: the command acts from now to the next tick.
    ///
    /// Runge-Kutta of order 4; over ticks that the caller knows to be smooth Adams' method of order 3, at
    /// half the cost, or a quarter of it where they are calm.
    pub fn step(&mut self, tick: &Tick) {
        // Copies of the inner loop: the one without hooks keeps everything in registers, the others carry no
        // more states, and show no more of the blade, than somebody looks at.
        let blade = !self.inflow_hooks.is_empty() || !self.foil_hooks.is_empty();
        let hooked = blade || !self.balance_hooks.is_empty();
        match (hooked, blade, self.used_states) {
            (false, ..) => self.step_as::<false, false, OWN>(tick),
            (_, false, ..=OWN) => self.step_as::<true, false, OWN>(tick),
            (_, true, ..=OWN) => self.step_as::<true, true, OWN>(tick),
            (_, false, ..=FEW) => self.step_as::<true, false, FEW>(tick),
            (_, true, ..=FEW) => self.step_as::<true, true, FEW>(tick),
            _ => self.step_as::<true, true, STATES>(tick),
        }
    }

    fn step_as<const HOOKED: bool, const BLADE: bool, const N: usize>(&mut self, tick: &Tick) {
        let dt = self.tick_s;
        let mut drive = Drive {
            command: T::from(tick.command),
            current_limit_a: T::from(self.current_limit_a),
            time_constant_s: self.parameters.get(P::TimeConstantS),
            supply_v: T::from(tick.supply_v.unwrap_or(self.nominal_supply_v)),
            resistance_ohm: self.constants.resistance_ohm,
            back_emf_v: self.constants.torque_constant_nm_a * self.x[SPEED],
            shaft_speed_rad_s: self.x[SPEED],
            current_a: self.current_a,
            voltage_limited: false,
        };
        for i in &self.drive_hooks {
            self.effects[*i].effect.drive(tick, &mut drive);
        }
        let (from, full) = (self.current_path(tick, &drive, 0.0), self.current_path(tick, &drive, dt));
        let speed = match self.amplifier {
            AmplifierKind::Speed if tick.driven == Driven::Command => {
                let (now, tau) = (self.x[SPEED], drive.time_constant_s);
                let left = if tau > 0.0 { (T::from(-dt) / tau).exp() } else { T::ZERO };
                Some((now, drive.command + (now - drive.command) * left))
            }
            _ => tick.driven_speed().map(|(a, b)| (T::from(a), T::from(b))),
        };

        // Current (and a prescribed speed) are known at each stage.
        let prescribe = |x: &mut [T; N], at: f64| {
            if let Some((a, b)) = speed {
                x[SPEED] = a + (b - a) * at;
            }
        };
        let mut start: [T; N] = each(|i| self.x[i]);
        prescribe(&mut start, 0.0);
        let begin = self.local_at(&start, from, 0.0, tick);
        let held = self.moving && self.rates_may_hold && begin.continues::<HOOKED>(&self.at);
        let mut balance = Balance::default();
        let k1: [T; N] = if held {
            each(|i| self.last_rates[0][i])
        } else {
            self.rates::<HOOKED, BLADE, N>(&start, &begin, &mut balance)
        };
        let (mut x, foretold) = if held && tick.course != Course::Any && self.slow && speed.is_none() {
            // Adams' predictor and corrector, with one look ahead; where so little lies between the two, the
            // rates and loads there are the end's.
            let k0 = &self.last_rates[1];
            let ahead = each(|i| start[i] + (k1[i] * 1.5 - k0[i] * 0.5) * dt);
            let at = self.local_at(&ahead, full, 1.0, tick);
            let k2 = self.rates::<HOOKED, BLADE, N>(&ahead, &at, &mut balance);
            (
                each(|i| start[i] + (k2[i] * 5.0 + k1[i] * 8.0 - k0[i]) * (dt / 12.0)),
                (tick.course == Course::Calm).then_some(k2),
            )
        } else {
            // Classic Runge-Kutta of order 4.
            let half = self.current_path(tick, &drive, 0.5 * dt);
            let along = |rate: &[T; N], dt: f64| each(|i| start[i] + rate[i] * dt);
            let mut x = along(&k1, 0.5 * dt);
            prescribe(&mut x, 0.5);
            let k2 = self.rates::<HOOKED, BLADE, N>(&x, &self.local_at(&x, half, 0.5, tick), &mut balance);
            x = along(&k2, 0.5 * dt);
            prescribe(&mut x, 0.5);
            let k3 = self.rates::<HOOKED, BLADE, N>(&x, &self.local_at(&x, half, 0.5, tick), &mut balance);
            x = along(&k3, dt);
            prescribe(&mut x, 1.0);
            let k4 = self.rates::<HOOKED, BLADE, N>(&x, &self.local_at(&x, full, 1.0, tick), &mut balance);
            (each(|i| start[i] + (k1[i] + (k2[i] + k3[i]) * 2.0 + k4[i]) * (dt / 6.0)), None)
        };
        prescribe(&mut x, 1.0);
        for (state, moved) in self.x.iter_mut().zip(x) {
            *state = moved;
        }
        self.current_a = full;
        self.time_s = tick.time_s + dt;

        let end = self.local_at(&x, full, 1.0, tick);
        let rates = foretold.unwrap_or_else(|| self.rates::<HOOKED, BLADE, N>(&x, &end, &mut balance));
        for i in 0..N {
            (self.last_rates[0][i], self.last_rates[1][i]) = (rates[i], k1[i]);
        }
        self.moving = true;
        self.at = end;
        self.at.thrust_n = balance.thrust_n;
        self.at.blade_torque_n_m = balance.blade_torque_n_m;
        self.observe(tick, &balance, true);
    }

    /// Motor current a time `after_s` into this tick.
    fn current_path(&self, tick: &Tick, drive: &Drive<T>, after_s: f64) -> T {
        if let Driven::Current(a, b) = tick.driven {
            return T::from(a + (b - a) * after_s / self.tick_s);
        }
        let target = match self.amplifier {
            AmplifierKind::Current => drive.command,
            // (10)-(12) with the inductance neglected; the lag then stands for L/R and the stage.
            AmplifierKind::Voltage => {
                (drive.command - drive.back_emf_v) / drive.resistance_ohm.max(T::from(1e-9))
            }
            // A speed drive's shaft follows the command through the lag (`step`); no current is modelled.
            AmplifierKind::Speed => return T::ZERO,
        };
        let mut target = target.clamp(-drive.current_limit_a, drive.current_limit_a);
        if drive.voltage_limited {
            // |R i + ke Om| <= V: what the bus can push through the winding at this speed.
            let r = drive.resistance_ohm.max(T::from(1e-9));
            target = target.clamp(
                ((-drive.supply_v - drive.back_emf_v) / r).min(T::ZERO),
                ((drive.supply_v - drive.back_emf_v) / r).max(T::ZERO),
            );
        }
        if drive.time_constant_s <= 0.0 {
            return target;
        }
        if after_s == 0.0 {
            return self.current_a;
        }
        // The stated lag's decay is at hand; an effect may have changed the lag, or its derivative alone.
        let (stated, half, full) = self.decays.drive;
        let left = if drive.time_constant_s != stated || !drive.time_constant_s.same_slopes(stated) {
            (T::from(-after_s) / drive.time_constant_s).exp()
        } else if after_s < self.tick_s {
            half
        } else {
            full
        };
        target + (self.current_a - target) * left
    }

    fn local(&self, current_a: T, tick: &Tick) -> Local<T> {
        Local {
            time_s: tick.time_s,
            shaft_speed_rad_s: self.x[SPEED],
            shaft_angle_rad: self.x[ANGLE],
            axial_m_s: self.x[FLOW],
            swirl_m_s: self.x[SWIRL],
            current_a,
            ..Local::default()
        }
    }

    #[inline(always)]
    fn local_at<const N: usize>(&self, x: &[T; N], current_a: T, part: f64, tick: &Tick) -> Local<T> {
        Local {
            time_s: tick.time_s + part * self.tick_s,
            shaft_speed_rad_s: x[SPEED],
            shaft_angle_rad: tick.angle_at(part).map_or(x[ANGLE], T::from),
            axial_m_s: x[FLOW],
            swirl_m_s: x[SWIRL],
            current_a,
            ambient_m_s: tick.ambient_at(part),
            depth_m: tick.depth_m,
            temperature_c: tick.temperature_c,
            thrust_n: T::ZERO,
            blade_torque_n_m: T::ZERO,
        }
    }

    /// Rates of all states. The loads they follow from are written where the caller keeps them: with
    /// derivatives they are a kilobyte, too much to hand back by value.
    #[inline(always)]
    fn rates<const HOOKED: bool, const BLADE: bool, const N: usize>(
        &self,
        x: &[T; N],
        at: &Local<T>,
        balance: &mut Balance<T>,
    ) -> [T; N] {
        let c = &self.constants;
        let (speed, flow) = (x[SPEED], x[FLOW]);
        *balance = Balance {
            motor_torque_n_m: c.torque_constant_nm_a * at.current_a,
            shaft_torque_n_m: -c.viscous_nm_s * speed,
            inertia_kg_m2: c.inertia_kg_m2,
            added_mass_kg: c.added_mass_kg,
            flux_kg_m: c.flux_kg_m,
            ambient_m_s: T::from(at.ambient_m_s),
            blade_torque_n_m: T::ZERO,
            thrust_n: T::ZERO,
            momentum_n: T::ZERO,
            stand_n: T::ZERO,
            foil: balance.foil,
        };
        match self.model {
            _ if c.dry => {}
            ModelName::Model0 => {
                let square = speed * speed.abs();
                balance.thrust_n = self.parameters.get(P::ThrustCoefficientNS2) * square;
                balance.blade_torque_n_m = self.parameters.get(P::TorqueCoefficientNmS2) * square;
            }
            ModelName::Model1 => {
                // (7), (8): T = rho a (s Om)|s Om|, Q Om = T vp, with slip speed s = eta r tan p;
                // the shaft's "inertia" of (9), s^2 rho V, is the water's: the fixed point's half
                // comes from vw = vp in (3).
                let vp = c.yoerger_slip_m * speed;
                let force = c.density_kg_m3 * 2.0 * c.half_area_m2 * vp * vp.abs();
                balance.thrust_n = force;
                balance.blade_torque_n_m = force * 0.5 * c.yoerger_slip_m;
                balance.inertia_kg_m2 = c.yoerger_slip_m * c.yoerger_slip_m * c.added_mass_kg;
            }
            _ => self.blade_loads::<BLADE, N>(at, x, flow, speed, balance),
        }
        let mut rates = [T::ZERO; N];
        for i in self.balance_hooks.iter().take(if HOOKED { usize::MAX } else { 0 }) {
            let hooked = &self.effects[*i];
            hooked.effect.balance(at, &x[hooked.own.clone()], balance, &mut rates[hooked.own.clone()]);
        }
        rates[SPEED] = (balance.motor_torque_n_m + balance.shaft_torque_n_m - balance.blade_torque_n_m)
            / balance.inertia_kg_m2;
        rates[ANGLE] = speed;
        match self.model {
            _ if c.dry => {}
            ModelName::Model0 | ModelName::Model1 => {}
            _ => {
                // (6a): T = m vp' + dbeta rho a (vp - va)|vp|
                rates[FLOW] = (balance.thrust_n + balance.momentum_n
                    - balance.flux_kg_m * (flow - balance.ambient_m_s) * flow.abs())
                    / balance.added_mass_kg;
                if self.model == ModelName::RotationalFlow {
                    // C4: rho a l gr us' = Q/re - dbr rho a |vp| us, no faster than a tick can follow.
                    let washed = c.swirl_flux_kg_m * flow.abs();
                    rates[SWIRL] = (balance.blade_torque_n_m / c.lever_m - washed * x[SWIRL])
                        / c.swirl_mass_kg.max(washed * self.tick_s);
                }
            }
        }
        rates
    }

    /// (14)-(17) without angles, with the hooks of inflow and foil.
    #[inline(always)]
    fn blade_loads<const BLADE: bool, const N: usize>(
        &self,
        at: &Local<T>,
        x: &[T; N],
        flow: T,
        speed: T,
        balance: &mut Balance<T>,
    ) {
        let c = &self.constants;
        let mut inflow = Inflow { tangential_m_s: c.lever_m * speed - x[SWIRL], axial_m_s: flow };
        for i in self.inflow_hooks.iter().take(if BLADE { usize::MAX } else { 0 }) {
            let hooked = &self.effects[*i];
            hooked.effect.inflow(at, &x[hooked.own.clone()], &mut inflow);
        }
        let (ut, vp) = (inflow.tangential_m_s, inflow.axial_m_s);
        let v2 = ut * ut + vp * vp;
        if v2 < STILL_M2_S2 {
            if BLADE {
                balance.foil = Foil::default();
            }
            return;
        }
        let wn = ut * c.sin_pitch - vp * c.cos_pitch;
        let wc = ut * c.cos_pitch + vp * c.sin_pitch;
        let sin_2a = wn * 2.0 * wc / v2;
        let one_minus_cos_2a = wn * 2.0 * wn / v2;
        let mut foil = Foil {
            speed_m_s: v2.sqrt(),
            normal_m_s: wn,
            chordwise_m_s: wc,
            sin_2a,
            one_minus_cos_2a,
            lift: c.lift_max * sin_2a,
            drag: c.drag_max * one_minus_cos_2a,
            density_kg_m3: c.density_kg_m3,
        };
        for i in self.foil_hooks.iter().take(if BLADE { usize::MAX } else { 0 }) {
            let hooked = &self.effects[*i];
            hooked.effect.foil(at, &x[hooked.own.clone()], &mut foil);
        }
        let q = foil.density_kg_m3 * c.half_area_m2 * foil.speed_m_s;
        if BLADE {
            balance.foil = foil;
        }
        balance.thrust_n = q * (foil.lift * ut - foil.drag * vp);
        balance.blade_torque_n_m = c.lever_m * q * (foil.lift * vp + foil.drag * ut);
    }
}

/// An array of what a function gives for each place. The standard library's `array::from_fn` is left as
/// calls where numbers carry derivatives.
#[inline(always)]
fn each<T: Real, const N: usize>(of: impl Fn(usize) -> T) -> [T; N] {
    let mut all = [T::ZERO; N];
    for (i, one) in all.iter_mut().enumerate() {
        *one = of(i);
    }
    all
}

impl<T: Real> Constants<T> {
    fn new(p: &Parameters<T>, dry: bool) -> Self {
        let (sin_pitch, cos_pitch) = p.get(P::PitchRad).sin_cos();
        let area = p.area_m2();
        let density = p.get(P::DensityKgM3);
        Self {
            sin_pitch,
            cos_pitch,
            lever_m: p.get(P::RadiusM) * crate::blade::REFERENCE_RADIUS,
            half_area_m2: area * 0.5,
            density_kg_m3: density,
            lift_max: p.get(P::LiftMax),
            drag_max: p.get(P::DragMax),
            added_mass_kg: p.duct_mass_kg() * p.get(P::AddedMassCoefficient),
            flux_kg_m: p.get(P::FluxCoefficient) * density * area,
            inertia_kg_m2: p.get(P::InertiaKgM2),
            torque_constant_nm_a: p.get(P::TorqueConstantNmA),
            resistance_ohm: p.get(P::WindingResistanceOhm),
            viscous_nm_s: p.get(P::ViscousFrictionNmS),
            swirl_mass_kg: p.duct_mass_kg() * p.get(P::SwirlMassCoefficient),
            swirl_flux_kg_m: p.get(P::SwirlFluxCoefficient) * density * area,
            yoerger_slip_m: p.get(P::Efficiency) * p.get(P::RadiusM) * p.get(P::PitchRad).tan(),
            dry,
        }
    }
}
