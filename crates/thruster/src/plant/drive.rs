//! The drive within a tick: from the command, through the effects on it, to a motor current or an imposed
//! shaft speed at every instant of the tick.

use super::{Balance, Drive, Driven, OWN, Plant, Rub, SPEED, STATES, Tick, each};
use crate::effects::FirstOrder;
use crate::parameters::Parameter as P;
use crate::real::Real;
use crate::rig::AmplifierKind;

/// Share of a disturbance that the winding may brake away in several ticks passed at once. Whoever chose them does not know
/// that an effect holds the drive to its supply, nor how a fit moves the winding.
const BRAKES: f64 = 0.8;

/// What the drive does over one tick.
#[derive(Clone, Copy)]
pub(super) struct Course<T> {
    drive: Drive<T>,
    /// A measured current that takes the command's place, at start and end of the tick, A.
    measured_a: Option<(f64, f64)>,
    /// Whether the current depends on the speed reached within the tick: through the back-EMF.
    by_speed: bool,
    /// Current at start and end of the tick where it does not, A.
    current_a: [T; 2],
    /// Shaft speed at start and end, rad/s, where it is imposed.
    pub(super) speed_rad_s: Option<(T, T)>,
    /// A speed drive whose current falls short of what its set-point takes.
    pub(super) at_limit: Option<AtLimit<T>>,
}

/// A speed drive at its current limit: its shaft is left to that current, and goes no further than the set-point.
#[derive(Clone, Copy)]
pub(super) struct AtLimit<T> {
    /// The limit, A: positive where it drives ahead.
    current_a: T,
    /// Where the shaft would be at the tick's end if the current were there, rad/s.
    wanted_rad_s: T,
}

impl<T: Real> Course<T> {
    /// The current to show: a speed drive's own is not modelled, and at its limit alone it would tell of a drive that gives
    /// nothing else.
    #[inline(always)]
    pub(super) fn shown_a(&self, current_a: T) -> T {
        if self.at_limit.is_some() { T::ZERO } else { current_a }
    }
}

impl<T: Real> AtLimit<T> {
    /// A speed that this current came to, or the one wanted where it came past that.
    #[inline(always)]
    pub(super) fn no_further(&self, speed_rad_s: T) -> T {
        if self.current_a > T::ZERO {
            speed_rad_s.min(self.wanted_rad_s)
        } else {
            speed_rad_s.max(self.wanted_rad_s)
        }
    }
}

impl<T: Real> Plant<T> {
    /// Has the stated lag of the drive act on what is commanded, as where a speed controller ramps its duty, and not on the
    /// current that follows.
    pub fn with_lag_on_command(mut self, on: bool) -> Self {
        self.command_lag = on.then(FirstOrder::new);
        self
    }

    /// Runs the effects on the drive and lays out a tick under a command, in place of the tick's own.
    #[inline(always)]
    pub(super) fn drive_over(&mut self, tick: &Tick, command: Option<f64>) -> Course<T> {
        let mut drive = Drive {
            command: T::from(command.unwrap_or(tick.command)),
            current_limit_a: self.parameters.get(P::CurrentLimitA),
            time_constant_s: self.parameters.get(P::TimeConstantS),
            supply_v: T::from(tick.supply_v.unwrap_or(self.nominal_supply_v)),
            resistance_ohm: self.constants.resistance_ohm,
            back_emf_v: self.constants.torque_constant_nm_a * self.x[SPEED],
            freewheels: T::ZERO,
            shaft_speed_rad_s: self.x[SPEED],
            current_a: self.current_a,
            voltage_limited: false,
        };
        for i in &self.drive_hooks {
            self.effects[*i].effect.drive(tick, &mut drive);
        }
        if let Some(lag) = &mut self.command_lag {
            drive.command = lag.mean_of_held(drive.command, drive.time_constant_s, self.tick_s);
            drive.time_constant_s = T::ZERO;
        }
        let commanded = tick.driven == Driven::Command && !tick.released;
        let by_speed = match (tick.driven, self.amplifier) {
            (Driven::Power(..), _) => !tick.released,
            (_, AmplifierKind::Voltage) => commanded,
            (_, AmplifierKind::Current) => commanded && drive.voltage_limited,
            (_, AmplifierKind::Speed) => false,
        };
        let (speed_rad_s, at_limit) = match self.amplifier {
            AmplifierKind::Speed if commanded => {
                let (now, tau) = (self.x[SPEED], drive.time_constant_s);
                let left = if tau > 0.0 { (T::from(-self.tick_s) / tau).exp() } else { T::ZERO };
                let wanted = drive.command + (now - drive.command) * left;
                let at_limit = self.at_limit(tick, wanted, drive.current_limit_a);
                (at_limit.is_none().then_some((now, wanted)), at_limit)
            }
            _ => (tick.driven_speed().map(|(a, b)| (T::from(a), T::from(b))), None),
        };
        let measured_a = match tick.driven {
            Driven::Current(a, b) => Some(command.map_or((a, b), |mean| (mean, mean))),
            _ => None,
        };
        let mut course =
            Course { drive, measured_a, by_speed, current_a: [T::ZERO; 2], speed_rad_s, at_limit };
        self.lay_out(tick, &mut course);
        course
    }

