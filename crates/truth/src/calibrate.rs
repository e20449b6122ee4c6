//! Sizes: scales of a run, strength of an effect as a share of full scale, what a re-fit absorbs.

use crate::dynamics::Scale;
use crate::hidden::Hidden;
use crate::refit;
use crate::stand::{ROWS_PER_FLOW, Rows, Stand};
use crate::thruster::Thruster;

/// Integration steps a tick while sizing; the recording itself takes [`FINE_STEPS`].
const COARSE_STEPS: usize = 2;
/// Integration steps a tick of a recording: 0.2 ms.
pub const FINE_STEPS: usize = 10;

/// Channels that a size is measured on, with the noise they carry over their largest value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Channels {
    /// Thrust is recorded.
    pub thrust: bool,
    /// Torque is recorded.
    pub torque: bool,
    /// Flow is recorded.
    pub flow: bool,
    /// Current is recorded.
    pub current: bool,
    /// Supply voltage is recorded.
    pub supply: bool,
}

/// One experiment whose sizes are asked for.
pub struct Experiment<'a> {
    /// True thruster.
    pub thruster: &'a Thruster,
    /// Command, a value a tick, A.
    pub command_a: &'a [f64],
    /// Recorded channels.
    pub channels: Channels,
    /// Largest values without hidden physics.
    pub scale: Scale,
    clean: Rows,
}

/// Response channels as (name, values, noise over full scale), flow at its own rate.
fn responses(rows: &Rows, channels: Channels) -> Vec<(&'static str, Vec<f64>, f64)> {
    let mut list = vec![("shaft_speed_rad_s", rows.speed_rad_s.clone(), 0.0013)];
    if channels.thrust {
        list.push(("thrust_n", rows.thrust_n.clone(), 0.005));
    }
    if channels.torque {
        list.push(("torque_n_m", rows.torque_n_m.clone(), 0.008));
    }
    if channels.flow {
        list.push(("flow_m_s", rows.flow_m_s.iter().step_by(ROWS_PER_FLOW).copied().collect(), 0.019));
    }
    list
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |top: f64, value| top.max(value.abs()))
}

fn rms(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len().max(1) as f64;
    (values.map(|value| value * value).sum::<f64>() / count).sqrt()
}

impl<'a> Experiment<'a> {
    /// Runs the experiment without hidden physics.
    pub fn new(thruster: &'a Thruster, command_a: &'a [f64], channels: Channels) -> Self {
        let unit = Scale { speed_rad_s: 1.0, flow_m_s: 1.0, thrust_n: 1.0, torque_n_m: 1.0 };
        let clean = smooth(thruster, &Hidden::default(), unit, command_a);
        let scale = Scale {
            speed_rad_s: largest(&clean.speed_rad_s),
            flow_m_s: largest(&clean.flow_m_s),
            thrust_n: largest(&clean.thrust_n),
            torque_n_m: largest(&clean.torque_n_m),
        };
        Experiment { thruster, command_a, channels, scale, clean }
    }

    /// Change that `hidden` makes on each channel, over that channel's largest value.
    fn change(&self, hidden: &Hidden) -> Vec<(&'static str, Vec<f64>, f64)> {
        let with = responses(&smooth(self.thruster, hidden, self.scale, self.command_a), self.channels);
        let clean = responses(&self.clean, self.channels);
        with.into_iter()
            .zip(clean)
            .map(|((name, with, noise), (_, clean, _))| {
                let full = largest(&clean);
                (name, with.iter().zip(&clean).map(|(w, c)| (w - c) / full).collect(), noise)
            })
            .collect()
    }

    /// Root-mean-square change on the best channel over its full scale, and that channel.
    pub fn share(&self, hidden: &Hidden) -> (f64, &'static str) {
        let sizes = self.change(hidden).into_iter().map(|(name, change, _)| (rms(change.into_iter()), name));
        sizes.fold((0.0, "none"), |best, next| if next.0 > best.0 { next } else { best })
    }

    /// Strength at which `make(strength)` changes the best channel by `wanted` of its full scale.
    /// An effect that saturates below that stays at full strength.
    pub fn strength(&self, wanted: f64, make: impl Fn(f64) -> Hidden) -> f64 {
        let (mut low, mut high, mut guess): (f64, f64, f64) = (1e-5, 1.0, 0.04);
        for _ in 0..14 {
            let (size, _) = self.share(&make(guess));
            if (size / wanted - 1.0).abs() < 0.03 {
                break;
            }
            if size < wanted {
                low = guess;
                if guess >= 0.999 {
                    break;
                }
            } else {
                high = guess;
            }
            let scaled = if size > 0.02 * wanted { guess * (wanted / size).powf(0.8) } else { guess * 5.0 };
            let inside = scaled > low && scaled < high;
            guess = if inside {
                scaled
            } else if high >= 1.0 && scaled >= 1.0 {
                1.0
            } else {
                (low * high).sqrt()
            };
        }
        guess
    }

