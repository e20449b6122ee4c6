//! The composed plant: drive, motor, shaft, blades, axial flow and the measuring chain, with any
//! omitted effects hooked in. One `step` is one control tick; the same step runs in the live
//! simulated stand, in soak tests, in `kort simulate` and inside a fit.

mod drive;
mod explicit;
mod friction;
mod leap;
mod load;
mod measuring;
mod observer;
mod rates;
mod run;
mod state;
mod stiff;
mod stiffness;
#[cfg(test)]
mod tests;

pub use crate::blade::Foil;
pub use leap::Leap;
pub use load::load_inertia_kg_m2;
pub use run::{Response, Stimulus, simulate, simulate_each};
use state::died_away;
pub use state::{Balance, Course, Drive, Driven, Local, Sensed, Tick};

use friction::Rub;
use measuring::{Counted, Filters, Way};
use rates::Constants;
use state::each;
use stiff::Slopes;
use stiffness::Stiff;

use crate::effects::{Context, Descriptor, Effect, FirstOrder, flexible_coupling};
use crate::models::ModelName;
use crate::parameters::{Parameter as P, Parameters};
use crate::real::Real;
use crate::rig::{AmplifierKind, Load, Rig, Sensors};

/// Most continuous states of a plant: speed, flow, angle, swirl and those of the effects.
const STATES: usize = 28;
const SPEED: usize = 0;
const FLOW: usize = 1;
const ANGLE: usize = 2;
const SWIRL: usize = 3;
const OWN: usize = 4;
/// Most states of the usual plant with an effect that has states.
const FEW: usize = OWN + 2;
/// Most states of a plant with several of them.
const SOME: usize = OWN + 8;

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
    /// Where the stated lag of the drive acts on the command.
    command_lag: Option<FirstOrder<T>>,
    x: [T; STATES],
    current_a: T,
    time_s: f64,
    filters: Filters<T>,
    counted: Counted<T>,
    /// What the sensors show, where effects are at work on them.
    sensed: Sensed<T>,
    supply_v: f64,
    true_thrust_n: T,
    at: Local<T>,
    /// Rates at the end of the last tick, which the next one starts with where no input jumps, and
    /// at its start. Dry friction is not in them.
    last_rates: [[T; STATES]; 2],
    /// Dry friction at the end of the last tick.
    last_rub: Rub<T>,
    /// Length of the last step, s.
    last_span_s: f64,
    /// Whether an effect may change within a few ticks by itself, or makes another motion of the model's: what is known of
    /// a tick's course is not known of several then.
    brisk: bool,
    /// Whether there was a last tick, and whether its speed was imposed.
    moving: bool,
    was_imposed: bool,
    /// Whether those rates can hold at all: no effect keeps a memory that changes between ticks
    /// and acts on the rates.
    rates_may_hold: bool,
    /// Whether all states are slow beside a tick, so that a look ahead is as good as the end.
    slow: bool,
    /// Where shaft, flow or swirl settle so fast beside a tick that explicit steps would run away.
    stiff: Option<Stiff>,
    /// The derivative that a calm stiff plant goes on with, and whether it was taken.
    slopes: Slopes<T, STATES>,
    slopes_hold: bool,
    /// Bandwidth of the observer, rad/s; 0 is off.
    observer_rad_s: f64,
    /// How far it has pulled the angle, rad.
    pulled_rad: T,
    quantise_encoder: bool,
}

/// Decay factors of the first-order filters over one tick.
#[derive(Clone, Copy)]
struct Decays<T> {
    /// Stated lag of the drive, and its decay over half a tick and a whole one.
    drive: (T, T, T),
    speed: Option<T>,
    thrust: Option<(f64, f64)>,
    torque: Option<(f64, f64)>,
}

impl<T: Real> Decays<T> {
    fn new(parameters: &Parameters<T>, sensors: &Sensors, tick_s: f64) -> Self {
        let [time_constant_s, filter_s] =
            [P::TimeConstantS, P::SpeedFilterTimeConstantS].map(|p| parameters.get(p));
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
            speed: (filter_s > 0.0).then(|| (T::from(-tick_s) / filter_s).exp()),
            thrust: corner(sensors.thrust_filter_hz),
            torque: corner(sensors.torque_filter_hz),
        }
    }
}