    /// Whether a speed drive's current brings its shaft to a speed within the tick. What water, load and dry friction take at
    /// the tick's start is taken first.
    fn at_limit(&self, tick: &Tick, wanted_rad_s: T, limit_a: T) -> Option<AtLimit<T>> {
        if !limit_a.re().is_finite() {
            return None;
        }
        let now = self.x[SPEED];
        let mut balance = Balance::default();
        let unpowered = if self.used_states <= OWN {
            self.unpowered::<OWN>(tick, &mut balance)
        } else {
            self.unpowered::<STATES>(tick, &mut balance)
        };
        let short = (wanted_rad_s - now) / self.tick_s - unpowered;
        let rub = Rub::of(&balance).slow(now, T::from(self.tick_s)) - now;
        let short_a =
            (short - rub / self.tick_s) * balance.inertia_kg_m2 / self.constants.torque_constant_nm_a;
        let current_a = short_a.clamp(-limit_a, limit_a);
        (current_a != short_a).then_some(AtLimit { current_a, wanted_rad_s })
    }

    /// Acceleration of the shaft where no current drives it, rad/s^2.
    fn unpowered<const N: usize>(&self, tick: &Tick, balance: &mut Balance<T>) -> T {
        let x: [T; N] = each(|i| self.x[i]);
        let at = self.local_at(&x, T::ZERO, 0.0, tick);
        self.rates::<true, true, N>(&x, &at, balance)[SPEED]
    }

    /// Whether the winding, under a voltage that stands, brakes the shaft within this time.
    #[inline(always)]
    pub(super) fn brakes_within(&self, tick: &Tick, course: &Course<T>, span_s: f64) -> bool {
        let kt = self.constants.torque_constant_nm_a.re();
        let resists = course.drive.resistance_ohm.re() * self.constants.inertia_kg_m2.re();
        course.by_speed && tick.driven == Driven::Command && kt * kt * span_s > BRAKES * resists
    }

    /// The currents of a tick, where no speed is needed for them.
    #[inline(always)]
    fn lay_out(&self, tick: &Tick, course: &mut Course<T>) {
        if !course.by_speed {
            course.current_a = [0.0, 1.0].map(|part| self.current_path(tick, course, part, T::ZERO));
        }
    }

    /// Runs the drive through ticks of which the first is laid out, while the shaft goes straight from one speed to
    /// another: the last one's layout, with the current at its start in place.
    #[inline(always)]
    pub(super) fn drive_to_last(
        &mut self,
        (ticks, commands): (&[Tick], Option<&[f64]>),
        first: Course<T>,
        [from, to]: [T; 2],
    ) -> Course<T> {
        let mut course = first;
        let count = ticks.len() as f64;
        let command = |k: usize| commands.map(|all| all[k]);
        for (k, pair) in ticks.windows(2).enumerate() {
            let speed = from + (to - from) * ((k as f64 + 1.0) / count);
            self.current_a = self.current_at(&pair[0], &course, 1.0, speed);
            let (tick, command) = (&pair[1], command(k + 1));
            if self.drive_hooks.is_empty() && !course.by_speed && course.measured_a.is_none() {
                // The same drive under another command.
                course.drive.command = T::from(command.unwrap_or(tick.command));
                self.lay_out(tick, &mut course);
            } else {
                self.x[SPEED] = speed;
                course = self.drive_over(tick, command);
            }
        }
        course
    }

