//! The encoder's disc sits off centre.

use super::memory::EncoderAhead;
use super::{
    Available, Descriptor, Effect, Hooks, Path, Scale, Sensing, Spec, angle_known, speed_measured,
    turns_round,
};
use crate::plant::{Sensed, Tick};
use crate::real::Real;
use crate::rig::Rig;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "encoder_eccentricity",
    path: Path::Sensor,
    what: "the encoder's disc sits off centre, or a resolver's two windings differ: measured speed varies once or twice a turn",
    equation: "y = Om (1 + sum_k ak sin kq + bk cos kq), k = 1, 2, through the stated filter; a, b [1], q shaft angle [rad], a \
               recorded angle shows q + g sum_k (bk sin kq - ak cos kq)/k, g = 1 if it is the disc's, 0 if another's",
    signature: "lines at orders 1 and 2 of shaft angle in speed, in proportion to speed; none in thrust",
    confused_with: &["torque_ripple_cogging"],
    separated_by: "a slow creep over full turns, averaged over angle, speed against thrust",
    reference: "Doebelin, Measurement Systems (angle encoders)",
    commonness: 0.7,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[&[0, 1], &[2, 3], &[0, 1, 2, 3]],
    parameters,
    starts: |_| [1.0, 0.0].map(|disc| vec![0.01, 0.01, 0.01, 0.01, disc]).to_vec(),
    needs,
    build: both!(|values, context| {
        Box::new(Eccentricity {
            disc: Disc { first: [values[0], values[1]], second: [values[2], values[3]] },
            angle_share: values[4],
            encoder: EncoderAhead::new(context),
        })
    }),
};

fn parameters(_: &Scale) -> Vec<Spec> {
    // A disc e off the centre of a track of radius r shows e/r: below 1 % in a mounted encoder, half a millimetre on a
    // magnet of a centimetre.
    let part = |name| Spec::strength(name, "1", 0.01, -0.5, 0.5).sigma(0.05);
    let angle = Spec::held("share_in_recorded_angle", "1", 1.0, 0.0, 1.0);
    vec![part("once_sin"), part("once_cos"), part("twice_sin"), part("twice_cos"), angle]
}

fn needs(rig: &Rig, available: &Available) -> Result<(), &'static str> {
    speed_measured(rig, available)?;
    angle_known(rig, available)?;
    turns_round(rig, available)
}

struct Eccentricity<T> {
    disc: Disc<T>,
    angle_share: T,
    encoder: EncoderAhead<T>,
}

/// Waves of the first and the second order: of sine and of cosine.
#[derive(Clone, Copy)]
struct Disc<T> {
    first: [T; 2],
    second: [T; 2],
}

impl<T: Real> Disc<T> {
    /// How much faster the disc seems to turn at an angle, as a share; and by how much it seems to have turned
    /// further, rad.
    fn wave(&self, angle: T) -> (T, T) {
        let (sin, cos) = angle.sin_cos();
        let (sin_2, cos_2) = (sin * 2.0 * cos, T::ONE - sin * 2.0 * sin);
        let [[a, b], [c, d]] = [self.first, self.second];
        (a * sin + b * cos + c * sin_2 + d * cos_2, b * sin - a * cos + (d * sin_2 - c * cos_2) * 0.5)
    }

    /// The angle at which the disc shows this one, rad: Newton's method, since the recorded angle is the disc's too.
    fn true_angle(&self, shown_rad: f64) -> T {
        let mut angle = T::from(shown_rad);
        for _ in 0..NEWTON_STEPS {
            let (faster, further) = self.wave(angle);
            // A disc that seems to stand still or turn back shows an angle more than once.
            angle -= (angle + further - T::from(shown_rad)) / (faster + 1.0).max(T::from(LEAST_SLOPE));
        }
        angle
    }
}

/// Steps from the shown angle to the true one: a disc 0.3 off shows it to 1e-3 after two.
const NEWTON_STEPS: usize = 2;
/// Least share of the true speed that a step takes the disc to show.
const LEAST_SLOPE: f64 = 0.3;

impl<T: Real> Effect<T> for Eccentricity<T> {
    fn hooks(&self) -> Hooks {
        Hooks::SENSE
    }

    fn sensing(&self) -> Sensing {
        Sensing::Disc
    }

    fn sense(&mut self, tick: &Tick, sensed: &mut Sensed<T>) {
        let angle = tick.shaft_angle_rad.map_or(sensed.shaft_angle_rad, |(_, end)| self.disc.true_angle(end));
        let (wave, further) = self.disc.wave(angle);
        sensed.shaft_angle_rad += further * self.angle_share;
        sensed.shaft_speed_rad_s += self.encoder.step(further, sensed.true_speed_rad_s * wave);
    }
}

#[cfg(test)]
mod tests {
    use super::Disc;

    #[test]
    fn the_true_angle_is_the_one_at_which_the_disc_shows_the_recorded() {
        let disc = Disc { first: [0.2, -0.1], second: [0.1, 0.05] };
        for k in 0..60 {
            let angle: f64 = 0.37 * f64::from(k) - 9.0;
            let shown = angle + disc.wave(angle).1;
            assert!((disc.true_angle(shown) - angle).abs() < 1e-3, "{angle}");
            // The speed shown is the rate of the angle shown.
            let rate = (disc.wave(angle + 1e-6).1 - disc.wave(angle - 1e-6).1) / 2e-6;
            assert!((rate - disc.wave(angle).0).abs() < 1e-6);
        }
    }
}
