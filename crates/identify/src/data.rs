//! A recording made ready for simulation: inputs on the control grid, responses on the log grid.

use kort_thruster::effects::{Available, Scale};
use kort_thruster::models::ModelName;
use kort_thruster::plant::{Course, Driven, Stimulus, Tick};
use kort_thruster::rig::{AmplifierKind, Rig};

use crate::refuse;

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
}

impl Response {
    /// Every response.
    pub const ALL: [Self; 5] = [Self::Current, Self::ShaftSpeed, Self::Thrust, Self::Torque, Self::Flow];

    /// The recording's column.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Current => "current_a",
            Self::ShaftSpeed => "shaft_speed_rad_s",
            Self::Thrust => "thrust_n",
            Self::Torque => "torque_n_m",
            Self::Flow => "flow_m_s",
        }
    }

    /// Its value in a simulated row.
    pub fn of<T: Copy>(self, row: &kort_thruster::plant::Sensed<T>) -> T {
        match self {
            Self::Current => row.current_a,
            Self::ShaftSpeed => row.shaft_speed_rad_s,
            Self::Thrust => row.thrust_n,
            Self::Torque => row.torque_n_m,
            Self::Flow => row.flow_m_s,
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
}

impl Driving {
    /// The column's name.
    pub const fn column(self) -> &'static str {
        match self {
            Self::Command(name) => name,
            Self::Current => "current_a",
            Self::Speed => "shaft_speed_rad_s",
        }
    }
}

/// Samples of one response.
#[derive(Clone, Debug)]
pub struct Channel {
    /// Which response.
    pub response: Response,
    /// Log rows where it was sampled.
    pub rows: Vec<usize>,
    /// The samples.
    pub values: Vec<f64>,
    /// Largest magnitude (99.5 % quantile), the full scale that errors are compared with.
    pub full_scale: f64,
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
    /// Jumps of the command: the first row that shows each.
    pub edges: Vec<usize>,
    /// Whether the command is laid on the control grid (it drives, or a measured current stands for it).
    pub commanded: bool,
    /// Command at each row.
    pub command: Vec<f64>,
    /// Control ticks a log interval (nominal).
    pub ticks_per_row: usize,
    /// Control period, s.
    pub tick_s: f64,
    /// State at the first row: shaft speed, axial flow, current, angle.
    pub start: [f64; 4],
}

/// Why a recording cannot be compared with a model.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DataError {
    /// No column to drive the model.
    #[error(
        "{recording}: no driving column\nhint: one of current_cmd_a, voltage_cmd_v, duty_cmd, speed_cmd_rad_s, or a measured current_a or shaft_speed_rad_s must be there and vary"
    )]
    NoDriving {
        /// The recording.
        recording: String,
    },
    /// Nothing to compare with.
    #[error(
        "{recording}: driven by {driving}, but no measured response beside it: {found}\nhint: record shaft_speed_rad_s, thrust_n, torque_n_m or flow_m_s as well; a log of commands alone can be replayed (kort simulate, a segment of kind \"replay\"), not diagnosed"
    )]
    NoResponse {
        /// The recording.
        recording: String,
        /// The driving column.
        driving: &'static str,
        /// What there is instead.
        found: String,
    },
    /// Too short.
    #[error(
        "{recording}: {rows} rows are too few to compare with a model; at least {least} are needed\nhint: record at least a few seconds with changes of the command"
    )]
    TooShort {
        /// The recording.
        recording: String,
        /// Rows found.
        rows: usize,
        /// Rows needed.
        least: usize,
    },
    /// A value that no thruster gives.
    #[error(
        "{recording}: {column} = {value:e} at {time_s} s is outside what is allowed: -{most:e} to {most:e}\nhint: is the unit right? a value not measured is an empty cell"
    )]
    Implausible {
        /// The recording.
        recording: String,
        /// The column.
        column: String,
        /// When.
        time_s: f64,
        /// The value found.
        value: f64,
        /// Largest size allowed.
        most: f64,
    },
    /// Rows closer together than any log writes them.
    #[error(
        "{recording}: rows are usually {interval_s:e} s apart; at least {least_s:e} s are needed\nhint: is time_s in seconds?"
    )]
    TooFast {
        /// The recording.
        recording: String,
        /// Median time between rows, s.
        interval_s: f64,
        /// Shortest allowed, s.
        least_s: f64,
    },
    /// The model cannot be simulated.
    #[error(
        "{recording}: the simulation of the stated rig breaks down (a response is not a number or runs away)\nhint: check the rig's inertia, duct length, resistance and gains for their units; kort simulate shows what the model does"
    )]
    BrokeDown {
        /// The recording.
        recording: String,
    },
    /// More control ticks than can be simulated.
    #[error(
        "{recording}: time_s spans {seconds} s; at most {most_s:.0} s can be compared at this control rate (the longest gap is from {} to {} s)\nhint: is time_s in seconds? cut the recording at its gaps, or take a part of it", .gap_s[0], .gap_s[1]
    )]
    TooLong {
        /// The recording.
        recording: String,
        /// Span found, s.
        seconds: f64,
        /// Longest allowed, s.
        most_s: f64,
        /// The longest gap, from and to, s.
        gap_s: [f64; 2],
    },
}

