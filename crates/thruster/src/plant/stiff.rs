//! The step for plants whose flow, swirl or shaft settles within a tick: a propeller in air, a very short
//! duct, a motor that its back-EMF brakes at once.
//!
//! Linearly implicit Euler steps with the derivative of the rates, one of a tick and two of half a tick,
//! extrapolated to order 2 (Deuflhard 1985, SIAM Review 27:505): stable at any stiffness, and what settles
//! within the tick is followed to where it settles. The derivative may be rough without costing order; it is
//! taken by differences where the shaft's acceleration leads: from rest, blades that do not turn yet would
//! show no slope. The shaft's own is the steeper of there and here: a drive at its limit shows no back-EMF.
//! Where hardly anything moves, one such step alone does, over several ticks at once where the caller allows it.
//! Whether a plant takes this step is settled once from the stated rig, so that a response stays smooth in the
//! parameters.

use super::drive::Course;
use super::stiffness::Stiff;
use super::{ANGLE, Balance, FLOW, OWN, Plant, Rub, SPEED, SWIRL, Tick, each};
use crate::models::ModelName;
use crate::real::Real;

/// Part of the largest speed and flow that a tick may move them by for one implicit step to do: its error is a hundredth of
/// that, and where a plant has settled every step ends at the same place.
const CALM: f64 = 1e-2;
/// Part of the largest speed and flow by which a calm plant may have moved since its derivative was taken: the loads' slopes go
/// with the speed, and a derivative that is off by a little costs no order.
const KEPT: f64 = 2e-2;
/// Part of the largest speed and flow by which one step alone may end elsewhere than it began: it is off by a third of that at
/// most, and where a slow state goes on so, by half of it in all.
const QUIET: f64 = 2e-4;
/// Step of differences, as a part of what is moved.
const DIFFERENCE: f64 = 1e-6;

/// A state, and what moves it.
#[derive(Clone, Copy)]
struct Push<T, const N: usize> {
    x: [T; N],
    rates: [T; N],
    /// What each load takes of its rate by the square of its own state.
    squares: [T; OWN],
    rub: Rub<T>,
}

impl<T: Real, const N: usize> Push<T, N> {
    /// Whether a tick moves the shaft and the water by less than a part of the largest speed and flow.
    fn moves_less(&self, part: f64, tick_s: f64, stiff: Stiff) -> bool {
        let moves = |place: usize, top: f64| self.rates[place].re().abs() * tick_s > part * top;
        !moves(SPEED, stiff.top_rad_s) && !moves(FLOW, stiff.top_m_s)
    }

    /// Whether a step from here ended close by.
    fn hardly_moved(&self, to: &[T; N], stiff: Stiff) -> bool {
        let moved = |place: usize, top: f64| (to[place] - self.x[place]).re().abs() > QUIET * top;
        !moved(SPEED, stiff.top_rad_s) && !moved(FLOW, stiff.top_m_s)
    }
}

/// Derivative of the rates, as far as it is fast: by shaft speed and axial flow of all states, and of each
/// other state by itself.
#[derive(Clone, Copy)]
pub(super) struct Slopes<T, const N: usize> {
    /// Shaft speed and axial flow at which it was taken.
    about: [f64; 2],
    by_speed: [T; N],
    by_flow: [T; N],
    by_itself: [T; N],
}

impl<T: Real, const N: usize> Slopes<T, N> {
    pub(super) const NONE: Self =
        Self { about: [0.0; 2], by_speed: [T::ZERO; N], by_flow: [T::ZERO; N], by_itself: [T::ZERO; N] };

    /// Whether the plant is still about where the derivative was taken.
    fn hold_at(&self, x: &[T], stiff: Stiff) -> bool {
        let near = |place: usize, top: f64| (x[place].re() - self.about[place]).abs() < KEPT * top;
        near(SPEED, stiff.top_rad_s) && near(FLOW, stiff.top_m_s)
    }

    /// The same of as many states as are there.
    fn resized<const M: usize>(&self) -> Slopes<T, M> {
        let as_many = |of: &[T; N]| each(|i| of.get(i).copied().unwrap_or(T::ZERO));
        Slopes {
            about: self.about,
            by_speed: as_many(&self.by_speed),
            by_flow: as_many(&self.by_flow),
            by_itself: as_many(&self.by_itself),
        }
    }
}