    /// Motor current, A, `part` of the tick after its start, where the shaft has this speed.
    #[inline(always)]
    pub(super) fn current_at(&self, tick: &Tick, course: &Course<T>, part: f64, speed_rad_s: T) -> T {
        if course.by_speed || part != 0.0 && part != 1.0 {
            self.current_path(tick, course, part, speed_rad_s)
        } else {
            course.current_a[part as usize]
        }
    }

    /// Motor current, A, that takes this electrical power at this speed: `P = (R i + kt |Om|) i`. A shaft that is
    /// turned against the power adds no voltage of its own.
    fn current_of_power(&self, power_w: f64, resistance_ohm: T, speed_rad_s: T) -> T {
        let ahead = 1.0_f64.copysign(power_w);
        let back_emf_v = (self.constants.torque_constant_nm_a * speed_rad_s * ahead).max(T::ZERO);
        let drop_v2 = resistance_ohm.max(T::from(1e-9)) * (4.0 * power_w.abs());
        // At no power and at rest there is no current, and the root has no slope.
        let root_v = (back_emf_v * back_emf_v + drop_v2 + T::from(1e-12)).sqrt();
        T::from(2.0 * power_w) / (back_emf_v + root_v)
    }

    #[inline(always)]
    fn current_path(&self, tick: &Tick, course: &Course<T>, part: f64, speed_rad_s: T) -> T {
        let drive = &course.drive;
        if let Some((a, b)) = course.measured_a {
            return T::from(a + (b - a) * part);
        }
        // Open terminals: no current, and so no braking by the back-EMF.
        if tick.released {
            return T::ZERO;
        }
        if let Driven::Power(a, b) = tick.driven {
            return self.current_of_power(a + (b - a) * part, drive.resistance_ohm, speed_rad_s);
        }
        // A speed drive's shaft follows the command through the lag, and no current is modelled, but at its limit.
        if self.amplifier == AmplifierKind::Speed {
            return course.at_limit.map_or(T::ZERO, |limit| limit.current_a);
        }
        let lagging = drive.time_constant_s > 0.0;
        if lagging && part == 0.0 {
            return self.current_a;
        }
        // Without a lag the current follows the back-EMF; with one, it has followed its mean so far.
        let gained = (speed_rad_s - drive.shaft_speed_rad_s) * self.constants.torque_constant_nm_a;
        let back_emf_v = drive.back_emf_v + if lagging { gained * 0.5 } else { gained };
        let r = drive.resistance_ohm.max(T::from(1e-9));
        let target = match self.amplifier {
            AmplifierKind::Current => drive.command,
            // (10)-(12) with the inductance neglected; the lag then stands for L/R and the stage.
            AmplifierKind::Voltage => (drive.command - felt_emf_v(drive, back_emf_v)) / r,
            // Told above.
            AmplifierKind::Speed => T::ZERO,
        };
        let mut target = target.clamp(-drive.current_limit_a, drive.current_limit_a);
        if drive.voltage_limited {
            // |R i + ke Om| <= V: what the bus can push through the winding at this speed.
            target = target.clamp(
                ((-drive.supply_v - back_emf_v) / r).min(T::ZERO),
                ((drive.supply_v - back_emf_v) / r).max(T::ZERO),
            );
        }
        if !lagging {
            return target;
        }
        // The stated lag's decay is at hand; an effect may have changed the lag, or its derivative alone.
        let (stated, half, full) = self.decays.drive;
        let left = if drive.time_constant_s != stated || !drive.time_constant_s.same_slopes(stated) {
            (T::from(-part * self.tick_s) / drive.time_constant_s).exp()
        } else if part == 0.5 {
            half
        } else if part == 1.0 {
            full
        } else {
            (T::from(-part * self.tick_s) / stated).exp()
        };
        target + (self.current_a - target) * left
    }
}

/// Back-EMF that a voltage drive's current feels, V: through diodes it drives none against the command's own voltage.
#[inline(always)]
fn felt_emf_v<T: Real>(drive: &Drive<T>, back_emf_v: T) -> T {
    let brakes = drive.freewheels == T::ZERO && drive.freewheels.same_slopes(T::ZERO);
    if brakes {
        return back_emf_v;
    }
    let most = drive.command.abs();
    back_emf_v + (back_emf_v.clamp(-most, most) - back_emf_v) * drive.freewheels
}