/// The coarsest step at which the plant is integrated, s.
const COARSEST_TICK_S: f64 = 0.002;
const FEWEST_ROWS: usize = 20;

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
        let channels: Vec<Channel> = Response::ALL
            .into_iter()
            .filter(|r| {
                r.name() != driving.column() && !(driving == Driving::Speed && *r == Response::Current)
            })
            .filter(|r| rig.propeller.is_some() || matches!(r, Response::Current | Response::ShaftSpeed))
            .filter_map(|r| Channel::new(series, r))
            .collect();
        if !channels.iter().any(|c| c.response != Response::Current) {
            let found = instead(series, driving.column());
            return Err(DataError::NoResponse { recording, driving: driving.column(), found });
        }
        let tick_s = match rig.sensors.control_rate_hz {
            Some(rate) if 1.0 / rate <= row_s * 1.001 => {
                let tick = 1.0 / rate;
                tick / (tick / COARSEST_TICK_S).ceil().max(1.0)
            }
            _ => row_s / (row_s / COARSEST_TICK_S).ceil().max(1.0),
        };
        refuse::too_long(series, tick_s)?;
        let column = series.column(driving.column()).unwrap_or(&[]);
        // A command stands until the next; a response moves on between its samples.
        let recorded = if let Driving::Command(_) = driving { held(column) } else { filled(column) };
        let mut prepared = Self {
            name: recording,
            time_s: series.time_s.clone(),
            stimulus: Stimulus::default(),
            driving,
            channels,
            edges: Vec::new(),
            commanded: false,
            command: if driving == Driving::Current { steps_of(&recorded) } else { recorded },
            ticks_per_row: (row_s / tick_s).round() as usize,
            tick_s,
            start: [0.0; 4],
        };
        if let Driving::Command("duty_cmd") = driving {
            // A duty of the supply is a voltage: of the recorded supply, or else the nominal one.
            let nominal = vec![rig.amplifier.supply_v.unwrap_or(1.0); rows];
            let supply = series.column("supply_v").map_or(nominal, filled);
            prepared.command.iter_mut().zip(supply).for_each(|(c, v)| *c *= v);
        }
        prepared.lay_out(series, rig);
        prepared.start = start_state(series, &prepared);
        Ok(prepared)
    }

    /// Lays the recorded inputs on the control grid.
    fn lay_out(&mut self, series: &Series, rig: &Rig) {
        let t0 = self.time_s[0];
        let end = (self.time_s[self.time_s.len() - 1] - t0) / self.tick_s;
        let count = (end - 1e-6).ceil().max(1.0) as usize;
        self.stimulus.logs = self
            .time_s
            .iter()
            .map(|t| {
                let at = (t - t0) / self.tick_s;
                let near = at.round();
                if (at - near).abs() < 0.02 {
                    (near as usize, 0.0)
                } else {
                    (at.floor() as usize, at - at.floor())
                }
            })
            .collect();
        let ambient = series.column("ambient_m_s").map(filled);
        let supply = series.column("supply_v").map(filled);
        let angle = series.column("shaft_angle_rad").map(filled);
        let depth = series.column("depth_m").map(filled);
        let temperature = series.column("temperature_c").map(filled);
        let speed = (self.driving == Driving::Speed).then(|| self.driving_speed(series, rig));
        let mut ticks = Vec::with_capacity(count);
        let mut row = 0;
        for i in 0..count {
            let time_s = t0 + i as f64 * self.tick_s;
            let next_s = time_s + self.tick_s;
            while row + 2 < self.time_s.len() && self.time_s[row + 1] <= time_s + 0.02 * self.tick_s {
                row += 1;
            }
            let at = |column: &[f64], t: f64| linear(&self.time_s, column, row, t);
            ticks.push(Tick {
                time_s,
                command: 0.0,
                driven: match self.driving {
                    Driving::Command(_) => Driven::Command,
                    Driving::Current => Driven::Current(at(&self.command, time_s), at(&self.command, next_s)),
                    Driving::Speed => {
                        let s = speed.as_deref().unwrap_or(&[]);
                        Driven::Speed(at(s, time_s), at(s, next_s))
                    }
                },
                ambient_m_s: ambient.as_deref().map_or((0.0, 0.0), |a| (at(a, time_s), at(a, next_s))),
                supply_v: supply.as_deref().map(|s| at(s, time_s)),
                shaft_angle_rad: angle.as_deref().map(|a| (at(a, time_s), at(a, next_s))),
                depth_m: depth.as_deref().map(|d| at(d, time_s)),
                temperature_c: temperature.as_deref().map(|d| at(d, time_s)),
                extra: 0.0,
                course: Course::Any,
                ..Tick::default()
            });
        }
        self.stimulus.ticks = ticks;
        let stepped = matches!(self.driving, Driving::Command(_))
            || self.driving == Driving::Current && rig.amplifier.kind == AmplifierKind::Current;
        if stepped {
            self.edges = find_edges(&self.command);
            if self.driving == Driving::Current {
                smooth_between(&mut self.command, &self.edges);
            }
            self.commanded = true;
        }
    }

    /// The command at every control tick, where its edges came so many ticks before their rows.
    pub fn commands(&self, ticks_before: &[usize]) -> Vec<f64> {
        let ticks = self.stimulus.ticks.len();
        if !self.commanded {
            return vec![0.0; ticks];
        }
        let c = &self.command;
        let n = c.len();
        let mut edge_at: Vec<Option<usize>> = vec![None; n + 2];
        self.edges.iter().zip(ticks_before).for_each(|(row, before)| edge_at[*row] = Some(*before));
        let t0 = self.time_s[0];
        let mut row = 0;
        let mut commands = Vec::with_capacity(ticks);
        for i in 0..ticks {
            let t = t0 + i as f64 * self.tick_s;
            while row + 2 < n && self.time_s[row + 1] <= t + 0.02 * self.tick_s {
                row += 1;
            }
            let (a, b) = (c[row], c[row + 1]);
            commands.push(match edge_at[row + 1] {
                Some(before) => {
                    let remaining = ((self.time_s[row + 1] - t) / self.tick_s).round() as usize;
                    if remaining <= before { b } else { a }
                }
                None => {
                    let u =
                        ((t - self.time_s[row]) / (self.time_s[row + 1] - self.time_s[row])).clamp(0.0, 1.0);
                    let smooth =
                        row > 0 && row + 2 < n && edge_at[row].is_none() && edge_at[row + 2].is_none();
                    if smooth { catmull_rom(c[row - 1], a, b, c[row + 2], u) } else { a + (b - a) * u }
                }
            });
        }
        commands
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

    /// Lays an unknown column beside the inputs, standardised, as a possible driver.
    pub fn lay_extra(&mut self, column: &[f64]) {
        let values = filled(column);
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let deviation = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt().max(1e-12);
        let mut row = 0;
        for tick in &mut self.stimulus.ticks {
            while row + 2 < self.time_s.len() && self.time_s[row + 1] <= tick.time_s {
                row += 1;
            }
            tick.extra = (linear(&self.time_s, &values, row, tick.time_s) - mean) / deviation;
        }
    }

    /// Length, s.
    pub fn duration_s(&self) -> f64 {
        self.time_s[self.time_s.len() - 1] - self.time_s[0]
    }
}

