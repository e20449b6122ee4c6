//! The servo's pure step: newest command and measurements in, drive and telemetry out.

use kort_proto::faults::{Fault, Names};
use kort_proto::messages::{
    Command, DriveKind, Fresh, Freshness, Outcome, Process, REQUEST_LIFE_NS, Reply, Request, RequestKind,
    Telemetry, Trip,
};
use kort_proto::signals::Signals;

use crate::guard::Guard;
use crate::settings::Settings;

/// State of the servo. Starts disarmed at zero.
#[derive(Clone, Copy, Debug)]
pub struct Servo {
    settings: Settings,
    guard: Guard,
    started_ns: u64,
    fresh: Freshness,
    command: Command,
    armed: bool,
    armed_at_ns: u64,
    latched: u64,
    /// Faults of drive and sensor sources whose cause is there now.
    devices: u64,
    /// The last stop nobody asked for.
    tripped: Trip,
    /// What the shaft did last while armed; becomes `tripped` with the stop.
    before: Trip,
    limits: u64,
    drive: f64,
    invalid: u64,
    stale: u64,
    /// Faults that commands raised since the last tick.
    raised: u64,
}

/// What one tick sees.
#[derive(Clone, Copy, Debug)]
pub struct Inputs<'a> {
    /// The tick's instant on CLOCK_MONOTONIC, ns.
    pub now_ns: u64,
    /// Periods since the last tick: one, and more after missed ones.
    pub ticks: u64,
    /// What the sensors show.
    pub measured: &'a Signals,
    /// What drive and sensor sources report, bits of [`Fault`].
    pub devices: u64,
}

/// Faults of devices that show nothing while they last.
const NOT_TELLING: u64 = Fault::DriveLost.bit() | Fault::DriveUnguarded.bit() | Fault::SensorLost.bit();

impl Servo {
    /// A servo at rest; `started_ns` is now on CLOCK_MONOTONIC: nothing sent before counts.
    pub fn new(settings: Settings, started_ns: u64) -> Self {
        Self {
            settings,
            guard: Guard::new(settings.limits, settings.period_ns as f64 * 1e-9),
            started_ns,
            fresh: Freshness::default(),
            command: Command::default(),
            armed: false,
            armed_at_ns: 0,
            latched: 0,
            devices: 0,
            tripped: Trip::default(),
            before: Trip::default(),
            limits: 0,
            drive: 0.0,
            invalid: 0,
            stale: 0,
            raised: 0,
        }
    }

    /// With what a predecessor left: its latched faults, and the stop that ended it. They outlive the process
    /// until somebody clears them.
    pub fn with_latched(self, latched: u64, tripped: Trip) -> Self {
        Self { latched, tripped, ..self }
    }

    /// Is the drive's output on?
    pub fn armed(&self) -> bool {
        self.armed
    }

    /// Latched faults.
    pub fn faults(&self) -> u64 {
        self.latched
    }

    /// One tick. Returns the drive for the amplifier; `None` means output stage off.
    pub fn tick(&mut self, inputs: &Inputs) -> Option<f64> {
        let mut faults = self.guard.inspect(inputs.measured, self.drive, inputs.ticks);
        // What a device does not tell that is away, or not to be driven, is no sensor's fault.
        if inputs.devices & NOT_TELLING != 0 {
            faults &= !Fault::SensorNotFinite.bit();
        }
        faults |= inputs.devices;
        self.devices = inputs.devices;
        faults |= std::mem::take(&mut self.raised);
        // The following are faults only while the drive is on.
        if self.armed {
            if inputs.ticks.saturating_mul(self.settings.period_ns) > self.settings.command_timeout_ns {
                faults |= Fault::LoopStalled.bit();
            }
            if inputs.now_ns.saturating_sub(self.command.header.stamp_ns) > self.settings.command_timeout_ns {
                faults |= Fault::CommandTimeout.bit();
            }
        }
        self.latched |= faults;
        if self.armed {
            self.remember(inputs);
        }
        if self.latched != 0 || self.command.stop != 0 {
            if self.armed {
                self.tripped = Trip { at_ns: inputs.now_ns, ..self.before };
            }
            self.armed = false;
        }
        if !self.armed {
            self.drive = 0.0;
            self.limits = 0;
            return None;
        }
        (self.drive, self.limits) = self.guard.limit(self.command.drive, self.drive);
        Some(self.drive)
    }

    /// Notes what the shaft does, for the record of a stop; a sensor that shows nothing leaves its last word.
    fn remember(&mut self, inputs: &Inputs) {
        let keep = |value: f64, last: f64| if value.is_finite() { value } else { last };
        self.before.thrust_n = keep(inputs.measured.thrust_n, self.before.thrust_n);
        self.before.shaft_speed_rad_s =
            keep(inputs.measured.shaft_speed_rad_s, self.before.shaft_speed_rad_s);
        self.before.drive = self.drive;
    }

    /// The process is about to end: the next tick is at zero, disarmed. An armed drive was not asked for that.
    pub fn end(&mut self) {
        if self.armed {
            self.raised |= Fault::ServoRestarted.bit();
        }
    }

    /// Zero and disarmed at once.
    fn stop(&mut self) {
        self.armed = false;
        self.drive = 0.0;
    }

    /// The newest command received since the last tick; before the requests that came with it, for a controller that
    /// has answered one has sent what follows from it.
    pub fn take_command(&mut self, command: &Command, now_ns: u64) {
        self.raised |= self.take(command, now_ns);
    }

