//! The composed plant: drive, motor, shaft, blades, axial flow and the measuring chain, with any
//! omitted effects hooked in. One `step` is one control tick; the same step runs in the live
//! simulated stand, in soak tests, in `kort simulate` and inside a fit.

mod run;
mod state;
#[cfg(test)]
mod tests;

pub use run::{Response, Stimulus, simulate};
pub use state::{Balance, Drive, Driven, Foil, Local, Sensed, Tick};

use crate::blade::Inflow;
use crate::effects::{Context, Descriptor, Effect};
use crate::models::ModelName;
use crate::parameters::{Parameter as P, Parameters};
use crate::rig::{AmplifierKind, Rig, Sensors};

/// Most continuous states of a plant: speed, flow, angle, swirl and those of the effects.
const STATES: usize = 12;
const SPEED: usize = 0;
const FLOW: usize = 1;
const ANGLE: usize = 2;
const SWIRL: usize = 3;
const OWN: usize = 4;

type States = [f64; STATES];

/// An effect at work, with the place of its states.
struct Hooked {
    effect: Box<dyn Effect>,
    own: std::ops::Range<usize>,
}

/// A thruster on its stand.
pub struct Plant {
    model: ModelName,
    parameters: Parameters,
    sensors: Sensors,
    amplifier: AmplifierKind,
    current_limit_a: f64,
    nominal_supply_v: f64,
    tick_s: f64,
    effects: Vec<Hooked>,
    drive_hooks: Vec<usize>,
    inflow_hooks: Vec<usize>,
    foil_hooks: Vec<usize>,
    balance_hooks: Vec<usize>,
    sense_hooks: Vec<usize>,
    used_states: usize,
    constants: Constants,
    decays: Decays,
    x: States,
    current_a: f64,
    time_s: f64,
    filters: Filters,
    sensed: Sensed,
    at: Local,
    /// Rates at the end of the last tick, which the next one starts with where no input jumps, and
    /// at its start.
    last_rates: Option<(States, States)>,
    /// Whether those rates can hold at all: no effect keeps a memory that changes between ticks
    /// and acts on the rates.
    rates_may_hold: bool,
    /// Whether all states are slow beside a tick, so that two ticks' rates foretell the next.
    slow: bool,
    quantise_encoder: bool,
}

/// Products of parameters that the inner loop needs.
#[derive(Clone, Copy)]
struct Constants {
    sin_pitch: f64,
    cos_pitch: f64,
    lever_m: f64,
    half_area_m2: f64,
    density_kg_m3: f64,
    lift_max: f64,
    drag_max: f64,
    added_mass_kg: f64,
    flux_kg_m: f64,
    inertia_kg_m2: f64,
    torque_constant_nm_a: f64,
    resistance_ohm: f64,
    viscous_nm_s: f64,
    swirl_mass_kg: f64,
    swirl_flux_kg_m: f64,
    yoerger_slip_m: f64,
    dry: bool,
}

/// Decay factors of the first-order filters over one tick.
#[derive(Clone, Copy)]
struct Decays {
    /// Stated lag of the drive, and its decay over half a tick and a whole one.
    drive: (f64, f64, f64),
    speed: Option<f64>,
    thrust: Option<(f64, f64)>,
    torque: Option<(f64, f64)>,
}

impl Decays {
    fn new(time_constant_s: f64, sensors: &Sensors, tick_s: f64) -> Self {
        let corner = |hz: Option<f64>| {
            hz.map(|hz| {
                let tau = 1.0 / (std::f64::consts::TAU * hz);
                (tau, (-tick_s / tau).exp())
            })
        };
        Self {
            drive: (
                time_constant_s,
                (-0.5 * tick_s / time_constant_s).exp(),
                (-tick_s / time_constant_s).exp(),
            ),
            speed: sensors.speed_filter_time_constant_s.filter(|t| *t > 0.0).map(|t| (-tick_s / t).exp()),
            thrust: corner(sensors.thrust_filter_hz),
            torque: corner(sensors.torque_filter_hz),
        }
    }
}

