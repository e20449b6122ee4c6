//! What a run's recording holds: what was commanded and what the sensors showed, at the log's instants.

use kort_proto::signals::Signals;
use kort_thruster::rig::AmplifierKind;

/// A recording under way. A command stands in its row as its mean until the next: it changes at every tick.
pub struct Log {
    command: &'static str,
    every: u64,
    ticks: u64,
    sum: f64,
    row: Option<(f64, Signals)>,
    /// Times of the rows, s.
    pub time_s: Vec<f64>,
    commands: Vec<f64>,
    signals: Vec<Signals>,
}

impl Log {
    /// Empty, for a drive, a control rate and a log rate, Hz.
    pub fn new(kind: AmplifierKind, control_rate_hz: f64, log_rate_hz: f64) -> Self {
        Self {
            command: match kind {
                AmplifierKind::Current => "current_cmd_a",
                AmplifierKind::Voltage => "voltage_cmd_v",
                AmplifierKind::Speed => "speed_cmd_rad_s",
            },
            every: (control_rate_hz / log_rate_hz).round().max(1.0) as u64,
            ticks: 0,
            sum: 0.0,
            row: None,
            time_s: Vec::new(),
            commands: Vec::new(),
            signals: Vec::new(),
        }
    }

    /// One tick: what was measured, and the command that then acted until the next.
    pub fn tick(&mut self, time_s: f64, measured: &Signals, command: f64) {
        if self.ticks.is_multiple_of(self.every) {
            self.finish_row();
            self.row = Some((time_s, *measured));
        }
        self.ticks += 1;
        self.sum += command;
    }

    fn finish_row(&mut self) {
        if let Some((time_s, signals)) = self.row.take() {
            self.time_s.push(time_s);
            self.commands.push(self.sum / self.every as f64);
            self.signals.push(signals);
        }
        self.sum = 0.0;
    }

    /// Columns that have a value, by the recording's names.
    pub fn columns(&self) -> Vec<(String, Vec<f64>)> {
        type Get = fn(&Signals) -> f64;
        let measured: [(&str, Get); 7] = [
            ("current_a", |s| s.current_a),
            ("shaft_angle_rad", |s| s.shaft_angle_rad),
            ("shaft_speed_rad_s", |s| s.shaft_speed_rad_s),
            ("thrust_n", |s| s.thrust_n),
            ("flow_m_s", |s| s.flow_m_s),
            ("ambient_m_s", |s| s.ambient_m_s),
            ("supply_v", |s| s.supply_v),
        ];
        let commands = std::iter::once((self.command.to_owned(), self.commands.clone()));
        let columns =
            measured.iter().map(|(name, get)| ((*name).to_owned(), self.signals.iter().map(get).collect()));
        commands
            .chain(columns)
            .filter(|(_, values): &(String, Vec<f64>)| values.iter().any(|v| v.is_finite()))
            .collect()
    }
}