impl<T: Real> Plant<T> {
    /// Steps through ticks under commands in place of their own, at once where hardly anything moves and else one by one.
    pub(super) fn stiff_as<const N: usize>(
        &mut self,
        ticks: &[Tick],
        commands: Option<&[f64]>,
        stiff: Stiff,
    ) {
        if ticks.len() > 1 && self.step_quiet::<N>(ticks, commands, stiff) {
            return;
        }
        for (k, tick) in ticks.iter().enumerate() {
            self.step_stiff::<N>(tick, commands.map(|all| all[k]), stiff);
        }
    }

    /// Several ticks in one implicit step, if hardly anything moves in them; else nothing is done. Whatever keeps a memory
    /// of each tick's command has its ticks one by one.
    fn step_quiet<const N: usize>(&mut self, ticks: &[Tick], commands: Option<&[f64]>, stiff: Stiff) -> bool {
        let remembers = !self.drive_hooks.is_empty() || self.command_lag.is_some();
        if remembers || !self.slow || self.brisk || self.quantise_encoder {
            return false;
        }
        let (last, span_s) = (&ticks[ticks.len() - 1], self.tick_s * ticks.len() as f64);
        let (x, current_a): ([T; N], T) = (each(|i| self.x[i]), self.current_a);
        let drive = self.drive_over(&ticks[0], commands.map(|all| all[0]));
        if drive.speed_rad_s.is_some() || drive.at_limit.is_some() {
            return false;
        }
        let drive = self.drive_to_last((ticks, commands), drive, [x[SPEED]; 2]);
        self.x[SPEED] = x[SPEED];
        let mut balance = Balance::default();
        let whole = self.push(last, &drive, &x, 1.0, stiff, &mut balance);
        let slopes = self.slopes_kept(last, &drive, &whole, span_s, stiff);
        let to = slopes.advance(&whole, span_s, whole.rub, false);
        if !whole.hardly_moved(&to, stiff) {
            self.current_a = current_a;
            return false;
        }
        self.end_stiff(ticks, &drive, to, &mut balance);
        true
    }

    fn step_stiff<const N: usize>(&mut self, tick: &Tick, command: Option<f64>, stiff: Stiff) {
        let drive = self.drive_over(tick, command);
        let mut balance = Balance::default();
        let mut x: [T; N] = each(|i| self.x[i]);
        let ticks = std::slice::from_ref(tick);
        let whole = self.push(tick, &drive, &x, 1.0, stiff, &mut balance);
        if whole.moves_less(CALM, self.tick_s, stiff) {
            let slopes = self.slopes_kept(tick, &drive, &whole, self.tick_s, stiff);
            let imposed = drive.speed_rad_s.is_some();
            let to = slopes.advance(&whole, self.tick_s, whole.rub, imposed);
            x = if !imposed && whole.hardly_moved(&to, stiff) {
                to
            } else {
                self.stiff_part(tick, &drive, &x, (0.0, 1.0), stiff, (&whole, &slopes), &mut balance)
            };
            return self.end_stiff(ticks, &drive, x, &mut balance);
        }
        self.slopes_hold = false;
        let part = 1.0 / stiff.steps as f64;
        for step in 0..stiff.steps {
            let from = step as f64 * part;
            let until = if step + 1 == stiff.steps { 1.0 } else { from + part };
            let whole = self.push(tick, &drive, &x, until, stiff, &mut balance);
            let slopes = self.slopes_ahead(
                tick,
                &drive,
                &whole,
                (until, (until - from) * self.tick_s),
                stiff.top_rad_s,
            );
            x = self.stiff_part(tick, &drive, &x, (from, until), stiff, (&whole, &slopes), &mut balance);
        }
        self.end_stiff(ticks, &drive, x, &mut balance);
    }

    /// The derivative that the plant goes on with while it is about where it was taken.
    fn slopes_kept<const N: usize>(
        &mut self,
        tick: &Tick,
        drive: &Course<T>,
        here: &Push<T, N>,
        step_s: f64,
        stiff: Stiff,
    ) -> Slopes<T, N> {
        if !self.slopes_hold || !self.slopes.hold_at(&self.x, stiff) {
            let slopes = self.slopes_ahead(tick, drive, here, (1.0, step_s), stiff.top_rad_s);
            (self.slopes, self.slopes_hold) = (slopes.resized(), true);
        }
        self.slopes.resized()
    }

