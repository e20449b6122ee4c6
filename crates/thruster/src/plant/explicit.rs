//! The usual step: Runge-Kutta of order 4, or Adams' method where a tick is known to be smooth.

use super::{Balance, Course, Plant, Rub, SPEED, Tick, each};
use crate::real::Real;

impl<T: Real> Plant<T> {
    pub(super) fn step_as<const HOOKED: bool, const BLADE: bool, const N: usize>(&mut self, tick: &Tick) {
        let dt = self.tick_s;
        let drive = self.drive_over(tick);
        let speed = drive.speed_rad_s;
        // An imposed speed is known at each stage; dry friction acts on the way to each, held at what it is
        // at the tick's start.
        let rub_of = |balance: &Balance<T>| if HOOKED { Rub::of(balance) } else { Rub::NONE };
        let settle = |x: &mut [T; N], rub: Rub<T>, part: f64| {
            if let Some((a, b)) = speed {
                x[SPEED] = a + (b - a) * part;
            } else if HOOKED {
                x[SPEED] = rub.slow(x[SPEED], T::from(part * dt));
            }
        };
        let local = |x: &[T; N], part: f64| {
            self.local_at(x, self.current_at(tick, &drive, part, x[SPEED]), part, tick)
        };
        let mut start: [T; N] = each(|i| self.x[i]);
        settle(&mut start, Rub::NONE, 0.0);
        let begin = local(&start, 0.0);
        let held = self.moving && self.rates_may_hold && begin.continues::<HOOKED>(&self.at);
        let mut balance = Balance::default();
        let (k1, rub): ([T; N], Rub<T>) = if held {
            (each(|i| self.last_rates[0][i]), self.last_rub)
        } else {
            let rates = self.rates::<HOOKED, BLADE, N>(&start, &begin, &mut balance);
            (rates, rub_of(&balance))
        };
        let (mut x, foretold) = if held && tick.course != Course::Any && self.slow && speed.is_none() {
            // Adams' predictor and corrector, with one look ahead; where so little lies between the two, the
            // rates and loads there are the end's.
            let k0 = &self.last_rates[1];
            let mut ahead = each(|i| start[i] + (k1[i] * 1.5 - k0[i] * 0.5) * dt);
            settle(&mut ahead, rub, 1.0);
            let k2 = self.rates::<HOOKED, BLADE, N>(&ahead, &local(&ahead, 1.0), &mut balance);
            (
                each(|i| start[i] + (k2[i] * 5.0 + k1[i] * 8.0 - k0[i]) * (dt / 12.0)),
                (tick.course == Course::Calm).then_some(k2),
            )
        } else {
            // Classic Runge-Kutta of order 4.
            let along = |rate: &[T; N], part: f64| {
                let mut x = each(|i| start[i] + rate[i] * (part * dt));
                settle(&mut x, rub, part);
                x
            };
            let mut x = along(&k1, 0.5);
            let k2 = self.rates::<HOOKED, BLADE, N>(&x, &local(&x, 0.5), &mut balance);
            x = along(&k2, 0.5);
            let k3 = self.rates::<HOOKED, BLADE, N>(&x, &local(&x, 0.5), &mut balance);
            x = along(&k3, 1.0);
            let k4 = self.rates::<HOOKED, BLADE, N>(&x, &local(&x, 1.0), &mut balance);
            (each(|i| start[i] + (k1[i] + (k2[i] + k3[i]) * 2.0 + k4[i]) * (dt / 6.0)), None)
        };
        // Over the whole tick, the mean of start and end.
        settle(&mut x, rub.mean(rub_of(&balance)), 1.0);
        let end = local(&x, 1.0);
        let rates = foretold.unwrap_or_else(|| self.rates::<HOOKED, BLADE, N>(&x, &end, &mut balance));
        for i in 0..N {
            (self.last_rates[0][i], self.last_rates[1][i]) = (rates[i], k1[i]);
        }
        self.last_rub = rub_of(&balance);
        self.moving = true;
        self.arrive(tick, &x, end, &balance);
    }
}
