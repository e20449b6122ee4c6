//! Lift and drag of the blades, lumped at 0.7 of the radius, and the swirl they leave: the one blade
//! row and the one swirl law that the models, the plant and the control laws call.
//!
//! Equations (14)-(17) of Whitcomb & Yoerger, in a form without angles: with the speed of the
//! chord line through the water split in a chord-normal part `wn` and a chordwise part `wc`,
//! `sin(2 alpha) = 2 wn wc / V^2` and `1 - cos(2 alpha) = 2 wn^2 / V^2`. The form has no
//! singularity at `V = 0`, needs no wrapping of angles, and is exactly odd under reversal of
//! shaft and flow together, so all four quadrants come from one expression.

use crate::parameters::{Parameter as P, Parameters};
use crate::real::Real;

/// Where the blade's mean chord sits, as a fraction of the propeller's radius.
pub const REFERENCE_RADIUS: f64 = 0.7;

/// The blade row as Model 2 sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blade {
    /// Radius of the duct, m.
    pub radius_m: f64,
    /// Pitch angle of the chord at 0.7 radius, rad. Sine and cosine are kept beside it.
    pub pitch_rad: f64,
    /// Largest lift coefficient `CLmax`, dimensionless.
    pub lift_max: f64,
    /// Drag coefficient `CDmax`, dimensionless: drag is `CDmax (1 - cos 2 alpha)`.
    pub drag_max: f64,
    /// Density of the water, kg/m^3.
    pub density_kg_m3: f64,
}

/// What the blades do to the water and to the shaft.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BladeLoad<T = f64> {
    /// Thrust, N; positive ahead.
    pub thrust_n: T,
    /// Torque, N m; positive when it opposes positive shaft speed.
    pub torque_n_m: T,
}

/// The speed of the water relative to the chord at 0.7 radius.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Inflow<T = f64> {
    /// Tangential speed of the blade through the water, m/s.
    pub tangential_m_s: T,
    /// Axial speed of the water through the disc, m/s.
    pub axial_m_s: T,
}

impl Inflow {
    /// Resultant speed `V`, m/s.
    pub fn speed_m_s(self) -> f64 {
        self.tangential_m_s.hypot(self.axial_m_s)
    }

    /// Angle of the inflow to the propeller's plane, `theta`, rad.
    pub fn angle_rad(self) -> f64 {
        self.axial_m_s.atan2(self.tangential_m_s)
    }
}

impl Blade {
    /// Disc area, m^2.
    pub fn area_m2(&self) -> f64 {
        std::f64::consts::PI * self.radius_m * self.radius_m
    }

    /// Radius at which lift and drag act, m.
    pub fn lever_m(&self) -> f64 {
        REFERENCE_RADIUS * self.radius_m
    }

    /// Inflow at the blade for a shaft speed, an axial flow, and a swirl speed of the water.
    pub fn inflow(&self, shaft_speed_rad_s: f64, axial_m_s: f64, swirl_m_s: f64) -> Inflow {
        Inflow { tangential_m_s: self.lever_m() * shaft_speed_rad_s - swirl_m_s, axial_m_s }
    }

    /// Angle of attack in (-pi/2, pi/2], rad: the chord has no preferred end in this model.
    pub fn attack_rad(&self, inflow: Inflow) -> f64 {
        self.row().section(inflow).attack_rad()
    }

    /// Thrust and torque for an inflow, equations (14)-(17).
    pub fn load(&self, inflow: Inflow) -> BladeLoad {
        self.row().load(inflow.tangential_m_s, inflow.axial_m_s)
    }

    /// The same blade with its products formed once, for inner loops.
    pub fn row(&self) -> BladeRow {
        let (sin_pitch, cos_pitch) = self.pitch_rad.sin_cos();
        BladeRow {
            sin_pitch,
            cos_pitch,
            lever_m: self.lever_m(),
            half_area_m2: 0.5 * self.area_m2(),
            density_kg_m3: self.density_kg_m3,
            lift_max: self.lift_max,
            drag_max: self.drag_max,
        }
    }
}

