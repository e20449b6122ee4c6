//! A propeller near the surface draws air.

use super::{Descriptor, Effect, Hooks, Path, Scale, Spec, wet};
use crate::plant::{Balance, Drive, Foil, Local, Tick};
use crate::real::Real;

/// Width of the onset, as a share of the onset speed.
const WIDTH: f64 = 0.04;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "ventilation",
    path: Path::Blade,
    what: "near the surface the propeller draws air above some speed: thrust and torque collapse, the shaft races, and the \
           blades recover only at a lower speed",
    equation: "CL (1 - k e), CD (1 - q k e), t e' = s[(|Om|/on - 1 + h e)/0.04] - e, t = tv while air comes in, tr while it \
               goes, s logistic; k, q, h [1], tv, tr [s], on [rad/s], in proportion to the root of depth where depth is recorded",
    signature: "an abrupt loss of thrust and torque together at high speed, a rise of shaft speed, recovery with hysteresis",
    confused_with: &["cavitation", "air_ingestion", "blade_stall"],
    separated_by: "depth changed at the same speed; the recovery on the way down",
    reference: "Minsaas, Faltinsen, Persson 1983; Smogeli 2006 (thesis, NTNU); kort's form",
    commonness: 0.3,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[],
    parameters,
    starts: |scale| {
        let start = |share, recovery| vec![0.05, share * scale.shaft_speed_rad_s, 0.1, recovery, 0.2, 0.9];
        vec![start(0.5, 0.3), start(0.65, 0.3), start(0.65, 2.0), start(0.95, 0.3)]
    },
    needs: wet,
    build: both!(|values, _| {
        Box::new(Ventilation {
            loss: values[0],
            onset_rad_s: values[1],
            lag_s: values[2],
            recovery_lag_s: values[3],
            hysteresis: values[4],
            drag_share: values[5],
            first_depth_m: None,
        })
    }),
};

fn parameters(scale: &Scale) -> Vec<Spec> {
    let full = scale.shaft_speed_rad_s;
    vec![
        Spec::strength("thrust_loss", "1", 0.05, 0.0, 0.95).sigma(0.4),
        Spec::shape("onset_speed_rad_s", "rad/s", 0.8 * full, 0.2 * full, 1.3 * full).sigma(0.25 * full),
        Spec::shape("lag_s", "s", 0.1, 0.02, 20.0).sigma(0.5),
        Spec::shape("recovery_lag_s", "s", 0.3, 0.02, 60.0).sigma(2.0),
        Spec::shape("hysteresis", "1", 0.2, 0.0, 0.7).sigma(0.2),
        Spec::shape("drag_loss_over_lift_loss", "1", 0.9, 0.2, 1.3).sigma(0.25),
    ]
}

struct Ventilation<T> {
    loss: T,
    onset_rad_s: T,
    lag_s: T,
    recovery_lag_s: T,
    hysteresis: T,
    drag_share: T,
    first_depth_m: Option<f64>,
}

impl<T: Real> Effect<T> for Ventilation<T> {
    fn states(&self) -> usize {
        1
    }

    fn hooks(&self) -> Hooks {
        Hooks { drive: true, foil: true, balance: true, ..Hooks::NONE }
    }

    fn drive(&mut self, tick: &Tick, _: &mut Drive<T>) {
        self.first_depth_m = self.first_depth_m.or(tick.depth_m);
    }

    fn foil(&self, _: &Local<T>, own: &[T], foil: &mut Foil<T>) {
        foil.lift *= T::ONE - self.loss * own[0];
        foil.drag *= T::ONE - self.drag_share * self.loss * own[0];
    }

    fn balance(&self, at: &Local<T>, own: &[T], _: &mut Balance<T>, rates: &mut [T]) {
        let deeper = match (at.depth_m, self.first_depth_m) {
            (Some(now), Some(first)) if first > 0.0 => (now / first).clamp(0.05, 20.0).sqrt(),
            _ => 1.0,
        };
        let past = at.shaft_speed_rad_s.abs() / (self.onset_rad_s * deeper) - 1.0 + self.hysteresis * own[0];
        let wanted = (past / WIDTH).logistic();
        // One lag passes into the other smoothly, as the integrator wants it.
        let coming = ((wanted - own[0]) / 0.05).logistic();
        rates[0] = (wanted - own[0]) * (coming / self.lag_s + (T::ONE - coming) / self.recovery_lag_s);
    }
}