/// States of the measuring chain.
#[derive(Clone, Copy, Default)]
struct Filters {
    last_angle_rad: f64,
    speed_rad_s: f64,
    thrust_n: f64,
    last_thrust_n: f64,
    torque_n_m: f64,
    last_torque_n_m: f64,
}

impl Plant {
    /// Sets a plant up at rest. `effects` are pairs of a catalogue entry and its parameter values.
    ///
    /// # Panics
    /// If the effects together have more than eight continuous states, or an effect is given the
    /// wrong number of values: errors of the program, not of its input.
    pub fn new(
        model: ModelName,
        rig: &Rig,
        parameters: &Parameters,
        effects: &[(&Descriptor, &[f64])],
        tick_s: f64,
    ) -> Self {
        let context = Context { parameters, rig, tick_s };
        let mut next = OWN;
        let effects: Vec<Hooked> = effects
            .iter()
            .map(|(descriptor, values)| {
                let effect = (descriptor.build)(values, &context);
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
        let changes_between_ticks = |e: &Hooked| {
            let h = e.effect.hooks();
            (h.drive || h.sense) && (h.inflow || h.foil || h.balance)
        };
        Self {
            model,
            rates_may_hold: !effects.iter().any(changes_between_ticks),
            slow: next == OWN && model != ModelName::RotationalFlow,
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
            x: [0.0; STATES],
            current_a: 0.0,
            time_s: 0.0,
            filters: Filters::default(),
            sensed: Sensed::default(),
            at: Local::default(),
            last_rates: None,
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
        self.last_rates = None;
        self.x[SPEED] = shaft_speed_rad_s;
        self.x[FLOW] = axial_m_s;
        self.x[ANGLE] = angle_rad;
        self.current_a = current_a;
        self.filters.last_angle_rad = angle_rad - shaft_speed_rad_s * self.tick_s;
        self.filters.speed_rad_s = shaft_speed_rad_s;
        self.at = self.local(0.0, &Tick::default());
        let (_, balance) = self.rates::<true>(&self.x, &self.at);
        self.filters.last_thrust_n = balance.thrust_n + balance.stand_n;
        self.filters.thrust_n = balance.thrust_n + balance.stand_n;
        self.filters.last_torque_n_m = balance.blade_torque_n_m;
        self.filters.torque_n_m = balance.blade_torque_n_m;
        self.observe(&Tick { time_s, ..Tick::default() }, &balance, false);
    }

    /// What the sensors show now (without noise).
    pub fn sensed(&self) -> &Sensed {
        &self.sensed
    }

    /// The true state and loads now.
    pub fn truth(&self) -> &Local {
        &self.at
    }

    /// The model's name.
    pub fn model(&self) -> ModelName {
        self.model
    }

    /// One control tick: the command acts from now to the next tick.
    ///
    /// Runge-Kutta of order 4; over ticks that the caller knows to be smooth Adams' method of order 3, at
    /// half the cost.
    pub fn step(&mut self, tick: &Tick) {
        // Two copies of the inner loop: the one without hooks keeps everything in registers.
        if self.inflow_hooks.is_empty() && self.foil_hooks.is_empty() && self.balance_hooks.is_empty() {
            self.step_as::<false>(tick);
        } else {
            self.step_as::<true>(tick);
        }
    }

    fn step_as<const HOOKED: bool>(&mut self, tick: &Tick) {
        let dt = self.tick_s;
        let mut drive = Drive {
            command: tick.command,
            current_limit_a: self.current_limit_a,
            time_constant_s: self.parameters.get(P::TimeConstantS),
            supply_v: tick.supply_v.unwrap_or(self.nominal_supply_v),
            resistance_ohm: self.constants.resistance_ohm,
            back_emf_v: self.constants.torque_constant_nm_a * self.x[SPEED],
            shaft_speed_rad_s: self.x[SPEED],
            current_a: self.current_a,
            voltage_limited: false,
        };
        for i in &self.drive_hooks {
            self.effects[*i].effect.drive(tick, &mut drive);
        }
        let (half, full) = (self.current_path(tick, &drive, 0.5 * dt), self.current_path(tick, &drive, dt));
        let from = self.current_path(tick, &drive, 0.0);
        let speed = match self.amplifier {
            AmplifierKind::Speed if tick.driven == Driven::Command => {
                let (now, tau) = (self.x[SPEED], drive.time_constant_s);
                let left = if tau > 0.0 { (-dt / tau).exp() } else { 0.0 };
                Some((now, drive.command + (now - drive.command) * left))
            }
            _ => tick.driven_speed(),
        };

        // Current (and a prescribed speed) are known at each stage.
        let prescribe = |x: &mut States, at: f64| {
            if let Some((a, b)) = speed {
                x[SPEED] = a + (b - a) * at;
            }
        };
        let mut start = self.x;
        prescribe(&mut start, 0.0);
        let begin = self.local_at(&start, from, 0.0, tick);
        let held = self.last_rates.filter(|_| self.rates_may_hold && begin.continues::<HOOKED>(&self.at));
        let k1 = held.map_or_else(|| self.rates::<HOOKED>(&start, &begin).0, |(end, _)| end);
        let states = if HOOKED { self.used_states } else { OWN };
        let foretold = held.filter(|_| tick.smooth && self.slow && speed.is_none()).map(|(_, k0)| {
            // Adams' predictor and corrector, with one look ahead.
            let mut x = start;
            for i in 0..states {
                x[i] += dt * (1.5 * k1[i] - 0.5 * k0[i]);
            }
            let (k2, _) = self.rates::<HOOKED>(&x, &self.local_at(&x, full, 1.0, tick));
            x = start;
            for i in 0..states {
                x[i] += dt / 12.0 * (5.0 * k2[i] + 8.0 * k1[i] - k0[i]);
            }
            x
        });
        self.x = foretold.unwrap_or_else(|| {
            // Classic Runge-Kutta of order 4.
            let mut x = self.advance(HOOKED, &start, &k1, 0.5 * dt);
            prescribe(&mut x, 0.5);
            let (k2, _) = self.rates::<HOOKED>(&x, &self.local_at(&x, half, 0.5, tick));
            x = self.advance(HOOKED, &start, &k2, 0.5 * dt);
            prescribe(&mut x, 0.5);
            let (k3, _) = self.rates::<HOOKED>(&x, &self.local_at(&x, half, 0.5, tick));
            x = self.advance(HOOKED, &start, &k3, dt);
            prescribe(&mut x, 1.0);
            let (k4, _) = self.rates::<HOOKED>(&x, &self.local_at(&x, full, 1.0, tick));
            let mut x = start;
            for i in 0..states {
                x[i] += dt / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
            }
            x
        });
        prescribe(&mut self.x, 1.0);
        self.current_a = full;
        self.time_s = tick.time_s + dt;

        let end = self.local_at(&self.x, full, 1.0, tick);
        let (rates, balance) = self.rates::<HOOKED>(&self.x, &end);
        self.last_rates = Some((rates, k1));
        self.at = end;
        self.at.thrust_n = balance.thrust_n;
        self.at.blade_torque_n_m = balance.blade_torque_n_m;
        let next = Tick { time_s: self.time_s, ..*tick };
        self.observe(&next, &balance, true);
    }

    /// Motor current a time `after_s` into this tick.
    fn current_path(&self, tick: &Tick, drive: &Drive, after_s: f64) -> f64 {
        if let Driven::Current(a, b) = tick.driven {
            return a + (b - a) * after_s / self.tick_s;
        }
        let target = match self.amplifier {
            AmplifierKind::Current => drive.command,
            // (10)-(12) with the inductance neglected; the lag then stands for L/R and the stage.
            AmplifierKind::Voltage => (drive.command - drive.back_emf_v) / drive.resistance_ohm.max(1e-9),
            // A speed drive's shaft follows the command through the lag (`step`); no current is modelled.
            AmplifierKind::Speed => return 0.0,
        };
        let mut target = target.clamp(-drive.current_limit_a, drive.current_limit_a);
        if drive.voltage_limited {
            // |R i + ke Om| <= V: what the bus can push through the winding at this speed.
            let r = drive.resistance_ohm.max(1e-9);
            target = target.clamp(
                ((-drive.supply_v - drive.back_emf_v) / r).min(0.0),
                ((drive.supply_v - drive.back_emf_v) / r).max(0.0),
            );
        }
        if drive.time_constant_s <= 0.0 {
            return target;
        }
        if after_s == 0.0 {
            return self.current_a;
        }
        // The stated lag's decay is at hand; an effect may have changed the lag.
        let (stated, half, full) = self.decays.drive;
        let left = if drive.time_constant_s != stated {
            (-after_s / drive.time_constant_s).exp()
        } else if after_s < self.tick_s {
            half
        } else {
            full
        };
        target + (self.current_a - target) * left
    }

    #[inline(always)]
    fn advance(&self, hooked: bool, from: &States, rate: &States, dt: f64) -> States {
        let mut x = *from;
        for i in 0..if hooked { self.used_states } else { OWN } {
            x[i] += dt * rate[i];
        }
        x
    }

    fn local(&self, current_a: f64, tick: &Tick) -> Local {
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
    fn local_at(&self, x: &States, current_a: f64, part: f64, tick: &Tick) -> Local {
        Local {
            time_s: tick.time_s + part * self.tick_s,
            shaft_speed_rad_s: x[SPEED],
            shaft_angle_rad: tick.angle_at(part).unwrap_or(x[ANGLE]),
            axial_m_s: x[FLOW],
            swirl_m_s: x[SWIRL],
            current_a,
            ambient_m_s: tick.ambient_at(part),
            depth_m: tick.depth_m,
            temperature_c: tick.temperature_c,
            thrust_n: 0.0,
            blade_torque_n_m: 0.0,
        }
    }

    /// Rates of all states, and the loads they follow from.
    #[inline(always)]
    fn rates<const HOOKED: bool>(&self, x: &States, at: &Local) -> (States, Balance) {
        let c = &self.constants;
        let (speed, flow) = (x[SPEED], x[FLOW]);
        let mut balance = Balance {
            motor_torque_n_m: c.torque_constant_nm_a * at.current_a,
            shaft_torque_n_m: -c.viscous_nm_s * speed,
            inertia_kg_m2: c.inertia_kg_m2,
            added_mass_kg: c.added_mass_kg,
            flux_kg_m: c.flux_kg_m,
            ambient_m_s: at.ambient_m_s,
            ..Balance::default()
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
                let force = 2.0 * c.density_kg_m3 * c.half_area_m2 * vp * vp.abs();
                balance.thrust_n = force;
                balance.blade_torque_n_m = 0.5 * force * c.yoerger_slip_m;
                balance.inertia_kg_m2 = c.yoerger_slip_m * c.yoerger_slip_m * c.added_mass_kg;
            }
            _ => self.blade_loads::<HOOKED>(at, x, flow, speed, &mut balance),
        }
        let mut rates = [0.0; STATES];
        for i in self.balance_hooks.iter().take(if HOOKED { usize::MAX } else { 0 }) {
            let hooked = &self.effects[*i];
            hooked.effect.balance(at, &x[hooked.own.clone()], &mut balance, &mut rates[hooked.own.clone()]);
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
        (rates, balance)
    }

    /// (14)-(17) without angles, with the hooks of inflow and foil.
    #[inline(always)]
    fn blade_loads<const HOOKED: bool>(
        &self,
        at: &Local,
        x: &States,
        flow: f64,
        speed: f64,
        balance: &mut Balance,
    ) {
        let c = &self.constants;
        let mut inflow = Inflow { tangential_m_s: c.lever_m * speed - x[SWIRL], axial_m_s: flow };
        for i in self.inflow_hooks.iter().take(if HOOKED { usize::MAX } else { 0 }) {
            let hooked = &self.effects[*i];
            hooked.effect.inflow(at, &x[hooked.own.clone()], &mut inflow);
        }
        let (ut, vp) = (inflow.tangential_m_s, inflow.axial_m_s);
        let v2 = ut * ut + vp * vp;
        if v2 == 0.0 {
            return;
        }
        let wn = ut * c.sin_pitch - vp * c.cos_pitch;
        let wc = ut * c.cos_pitch + vp * c.sin_pitch;
        let sin_2a = 2.0 * wn * wc / v2;
        let one_minus_cos_2a = 2.0 * wn * wn / v2;
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
        for i in self.foil_hooks.iter().take(if HOOKED { usize::MAX } else { 0 }) {
            let hooked = &self.effects[*i];
            hooked.effect.foil(at, &x[hooked.own.clone()], &mut foil);
        }
        let q = foil.density_kg_m3 * c.half_area_m2 * foil.speed_m_s;
        if HOOKED {
            balance.foil = foil;
        }
        balance.thrust_n = q * (foil.lift * ut - foil.drag * vp);
        balance.blade_torque_n_m = c.lever_m * q * (foil.lift * vp + foil.drag * ut);
    }

    /// The measuring chain, once a tick.
    fn observe(&mut self, tick: &Tick, balance: &Balance, filter: bool) {
        let dt = self.tick_s;
        let s = &self.sensors;
        let f = &mut self.filters;
        let mut angle = self.x[ANGLE];
        if let (true, Some(counts)) = (self.quantise_encoder, s.encoder_counts_per_rev) {
            let quantum = std::f64::consts::TAU / counts;
            angle = (angle / quantum).floor() * quantum;
        }
        if filter {
            // Angle differenced at the control rate, then a first-order filter.
            let raw = (angle - f.last_angle_rad) / dt;
            f.speed_rad_s = match self.decays.speed {
                Some(left) => raw + (f.speed_rad_s - raw) * left,
                _ if s.encoder_counts_per_rev.is_some() => raw,
                _ => self.x[SPEED],
            };
            f.last_angle_rad = angle;
            let (thrust, torque) = (balance.thrust_n + balance.stand_n, balance.blade_torque_n_m);
            f.thrust_n = first_order(f.thrust_n, f.last_thrust_n, thrust, dt, self.decays.thrust);
            f.torque_n_m = first_order(f.torque_n_m, f.last_torque_n_m, torque, dt, self.decays.torque);
            f.last_thrust_n = thrust;
            f.last_torque_n_m = balance.blade_torque_n_m;
        }
        let axial = match self.model {
            ModelName::Model1 => self.constants.yoerger_slip_m * self.x[SPEED],
            _ => self.x[FLOW],
        };
        let mut sensed = Sensed {
            current_a: self.current_a,
            shaft_angle_rad: angle,
            shaft_speed_rad_s: f.speed_rad_s,
            thrust_n: f.thrust_n,
            torque_n_m: f.torque_n_m,
            flow_m_s: axial,
            true_speed_rad_s: self.x[SPEED],
            true_thrust_n: balance.thrust_n,
            supply_v: tick.supply_v.unwrap_or(self.nominal_supply_v),
        };
        for i in &self.sense_hooks {
            self.effects[*i].effect.sense(tick, &mut sensed);
        }
        self.sensed = sensed;
    }
}

/// Exact first-order low pass over one tick whose input runs straight from `u0` to `u1`.
fn first_order(y: f64, u0: f64, u1: f64, dt: f64, filter: Option<(f64, f64)>) -> f64 {
    let Some((tau, left)) = filter else { return u1 };
    let slope = (u1 - u0) / dt;
    u1 - tau * slope + (y - u0 + tau * slope) * left
}

impl Constants {
    fn new(p: &Parameters, dry: bool) -> Self {
        let (sin_pitch, cos_pitch) = p.get(P::PitchRad).sin_cos();
        let area = p.area_m2();
        let density = p.get(P::DensityKgM3);
        Self {
            sin_pitch,
            cos_pitch,
            lever_m: crate::blade::REFERENCE_RADIUS * p.get(P::RadiusM),
            half_area_m2: 0.5 * area,
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