/// The blade section at work.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foil<T = f64> {
    /// Resultant speed `V`, m/s.
    pub speed_m_s: T,
    /// Speed normal to the chord, m/s.
    pub normal_m_s: T,
    /// Speed along the chord, m/s.
    pub chordwise_m_s: T,
    /// `sin 2 alpha`
    pub sin_2a: T,
    /// `1 - cos 2 alpha`
    pub one_minus_cos_2a: T,
    /// Lift coefficient.
    pub lift: T,
    /// Drag coefficient.
    pub drag: T,
    /// Density of the water, kg/m^3.
    pub density_kg_m3: T,
}

impl<T: Real> Foil<T> {
    /// Angle of attack in (-pi/2, pi/2], rad.
    pub fn attack_rad(&self) -> T {
        if self.chordwise_m_s < 0.0 {
            (-self.normal_m_s).atan2(-self.chordwise_m_s)
        } else {
            self.normal_m_s.atan2(self.chordwise_m_s)
        }
    }
}

/// A blade whose constant products are formed: one square root and one division a load.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BladeRow<T = f64> {
    sin_pitch: T,
    cos_pitch: T,
    /// Radius at which lift and drag act, m.
    pub lever_m: T,
    half_area_m2: T,
    density_kg_m3: T,
    lift_max: T,
    drag_max: T,
}

/// Added to the square of the speed through the water, m^2/s^2: keeps the quotient finite where
/// nothing moves, vanishes in rounding everywhere else, and costs no branch, so that the compiler
/// may work on several trajectories at once. Its square is still a number, as the derivative of a
/// quotient wants it.
const STILL_M2_S2: f64 = 1e-60;

impl<T: Real> BladeRow<T> {
    /// The row with these parameters; they must be those of a propeller.
    pub fn new(p: &Parameters<T>) -> Self {
        let (sin_pitch, cos_pitch) = p.get(P::PitchRad).sin_cos();
        Self {
            sin_pitch,
            cos_pitch,
            lever_m: p.get(P::RadiusM) * REFERENCE_RADIUS,
            half_area_m2: p.area_m2() * 0.5,
            density_kg_m3: p.get(P::DensityKgM3),
            lift_max: p.get(P::LiftMax),
            drag_max: p.get(P::DragMax),
        }
    }

    /// The section that meets this inflow, equations (15) and (17).
    #[inline(always)]
    pub fn section(&self, inflow: Inflow<T>) -> Foil<T> {
        let (ut, vp) = (inflow.tangential_m_s, inflow.axial_m_s);
        let wn = ut * self.sin_pitch - vp * self.cos_pitch;
        let wc = ut * self.cos_pitch + vp * self.sin_pitch;
        let v2 = ut * ut + vp * vp + STILL_M2_S2;
        let twice = wn * 2.0 * v2.recip();
        let (sin_2a, one_minus_cos_2a) = (twice * wc, twice * wn);
        Foil {
            speed_m_s: v2.sqrt(),
            normal_m_s: wn,
            chordwise_m_s: wc,
            sin_2a,
            one_minus_cos_2a,
            lift: self.lift_max * sin_2a,
            drag: self.drag_max * one_minus_cos_2a,
            density_kg_m3: self.density_kg_m3,
        }
    }

    /// Thrust and torque of a section in this inflow, equations (14) and (16).
    #[inline(always)]
    pub fn load_of(&self, foil: &Foil<T>, inflow: Inflow<T>) -> BladeLoad<T> {
        let (ut, vp) = (inflow.tangential_m_s, inflow.axial_m_s);
        let q = foil.density_kg_m3 * self.half_area_m2 * foil.speed_m_s;
        BladeLoad {
            thrust_n: q * (foil.lift * ut - foil.drag * vp),
            torque_n_m: self.lever_m * q * (foil.lift * vp + foil.drag * ut),
        }
    }

    /// Thrust and torque for a tangential and an axial speed, m/s; equations (14)-(17).
    #[inline(always)]
    pub fn load(&self, tangential_m_s: T, axial_m_s: T) -> BladeLoad<T> {
        let inflow = Inflow { tangential_m_s, axial_m_s };
        self.load_of(&self.section(inflow), inflow)
    }
}

/// Rotational flow of the wake, lumped at 0.7 radius: the angular momentum of the water in the duct,
/// driven by the blades' torque and washed out by the axial flow,
/// `rho a l gr us' = y Q/re - dbr rho a |vp| us`.
///
/// After Bachmayer, Whitcomb & Grosenbaugh 2000, who add rotational fluid velocity and inertia; the
/// form is ours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Swirl<T = f64> {
    /// Share `y` of the torque that turns the water, dimensionless; 1 for all of it.
    pub share: T,
    /// Mass of the turning water `rho a l gr`, kg.
    pub mass_kg: T,
    /// Washed out `dbr rho a`, kg/m.
    pub flux_kg_m: T,
    /// Radius at which the swirl is taken `re`, m.
    pub lever_m: T,
}

