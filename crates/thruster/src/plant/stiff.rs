//! The step for plants whose flow, swirl or shaft settles within a tick: a propeller in air, a very short
//! duct, a motor that its back-EMF brakes at once.
//!
//! Linearly implicit Euler steps with the derivative of the rates, one of a tick and two of half a tick,
//! extrapolated to order 2 (Deuflhard 1985, SIAM Review 27:505): stable at any stiffness, and what settles
//! within the tick is followed to where it settles. The derivative may be rough without costing order; it is
//! taken by differences where the shaft's acceleration leads: from rest, blades that do not turn yet would
//! show no slope. The shaft's own is the steeper of there and here: a drive at its limit shows no back-EMF.
//! Whether a plant takes this step is settled once from the stated rig, so that a response stays smooth in the
//! parameters.

use super::drive::Course;
use super::{ANGLE, Balance, FLOW, OWN, Plant, Rub, SPEED, SWIRL, Tick, each};
use crate::blade::{BladeRow, Swirl};
use crate::models::{DriveInput, Model, Model2, ModelName};
use crate::parameters::{Parameter as P, Parameters};
use crate::real::Real;
use crate::rig::{AmplifierKind, Rig};

/// Largest product of decay rate and tick that explicit steps are left to: they stay stable to 2.8, and a
/// fit may move inertia and masses to a third of what is stated.
const EXPLICIT: f64 = 0.9;

/// The same of a part of the inertia that moves by itself: stable, with some room.
const STABLE: f64 = 2.0;
/// Part of the slower decay that one implicit step may take: the loads go with the square of the speed, and a
/// straight line through them leads far off where the speed changes by more than itself.
const RESOLVED: f64 = 0.4;
/// Part of the faster decay, back-EMF and flow together, that one implicit step may pass over, for the same reason
/// at a jump from rest.
const PASSED: f64 = 10.0;
/// Most implicit steps a tick.
const MOST_STEPS: f64 = 64.0;
/// Part of the largest speed and flow that a tick may move them by for one implicit step to do: its error is a hundredth of
/// that, and where a plant has settled every step ends at the same place.
const CALM: f64 = 1e-2;
/// Part of the largest speed and flow by which a calm plant may have moved since its derivative was taken: the loads' slopes go
/// with the speed, and a derivative that is off by a little costs no order.
const KEPT: f64 = 2e-2;
/// Step of differences, as a part of what is moved.
const DIFFERENCE: f64 = 1e-6;

/// Blade tip speed that bounds a rig whose drive states no limit, m/s: cavitation in water, sound in air.
const TIP_M_S: (f64, f64) = (25.0, 250.0);
/// Density below which a rig is taken to run in a gas, kg/m^3.
const GAS_KG_M3: f64 = 100.0;

/// What the implicit step needs to know of the stated rig.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stiff {
    /// Largest shaft speed, rad/s.
    pub(super) top_rad_s: f64,
    /// Largest axial flow, m/s: in bollard pull.
    pub(super) top_m_s: f64,
    /// Blade torque over its square, N m s^2; zero without blades.
    load_nm_s2: f64,
    /// Steps a tick that moves: as many as its slower decay asks for.
    pub(super) steps: usize,
}

impl Stiff {
    /// For a rig that is too stiff for explicit steps at its stated values and largest speed, where no less than
    /// a share of its inertia moves by itself.
    pub(super) fn of(model: ModelName, rig: &Rig, tick_s: f64, lightest_share: f64) -> Option<Self> {
        let p = Parameters::stated(rig);
        let mut shaft_1_s = p.get(P::ViscousFrictionNmS) / p.get(P::InertiaKgM2);
        let ohm = p.get(P::WindingResistanceOhm);
        if rig.amplifier.kind == AmplifierKind::Voltage && ohm > 0.0 {
            shaft_1_s += p.get(P::TorqueConstantNmA).powi(2) / (ohm * p.get(P::InertiaKgM2));
        }
        let top_rad_s = top_speed_rad_s(rig, &p);
        let (fast_1_s, slow_1_s) = match model {
            _ if rig.propeller.is_none() => (0.0, 0.0),
            ModelName::Model0 | ModelName::Model1 => (0.0, 0.0),
            ModelName::RotationalFlow => {
                let (fast_1_s, slow_1_s) = wet_1_s(&p, top_rad_s);
                (fast_1_s.max(swirl_1_s(&p, top_rad_s)), slow_1_s)
            }
            _ => wet_1_s(&p, top_rad_s),
        };
        let steps = (slow_1_s * tick_s / RESOLVED).max((fast_1_s + shaft_1_s) * tick_s / PASSED);
        let steps = steps.ceil().clamp(1.0, MOST_STEPS);
        let rate = (shaft_1_s + fast_1_s) * tick_s;
        (rate > EXPLICIT || rate > STABLE * lightest_share).then_some(Self {
            top_rad_s,
            top_m_s: if rig.propeller.is_some() { bollard_flow_m_s(&p, top_rad_s) } else { 0.0 },
            load_nm_s2: if rig.propeller.is_some() { p.bollard_coefficients().1 } else { 0.0 },
            steps: steps as usize,
        })
    }
}