    fn end_stiff<const N: usize>(
        &mut self,
        ticks: &[Tick],
        drive: &Course<T>,
        mut x: [T; N],
        balance: &mut Balance<T>,
    ) {
        let tick = &ticks[ticks.len() - 1];
        if let Some(limit) = drive.at_limit {
            x[SPEED] = limit.no_further(x[SPEED]);
        }
        let current = self.current_at(tick, drive, 1.0, x[SPEED]);
        let mut end = self.local_at(&x, current, 1.0, tick);
        self.rates::<true, true, N>(&x, &end, balance);
        self.moving = false;
        end.current_a = drive.shown_a(end.current_a);
        self.arrive(ticks, &x, end, balance);
    }

    /// What moves a state under the inputs at a part of the tick.
    fn push<const N: usize>(
        &self,
        tick: &Tick,
        drive: &Course<T>,
        x: &[T; N],
        until: f64,
        stiff: Stiff,
        balance: &mut Balance<T>,
    ) -> Push<T, N> {
        let mut x = *x;
        x[SPEED] = drive.speed_rad_s.map_or(x[SPEED], |(a, b)| a + (b - a) * until);
        let rates = self.rates_at(tick, drive, &x, until, balance);
        let mut squares = [T::ZERO; OWN];
        squares[SPEED] = T::from(stiff.load_nm_s2) / balance.inertia_kg_m2;
        squares[FLOW] = balance.flux_kg_m / balance.added_mass_kg;
        squares[SWIRL] = self.constants.swirl.flux_kg_m / self.constants.swirl.mass_kg;
        Push { x, rates, squares, rub: Rub::of(balance) }
    }

    /// One extrapolated step between two parts of the tick, by what moves the state at its end and the derivative.
    #[expect(clippy::too_many_arguments)]
    fn stiff_part<const N: usize>(
        &self,
        tick: &Tick,
        drive: &Course<T>,
        from: &[T; N],
        (start, end): (f64, f64),
        stiff: Stiff,
        (whole, slopes): (&Push<T, N>, &Slopes<T, N>),
        balance: &mut Balance<T>,
    ) -> [T; N] {
        let step_s = (end - start) * self.tick_s;
        let rub = whole.rub;
        let advance = |push: &Push<T, N>, step_s: f64| {
            slopes.advance(push, step_s, rub.mean(push.rub), drive.speed_rad_s.is_some())
        };
        let half = self.push(tick, drive, from, 0.5 * (start + end), stiff, balance);
        let half = advance(&half, 0.5 * step_s);
        let halves = advance(&self.push(tick, drive, &half, end, stiff, balance), 0.5 * step_s);
        let whole = advance(whole, step_s);
        let mut x: [T; N] = each(|i| halves[i] * 2.0 - whole[i]);
        x[SPEED] = match drive.speed_rad_s {
            Some((a, b)) => a + (b - a) * end,
            // Held by dry friction at the end of the finer steps.
            None if halves[SPEED] == T::ZERO => T::ZERO,
            None => x[SPEED],
        };
        x
    }

    /// Derivative of the rates where the shaft is led, and of its own acceleration also here, whichever is steeper.
    fn slopes_ahead<const N: usize>(
        &self,
        tick: &Tick,
        drive: &Course<T>,
        here: &Push<T, N>,
        (end, step_s): (f64, f64),
        top_rad_s: f64,
    ) -> Slopes<T, N> {
        let mut about = here.x;
        if drive.speed_rad_s.is_some() {
            return self.slopes(tick, drive, &about, end);
        }
        let reach = T::from(top_rad_s);
        let led = about[SPEED] + (here.rates[SPEED] * step_s).clamp(-reach, reach);
        // A reversal passes rest, where nothing is fast, but does not stay there.
        let least = about[SPEED].abs();
        about[SPEED] = if led < 0.0 { led.min(-least) } else { led.max(least) };
        let mut slopes = self.slopes(tick, drive, &about, end);
        slopes.about = [here.x[SPEED].re(), here.x[FLOW].re()];

        let by = DIFFERENCE * here.x[SPEED].re().abs().max(1.0);
        let mut moved = here.x;
        moved[SPEED] = moved[SPEED] + by;
        let there = self.rates_at(tick, drive, &moved, end, &mut Balance::default());
        slopes.by_speed[SPEED] = slopes.by_speed[SPEED].min((there[SPEED] - here.rates[SPEED]) / by);
        slopes
    }