impl<T: Real> Swirl<T> {
    /// All of the torque turns the water, with the two swirl coefficients of these parameters.
    pub fn new(p: &Parameters<T>) -> Self {
        Self {
            share: T::ONE,
            mass_kg: p.duct_mass_kg() * p.get(P::SwirlMassCoefficient),
            flux_kg_m: p.get(P::SwirlFluxCoefficient) * p.get(P::DensityKgM3) * p.area_m2(),
            lever_m: p.get(P::RadiusM) * REFERENCE_RADIUS,
        }
    }

    /// `us'`, m/s^2, under a blade torque, N m, at an axial flow and a swirl, m/s. The swirl settles no
    /// faster than in `shortest_s`, s: what an explicit step can follow; 0 for the law itself.
    #[inline(always)]
    pub fn acceleration(&self, torque_n_m: T, axial_m_s: T, swirl_m_s: T, shortest_s: f64) -> T {
        let washed_kg_s = self.flux_kg_m * axial_m_s.abs();
        (self.share * torque_n_m / self.lever_m - washed_kg_s * swirl_m_s)
            / self.mass_kg.max(washed_kg_s * shortest_s)
    }

    /// How fast the axial flow washes the swirl out, 1/s.
    pub fn decay_1_s(&self, axial_m_s: T) -> T {
        self.flux_kg_m * axial_m_s.abs() / self.mass_kg
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BLADE: Blade =
        Blade { radius_m: 0.13, pitch_rad: 0.39, lift_max: 0.542, drag_max: 1.25, density_kg_m3: 998.0 };

    /// Equations (14)-(17) as printed, angles and all.
    fn printed(blade: &Blade, inflow: Inflow) -> BladeLoad {
        let theta = inflow.angle_rad();
        let alpha = blade.pitch_rad - theta;
        let q = 0.5 * blade.density_kg_m3 * inflow.speed_m_s().powi(2) * blade.area_m2();
        let lift = q * blade.lift_max * (2.0 * alpha).sin();
        let drag = q * blade.drag_max * (1.0 - (2.0 * alpha).cos());
        BladeLoad {
            thrust_n: lift * theta.cos() - drag * theta.sin(),
            torque_n_m: blade.lever_m() * (lift * theta.sin() + drag * theta.cos()),
        }
    }

    #[test]
    fn agrees_with_the_printed_equations_in_all_quadrants() {
        for speed in [-60.0, -3.0, 0.0, 20.0, 60.0] {
            for flow in [-1.5, -0.1, 0.0, 0.4, 1.2] {
                let inflow = BLADE.inflow(speed, flow, 0.0);
                let (ours, theirs) = (BLADE.load(inflow), printed(&BLADE, inflow));
                assert!((ours.thrust_n - theirs.thrust_n).abs() < 1e-9, "{speed} {flow}");
                assert!((ours.torque_n_m - theirs.torque_n_m).abs() < 1e-10, "{speed} {flow}");
            }
        }
    }

    #[test]
    fn still_water_and_a_stopped_shaft_give_nothing() {
        assert_eq!(BLADE.load(Inflow::default()), BladeLoad::default());
    }

    #[test]
    fn swirl_settles_where_the_flow_washes_out_what_the_blades_turn() {
        let swirl = Swirl { share: 1.0, mass_kg: 0.7, flux_kg_m: 53.0, lever_m: 0.091 };
        let (torque, flow) = (9.0, 1.2);
        let steady = torque / (0.091 * 53.0 * flow);
        assert!(swirl.acceleration(torque, flow, steady, 0.0).abs() < 1e-9);
        let back = swirl.acceleration(torque, flow, steady + 0.1, 0.0);
        assert!((back + 0.1 * swirl.decay_1_s(flow)).abs() < 1e-9);
        // Held to a lag of 0.1 s, ten times as slow as the law, and at rest in the same place.
        let held = swirl.acceleration(torque, flow, steady + 0.1, 0.1);
        assert!((held + 0.1 / 0.1).abs() < 1e-9, "{held}");
    }
}