impl<T: Real> Plant<T> {
    /// Sets a plant up at rest, with its load and the effects that the rig is known to have. `effects` are pairs
    /// of a catalogue entry and its parameter values; one that the rig has too takes its place.
    ///
    /// # Panics
    /// If the effects together have more than 24 continuous states, or an effect is given the
    /// wrong number of values: errors of the program, not of its input.
    pub fn new(
        model: ModelName,
        rig: &Rig,
        parameters: &Parameters<T>,
        effects: &[(&Descriptor, &[T])],
        tick_s: f64,
    ) -> Self {
        let context = Context { parameters, rig, tick_s };
        let built = |descriptor: &Descriptor, values: &[T]| T::build(descriptor, values, &context);
        let given = |id: &str| effects.iter().any(|(descriptor, _)| descriptor.id == id);
        let mut all: Vec<Box<dyn Effect<T>>> = Vec::new();
        for known in rig.effects.iter().filter(|known| !given(known.effect)) {
            let values: Vec<T> = known.values().map(T::from).collect();
            all.extend(known.descriptor().map(|descriptor| built(descriptor, &values)));
        }
        all.extend(effects.iter().map(|(descriptor, values)| built(descriptor, values)));
        if let Load::TwoMass { .. } = rig.load {
            all.push(flexible_coupling::of_load(&context));
        }
        let mut next = OWN;
        let effects: Vec<Hooked<T>> = all
            .into_iter()
            .map(|effect| {
                let own = next..next + effect.states();
                next = own.end;
                assert!(next <= STATES, "too many effect states");
                Hooked { effect, own }
            })
            .collect();
        let (stated, mut model, mut parameters) = (model, model, *parameters);
        effects.iter().for_each(|e| e.effect.amend(&mut model, &mut parameters));
        let hooked = |used: fn(&crate::effects::Hooks) -> bool| -> Vec<usize> {
            (0..effects.len()).filter(|i| used(&effects[*i].effect.hooks())).collect()
        };
        let mut sense_hooks = hooked(|h| h.sense);
        sense_hooks.sort_by_key(|i| effects[*i].effect.sensing());
        let changes_between_ticks = |e: &Hooked<T>| {
            let h = e.effect.hooks();
            (h.drive || h.sense) && (h.inflow || h.foil || h.balance)
        };
        // Before anything is measured too: a log that begins with no voltage would stop every drive.
        let nominal_supply_v = rig.amplifier.supply_v.unwrap_or(f64::INFINITY);
        let lightest_share = effects.iter().map(|e| e.effect.lightest_share()).fold(1.0, f64::min);
        Self {
            model,
            rates_may_hold: !effects.iter().any(changes_between_ticks),
            slow: effects.iter().all(|e| e.effect.slow()) && model != ModelName::RotationalFlow,
            brisk: model != stated || effects.iter().any(|e| e.effect.brisk()),
            last_span_s: tick_s,
            stiff: Stiff::of(model, rig, tick_s, lightest_share),
            slopes: Slopes::NONE,
            slopes_hold: false,
            parameters,
            sensors: rig.sensors,
            amplifier: rig.amplifier.kind,
            nominal_supply_v,
            tick_s,
            drive_hooks: hooked(|h| h.drive),
            inflow_hooks: hooked(|h| h.inflow),
            foil_hooks: hooked(|h| h.foil),
            balance_hooks: hooked(|h| h.balance),
            sense_hooks,
            effects,
            used_states: next,
            constants: Constants::new(&parameters, rig),
            decays: Decays::new(&parameters, &rig.sensors, tick_s),
            command_lag: None,
            x: [T::ZERO; STATES],
            current_a: T::ZERO,
            time_s: 0.0,
            filters: Filters::still(),
            counted: Counted::over(1, tick_s),
            sensed: Sensed { supply_v: T::from(nominal_supply_v), ..Sensed::default() },
            supply_v: nominal_supply_v,
            true_thrust_n: T::ZERO,
            at: Local::default(),
            last_rates: [[T::ZERO; STATES]; 2],
            last_rub: Rub::NONE,
            moving: false,
            was_imposed: false,
            observer_rad_s: 0.0,
            pulled_rad: T::ZERO,
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
        self.slopes_hold = false;
        self.x[SPEED] = T::from(shaft_speed_rad_s);
        self.x[FLOW] = T::from(axial_m_s);
        self.x[ANGLE] = T::from(angle_rad);
        self.current_a = T::from(current_a);
        self.counted.came_to(angle_rad, shaft_speed_rad_s);
        self.filters.speed_rad_s = T::from(shaft_speed_rad_s);
        T::settle(self);
    }

    /// Loads and sensors in the state that is set.
    pub(crate) fn settle(&mut self) {
        let now = Tick { time_s: self.time_s, ..Tick::default() };
        self.at = self.local_at(&self.x, self.current_a, 0.0, &now);
        let mut balance = Balance::default();
        self.rates::<true, true, STATES>(&self.x, &self.at, &mut balance);
        self.filters.last_thrust_n = balance.thrust_n + balance.stand_n;
        self.filters.thrust_n = balance.thrust_n + balance.stand_n;
        self.filters.last_torque_n_m = balance.blade_torque_n_m;
        self.filters.torque_n_m = balance.blade_torque_n_m;
        self.true_thrust_n = balance.thrust_n;
        self.filters.angle_rad = self.encoded(self.x[ANGLE]);
        self.show(&now, self.time_s);
    }

    /// What was commanded until the start, which a drive that remembers begins with; else it begins with the first
    /// command.
    pub fn commanded_before(&mut self, command: f64) {
        let before = Tick { time_s: self.time_s - self.tick_s, ..Tick::default() };
        self.drive_over(&before, Some(command));
    }

    /// The true state and loads now; under an observer, before its pull.
    pub fn truth(&self) -> &Local<T> {
        &self.at
    }

    /// The model's name.
    pub fn model(&self) -> ModelName {
        self.model
    }

    /// Whether this plant takes the implicit step, chosen once from the stated rig: its flow, swirl or shaft
    /// settles within a tick.
    pub fn is_stiff(&self) -> bool {
        self.stiff.is_some()
    }

    /// One control tick: the command acts from now to the next tick.
    pub fn step(&mut self, tick: &Tick) {
        self.stride(std::slice::from_ref(tick), None);
    }

    /// Control ticks in a row, under commands in place of their own where they are given (measured currents where those
    /// drive). Several may be passed in one step where the caller knows them to be as smooth together as
    /// [`Course`] says of each; where something jumps all the same, and where the plant has a reason not to, they are
    /// taken one by one.
    ///
    /// Runge-Kutta of order 4; over ticks that the caller knows to be smooth Adams' method of order 3, at
    /// half the cost, or a quarter of it where they are calm. A stiff plant takes linearly implicit steps, one for several
    /// ticks where hardly anything moves in them.
    pub fn stride(&mut self, ticks: &[Tick], commands: Option<&[f64]>) {
        if self.observer_rad_s == 0.0 {
            return T::advance(self, ticks, commands);
        }
        for (k, tick) in ticks.iter().enumerate() {
            T::advance(self, &ticks[k..=k], commands.map(|all| &all[k..=k]));
            self.pull(tick);
        }
    }

    pub(crate) fn advance(&mut self, ticks: &[Tick], commands: Option<&[f64]>) {
        // Copies of the inner loop: the one without hooks keeps everything in registers, the others carry no
        // more states, and show no more of the blade, than somebody looks at.
        let blade = !self.inflow_hooks.is_empty() || !self.foil_hooks.is_empty();
        let hooked = blade || !self.balance_hooks.is_empty();
        match (self.stiff, hooked, blade, self.used_states) {
            (Some(stiff), .., ..=OWN) => self.stiff_as::<OWN>(ticks, commands, stiff),
            (Some(stiff), .., ..=FEW) => self.stiff_as::<FEW>(ticks, commands, stiff),
            (Some(stiff), .., ..=SOME) => self.stiff_as::<SOME>(ticks, commands, stiff),
            (Some(stiff), ..) => self.stiff_as::<STATES>(ticks, commands, stiff),
            (_, false, ..) => self.step_as::<false, false, OWN>(ticks, commands),
            (_, _, false, ..=OWN) => self.step_as::<true, false, OWN>(ticks, commands),
            (_, _, true, ..=OWN) => self.step_as::<true, true, OWN>(ticks, commands),
            (_, _, false, ..=FEW) => self.step_as::<true, false, FEW>(ticks, commands),
            (_, _, true, ..=FEW) => self.step_as::<true, true, FEW>(ticks, commands),
            (.., ..=SOME) => self.step_as::<true, true, SOME>(ticks, commands),
            _ => self.step_as::<true, true, STATES>(ticks, commands),
        }
    }

    /// Takes over the state at the end of one tick or of several, with what acts there.
    #[inline(always)]
    fn arrive<const N: usize>(&mut self, ticks: &[Tick], x: &[T; N], end: Local<T>, balance: &Balance<T>) {
        let way = Way { from: self.at, from_rad: self.x[ANGLE], to_rad: x[ANGLE] };
        for (state, moved) in self.x.iter_mut().zip(x) {
            *state = died_away(*moved);
        }
        let end = end.settled();
        self.current_a = end.current_a;
        self.at = end;
        self.at.thrust_n = balance.thrust_n;
        self.at.blade_torque_n_m = balance.blade_torque_n_m;
        self.observe(ticks, &way, balance);
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
            load_n_m: tick.load_at(part),
            depth_m: tick.depth_m,
            temperature_c: tick.temperature_c,
            thrust_n: T::ZERO,
            blade_torque_n_m: T::ZERO,
        }
    }
}
