//! A recording made ready for simulation: inputs on the control grid, responses on the log grid.

use kort_thruster::plant::{Leap, Stimulus};
use kort_thruster::real::Real;
use kort_thruster::rig::{AmplifierKind, Rig};

use crate::gaps::unsampled;
use crate::refuse;

mod channel;
mod columns;
mod command;
mod counted;
mod driving;
mod error;
pub mod experiments;
mod fill;
mod fresh;
mod grain;
mod lay_out;
pub mod loaded;
mod observed;
mod pauses;
pub mod row_means;
mod scale;
mod start;

pub use channel::{Channel, rates};
pub use columns::{KNOWN, possible_drivers, spread};
pub use counted::counted_angle;
pub use error::DataError;
pub use fresh::fresh;
pub use grain::Grain;
pub use observed::OBSERVER_RAD_S;
pub use pauses::pause_s;
pub use scale::{available, scale};

use command::steps_of;
use driving::{choose_driving, driving_power, instead};
use fill::{filled, held, median_step};
use start::start_state;

/// A measured response that a model can be compared with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Response {
    /// `current_a`
    Current,
    /// `shaft_speed_rad_s`
    ShaftSpeed,
    /// `thrust_n`
    Thrust,
    /// `torque_n_m`
    Torque,
    /// `flow_m_s`
    Flow,
    /// `shaft_angle_rad`, compared as its mean rate from sample to sample: an angle itself only drifts.
    ShaftAngle,
}

impl Response {
    /// Every response.
    pub const ALL: [Self; 6] =
        [Self::Current, Self::ShaftSpeed, Self::Thrust, Self::Torque, Self::Flow, Self::ShaftAngle];

    /// The recording's column.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Current => "current_a",
            Self::ShaftSpeed => "shaft_speed_rad_s",
            Self::Thrust => "thrust_n",
            Self::Torque => "torque_n_m",
            Self::Flow => "flow_m_s",
            Self::ShaftAngle => "shaft_angle_rad",
        }
    }

    /// Its value in a simulated row.
    pub fn of<T: Real>(self, row: &kort_thruster::plant::Sensed<T>) -> T {
        match self {
            Self::Current => row.current_a,
            Self::ShaftSpeed => row.shaft_speed_rad_s,
            Self::Thrust => row.thrust_n,
            Self::Torque => row.torque_n_m,
            Self::Flow => row.flow_m_s,
            // Its rates are compared, and what an observer pulled is no motion.
            Self::ShaftAngle => row.shaft_angle_rad - row.pulled_rad,
        }
    }
}

/// Columns of a recording as numbers; NaN means "not sampled then".
#[derive(Clone, Debug, Default)]
pub struct Series {
    /// Name for messages and the report.
    pub name: String,
    /// Strictly increasing, s.
    pub time_s: Vec<f64>,
    /// Columns by name.
    pub columns: Vec<(String, Vec<f64>)>,
}

impl Series {
    /// A column with at least one sample.
    pub fn column(&self, name: &str) -> Option<&[f64]> {
        self.columns
            .iter()
            .find(|c| c.0 == name)
            .map(|c| c.1.as_slice())
            .filter(|c| c.iter().any(|v| v.is_finite()))
    }
}

/// What drives the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Driving {
    /// A command column.
    Command(&'static str),
    /// Measured current.
    Current,
    /// Measured shaft speed.
    Speed,
    /// Measured electrical power: what a speed controller's telemetry gives where no command is logged.
    Power,
}

impl Driving {
    /// The column's name.
    pub const fn column(self) -> &'static str {
        match self {
            Self::Command(name) => name,
            Self::Current => "current_a",
            Self::Speed => "shaft_speed_rad_s",
            Self::Power => "power_w",
        }
    }
}