    /// Rates at a state under the inputs `part` of the tick after its start.
    fn rates_at<const N: usize>(
        &self,
        tick: &Tick,
        drive: &Course<T>,
        x: &[T; N],
        part: f64,
        balance: &mut Balance<T>,
    ) -> [T; N] {
        let at = self.local_at(x, self.current_at(tick, drive, part, x[SPEED]), part, tick);
        self.rates::<true, true, N>(x, &at, balance)
    }

    /// Derivative of the rates by differences about a state.
    fn slopes<const N: usize>(
        &self,
        tick: &Tick,
        drive: &Course<T>,
        about: &[T; N],
        part: f64,
    ) -> Slopes<T, N> {
        let mut balance = Balance::default();
        let here = self.rates_at(tick, drive, about, part, &mut balance);
        let mut difference = |moves: &dyn Fn(usize) -> bool, least: f64| {
            let by = each::<T, N>(|i| {
                T::from(if moves(i) { DIFFERENCE * about[i].re().abs().max(least) } else { 0.0 })
            });
            let moved: [T; N] = each(|i| about[i] + by[i]);
            (by, self.rates_at(tick, drive, &moved, part, &mut balance))
        };
        let mut column = |place: usize, least: f64| -> [T; N] {
            let (by, there) = difference(&|i| i == place, least);
            each(|i| (there[i] - here[i]) / by[place])
        };
        let (by_speed, by_flow) = (column(SPEED, 1.0), column(FLOW, 0.1));
        let mut by_itself = [T::ZERO; N];
        if N > OWN || self.model == ModelName::RotationalFlow {
            // The others all at once: what they do to each other is left to be followed.
            let (by, there) = difference(&|i| i > ANGLE, 0.1);
            by_itself =
                each(|i| if i > ANGLE { ((there[i] - here[i]) / by[i]).min(T::ZERO) } else { T::ZERO });
        }
        Slopes { about: [about[SPEED].re(), about[FLOW].re()], by_speed, by_flow, by_itself }
    }
}

impl<T: Real, const N: usize> Slopes<T, N> {
    /// One linearly implicit step, with dry friction at its end: `(1 - h J) (x1 - x) = h x'`.
    fn advance(
        &self,
        Push { x, rates, squares, .. }: &Push<T, N>,
        step_s: f64,
        rub: Rub<T>,
        imposed: bool,
    ) -> [T; N] {
        // Only what decays is taken implicitly; what grows is left to be followed.
        // Where the loads go with the square (`x' = f - k x|x|`), a step from rest must not pass the state in
        // which they balance, at sqrt(f/k), however little they resist at first.
        let resists =
            |slope: T, place: usize| slope.min(T::ZERO).min(-(rates[place].abs() * squares[place]).sqrt());
        let (ww, vv) = (resists(self.by_speed[SPEED], SPEED), resists(self.by_flow[FLOW], FLOW));
        // Nor may each drive the other beyond what both lose.
        let (vw, mut wv) = (self.by_speed[FLOW], self.by_flow[SPEED]);
        if wv * vw > ww * vv {
            wv = ww * vv / vw;
        }
        let (a, d) = (T::ONE - ww * step_s, T::ONE - vv * step_s);
        let det = a * d - wv * vw * (step_s * step_s);
        let mut next = *x;
        let mut speed_by = T::ZERO;
        if !imposed {
            speed_by = (d * rates[SPEED] + wv * rates[FLOW] * step_s) / det * step_s;
            // The friction's torque meets the same resistance as any other.
            let slowed = rub.slow(x[SPEED] + speed_by, d / det * step_s);
            speed_by = slowed - x[SPEED];
            next[SPEED] = slowed;
        }
        let flow_by = (rates[FLOW] + vw * speed_by) / d * step_s;
        next[FLOW] = x[FLOW] + flow_by;
        for i in ANGLE..N {
            let pushed = rates[i] + self.by_speed[i] * speed_by + self.by_flow[i] * flow_by;
            let itself = if i == SWIRL { resists(self.by_itself[i], i) } else { self.by_itself[i] };
            next[i] = x[i] + pushed / (T::ONE - itself * step_s) * step_s;
        }
        next
    }
}
