//! The usual step: Runge-Kutta of order 4, or Adams' method where ticks are known to be smooth; over several ticks at
//! once where they stay so.

use super::drive::Course as DriveCourse;
use super::{Balance, Course, Plant, Rub, SPEED, Tick, each};
use crate::real::Real;

/// Share of the shaft's speed that may go in several ticks passed at once: dry friction turns round with the speed,
/// which a long step would pass over.
const TURNS: f64 = 0.5;

impl<T: Real> Plant<T> {
    /// Steps through ticks under commands in place of their own, at once where that is allowed and else one by one.
    pub(super) fn step_as<const HOOKED: bool, const BLADE: bool, const N: usize>(
        &mut self,
        ticks: &[Tick],
        commands: Option<&[f64]>,
    ) {
        let mut from = 0;
        while from < ticks.len() {
            let drive = self.drive_over(&ticks[from], commands.map(|all| all[from]));
            let at_once =
                ticks.len() > 1 && from == 0 && self.passes::<HOOKED, N>(ticks, &drive, &each(|i| self.x[i]));
            let to = if at_once { ticks.len() } else { from + 1 };
            self.step_under::<HOOKED, BLADE, N>(&ticks[from..to], commands.map(|all| &all[from..to]), drive);
            from = to;
        }
    }

    /// Whether several smooth ticks may be passed at once here.
    #[inline(always)]
    fn passes<const HOOKED: bool, const N: usize>(
        &self,
        ticks: &[Tick],
        drive: &DriveCourse<T>,
        x: &[T; N],
    ) -> bool {
        let tick = &ticks[0];
        let begin = self.local_at(x, self.current_at(tick, drive, 0.0, x[SPEED]), 0.0, tick);
        let goes = self.last_rates[0][SPEED].re().abs() + self.last_rub.largest();
        self.foretold::<HOOKED>(tick, drive, &begin)
            && self.slow
            && drive.speed_rad_s.is_none()
            && drive.at_limit.is_none()
            && !self.quantise_encoder
            && !self.brisk
            && !self.brakes_within(tick, drive, self.tick_s * ticks.len() as f64)
            && (!HOOKED
                || self.last_rub.is_none()
                || goes * self.tick_s * (ticks.len() as f64) < TURNS * x[SPEED].re().abs())
    }

    /// Whether rates of the last step and a look ahead tell this one.
    #[inline(always)]
    fn foretold<const HOOKED: bool>(
        &self,
        tick: &Tick,
        drive: &DriveCourse<T>,
        begin: &super::Local<T>,
    ) -> bool {
        self.holds::<HOOKED>(begin)
            && tick.course != Course::Any
            && drive.speed_rad_s.is_some() == self.was_imposed
    }

    /// Whether the rates at the end of the last step are this one's at its start.
    #[inline(always)]
    fn holds<const HOOKED: bool>(&self, begin: &super::Local<T>) -> bool {
        self.moving && self.rates_may_hold && begin.continues::<HOOKED>(&self.at)
    }

