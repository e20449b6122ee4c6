//! How fast a stated rig settles: whether explicit steps of a tick follow it, and how many implicit ones a tick takes.

use super::{Balance, Driven, FLOW, Local, Plant, SPEED, STATES};
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
    pub(super) load_nm_s2: f64,
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

impl<T: Real> Plant<T> {
    /// How fast a disturbance of shaft speed and axial flow dies at most, 1/s, where the plant is now and while this drives it:
    /// the larger eigenvalue of the rates' derivative. A voltage or a power that stands brakes by the winding too.
    pub fn fastest_decay_1_s(&self, driven: Driven) -> f64 {
        let braked_a_s_rad = self.braked_a_s_rad(driven);
        let rates = |place: usize, by: f64| {
            let mut x = self.x;
            x[place] += T::from(by);
            let less_a = if place == SPEED { braked_a_s_rad * by } else { 0.0 };
            let at = Local {
                shaft_speed_rad_s: x[SPEED],
                axial_m_s: x[FLOW],
                current_a: self.at.current_a - T::from(less_a),
                ..self.at
            };
            let rates = self.rates::<true, true, STATES>(&x, &at, &mut Balance::default());
            [rates[SPEED].re(), rates[FLOW].re()]
        };
        let here = rates(SPEED, 0.0);
        let [[a, c], [b, d]] = [SPEED, FLOW].map(|place| {
            let by = 1e-6 * self.x[place].re().abs().max(1e-3);
            let there = rates(place, by);
            [(there[0] - here[0]) / by, (there[1] - here[1]) / by]
        });
        fastest_1_s([[a, b], [c, d]])
    }

    /// How much less current flows for each rad/s that the shaft is faster, A s: once the winding's lag is over.
    fn braked_a_s_rad(&self, driven: Driven) -> f64 {
        let kt = self.constants.torque_constant_nm_a.re();
        let ohm = self.constants.resistance_ohm.re().max(1e-9);
        match (driven, self.amplifier) {
            (Driven::Command, AmplifierKind::Voltage) => kt / ohm,
            (Driven::Power(..), _) => {
                let current_a = self.at.current_a.re().abs();
                kt * current_a / (2.0 * ohm * current_a + kt * self.x[SPEED].re().abs()).max(1e-9)
            }
            _ => 0.0,
        }
    }
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
        // Its speed may be driven beyond what its current holds.
        AmplifierKind::Speed => f64::INFINITY,
        _ => (kt * rig.amplifier.current_limit_a / load_nm_s2.max(1e-12)).sqrt(),
    };
    tip.min(by_supply).min(by_current)
}
