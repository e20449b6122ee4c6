//! The pressure on the blade falls below that of vapour.

use super::{Descriptor, Effect, Hooks, Path, Scale, Spec, wet};
use crate::plant::{Foil, Local};
use crate::real::Real;

/// Atmospheric less vapour pressure, Pa, at 20 deg C.
const PRESSURE_PA: f64 = 101_325.0 - 2_339.0;
/// Gravity, m/s^2.
const GRAVITY_M_S2: f64 = 9.81;
/// Depth where none is recorded, m.
const DEPTH_M: f64 = 1.0;
/// Width of the onset in sigma_i/sigma.
const WIDTH: f64 = 0.05;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "cavitation",
    path: Path::Blade,
    what: "at high blade speed the water boils on the blades: lift and drag coefficients fall",
    equation: "sigma = (pa + rho g h - pv)/(rho/2 V^2); CL (1 + k ramp(sigma_i/sigma - 1))^-1, CD (1 + k ramp(...))^-e; \
               k, sigma_i, e [1], h recorded or 1 m; e = 1: both lose alike, e < 0: drag rises. An onset sigma_i above \
               about 3 is no cavitation at 0.7 radius",
    signature: "thrust over speed squared droops at top speed only, alike in both directions; less so at depth",
    confused_with: &[
        "ventilation",
        "voltage_limit_backemf",
        "current_saturation",
        "torque_constant_saturation",
        "air_ingestion",
    ],
    separated_by: "the same run at several depths; a voltage limit caps speed but leaves thrust over speed squared alone",
    reference: "Carlton, Marine Propellers and Propulsion (cavitation number); the loss below onset is kort's form",
    commonness: 0.5,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[&[0, 1], &[0, 1, 2]],
    parameters,
    starts: |scale| {
        [1.3, 3.0, 5.0]
            .iter()
            .map(|factor| vec![0.1, onset(scale, *factor), 1.0])
            .chain([vec![0.1, onset(scale, 2.0), -0.3]])
            .collect()
    },
    needs: wet,
    build: both!(|values, _| Box::new(Cavitation { loss: values[0], onset: values[1], drag: values[2] })),
};

/// Onset at a multiple of the smallest cavitation number in the recording; the speed through the
/// water at 0.7 radius is taken from the axial flow at a common inflow angle of 0.25 rad.
fn onset(scale: &Scale, factor: f64) -> f64 {
    let speed_m_s = scale.flow_m_s / 0.25;
    let smallest = (PRESSURE_PA + 998.0 * GRAVITY_M_S2 * DEPTH_M) / (0.5 * 998.0 * speed_m_s * speed_m_s);
    (factor * smallest).clamp(0.3, 40.0)
}

fn parameters(scale: &Scale) -> Vec<Spec> {
    vec![
        Spec::strength("loss", "1", 0.1, 0.0, 3.0).sigma(0.4),
        Spec::shape("onset_sigma", "1", onset(scale, 2.0), 0.2, 50.0).sigma(onset(scale, 2.0)),
        Spec::shape("drag_exponent", "1", 1.0, -1.0, 2.0).prior(1.0, 0.7),
    ]
}

struct Cavitation<T> {
    loss: T,
    onset: T,
    drag: T,
}

impl<T: Real> Effect<T> for Cavitation<T> {
    fn hooks(&self) -> Hooks {
        Hooks::FOIL
    }

    fn foil(&self, at: &Local<T>, _: &[T], foil: &mut Foil<T>) {
        let pressure = foil.density_kg_m3 * GRAVITY_M_S2 * at.depth_m.unwrap_or(DEPTH_M) + PRESSURE_PA;
        let dynamic = foil.density_kg_m3 * 0.5 * foil.speed_m_s * foil.speed_m_s;
        let past = self.onset * dynamic / pressure - 1.0;
        // A ramp with a rounded foot; no loss at all at rest.
        let ramp = |x: T| (x + (x * x + WIDTH * WIDTH).sqrt()) * 0.5;
        let left = (self.loss * (ramp(past) - ramp(T::from(-1.0))) + 1.0).recip();
        foil.lift *= left;
        foil.drag *= left.powf(self.drag);
    }
}