/// One recording, ready to be compared with a model.
#[derive(Clone, Debug)]
pub struct Prepared {
    /// Name for the report.
    pub name: String,
    /// Log instants, s.
    pub time_s: Vec<f64>,
    /// Inputs on the control grid.
    pub stimulus: Stimulus,
    /// What drives.
    pub driving: Driving,
    /// Measured responses.
    pub channels: Vec<Channel>,
    /// How many ticks may be passed at once from each on.
    pub strides: Vec<usize>,
    /// Jumps of the command: the first row that shows each.
    pub edges: Vec<usize>,
    /// Command at each row.
    pub command: Vec<f64>,
    /// Whether the command stands from most rows to the next.
    pub stepwise: bool,
    /// Control ticks a log interval (nominal).
    pub ticks_per_row: usize,
    /// Ticks of the simulation a control period: over it an encoder's counts are differenced.
    pub ticks_per_period: usize,
    /// Whether the log has a row for every command: the drive's stated control is no faster than the log.
    pub every_command: bool,
    /// Step of the simulation, s.
    pub tick_s: f64,
    /// How far a sample, and a command, may lie from its stamp, s.
    pub grain_s: Grain,
    /// State at the first row: shaft speed, axial flow, current, angle.
    pub start: [f64; 4],
    /// Command before the first row, where it is known not to have been the first one.
    pub before: Option<f64>,
    /// The interval from row to row beyond which the log has paused, s.
    pub pause_s: f64,
    /// Pauses that are passed over without ticks, in order.
    pub leaps: Vec<Leap>,
    /// Where what drives was measured: rows between which it has no samples for longer than usual.
    pub unsampled: Vec<(usize, usize)>,
    /// Shaft speed at each row, where it drives.
    pub speed_between: Vec<f64>,
    /// The column that is laid beside the inputs as a possible driver of what is left.
    pub extra: Option<String>,
    /// Of the supply that a duty is a share of, by row: held from each of its samples to the next, over its course straight
    /// between them, which is taken.
    pub supply_held: Vec<f64>,
    /// Bandwidth with which the simulated shaft is kept with the recorded one, rad/s; 0 where it runs freely.
    pub observer_rad_s: f64,
    /// Whether a measured current that drives is taken for the mean since the row before.
    pub row_means: bool,
    /// Whether the drive's stated lag is taken to act on the command, not on the current that follows.
    pub lag_on_command: bool,
    /// Whether it is the second experiment of a recording that stands before it.
    pub second: bool,
}

/// Whether a rig shows a response. Of a speed drive's current nothing is modelled. A dry shaft has no water to feel; its
/// angle tells what a filtered speed hides, which beside a propeller thrust and flow do.
fn shown(rig: &Rig, driving: Driving, response: Response) -> bool {
    match response {
        Response::Current => rig.amplifier.kind != AmplifierKind::Speed,
        Response::ShaftSpeed => true,
        Response::ShaftAngle => rig.propeller.is_none() && driving != Driving::Speed,
        _ => rig.propeller.is_some(),
    }
}

/// The coarsest step at which the plant is integrated, s.
const COARSEST_TICK_S: f64 = 0.002;
/// Fewest rows of a recording that can be compared with a model.
pub const FEWEST_ROWS: usize = 20;

/// Step at which the plant is integrated under a log of this usual interval, s.
pub fn control_period_s(rig: &Rig, row_s: f64) -> f64 {
    let tick_s = match rig.sensors.control_rate_hz {
        Some(rate) if 1.0 / rate <= row_s * 1.001 => 1.0 / rate,
        _ => row_s,
    };
    tick_s / (tick_s / COARSEST_TICK_S).ceil().max(1.0)
}

/// A row may be this many control periods for the log to have every command: stamps scatter, and now and then a row is
/// missing.
const EVERY: f64 = 1.05;

/// Steps in a stated control period, in a row at most; one where none is stated.
fn ticks_per_period(rig: &Rig, row_s: f64, tick_s: f64) -> usize {
    let period_s = rig.sensors.control_rate_hz.map_or(tick_s, |rate_hz| (1.0 / rate_hz).min(row_s));
    (period_s / tick_s).round().max(1.0) as usize
}