impl Channel {
    fn new(series: &Series, response: Response) -> Option<Self> {
        let column = series.column(response.name())?;
        let mut rows: Vec<usize> = (0..column.len()).filter(|k| column[*k].is_finite()).collect();
        // A held sensor logged at every row repeats itself: keep the fresh samples only.
        let changes = rows.windows(2).filter(|w| column[w[0]] != column[w[1]]).count();
        if response == Response::Flow && rows.len() > 50 && changes * 2 < rows.len() {
            rows = std::iter::once(rows[0])
                .chain(rows.windows(2).filter(|w| column[w[0]] != column[w[1]]).map(|w| w[1]))
                .collect();
        }
        let values: Vec<f64> = rows.iter().map(|k| column[*k]).collect();
        let mut size: Vec<f64> = values.iter().map(|v| v.abs()).collect();
        size.sort_by(f64::total_cmp);
        let full_scale = size.get(((size.len() as f64) * 0.995) as usize).copied().unwrap_or(0.0);
        let constant = values.iter().all(|v| *v == values[0]);
        (values.len() >= FEWEST_ROWS && !constant && full_scale > 0.0).then_some(Self {
            response,
            rows,
            values,
            full_scale,
        })
    }
}

/// What a recording without a usable response holds.
fn instead(series: &Series, driving: &str) -> String {
    let few = Response::ALL.into_iter().filter(|r| r.name() != driving).find_map(|r| {
        let samples = series.column(r.name())?.iter().filter(|v| v.is_finite()).count();
        (samples < FEWEST_ROWS)
            .then(|| format!("{} has {samples} samples, at least {FEWEST_ROWS} are needed", r.name()))
    });
    if let Some(few) = few {
        return few;
    }
    let others: Vec<&str> =
        series.columns.iter().map(|c| c.0.as_str()).filter(|n| *n != driving && *n != "time_s").collect();
    let mut found = if others.is_empty() { "nothing else is in it".into() } else { others.join(", ") };
    if let Some(sag) = crate::checks::supply_sag(series).and_then(|sag| sag.words()) {
        found.push_str(&format!("\nnote: {sag}"));
    }
    found
}