    /// Takes a command if it is new and sound. Returns the faults it raises.
    fn take(&mut self, command: &Command, now_ns: u64) -> u64 {
        let sender = self.fresh.check(&command.header, now_ns, self.settings.command_timeout_ns);
        if sender == Fresh::No {
            self.stale = self.stale.wrapping_add(1);
            return 0;
        }
        let sound = command.drive.is_finite()
            && command.drive.abs() <= self.guard.limits().drive_max * (1.0 + 1e-9)
            && DriveKind::from_u32(command.kind) == Some(self.guard.limits().kind);
        if !sound {
            self.invalid = self.invalid.wrapping_add(1);
            return if self.armed { Fault::CommandInvalid.bit() } else { 0 };
        }
        let before = std::mem::replace(&mut self.command, *command);
        let replaced = sender == Fresh::NewSession;
        let ends = replaced || command.stop == Command::ENDS;
        // Faults stop whoever has them latched: they do not go with it.
        let forgets = replaced && before.stop == Command::STOPS && command.stop == 0;
        if (self.armed && ends) || forgets { Fault::ControllerRestarted.bit() } else { 0 }
    }

    /// Acts on a request; `None` if it is not for the servo. One that is too old to be meant for now is refused, but
    /// for a disarming: that is always meant.
    pub fn request(&mut self, request: &Request, now_ns: u64) -> Option<Reply> {
        let sent = request.header.stamp_ns;
        let old = sent < self.started_ns || now_ns.saturating_sub(sent) > REQUEST_LIFE_NS;
        let answer =
            |outcome, words: std::fmt::Arguments| Some(Reply::to(request, Process::Servo, outcome, words));
        match RequestKind::from_u32(request.kind)? {
            RequestKind::SetController
            | RequestKind::SetRig
            | RequestKind::Rest
            | RequestKind::StandAside => None,
            RequestKind::Disarm => {
                self.stop();
                answer(Outcome::Done, format_args!("disarmed"))
            }
            _ if old => answer(Outcome::Refused, format_args!("it was given too long ago; hint: ask again")),
            RequestKind::Arm if self.armed => answer(Outcome::Done, format_args!("armed already")),
            RequestKind::Arm if self.latched != 0 => answer(
                Outcome::Refused,
                format_args!(
                    "faults are latched: {}; hint: remove the cause, then clear-faults",
                    Names(self.latched)
                ),
            ),
            RequestKind::Arm
                if now_ns.saturating_sub(self.command.header.stamp_ns) > self.settings.command_timeout_ns =>
            {
                answer(
                    Outcome::Refused,
                    format_args!("no controller sends commands; hint: see the controller's log"),
                )
            }
            RequestKind::Arm if self.command.stop != 0 => answer(
                Outcome::Refused,
                format_args!("the controller says stop; hint: see its faults, then clear-faults"),
            ),
            RequestKind::Arm if self.command.drive != 0.0 => answer(
                Outcome::Refused,
                format_args!("the controller does not ask for zero; hint: set the setpoint to zero first"),
            ),
            RequestKind::Arm => {
                self.armed = true;
                self.armed_at_ns = now_ns;
                self.before = Trip { thrust_n: f64::NAN, shaft_speed_rad_s: f64::NAN, ..Trip::default() };
                answer(Outcome::Done, format_args!("armed"))
            }
            RequestKind::ClearFaults => {
                // What is latched and still there stays.
                self.latched &= self.guard.active() | self.devices;
                if self.latched == 0 {
                    answer(Outcome::Done, format_args!("no faults"))
                } else {
                    answer(
                        Outcome::Refused,
                        format_args!("the cause is still there: {}", Names(self.latched)),
                    )
                }
            }
        }
    }

    /// The tick's telemetry, without header and timing: measured signals with the commands that
    /// act from this tick on.
    pub fn telemetry(&self, time_ns: u64, measured: &Signals) -> Telemetry {
        let kind = self.guard.limits().kind;
        let commanded = |k: DriveKind| if k == kind { self.drive } else { f64::NAN };
        let asked = |value: f64| if self.armed { value } else { f64::NAN };
        let signals = Signals {
            current_cmd_a: commanded(DriveKind::Current),
            voltage_cmd_v: commanded(DriveKind::Voltage),
            duty_cmd: commanded(DriveKind::Duty),
            speed_cmd_rad_s: if kind == DriveKind::Speed {
                self.drive
            } else {
                asked(self.command.speed_cmd_rad_s)
            },
            thrust_cmd_n: asked(self.command.thrust_cmd_n),
            ..*measured
        };
        Telemetry {
            time_ns,
            signals,
            faults: self.latched,
            limits: self.limits,
            armed: u32::from(self.armed),
            drive_kind: kind as u32,
            armed_at_ns: self.armed_at_ns,
            command_sequence: self.command.header.sequence,
            command_stamp_ns: self.command.header.stamp_ns,
            command_telemetry_stamp_ns: self.command.telemetry_stamp_ns,
            commands_invalid: self.invalid,
            commands_stale: self.stale,
            thermal_load: self.guard.thermal_load(),
            drive_max: self.guard.limits().drive_max,
            tripped: self.tripped,
            ..Telemetry::default()
        }
    }
}

#[cfg(test)]
mod tests;
