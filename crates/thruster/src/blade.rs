//! Lift and drag of the blades, lumped at 0.7 of the radius.
//!
//! Equations (14)-(17) of Whitcomb & Yoerger, in a form without angles: with the speed of the
//! chord line through the water split in a chord-normal part `wn` and a chordwise part `wc`,
//! `sin(2 alpha) = 2 wn wc / V^2` and `1 - cos(2 alpha) = 2 wn^2 / V^2`. The form has no
//! singularity at `V = 0`, needs no wrapping of angles, and is exactly odd under reversal of
//! shaft and flow together, so all four quadrants come from one expression.

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
pub struct BladeLoad {
    /// Thrust, N; positive ahead.
    pub thrust_n: f64,
    /// Torque, N m; positive when it opposes positive shaft speed.
    pub torque_n_m: f64,
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
        let (sin, cos) = self.pitch_rad.sin_cos();
        let wn = inflow.tangential_m_s * sin - inflow.axial_m_s * cos;
        let wc = inflow.tangential_m_s * cos + inflow.axial_m_s * sin;
        if wc < 0.0 { (-wn).atan2(-wc) } else { wn.atan2(wc) }
    }

    /// Thrust and torque for an inflow, equations (14)-(17).
    pub fn load(&self, inflow: Inflow) -> BladeLoad {
        self.row().load(inflow.tangential_m_s, inflow.axial_m_s)
    }

    /// The same blade with its products formed once, for inner loops.
    pub fn row(&self) -> BladeRow {
        let (sin_pitch, cos_pitch) = self.pitch_rad.sin_cos();
        let scale = self.density_kg_m3 * self.area_m2();
        BladeRow {
            sin_pitch,
            cos_pitch,
            lever_m: self.lever_m(),
            lift_kg_m: scale * self.lift_max,
            drag_kg_m: scale * self.drag_max,
        }
    }
}

/// A blade whose constant products are formed: one square root and one division a load.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BladeRow {
    sin_pitch: f64,
    cos_pitch: f64,
    /// Radius at which lift and drag act, m.
    pub lever_m: f64,
    lift_kg_m: f64,
    drag_kg_m: f64,
}

/// Added to the square of the speed through the water, m^2/s^2: keeps the quotient finite where
/// nothing moves, vanishes in rounding everywhere else, and costs no branch, so that the compiler
/// may work on several trajectories at once.
const STILL: f64 = 1e-200;

impl BladeRow {
    /// Thrust and torque for a tangential and an axial speed, m/s; equations (14)-(17).
    #[inline(always)]
    pub fn load(&self, tangential_m_s: f64, axial_m_s: f64) -> BladeLoad {
        let (ut, vp) = (tangential_m_s, axial_m_s);
        let v2 = ut * ut + vp * vp;
        let wn = ut * self.sin_pitch - vp * self.cos_pitch;
        let wc = ut * self.cos_pitch + vp * self.sin_pitch;
        // wn / V written as wn V / V^2: root and quotient do not wait for each other.
        let (root, inverse) = (v2.sqrt(), 1.0 / (v2 + STILL));
        let lift = self.lift_kg_m * wc;
        let drag = self.drag_kg_m * wn;
        let ahead = wn * (lift * ut - drag * vp);
        let around = self.lever_m * wn * (lift * vp + drag * ut);
        let scale = root * inverse;
        BladeLoad { thrust_n: ahead * scale, torque_n_m: around * scale }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Equations (14)-(17) as printed, with angles.
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
        let blade =
            Blade { radius_m: 0.13, pitch_rad: 0.39, lift_max: 0.542, drag_max: 1.25, density_kg_m3: 998.0 };
        for speed in [-60.0, -3.0, 0.0, 20.0, 60.0] {
            for flow in [-1.5, -0.1, 0.0, 0.4, 1.2] {
                let inflow = blade.inflow(speed, flow, 0.0);
                let (ours, theirs) = (blade.load(inflow), printed(&blade, inflow));
                assert!((ours.thrust_n - theirs.thrust_n).abs() < 1e-9, "{speed} {flow}");
                assert!((ours.torque_n_m - theirs.torque_n_m).abs() < 1e-10, "{speed} {flow}");
            }
        }
    }

    #[test]
    fn still_water_and_a_stopped_shaft_give_nothing() {
        let blade =
            Blade { radius_m: 0.13, pitch_rad: 0.39, lift_max: 0.542, drag_max: 1.25, density_kg_m3: 998.0 };
        assert_eq!(blade.load(Inflow::default()), BladeLoad::default());
    }
}