/// The driving column, by preference: a command that fits the drive, then measured current, then speed.
fn choose_driving(series: &Series, rig: &Rig, speed_driven: bool) -> Option<Driving> {
    let varies = |name: &str| {
        series.column(name).is_some_and(|c| {
            let first = c.iter().copied().find(|v| v.is_finite());
            c.iter().any(|v| v.is_finite() && Some(*v) != first)
        })
    };
    if speed_driven && varies("shaft_speed_rad_s") {
        return Some(Driving::Speed);
    }
    let commands: &[&'static str] = match rig.amplifier.kind {
        AmplifierKind::Current => &["current_cmd_a"],
        AmplifierKind::Voltage => &["voltage_cmd_v", "duty_cmd"],
        AmplifierKind::Speed => &["speed_cmd_rad_s"],
    };
    if let Some(command) = commands.iter().find(|c| varies(c)) {
        return Some(Driving::Command(command));
    }
    if varies("current_a") && varies("shaft_speed_rad_s")
        || varies("current_a") && rig.amplifier.kind != AmplifierKind::Speed
    {
        return Some(Driving::Current);
    }
    varies("shaft_speed_rad_s").then_some(Driving::Speed)
}

/// A measured current as the command that made it: a sample caught in the middle of a jump (the
/// drive's lag) takes the value that follows, so that every step has one edge.
fn steps_of(current: &[f64]) -> Vec<f64> {
    let mut out = current.to_vec();
    let mut sizes: Vec<f64> = current.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let usual = sizes.get(sizes.len() / 2).copied().unwrap_or(0.0);
    let range = current.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
    let jump = (8.0 * usual).max(0.02 * range);
    let mut k = 1;
    while k + 1 < current.len() {
        let (to, on) = (current[k] - current[k - 1], current[k + 1] - current[k]);
        if to.abs() > jump && on.abs() > 4.0 * usual && to * on > 0.0 {
            out[k] = current[k + 1];
            k += 1;
        }
        k += 1;
    }
    out
}

