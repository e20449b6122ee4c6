//! The true thruster: geometry, coefficients and the blade sections that make its force.
//!
//! Lumped truth has one section at 0.7 r with the whole disc as its reference area (equations
//! (14) to (17) of the seed paper, written with the inflow angle itself). Distributed truth has
//! several twisted sections; what a lumped model would call its lift, drag and pitch is then found
//! by a fit to its forces ([`Thruster::lumped_equivalent`]).

use std::f64::consts::PI;

/// One radial station of the blade row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// Radius of the station over the duct radius.
    pub radius_ratio: f64,
    /// Share of the reference area, summing to one over the blade.
    pub share: f64,
    /// Chord angle against the disc plane, rad.
    pub pitch_rad: f64,
}

/// True parameters of a thruster, its motor and its drive.
#[derive(Clone, Debug, PartialEq)]
pub struct Thruster {
    /// Class as the rig file names it.
    pub class: &'static str,
    /// Duct radius, m.
    pub radius_m: f64,
    /// Duct length, m.
    pub duct_length_m: f64,
    /// Pitch a lumped model would state, rad.
    pub pitch_rad: f64,
    /// Lift coefficient amplitude a lumped model would state.
    pub lift_max: f64,
    /// Drag coefficient amplitude a lumped model would state.
    pub drag_max: f64,
    /// Water density, kg/m3.
    pub density_kg_m3: f64,
    /// Momentum flux coefficient.
    pub flux_coefficient: f64,
    /// Added-mass coefficient of the duct volume.
    pub added_mass_coefficient: f64,
    /// Rotor inertia, kg m2.
    pub inertia_kg_m2: f64,
    /// Motor torque constant, N m/A.
    pub torque_constant_nm_a: f64,
    /// Winding resistance, ohm.
    pub winding_resistance_ohm: f64,
    /// Amplifier lag, s.
    pub amplifier_time_constant_s: f64,
    /// Amplifier current limit, A.
    pub current_limit_a: f64,
    /// Supply voltage, V.
    pub supply_v: f64,
    /// Blade stations.
    pub sections: Vec<Section>,
    /// Section coefficients relative to the lumped ones (lift, drag); ones for lumped truth.
    pub section_gain: (f64, f64),
}

/// Force of the blade row.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BladeForce {
    /// Axial thrust, N, positive ahead.
    pub thrust_n: f64,
    /// Torque against positive rotation, N m.
    pub torque_n_m: f64,
}

/// Changes to a section's coefficients, by hidden physics. Arguments: wrapped angle of attack in
/// rad, lift and drag coefficient; result: both coefficients.
pub type Polar<'a> = &'a dyn Fn(f64, f64, f64) -> (f64, f64);

impl Thruster {
    /// Disc area, m2.
    pub fn area_m2(&self) -> f64 {
        PI * self.radius_m.powi(2)
    }

    /// Mass of the water that is accelerated, kg.
    pub fn added_mass_kg(&self) -> f64 {
        self.density_kg_m3 * self.area_m2() * self.duct_length_m * self.added_mass_coefficient
    }

    /// Torque at the current limit, N m.
    pub fn torque_max_n_m(&self) -> f64 {
        self.torque_constant_nm_a * self.current_limit_a
    }

    /// Blade force at a shaft speed (rad/s), axial flow (m/s) and tangential flow at 0.7 r (m/s).
    pub fn blade_force(&self, speed_rad_s: f64, flow_m_s: f64, swirl_m_s: f64, polar: Polar) -> BladeForce {
        let mut force = BladeForce::default();
        let dynamic = 0.5 * self.density_kg_m3 * self.area_m2();
        for section in &self.sections {
            let arm = section.radius_ratio * self.radius_m;
            let tangential = arm * speed_rad_s - swirl_m_s * section.radius_ratio / 0.7;
            let squared = tangential * tangential + flow_m_s * flow_m_s;
            if squared < 1e-18 {
                continue;
            }
            let speed = squared.sqrt();
            let attack = section.pitch_rad - flow_m_s.atan2(tangential);
            let (sine, cosine) = (2.0 * attack).sin_cos();
            let lift = self.section_gain.0 * self.lift_max * sine;
            let drag = self.section_gain.1 * self.drag_max * (1.0 - cosine);
            let wrapped = (attack + 0.5 * PI).rem_euclid(PI) - 0.5 * PI;
            let (lift, drag) = polar(wrapped, lift, drag);
            let scale = dynamic * section.share * speed;
            force.thrust_n += scale * (lift * tangential - drag * flow_m_s);
            force.torque_n_m += arm * scale * (lift * flow_m_s + drag * tangential);
        }
        force
    }

