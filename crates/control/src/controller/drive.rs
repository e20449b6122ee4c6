//! Between the law and the drive: what is measured as an ideal plant would show it, limits on the current, and the
//! command that gives it.

use kort_thruster::rig::AmplifierKind;

use super::{Controller, Mode, SENT};
use crate::known::OperatingPoint;
use crate::limits::{Limit, LimitSet};
use crate::mismatch::Seen;
use crate::signals::{DriveCommand, Estimate, Measurement};

impl Controller {
    /// The measurement as ideal sensors would show it, the supply that the drive was told, and the current, A, that
    /// an ideal motor had over the last period.
    pub(super) fn ideal(&mut self, raw: &Measurement, dt: f64) -> (Measurement, Option<f64>, f64) {
        let last = self.estimate;
        let mut measured = self.known.measured(raw, last.as_ref(), &self.model);
        let shown_a = measured.current_a;
        let actual_a = self.drive_current(&measured, dt);
        if self.known.advance(&measured, last.as_ref(), actual_a, dt) {
            self.model.ambient_mean_m_s = self.known.ambient_m_s();
        }
        let current_a = self.known.ideal_a(&self.model, actual_a);
        measured.current_a = measured.current_a.map(|_| current_a);
        let flow = last.map_or(0.0, |l| l.flow_m_s.value);
        measured.thrust_n = measured.thrust_n.map(|t| self.model.blade_thrust_n(t, flow));
        let at = OperatingPoint {
            supply_v: raw.supply_v,
            current_a: actual_a,
            shaft_speed_rad_s: last.map_or(0.0, |l| l.shaft_speed_rad_s.value),
        };
        if let Some(reach) = self.known.reach(at) {
            measured.supply_v = Some(reach.supply_v).filter(|v| v.is_finite());
        }
        self.monitor.tick(&Seen {
            model: &self.nominal,
            measured: &measured,
            drive_a: shown_a.map(|shown| (self.reached_a(), shown)),
            driving: self.mode != Mode::Off,
            dt_s: dt,
        });
        (measured, raw.supply_v, current_a)
    }

    /// The estimate as it is reported: thrust as stand or hull feel it.
    pub(super) fn felt(&self, mut estimate: Estimate) -> Estimate {
        let thrust = &mut estimate.thrust_n;
        thrust.value = self.model.net_thrust_n(thrust.value, estimate.flow_m_s.value);
        estimate
    }

    pub(super) fn send(&mut self, current_a: f64) {
        self.newest = (self.newest + 1) % SENT;
        self.sent_a[self.newest] = current_a;
    }

    /// What was asked of the drive and has reached it, A.
    pub(super) fn reached_a(&self) -> f64 {
        let ago = ((self.model.delay_s / self.stated.period_s).round() as usize).min(SENT - 1);
        self.sent_a[(self.newest + SENT - ago) % SENT]
    }

    /// Motor current over the last period: measured, or the command that has reached the drive behind its lag.
    pub(super) fn drive_current(&mut self, measured: &Measurement, dt: f64) -> f64 {
        let lag = self.model.amplifier_lag_s;
        let reached = self.reached_a();
        self.drive_a += (reached - self.drive_a) * dt / (lag + dt);
        if let Some(current) = measured.current_a {
            self.drive_a = current;
        }
        self.drive_a
    }

    /// Magnitude, supply, overspeed and rate, in that order; the rate last, as the drive sees it.
    pub(super) fn limit_current(
        &mut self,
        asked_a: f64,
        speed: f64,
        measured: &Measurement,
        dt: f64,
        limits: &mut LimitSet,
    ) -> f64 {
        let model = &self.model;
        let mut current = asked_a.clamp(-model.current_limit_a, model.current_limit_a);
        if current != asked_a {
            limits.set(Limit::Current);
        }
        if let (Some(r), Some(supply)) = (model.winding_resistance_ohm, measured.supply_v.or(model.supply_v))
            && r > 0.0
        {
            let emf = model.torque_constant_nm_a * speed;
            let inside = current.clamp(((-supply - emf) / r).min(0.0), ((supply - emf) / r).max(0.0));
            if inside != current {
                limits.set(Limit::Voltage);
                current = inside;
            }
        }
        let cap = self.config.limits.overspeed * model.speed_max_rad_s;
        let span = 0.1 * cap;
        if speed.abs() > cap - span && current * speed > 0.0 {
            let share = ((cap - speed.abs()) / span).clamp(0.0, 1.0);
            let most = share * model.current_limit_a;
            if current.abs() > most {
                current = most.copysign(current);
                limits.set(Limit::ShaftSpeed);
            }
        }
        let rate = self.config.limits.current_rate_per_s * model.current_limit_a;
        let (current, limited) = self.current_rate.step(current, rate, dt);
        if limited {
            limits.set(Limit::CurrentRate);
        }
        current
    }

    /// What the drive is told: what it turns into this current, voltage or speed, carried over from the last command
    /// after a switch. Whatever the switch changed between law and drive, the drive sees no step.
    pub(super) fn command(
        &mut self,
        current_a: f64,
        target: f64,
        measured: &Measurement,
        supply_v: Option<f64>,
        dt: f64,
        limits: &mut LimitSet,
    ) -> DriveCommand {
        let model = &self.model;
        let resistance = model.winding_resistance_ohm.unwrap_or(0.0);
        // The back-EMF is that of the speed itself, not of what its filter shows later.
        let speed = self.estimate.map_or(0.0, |e| e.shaft_speed_rad_s.value);
        let at = OperatingPoint { supply_v, current_a: self.drive_a, shaft_speed_rad_s: speed };
        let (wanted, most) = match model.amplifier {
            // A limit that came down is met at the rate of the current, which is held already.
            AmplifierKind::Current => (current_a, model.current_limit_a.max(current_a.abs())),
            AmplifierKind::Voltage => {
                let wanted = resistance * current_a + model.torque_constant_nm_a * speed;
                let supply = measured.supply_v.or(model.supply_v).unwrap_or(f64::INFINITY);
                if wanted.abs() > supply {
                    limits.set(Limit::Voltage);
                }
                let voltage =
                    if current_a == 0.0 && target == 0.0 { 0.0 } else { wanted.clamp(-supply, supply) };
                (voltage, supply_v.or(self.stated_supply_v).unwrap_or(f64::INFINITY))
            }
            AmplifierKind::Speed => {
                (target.clamp(-model.speed_max_rad_s, model.speed_max_rad_s), model.speed_max_rad_s)
            }
        };
        let asked = self.known.command(wanted, at);
        let carried = self.drive_bumpless.step(asked, self.commanded, self.config.limits.fade_s, dt);
        let command = carried.clamp(-most, most);
        self.commanded = command;
        let amplifier = model.amplifier;
        // While it fades the drive gives by so much another current than the law's.
        let beside = if carried == asked { 0.0 } else { self.known.given(command, at) - wanted };
        self.send(match amplifier {
            AmplifierKind::Current => current_a + beside,
            AmplifierKind::Voltage if resistance > 0.0 => current_a + beside / resistance,
            AmplifierKind::Voltage | AmplifierKind::Speed => current_a,
        });
        match amplifier {
            AmplifierKind::Current => DriveCommand { current_a: command, ..DriveCommand::default() },
            AmplifierKind::Voltage => DriveCommand { current_a, voltage_v: Some(command), speed_rad_s: None },
            AmplifierKind::Speed => DriveCommand { current_a, voltage_v: None, speed_rad_s: Some(command) },
        }
    }
}