    /// One step over one tick, or over several that may be passed at once, the first of which the drive is laid out for.
    #[inline(always)]
    fn step_under<const HOOKED: bool, const BLADE: bool, const N: usize>(
        &mut self,
        ticks: &[Tick],
        commands: Option<&[f64]>,
        mut drive: DriveCourse<T>,
    ) {
        let (first, last) = (&ticks[0], &ticks[ticks.len() - 1]);
        let span_s = self.tick_s * ticks.len() as f64;
        let speed = drive.speed_rad_s;
        // An imposed speed is known at each stage; dry friction acts on the way to each, held at what it is
        // at the step's start.
        let rub_of = |balance: &Balance<T>| if HOOKED { Rub::of(balance) } else { Rub::NONE };
        let settle = |x: &mut [T; N], rub: Rub<T>, part: f64| {
            if let Some((a, b)) = speed {
                x[SPEED] = a + (b - a) * part;
            } else if HOOKED {
                x[SPEED] = rub.slow(x[SPEED], T::from(part * span_s));
            }
        };
        let mut start: [T; N] = each(|i| self.x[i]);
        settle(&mut start, Rub::NONE, 0.0);
        let begin = self.local_at(&start, self.current_at(first, &drive, 0.0, start[SPEED]), 0.0, first);
        let foretold = self.foretold::<HOOKED>(first, &drive, &begin);
        let mut balance = Balance::default();
        let (k1, rub): ([T; N], Rub<T>) = if self.holds::<HOOKED>(&begin) {
            (each(|i| self.last_rates[0][i]), self.last_rub)
        } else {
            let rates = self.rates::<HOOKED, BLADE, N>(&start, &begin, &mut balance);
            (rates, rub_of(&balance))
        };
        let (mut x, end_rates) = if foretold {
            // Adams' predictor and corrector on steps of any two lengths, with one look ahead; where so little lies
            // between the two, the rates and loads there are the end's.
            let [ahead_1, ahead_0] = predictor(span_s, self.last_span_s);
            let [c2, c1, c0] = corrector(span_s, self.last_span_s);
            let k0: [T; N] = each(|i| self.last_rates[1][i]);
            let mut ahead = each(|i| start[i] + k1[i] * ahead_1 + k0[i] * ahead_0);
            settle(&mut ahead, rub, 1.0);
            drive = self.drive_to_last((ticks, commands), drive, [start[SPEED], ahead[SPEED]]);
            let there = self.local_at(&ahead, self.current_at(last, &drive, 1.0, ahead[SPEED]), 1.0, last);
            let k2 = self.rates::<HOOKED, BLADE, N>(&ahead, &there, &mut balance);
            (
                each(|i| start[i] + k2[i] * c2 + k1[i] * c1 + k0[i] * c0),
                (first.course == Course::Calm && self.slow).then_some(k2),
            )
        } else {
            // Classic Runge-Kutta of order 4.
            let local = |x: &[T; N], part: f64| {
                self.local_at(x, self.current_at(first, &drive, part, x[SPEED]), part, first)
            };
            let along = |rate: &[T; N], part: f64| {
                let mut x = each(|i| start[i] + rate[i] * (part * span_s));
                settle(&mut x, rub, part);
                x
            };
            let mut x = along(&k1, 0.5);
            let k2 = self.rates::<HOOKED, BLADE, N>(&x, &local(&x, 0.5), &mut balance);
            x = along(&k2, 0.5);
            let k3 = self.rates::<HOOKED, BLADE, N>(&x, &local(&x, 0.5), &mut balance);
            x = along(&k3, 1.0);
            let k4 = self.rates::<HOOKED, BLADE, N>(&x, &local(&x, 1.0), &mut balance);
            (each(|i| start[i] + (k1[i] + (k2[i] + k3[i]) * 2.0 + k4[i]) * (span_s / 6.0)), None)
        };
        // Over the whole step, the mean of start and end.
        settle(&mut x, rub.mean(rub_of(&balance)), 1.0);
        if let Some(limit) = drive.at_limit {
            x[SPEED] = limit.no_further(x[SPEED]);
        }
        let mut end = self.local_at(&x, self.current_at(last, &drive, 1.0, x[SPEED]), 1.0, last);
        let rates = end_rates.unwrap_or_else(|| self.rates::<HOOKED, BLADE, N>(&x, &end, &mut balance));
        for i in 0..N {
            (self.last_rates[0][i], self.last_rates[1][i]) = (rates[i], k1[i]);
        }
        self.last_rub = rub_of(&balance);
        self.last_span_s = span_s;
        (self.moving, self.was_imposed) = (true, speed.is_some());
        end.current_a = drive.shown_a(end.current_a);
        self.arrive(ticks, &x, end, &balance);
    }
}

/// What rates at the start of this step and of the one before count where the straight line through them is followed, s.
#[inline(always)]
fn predictor(span_s: f64, before_s: f64) -> [f64; 2] {
    let beyond = span_s * 0.5 * span_s / before_s;
    [span_s + beyond, -beyond]
}

/// What rates at the end of a step, at its start and at the start of the one before count under the parabola through
/// them, s: Adams and Moulton's order 3 for steps of two lengths.
#[inline(always)]
fn corrector(span_s: f64, before_s: f64) -> [f64; 3] {
    let both = 6.0 * (span_s + before_s);
    let c2 = span_s * (2.0 * span_s + 3.0 * before_s) / both;
    let c0 = -span_s.powi(3) / (both * before_s);
    [c2, span_s - c2 - c0, c0]
}

#[cfg(test)]
mod tests {
    use super::{corrector, predictor};

    #[test]
    fn steps_of_two_lengths_are_exact_for_lines_and_parabolas() {
        // Rates 1 + 2t + 3t^2 at -b, 0 and s; their integral from 0 to s.
        let rate = |t: f64| 1.0 + 2.0 * t + 3.0 * t * t;
        for (span, before) in [(0.002, 0.002), (0.01, 0.002), (0.002, 0.01)] {
            let [c2, c1, c0] = corrector(span, before);
            let sum = c2 * rate(span) + c1 * rate(0.0) + c0 * rate(-before);
            assert!((sum - (span + span * span + span.powi(3))).abs() < 1e-15);
            let [a1, a0] = predictor(span, before);
            assert!((a1 + a0 * (1.0 - 2.0 * before) - (span + span * span)).abs() < 1e-15);
        }
        let [c2, c1, c0] = corrector(12.0, 12.0);
        assert!((c2 - 5.0).abs() < 1e-12 && (c1 - 8.0).abs() < 1e-12 && (c0 + 1.0).abs() < 1e-12);
    }
}