impl Prepared {
    /// Prepares a recording for a rig. A shaft-speed drive is chosen only where `speed_driven`
    /// asks for it (Model 3) or nothing else can drive.
    ///
    /// # Errors
    /// [`DataError`] if nothing drives, nothing responds, or it is too short.
    pub fn new(series: &Series, rig: &Rig, speed_driven: bool) -> Result<Self, DataError> {
        let recording = series.name.clone();
        let rows = series.time_s.len();
        if rows < FEWEST_ROWS {
            return Err(DataError::TooShort { recording, rows, least: FEWEST_ROWS });
        }
        let row_s = median_step(&series.time_s);
        refuse::implausible(series, row_s)?;
        let driving = choose_driving(series, rig, speed_driven)
            .ok_or(DataError::NoDriving { recording: recording.clone() })?;
        let shown = |r: &Response| {
            let drives = r.name() == driving.column() || driving == Driving::Speed && *r == Response::Current;
            !drives && shown(rig, driving, *r)
        };
        let answering = |at_rest: bool| -> Vec<Channel> {
            let channel = |r: Response| Channel::new(series, rig, r, at_rest);
            Response::ALL.into_iter().filter(shown).filter_map(channel).collect()
        };
        let answers = |channels: &[Channel]| channels.iter().any(|c| c.response != Response::Current);
        let mut channels = answering(false);
        if !answers(&channels) {
            channels = answering(true);
        }
        if !answers(&channels) {
            if let Some((column, kind)) = driving::other_drive(series, rig) {
                return Err(DataError::OtherDrive { recording, column, kind });
            }
            let found = instead(series, rig, driving.column());
            return Err(DataError::NoResponse { recording, driving: driving.column(), found });
        }
        let tick_s = control_period_s(rig, row_s);
        refuse::too_long(series, tick_s)?;
        let column = series.column(driving.column()).unwrap_or(&[]);
        // A command stands until the next; a response moves on between its samples.
        let recorded = match driving {
            Driving::Command(_) => held(column),
            Driving::Power => driving_power(series),
            Driving::Current | Driving::Speed => filled(column),
        };
        let mut prepared = Self {
            name: recording,
            time_s: series.time_s.clone(),
            stimulus: Stimulus::default(),
            driving,
            channels,
            strides: Vec::new(),
            edges: Vec::new(),
            stepwise: false,
            command: if driving == Driving::Current { steps_of(&recorded) } else { recorded },
            ticks_per_row: (row_s / tick_s).round() as usize,
            ticks_per_period: ticks_per_period(rig, row_s, tick_s),
            every_command: rig.sensors.control_rate_hz.is_some_and(|rate_hz| rate_hz * row_s < EVERY),
            tick_s,
            grain_s: Grain::new(rig, row_s, tick_s),
            start: [0.0; 4],
            before: None,
            pause_s: pause_s(&series.time_s),
            leaps: Vec::new(),
            unsampled: if matches!(driving, Driving::Command(_)) {
                Vec::new()
            } else {
                unsampled(&series.time_s, column)
            },
            speed_between: Vec::new(),
            extra: None,
            supply_held: Vec::new(),
            observer_rad_s: 0.0,
            row_means: false,
            lag_on_command: false,
            second: false,
        };
        if let Driving::Command("duty_cmd") = driving {
            // A duty of the supply is a voltage: of the recorded supply, or else the nominal one.
            let nominal = vec![rig.amplifier.supply_v.unwrap_or(1.0); rows];
            let recorded = series.column("supply_v");
            let supply = recorded.map_or(nominal, filled);
            prepared.command.iter_mut().zip(&supply).for_each(|(c, v)| *c *= v);
            let stands = recorded.map_or_else(|| supply.clone(), held);
            prepared.supply_held = stands.iter().zip(&supply).map(|(held, v)| held / v.max(1e-9)).collect();
        }
        prepared.observer_rad_s = observed::bandwidth_rad_s(series, rig, &prepared);
        prepared.lay_out(series, rig);
        (prepared.start, prepared.before) = start_state(series, &prepared);
        Ok(prepared)
    }

    /// Shaft speed without the stated measuring chain: from the angle where it is recorded, else
    /// the filtered speed with the filter's lag taken back.
    fn driving_speed(&self, series: &Series, rig: &Rig) -> Vec<f64> {
        let t = &self.time_s;
        let n = t.len();
        let slope = |y: &[f64], k: usize| {
            let (a, b) = (k.saturating_sub(1), (k + 1).min(n - 1));
            (y[b] - y[a]) / (t[b] - t[a])
        };
        if let Some(angle) = series.column("shaft_angle_rad").map(filled) {
            return (0..n).map(|k| slope(&angle, k)).collect();
        }
        let tau = rig.sensors.speed_filter_time_constant_s.unwrap_or(0.0)
            + if rig.sensors.encoder_counts_per_rev.is_some() { 0.5 * self.tick_s } else { 0.0 };
        (0..n).map(|k| self.command[k] + tau * slope(&self.command, k)).collect()
    }

    /// Length, s.
    pub fn duration_s(&self) -> f64 {
        self.time_s[self.time_s.len() - 1] - self.time_s[0]
    }
}