/// Faster and slower decay of shaft speed and flow at a shaft speed, 1/s: in bollard pull, and the faster one
/// also in still water, where the blades pull hardest.
fn wet_1_s(p: &Parameters, speed_rad_s: f64) -> (f64, f64) {
    let model = Model2::new(p);
    let rates = |x: [f64; 2]| model.rates(&x, &DriveInput::torque(0.0));
    let slopes = |x: [f64; 2]| -> [[f64; 2]; 2] {
        let here = rates(x);
        let by = x.map(|x| 1e-6 * x.abs().max(1e-6));
        let there = [rates([x[0] + by[0], x[1]]), rates([x[0], x[1] + by[1]])];
        std::array::from_fn(|i| std::array::from_fn(|j| (there[j][i] - here[i]) / by[j]))
    };
    let bollard = model.rough_steady_state(&DriveInput::torque(1.0));
    let steady = slopes([speed_rad_s, speed_rad_s * bollard[1] / bollard[0]]);
    let [[a, b], [c, d]] = steady;
    let settled = fastest_1_s(steady);
    let still = [speed_rad_s, 0.0];
    // Where the water is drawn in by F and carried off by k v^2, it settles at 2 sqrt(F k).
    let drawn =
        2.0 * (rates(still)[1].abs() * model.momentum.flux_kg_m / model.momentum.added_mass_kg).sqrt();
    let onset = fastest_1_s(slopes(still)).max(drawn);
    (settled.max(onset), ((a * d - b * c) / settled).abs())
}

/// Decay of the swirl in bollard pull, washed out and resisted by the blades, 1/s.
fn swirl_1_s(p: &Parameters, speed_rad_s: f64) -> f64 {
    let (row, swirl) = (BladeRow::new(p), Swirl::new(p));
    let flow = bollard_flow_m_s(p, speed_rad_s);
    let rate = |us: f64| {
        let load = row.load(row.lever_m * speed_rad_s - us, flow);
        swirl.acceleration(load.torque_n_m, flow, us, 0.0)
    };
    let by = 1e-6 * row.lever_m * speed_rad_s;
    ((rate(by) - rate(0.0)) / by).abs()
}

/// Axial flow in bollard pull, m/s.
fn bollard_flow_m_s(p: &Parameters, speed_rad_s: f64) -> f64 {
    let (thrust, _) = p.bollard_coefficients();
    let flux = p.get(P::FluxCoefficient) * p.get(P::DensityKgM3) * p.area_m2();
    speed_rad_s * (thrust / flux).max(0.0).sqrt()
}

/// The largest eigenvalue of a matrix by size.
pub(super) fn fastest_1_s([[a, b], [c, d]]: [[f64; 2]; 2]) -> f64 {
    let (mean, det) = (0.5 * (a + d), a * d - b * c);
    let root = mean * mean - det;
    if root < 0.0 { det.sqrt() } else { mean.abs() + root.sqrt() }
}

/// Largest shaft speed that the stated limits allow, rad/s.
fn top_speed_rad_s(rig: &Rig, p: &Parameters) -> f64 {
    if rig.propeller.is_none() {
        return 0.0;
    }
    let kt = p.get(P::TorqueConstantNmA);
    let gas = p.get(P::DensityKgM3) < GAS_KG_M3;
    let tip = if gas { TIP_M_S.1 } else { TIP_M_S.0 } / p.get(P::RadiusM);
    let by_supply = rig.amplifier.supply_v.map_or(f64::INFINITY, |v| v / kt);
    let (_, load_nm_s2) = p.bollard_coefficients();
    let by_current = match rig.amplifier.kind {
        // Its speed is as commanded, whatever that takes.
        AmplifierKind::Speed => f64::INFINITY,
        _ => (kt * rig.amplifier.current_limit_a / load_nm_s2.max(1e-12)).sqrt(),
    };
    tip.min(by_supply).min(by_current)
}

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
    pub(super) fn step_stiff<const N: usize>(&mut self, tick: &Tick, stiff: Stiff) {
        let drive = self.drive_over(tick);
        let mut balance = Balance::default();
        let mut x: [T; N] = each(|i| self.x[i]);
        if N == OWN && stiff.steps > 1 {
            let whole = self.push(tick, &drive, &x, 1.0, stiff, &mut balance);
            if whole.moves_less(CALM, self.tick_s, stiff) {
                let kept = self.slopes.take().filter(|kept| kept.hold_at(&self.x, stiff));
                let slopes = kept.map_or_else(
                    || self.slopes_ahead(tick, &drive, &whole, (1.0, self.tick_s), stiff.top_rad_s),
                    |kept| kept.resized(),
                );
                self.slopes = Some(slopes.resized());
                x = self.stiff_part(tick, &drive, &x, (0.0, 1.0), stiff, (&whole, &slopes), &mut balance);
                return self.end_stiff(tick, &drive, x, &mut balance);
            }
        }
        self.slopes = None;
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
        self.end_stiff(tick, &drive, x, &mut balance);
    }

    fn end_stiff<const N: usize>(
        &mut self,
        tick: &Tick,
        drive: &Course<T>,
        x: [T; N],
        balance: &mut Balance<T>,
    ) {
        let current = self.current_at(tick, drive, 1.0, x[SPEED]);
        let end = self.local_at(&x, current, 1.0, tick);
        self.rates::<true, true, N>(&x, &end, balance);
        self.moving = false;
        self.arrive(tick, &x, end, balance);
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