    /// The share of [`Self::share`] that a re-fit of the seven base parameters leaves (linearised,
    /// channels weighed by their noise, none moved beyond its stated tolerance).
    pub fn visible(&self, hidden: &Hidden, tolerances: &[f64; 7]) -> f64 {
        let target = self.weighed(hidden);
        let rest = refit::residual_within(&self.base_columns(), &target, tolerances);
        self.share(hidden).0 * (energy(&rest) / energy(&target).max(1e-30)).sqrt()
    }

    /// What tells `hidden` from a rival: the sum of squares, in the noise of the channels, that the
    /// best strength of the rival leaves together with a re-fit of the base parameters, and what that
    /// re-fit costs against the stated tolerances (two sigma). `rival` makes one of a given strength;
    /// the search begins at `strength`.
    #[cfg(test)]
    pub fn apart(
        &self,
        hidden: &Hidden,
        rival: impl Fn(f64) -> Hidden,
        strength: f64,
        tolerances: &[f64; 7],
    ) -> f64 {
        let wanted = responses(&smooth(self.thruster, hidden, self.scale, self.command_a), self.channels);
        let full: Vec<f64> = responses(&self.clean, self.channels).iter().map(|c| largest(&c.1)).collect();
        let mut residual = |values: &[f64]| -> Vec<f64> {
            let thruster = (0..7).fold(self.thruster.clone(), |thruster, k| varied(&thruster, k, values[k]));
            let rows = smooth(&thruster, &rival(values[7]), self.scale, self.command_a);
            let channels = responses(&rows, self.channels).into_iter().zip(&wanted).zip(&full);
            let data = channels.flat_map(|(((_, a, noise), (_, b, _)), full)| {
                a.into_iter().zip(b).map(move |(a, b)| (a - b) / (noise * full)).collect::<Vec<f64>>()
            });
            data.chain(values.iter().zip(tolerances).map(|(v, tol)| 2.0 * (v - 1.0) / tol)).collect()
        };
        let mut values = vec![1.0; 8];
        values[7] = strength;
        let mut cost = energy(&residual(&values));
        for _ in 0..10 {
            let mut next = refit::gauss_newton_step(values.clone(), &mut residual, &[0.0; 8]);
            let mut there = energy(&residual(&next));
            // A step too far is halved.
            for _ in 0..8 {
                if there < cost {
                    break;
                }
                next.iter_mut().zip(&values).for_each(|(n, v)| *n = 0.5 * (*n + v));
                there = energy(&residual(&next));
            }
            if there > 0.999 * cost {
                break;
            }
            (values, cost) = (next, there);
        }
        cost
    }

    /// The change that `hidden` makes on all channels, in their noise.
    fn weighed(&self, hidden: &Hidden) -> Vec<f64> {
        let change = self.change(hidden);
        change.iter().flat_map(|(_, values, noise)| values.iter().map(move |value| value / noise)).collect()
    }

    /// What a relative change of each base parameter does, on all channels, in their noise.
    fn base_columns(&self) -> Vec<Vec<f64>> {
        let step = 1e-3;
        let clean = responses(&self.clean, self.channels);
        (0..7)
            .map(|index| {
                let moved = varied(self.thruster, index, 1.0 + step);
                let moved = smooth(&moved, &Hidden::default(), self.scale, self.command_a);
                responses(&moved, self.channels)
                    .into_iter()
                    .zip(&clean)
                    .flat_map(|((_, m, noise), (_, c, _))| {
                        let unit = step * largest(c) * noise;
                        m.into_iter().zip(c).map(move |(m, c)| (m - c) / unit).collect::<Vec<f64>>()
                    })
                    .collect()
            })
            .collect()
    }
}

fn energy(values: &[f64]) -> f64 {
    values.iter().map(|value| value * value).sum()
}

/// A thruster with one of its seven base parameters scaled.
fn varied(thruster: &Thruster, index: usize, factor: f64) -> Thruster {
    let mut t = thruster.clone();
    match index {
        0 => t.sections.iter_mut().for_each(|section| section.pitch_rad *= factor),
        1 => t.section_gain.0 *= factor,
        2 => t.section_gain.1 *= factor,
        3 => t.flux_coefficient *= factor,
        4 => t.added_mass_coefficient *= factor,
        5 => t.inertia_kg_m2 *= factor,
        _ => t.torque_constant_nm_a *= factor,
    }
    t
}

fn smooth(thruster: &Thruster, hidden: &Hidden, scale: Scale, command_a: &[f64]) -> Rows {
    // Teeth that pass in a millisecond are not seen in steps of one.
    let steps_per_tick = if hidden.cogging_order > 0.0 { FINE_STEPS } else { COARSE_STEPS };
    let stand = Stand { thruster, hidden, scale, thrust_full_scale_n: f64::INFINITY, steps_per_tick };
    stand.record_smooth(command_a)
}
