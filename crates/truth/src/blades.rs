//! Blades, duct and water. Force comes from one section at 0.7 r with the whole disc as its area, or
//! from several twisted ones; what a lumped model would call lift, drag and pitch is then found by a
//! fit to their force ([`Blades::distribute`]).

use std::f64::consts::PI;

use crate::refit;

/// One radial station of the blade row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// Radius of the station over the duct radius.
    pub radius_ratio: f64,
    /// Share of the reference area; over the blade they sum to one.
    pub share: f64,
    /// Chord angle against the disc plane, rad.
    pub pitch_rad: f64,
}

/// Propeller, duct and the water in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Blades {
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
    /// Stations.
    pub sections: Vec<Section>,
    /// Section coefficients over the lumped ones (lift, drag).
    pub section_gain: (f64, f64),
}

/// Force of the blade row.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Force {
    /// Axial thrust, N, positive ahead.
    pub thrust_n: f64,
    /// Torque against positive rotation, N m.
    pub torque_n_m: f64,
}

/// Inflow of one station.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inflow {
    /// Speed along the blade's turning, m/s.
    pub tangential_m_s: f64,
    /// Axial flow, m/s.
    pub axial_m_s: f64,
    /// Station.
    pub section: Section,
}

impl Inflow {
    /// Angle of attack from the nearer edge of the (symmetric) section, rad, -pi/2 to pi/2.
    pub fn attack_rad(&self) -> f64 {
        let angle = self.section.pitch_rad - self.axial_m_s.atan2(self.tangential_m_s);
        (angle + 0.5 * PI).rem_euclid(PI) - 0.5 * PI
    }
}

/// Changes of lift and drag coefficient at a station.
pub type Polar<'a> = &'a dyn Fn(&Inflow, &mut f64, &mut f64);

impl Blades {
    /// One section at 0.7 r.
    pub fn lump(&mut self) {
        self.sections = vec![Section { radius_ratio: 0.7, share: 1.0, pitch_rad: self.pitch_rad }];
        self.section_gain = (1.0, 1.0);
    }

    /// Disc area, m2.
    pub fn area_m2(&self) -> f64 {
        PI * self.radius_m.powi(2)
    }

    /// Mass of the water that is accelerated, kg.
    pub fn added_mass_kg(&self) -> f64 {
        self.density_kg_m3 * self.area_m2() * self.duct_length_m * self.added_mass_coefficient
    }

    /// Radius of the reference section, m.
    pub fn arm_m(&self) -> f64 {
        0.7 * self.radius_m
    }

    /// Force at a shaft speed (rad/s), axial flow and tangential flow at 0.7 r (m/s).
    pub fn force(&self, speed_rad_s: f64, flow_m_s: f64, swirl_m_s: f64, polar: Option<Polar>) -> Force {
        let mut force = Force::default();
        let dynamic = 0.5 * self.density_kg_m3 * self.area_m2();
        let (lift_max, drag_max) = (self.section_gain.0 * self.lift_max, self.section_gain.1 * self.drag_max);
        for &section in &self.sections {
            let arm = section.radius_ratio * self.radius_m;
            let tangential = arm * speed_rad_s - swirl_m_s * section.radius_ratio / 0.7;
            let speed = tangential.hypot(flow_m_s);
            if speed < 1e-9 {
                continue;
            }
            // Sine and cosine of the angle of attack: the inflow seen along and across the chord.
            let (pitch_sin, pitch_cos) = section.pitch_rad.sin_cos();
            let across = (pitch_sin * tangential - pitch_cos * flow_m_s) / speed;
            let along = (pitch_cos * tangential + pitch_sin * flow_m_s) / speed;
            let (mut lift, mut drag) = (lift_max * 2.0 * across * along, drag_max * 2.0 * across * across);
            if let Some(polar) = polar {
                let inflow = Inflow { tangential_m_s: tangential, axial_m_s: flow_m_s, section };
                polar(&inflow, &mut lift, &mut drag);
            }
            let scale = dynamic * section.share * speed;
            force.thrust_n += scale * (lift * tangential - drag * flow_m_s);
            force.torque_n_m += arm * scale * (lift * flow_m_s + drag * tangential);
        }
        force
    }

    /// Replaces the lumped section by `count` twisted ones between `inner` and `outer` (over the
    /// radius), and sets lumped lift, drag and pitch to what fits their force best. Returns the
    /// relative misfit that is left (root mean square).
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
        // The sections stay where they are; only the lumped names for them move.
        self.section_gain = (self.lift_max / lift, self.drag_max / drag);
        (self.lift_max, self.drag_max, self.pitch_rad) = (lift, drag, pitch);
        misfit
    }

    /// Lumped lift, drag and pitch whose force comes nearest, and the misfit.
    fn lumped_equivalent(&self) -> (f64, f64, f64, f64) {
        // Inflow angles from a start at rest over the bollard state to a reversal.
        let states: Vec<(f64, f64)> = (0..60)
            .map(|index| -0.08 + 0.37 * f64::from(index) / 59.0)
            .map(|angle: f64| (1.0, self.arm_m() * angle.tan()))
            .collect();
        let truth: Vec<Force> = states.iter().map(|&(om, vp)| self.force(om, vp, 0.0, None)).collect();
        let scale = |pick: fn(&Force) -> f64| truth.iter().map(|f| pick(f).abs()).fold(0.0, f64::max);
        let (thrust_scale, torque_scale) = (scale(|f| f.thrust_n), scale(|f| f.torque_n_m));
        let misfit = |values: &[f64]| -> Vec<f64> {
            let mut model = self.clone();
            (model.lift_max, model.drag_max, model.pitch_rad) = (values[0], values[1], values[2]);
            model.lump();
            let forces = states.iter().map(|&(om, vp)| model.force(om, vp, 0.0, None));
            forces
                .zip(&truth)
                .flat_map(|(f, t)| {
                    [(f.thrust_n - t.thrust_n) / thrust_scale, (f.torque_n_m - t.torque_n_m) / torque_scale]
                })
                .collect()
        };
        let mut values = vec![self.lift_max, self.drag_max, self.pitch_rad];
        for _ in 0..20 {
            values = refit::gauss_newton_step(values, &misfit, &[0.0; 3]);
        }
        let rest = misfit(&values);
        let rms = (rest.iter().map(|r| r * r).sum::<f64>() / rest.len() as f64).sqrt();
        (values[0], values[1], values[2], rms)
    }
}