    /// Replaces the lumped section by `count` twisted ones between `inner` and `outer` (over the
    /// radius) and sets the stated-style lumped lift, drag and pitch to what fits their force best.
    /// Returns the remaining relative misfit (root mean square, of the larger force).
    pub fn distribute(&mut self, count: usize, inner: f64, outer: f64) -> f64 {
        let width = (outer - inner) / count as f64;
        // Elliptic loading over the span, helical twist through the lumped pitch at 0.7 r.
        let load = |ratio: f64| (1.0 - ((2.0 * ratio - inner - outer) / (outer - inner)).powi(2)).sqrt();
        let ratios: Vec<f64> = (0..count).map(|index| inner + width * (index as f64 + 0.5)).collect();
        let total: f64 = ratios.iter().map(|&ratio| load(ratio)).sum();
        self.sections = ratios
            .iter()
            .map(|&ratio| Section {
                radius_ratio: ratio,
                share: load(ratio) / total,
                pitch_rad: (0.7 * self.pitch_rad.tan() / ratio).atan(),
            })
            .collect();
        let (lift, drag, pitch, misfit) = self.lumped_equivalent();
        // Keep the section polars where they are; only the lumped names for them move.
        self.section_gain = (self.lift_max / lift, self.drag_max / drag);
        (self.lift_max, self.drag_max, self.pitch_rad) = (lift, drag, pitch);
        misfit
    }

    /// Lumped lift, drag and pitch whose force comes nearest to this blade's, and the misfit.
    fn lumped_equivalent(&self) -> (f64, f64, f64, f64) {
        let mut lumped = self.clone();
        lumped.section_gain = (1.0, 1.0);
        // Inflow angles met by a thruster from a start at rest to its bollard state and a reversal.
        let states: Vec<(f64, f64)> = (0..60)
            .map(|index| -0.08 + 0.37 * index as f64 / 59.0)
            .map(|angle: f64| (1.0, 0.7 * self.radius_m * angle.tan()))
            .collect();
        let plain: Polar = &|_, lift, drag| (lift, drag);
        let truth: Vec<BladeForce> =
            states.iter().map(|&(om, vp)| self.blade_force(om, vp, 0.0, plain)).collect();
        let scale = |pick: fn(&BladeForce) -> f64| truth.iter().map(|f| pick(f).abs()).fold(0.0, f64::max);
        let (thrust_scale, torque_scale) = (scale(|f| f.thrust_n), scale(|f| f.torque_n_m));
        let misfit = |values: [f64; 3]| -> Vec<f64> {
            let mut model = lumped.clone();
            (model.lift_max, model.drag_max) = (values[0], values[1]);
            model.sections = vec![Section { radius_ratio: 0.7, share: 1.0, pitch_rad: values[2] }];
            let forces = states.iter().map(|&(om, vp)| model.blade_force(om, vp, 0.0, plain));
            forces
                .zip(&truth)
                .flat_map(|(f, t)| {
                    [(f.thrust_n - t.thrust_n) / thrust_scale, (f.torque_n_m - t.torque_n_m) / torque_scale]
                })
                .collect()
        };
        let mut values = [self.lift_max, self.drag_max, self.pitch_rad];
        for _ in 0..20 {
            values = crate::refit::gauss_newton_step(
                values.to_vec(),
                &mut |v| misfit([v[0], v[1], v[2]]),
                &[0.0; 3],
            )
            .try_into()
            .unwrap_or([self.lift_max, self.drag_max, self.pitch_rad]);
        }
        let rest = misfit(values);
        let rms = (rest.iter().map(|r| r * r).sum::<f64>() / rest.len() as f64).sqrt();
        (values[0], values[1], values[2], rms)
    }
}