/// Takes a measured command's noise out: a parabola through the neighbours at each row, never
/// across an edge. Noise in the drive would pass for noise of the shaft.
fn smooth_between(command: &mut [f64], edges: &[usize]) {
    const REACH: usize = 8;
    let raw = command.to_vec();
    let mut bounds: Vec<usize> = std::iter::once(0).chain(edges.iter().copied()).collect();
    bounds.push(raw.len());
    for segment in bounds.windows(2) {
        for (k, smooth) in command.iter_mut().enumerate().take(segment[1]).skip(segment[0]) {
            let (from, to) = (k.saturating_sub(REACH).max(segment[0]), (k + REACH + 1).min(segment[1]));
            if to - from < 4 {
                *smooth = raw[from..to].iter().sum::<f64>() / (to - from) as f64;
                continue;
            }
            let rows = to - from;
            let x = nalgebra::DMatrix::from_fn(rows, 3, |i, j| ((from + i) as f64 - k as f64).powi(j as i32));
            let y = nalgebra::DVector::from_column_slice(&raw[from..to]);
            let normal = x.tr_mul(&x);
            if let Some(c) = normal.cholesky() {
                *smooth = c.solve(&x.tr_mul(&y))[0];
            }
        }
    }
}

/// Rows where the command jumps: it holds on at least one side, so the change is a step.
fn find_edges(command: &[f64]) -> Vec<usize> {
    let n = command.len();
    let range = command.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
    let mut sizes: Vec<f64> = command.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
    sizes.sort_by(f64::total_cmp);
    // Noise of a measured command; zero for a logged one that holds.
    let usual = sizes.get(sizes.len() / 2).copied().unwrap_or(0.0);
    (1..n)
        .filter(|k| {
            let jump = (command[*k] - command[k - 1]).abs();
            let before = if *k >= 2 { (command[k - 1] - command[k - 2]).abs() } else { 0.0 };
            let after = if k + 1 < n { (command[k + 1] - command[*k]).abs() } else { 0.0 };
            jump > 0.004 * range && jump > 4.0 * before.max(after).max(usual)
        })
        .collect()
}

/// Share of the largest command below which a standing shaft may be held by friction.
const STANDING_SHARE: f64 = 0.1;

/// Shaft speed, axial flow, current and shaft angle at the first row.
fn start_state(series: &Series, prepared: &Prepared) -> [f64; 4] {
    let first =
        |name: &str| series.column(name).and_then(|c| c.iter().take(10).copied().find(|v| v.is_finite()));
    let speed_scale = series
        .column("shaft_speed_rad_s")
        .map_or(0.0, |c| c.iter().filter(|v| v.is_finite()).fold(0.0_f64, |m, v| m.max(v.abs())));
    let speed = first("shaft_speed_rad_s").unwrap_or(0.0);
    if speed.abs() < 0.01 * speed_scale || speed_scale == 0.0 {
        if prepared.driving != Driving::Command("current_cmd_a") {
            return [0.0; 4];
        }
        let asked = prepared.command.first().copied().unwrap_or(0.0);
        let range = prepared.command.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
        // A shaft that stands although torque is asked for: the command came just now.
        let current = if asked.abs() < STANDING_SHARE * range {
            asked
        } else {
            first("current_a").map_or(0.0, |measured| measured.clamp(-asked.abs(), asked.abs()))
        };
        return [0.0, 0.0, current, 0.0];
    }
    let flow = first("flow_m_s").unwrap_or(0.0);
    let current = first("current_a").or_else(|| prepared.command.first().copied()).unwrap_or(0.0);
    [speed, flow, current, first("shaft_angle_rad").unwrap_or(0.0)]
}

