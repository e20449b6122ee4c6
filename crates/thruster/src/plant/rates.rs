//! Rates of all states, and the loads they follow from.

use super::load::Hanging;
use super::{ANGLE, Balance, FLOW, Local, Plant, SPEED, SWIRL};
use crate::blade::{BladeRow, Foil, Inflow, Swirl};
use crate::models::ModelName;
use crate::parameters::{Parameter as P, Parameters};
use crate::real::Real;
use crate::rig::Rig;

/// Square of the speed through the water below which the blades do nothing and no effect is asked about
/// them, m^2/s^2.
const STILL_M2_S2: f64 = 1e-50;

/// Products of parameters that the inner loop needs.
#[derive(Clone, Copy)]
pub(super) struct Constants<T> {
    pub(super) row: BladeRow<T>,
    pub(super) swirl: Swirl<T>,
    half_area_m2: T,
    density_kg_m3: T,
    added_mass_kg: T,
    flux_kg_m: T,
    pub(super) inertia_kg_m2: T,
    pub(super) torque_constant_nm_a: T,
    pub(super) resistance_ohm: T,
    viscous_nm_s: T,
    pub(super) yoerger_slip_m: T,
    load: Hanging<T>,
    dry: bool,
}

impl<T: Real> Constants<T> {
    pub(super) fn new(p: &Parameters<T>, rig: &Rig) -> Self {
        let load = Hanging::new(&rig.load, p);
        let area = p.area_m2();
        let density = p.get(P::DensityKgM3);
        Self {
            row: BladeRow::new(p),
            swirl: Swirl::new(p),
            half_area_m2: area * 0.5,
            density_kg_m3: density,
            added_mass_kg: p.duct_mass_kg() * p.get(P::AddedMassCoefficient),
            flux_kg_m: p.get(P::FluxCoefficient) * density * area,
            inertia_kg_m2: p.get(P::InertiaKgM2) + load.inertia_kg_m2,
            torque_constant_nm_a: p.get(P::TorqueConstantNmA),
            resistance_ohm: p.get(P::WindingResistanceOhm),
            viscous_nm_s: p.get(P::ViscousFrictionNmS),
            yoerger_slip_m: p.get(P::Efficiency) * p.get(P::RadiusM) * p.get(P::PitchRad).tan(),
            load,
            dry: rig.propeller.is_none(),
        }
    }
}

impl<T: Real> Plant<T> {
    /// Rates of all states but for dry friction. The loads they follow from are written where the caller
    /// keeps them: with derivatives they are a kilobyte, too much to hand back by value.
    #[inline(always)]
    pub(super) fn rates<const HOOKED: bool, const BLADE: bool, const N: usize>(
        &self,
        x: &[T; N],
        at: &Local<T>,
        balance: &mut Balance<T>,
    ) -> [T; N] {
        let c = &self.constants;
        let (speed, flow) = (x[SPEED], x[FLOW]);
        *balance = Balance {
            motor_torque_n_m: c.torque_constant_nm_a * at.current_a,
            shaft_torque_n_m: -c.viscous_nm_s * speed,
            inertia_kg_m2: c.inertia_kg_m2,
            added_mass_kg: c.added_mass_kg,
            flux_kg_m: c.flux_kg_m,
            ambient_m_s: T::from(at.ambient_m_s),
            load_torque_n_m: match c.load.pulls {
                true => c.load.torque_n_m(x[ANGLE], speed),
                false => T::from(-at.load_n_m),
            },
            friction_ahead_n_m: T::ZERO,
            friction_astern_n_m: T::ZERO,
            blade_torque_n_m: T::ZERO,
            thrust_n: T::ZERO,
            momentum_n: T::ZERO,
            stand_n: T::ZERO,
            foil: balance.foil,
        };
        match self.model {
            _ if c.dry => {}
            ModelName::Model0 => {
                let square = speed * speed.abs();
                balance.thrust_n = self.parameters.get(P::ThrustCoefficientNS2) * square;
                balance.blade_torque_n_m = self.parameters.get(P::TorqueCoefficientNmS2) * square;
            }
            ModelName::Model1 => {
                // (7), (8): T = rho a (s Om)|s Om|, Q Om = T vp, with slip speed s = eta r tan p;
                // the shaft's "inertia" of (9), s^2 rho V, is the water's: the fixed point's half
                // comes from vw = vp in (3).
                let vp = c.yoerger_slip_m * speed;
                let force = c.density_kg_m3 * 2.0 * c.half_area_m2 * vp * vp.abs();
                balance.thrust_n = force;
                balance.blade_torque_n_m = force * 0.5 * c.yoerger_slip_m;
                balance.inertia_kg_m2 =
                    c.yoerger_slip_m * c.yoerger_slip_m * c.added_mass_kg + c.load.inertia_kg_m2;
            }
            _ => self.blade_loads::<BLADE, N>(at, x, balance),
        }
        let mut rates = [T::ZERO; N];
        for i in self.balance_hooks.iter().take(if HOOKED { usize::MAX } else { 0 }) {
            let hooked = &self.effects[*i];
            hooked.effect.balance(at, &x[hooked.own.clone()], balance, &mut rates[hooked.own.clone()]);
        }
        rates[SPEED] = (balance.motor_torque_n_m + balance.shaft_torque_n_m + balance.load_torque_n_m
            - balance.blade_torque_n_m)
            / balance.inertia_kg_m2;
        rates[ANGLE] = speed;
        match self.model {
            _ if c.dry => {}
            ModelName::Model0 | ModelName::Model1 => {}
            _ => {
                // (6a): T = m vp' + dbeta rho a (vp - va)|vp|
                rates[FLOW] = (balance.thrust_n + balance.momentum_n
                    - balance.flux_kg_m * (flow - balance.ambient_m_s) * flow.abs())
                    / balance.added_mass_kg;
                if self.model == ModelName::RotationalFlow {
                    // The implicit step follows a swirl of any lag.
                    let shortest_s = if self.is_stiff() { 0.0 } else { self.tick_s };
                    rates[SWIRL] = c.swirl.acceleration(balance.blade_torque_n_m, flow, x[SWIRL], shortest_s);
                }
            }
        }
        rates
    }

    /// (14)-(17) without angles, with the hooks of inflow and foil.
    #[inline(always)]
    fn blade_loads<const BLADE: bool, const N: usize>(
        &self,
        at: &Local<T>,
        x: &[T; N],
        balance: &mut Balance<T>,
    ) {
        let row = &self.constants.row;
        let mut inflow = Inflow { tangential_m_s: row.lever_m * x[SPEED] - x[SWIRL], axial_m_s: x[FLOW] };
        for i in self.inflow_hooks.iter().take(if BLADE { usize::MAX } else { 0 }) {
            let hooked = &self.effects[*i];
            hooked.effect.inflow(at, &x[hooked.own.clone()], &mut inflow);
        }
        let (ut, vp) = (inflow.tangential_m_s, inflow.axial_m_s);
        if ut * ut + vp * vp < STILL_M2_S2 {
            if BLADE {
                balance.foil = Foil::default();
            }
            return;
        }
        let mut foil = row.section(inflow);
        for i in self.foil_hooks.iter().take(if BLADE { usize::MAX } else { 0 }) {
            let hooked = &self.effects[*i];
            hooked.effect.foil(at, &x[hooked.own.clone()], &mut foil);
        }
        let load = row.load_of(&foil, inflow);
        if BLADE {
            balance.foil = foil;
        }
        (balance.thrust_n, balance.blade_torque_n_m) = (load.thrust_n, load.torque_n_m);
    }
}