/// Sizes in use over all recordings, for the scale of the effects' parameters.
pub fn scale(all: &[Prepared], rig: &Rig) -> Scale {
    let full = |r: Response| {
        all.iter()
            .flat_map(|p| &p.channels)
            .filter(|c| c.response == r)
            .map(|c| c.full_scale)
            .fold(0.0, f64::max)
    };
    let stated = kort_thruster::parameters::Parameters::stated(rig);
    let kt = rig.motor.torque_constant_nm_a.value;
    let command = all.iter().flat_map(|p| &p.command).fold(0.0_f64, |m, c| m.max(c.abs()));
    let (ct, cq) = if rig.propeller.is_some() { stated.bollard_coefficients() } else { (0.0, 0.0) };
    let driven_by = |name: &str| all.iter().any(|p| p.driving.column() == name);
    let current =
        if driven_by("current_cmd_a") || driven_by("current_a") { command } else { full(Response::Current) };
    let mut speed = full(Response::ShaftSpeed);
    if driven_by("shaft_speed_rad_s") || driven_by("speed_cmd_rad_s") {
        speed = speed.max(command);
    }
    if speed == 0.0 && cq > 0.0 {
        speed = (kt * current / cq).sqrt();
    }
    let thrust = Some(full(Response::Thrust)).filter(|t| *t > 0.0).unwrap_or(ct * speed * speed);
    let flux = stated.get(kort_thruster::parameters::Parameter::FluxCoefficient)
        * stated.get(kort_thruster::parameters::Parameter::DensityKgM3)
        * stated.area_m2();
    let ohm = stated.get(kort_thruster::parameters::Parameter::WindingResistanceOhm);
    let torque = if current > 0.0 {
        kt * current
    } else if cq > 0.0 {
        cq * speed * speed
    } else if ohm > 0.0 && rig.amplifier.kind == AmplifierKind::Voltage {
        // A dry shaft without a current: what the largest voltage gives at standstill.
        kt * command / ohm
    } else {
        // ... or what brings it to speed within a second.
        rig.motor.inertia_kg_m2.value * speed
    };
    Scale {
        shaft_speed_rad_s: speed.max(1e-6),
        torque_n_m: torque.max(1e-9),
        thrust_n: thrust.max(1e-9),
        flow_m_s: if flux > 0.0 { (thrust / flux).sqrt() } else { 1.0 },
        current_a: current.max(1e-9),
        command: command.max(1e-9),
        supply_v: rig.amplifier.supply_v.unwrap_or(0.0),
        winding_resistance_ohm: rig.motor.winding_resistance_ohm.map_or(0.0, |r| r.value),
        inertia_kg_m2: rig.motor.inertia_kg_m2.value,
        tick_s: all.first().map_or(0.002, |p| p.tick_s),
        duration_s: all.iter().map(Prepared::duration_s).fold(0.0, f64::max),
    }
}

/// Columns of the contract; any other is a possible driver of what is left.
pub const KNOWN: [&str; 16] = [
    "time_s",
    "current_cmd_a",
    "current_a",
    "voltage_cmd_v",
    "duty_cmd",
    "speed_cmd_rad_s",
    "thrust_cmd_n",
    "shaft_angle_rad",
    "shaft_speed_rad_s",
    "thrust_n",
    "torque_n_m",
    "flow_m_s",
    "ambient_m_s",
    "supply_v",
    "temperature_c",
    "depth_m",
];

/// Columns that a model has no use for by itself but that may drive what is left: unknown ones,
/// and known ones that no part of the baseline reads. Every recording must have them, varying.
pub fn possible_drivers(series: &[Series]) -> Vec<String> {
    let Some(first) = series.first() else { return Vec::new() };
    let optional = ["supply_v", "temperature_c", "depth_m"];
    let varies = |column: &[f64]| {
        let known: Vec<f64> = column.iter().copied().filter(|v| v.is_finite()).collect();
        known.iter().any(|v| *v != known[0])
    };
    first
        .columns
        .iter()
        .map(|c| c.0.clone())
        .filter(|name| !KNOWN.contains(&name.as_str()) || optional.contains(&name.as_str()))
        .filter(|name| series.iter().all(|s| s.column(name).is_some_and(varies)))
        .collect()
}

/// What the recordings offer, for the effects' `needs`.
pub fn available(model: ModelName, series: &[Series], all: &[Prepared]) -> Available {
    let mut columns: Vec<String> = series
        .iter()
        .flat_map(|s| s.columns.iter().filter(|c| s.column(&c.0).is_some()).map(|c| c.0.clone()))
        .collect();
    columns.sort();
    columns.dedup();
    Available {
        columns,
        shaft_prescribed: all.iter().all(|p| p.driving == Driving::Speed),
        current_prescribed: all.iter().all(|p| p.driving == Driving::Current),
        axial_flow_modelled: !matches!(model, ModelName::Model0 | ModelName::Model1),
        supply_sag_share: series
            .iter()
            .map(|s| crate::checks::supply_sag(s).map(|sag| sag.share()))
            .collect::<Option<Vec<f64>>>()
            .map(|shares| shares.into_iter().fold(0.0, f64::max)),
    }
}

fn median_step(time_s: &[f64]) -> f64 {
    let mut steps: Vec<f64> = time_s.windows(2).map(|w| w[1] - w[0]).collect();
    steps.sort_by(f64::total_cmp);
    steps[steps.len() / 2]
}

/// The column with empty cells filled by the value before; the first known one stands before it too.
fn held(column: &[f64]) -> Vec<f64> {
    let mut at = column.iter().copied().find(|v| v.is_finite()).unwrap_or(0.0);
    column
        .iter()
        .map(|v| {
            if v.is_finite() {
                at = *v;
            }
            at
        })
        .collect()
}

/// The column with empty cells filled: straight between samples, held at the ends.
fn filled(column: &[f64]) -> Vec<f64> {
    let mut out = column.to_vec();
    let known: Vec<usize> = (0..column.len()).filter(|k| column[*k].is_finite()).collect();
    let (Some(first), Some(last)) = (known.first().copied(), known.last().copied()) else {
        out.fill(0.0);
        return out;
    };
    out[..first].fill(column[first]);
    out[last..].fill(column[last]);
    for w in known.windows(2) {
        for (k, cell) in out.iter_mut().enumerate().take(w[1]).skip(w[0] + 1) {
            let u = (k - w[0]) as f64 / (w[1] - w[0]) as f64;
            *cell = column[w[0]] + (column[w[1]] - column[w[0]]) * u;
        }
    }
    out
}

fn linear(time_s: &[f64], column: &[f64], row: usize, t: f64) -> f64 {
    let next = (row + 1).min(time_s.len() - 1);
    let width = time_s[next] - time_s[row];
    let u = if width > 0.0 { (t - time_s[row]) / width } else { 0.0 };
    column[row] + (column[next] - column[row]) * u.clamp(0.0, 1.5)
}

fn catmull_rom(p0: f64, p1: f64, p2: f64, p3: f64, u: f64) -> f64 {
    0.5 * (2.0 * p1
        + (p2 - p0) * u
        + (2.0 * p0 - 5.0 * p1 + 4.0 * p2 - p3) * u * u
        + (3.0 * p1 - p0 - 3.0 * p2 + p3) * u * u * u)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_with_empty_cells_is_held_and_a_response_joined() {
        let column = [f64::NAN, 2.0, f64::NAN, f64::NAN, 8.0, f64::NAN];
        assert_eq!(held(&column), [2.0, 2.0, 2.0, 2.0, 8.0, 8.0]);
        assert_eq!(filled(&column), [2.0, 2.0, 4.0, 6.0, 8.0, 8.0]);
    }
}
