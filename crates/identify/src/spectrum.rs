//! Residuals line by line in frequency: what a criterion can weigh without one error counting many times.
//!
//! Every channel of every recording is a frame. Its samples in use go through an orthonormal cosine
//! transform (DCT-II: no leakage round the ends), in units of the channel's full scale. Lines are collected
//! in bands, five a decade; the constant is a band of its own.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::DVector;
use rustdct::{DctPlanner, TransformType2And3};

use crate::data::{Channel, Prepared, Response};
use crate::simulate::Stack;

/// Bands a decade of frequency.
const BANDS_A_DECADE: f64 = 5.0;

/// Lines next to each other in frequency, of one channel of one recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Band {
    /// Its lines.
    pub lines: Range<usize>,
    /// Mean frequency, Hz.
    pub hz: f64,
    /// Lines of this channel about this frequency in all recordings: one structural error is in all of them.
    pub alike: usize,
    /// Mean square of the measured signal there, in full scales.
    pub signal: f64,
    /// Variance of the channel's quantisation, in full scales; of a reading at rest what it scatters by too.
    pub quantisation: f64,
    /// Interval between the recording's rows, s.
    pub row_s: f64,
    /// Doubt of the samples' instants beyond that of the stamps, s: a sensor slower than the log shows each
    /// sample at the next row.
    pub stale_s: f64,
    /// Whether the next band continues this channel at higher frequency.
    pub continues: bool,
    /// Whether this is the mean reading while the drive rests before its first command ([`crate::rest`]).
    pub rest: bool,
}

/// One channel of one recording.
#[derive(Clone)]
struct Frame {
    /// Samples in use.
    picks: Vec<usize>,
    full_scale: f64,
    /// What else shows the same motion.
    twice: Option<Twice>,
    transform: Arc<dyn TransformType2And3<f64>>,
    lines: Range<usize>,
    /// Samples at rest; their mean is a line of its own, after the others.
    rest: Vec<usize>,
}

/// Speed and angle show one motion, which must not count twice: the lines of the speed are those of the less noisy of the
/// two, the lines of the angle's rate are its difference to the speed, which shows what the sensors do.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Twice {
    /// Of a speed: the angle's place among the channels, and how many of the lowest lines are its rate's.
    Speed { angle: usize, lines: usize },
    /// Of an angle: the speed's place.
    Angle { speed: usize },
}

/// All channels of all recordings.
#[derive(Clone)]
pub struct Spectrum {
    frames: Vec<Vec<Frame>>,
    /// Bands of all frames, low to high frequency within each.
    pub bands: Vec<Band>,
    /// Number of lines in all.
    pub lines: usize,
}

impl Spectrum {
    /// For recordings of which `masked` rows are left out.
    pub fn new(recordings: &[Prepared], masked: &[Vec<bool>]) -> Self {
        let mut planner = DctPlanner::new();
        let (mut frames, mut bands, mut lines) = (Vec::new(), Vec::new(), 0);
        let mut places = Vec::new();
        for (nth, (recording, masked)) in recordings.iter().zip(masked).enumerate() {
            let mut own = Vec::new();
            for channel in &recording.channels {
                let picks: Vec<usize> =
                    (0..channel.rows.len()).filter(|k| !masked[channel.rows[*k]]).collect();
                let n = picks.len();
                let ranges = band_ranges(n);
                let twice = shown_twice(recording, channel, &picks, &ranges);
                let frame = Frame {
                    full_scale: channel.full_scale,
                    twice,
                    transform: planner.plan_dct2(n.max(1)),
                    lines: lines..lines + n,
                    rest: recording.at_rest(channel, masked),
                    picks,
                };
                let times: Vec<f64> =
                    frame.picks.iter().map(|k| recording.time_s[channel.rows[*k]]).collect();
                let interval_s = median_interval(&times);
                let mut signal = vec![0.0; n];
                let samples = |c: usize| recording.channels[c].values.as_slice();
                frame.transform(&channel.values, samples, &mut signal);
                let quantised =
                    |channel: &Channel| (quantum(&channel.values) / frame.full_scale).powi(2) / 12.0;
                let quantisation = quantised(channel);
                let row_s = median_interval(&recording.time_s);
                // Of a delay anywhere in a row the mean is a free number; what differs from sample to sample is not.
                let stale_s = match channel.held_s {
                    Some(held_s) => held_s / 12.0_f64.sqrt(),
                    None if is_slow(interval_s, row_s) => row_s / 12.0_f64.sqrt(),
                    None => 0.0,
                };
                for (i, range) in ranges.iter().enumerate() {
                    let power: f64 = signal[range.clone()].iter().map(|v| v * v).sum();
                    // The constant counts as half of the lowest frequency.
                    let middle = (0.5 * (range.start + range.end - 1) as f64).max(0.5);
                    let hz = middle / (2.0 * n as f64 * interval_s);
                    bands.push(Band {
                        lines: lines + range.start..lines + range.end,
                        hz,
                        alike: range.len(),
                        signal: power / range.len() as f64,
                        quantisation: match frame.twice {
                            Some(Twice::Speed { angle, lines }) if range.start < lines => {
                                let counts = quantised(&recording.channels[angle]);
                                counts * differenced(Response::ShaftAngle, hz * interval_s, n)
                            }
                            _ => quantisation * differenced(channel.response, hz * interval_s, n),
                        },
                        row_s,
                        stale_s,
                        continues: i + 1 < ranges.len(),
                        rest: false,
                    });
                    places.push(Place { recording: nth, response: channel.response, constant: i == 0 });
                }
                lines += n;
                if !frame.rest.is_empty() {
                    let scatter = variance(&channel.values, &frame.rest) / channel.full_scale.powi(2);
                    bands.push(Band {
                        lines: lines..lines + 1,
                        hz: 0.5 / (2.0 * n as f64 * interval_s),
                        alike: 1,
                        signal: 0.0,
                        quantisation: quantisation + scatter,
                        row_s,
                        stale_s: 0.0,
                        continues: false,
                        rest: true,
                    });
                    places.push(Place { recording: nth, response: channel.response, constant: true });
                    lines += 1;
                }
                own.push(frame);
            }
            frames.push(own);
        }
        count_alike(&mut bands, &places);
        Self { frames, bands, lines }
    }

    /// The lines of a stack of samples.
    pub fn transform(&self, stack: &Stack) -> DVector<f64> {
        let mut out = DVector::zeros(self.lines);
        for (frames, channels) in self.frames.iter().zip(stack) {
            for (frame, samples) in frames.iter().zip(channels) {
                let own = &mut out.as_mut_slice()[frame.lines.clone()];
                frame.transform(samples, |c| channels[c].as_slice(), own);
                if !frame.rest.is_empty() {
                    let sum: f64 = frame.rest.iter().map(|k| samples[*k]).sum();
                    out[frame.lines.end] = sum / frame.rest.len() as f64 / frame.full_scale;
                }
            }
        }
        out
    }

    /// Mean square of each band.
    pub fn powers(&self, lines: &DVector<f64>) -> Vec<f64> {
        let all = lines.as_slice();
        self.bands
            .iter()
            .map(|b| all[b.lines.clone()].iter().map(|v| v * v).sum::<f64>() / b.lines.len() as f64)
            .collect()
    }

    /// Mean of a variance by band over the lines of each channel of each recording, in its unit squared. What a
    /// channel shares with another counts with it.
    pub fn variances(&self, by_band: &[f64]) -> Vec<Vec<f64>> {
        let over = |frame: &Frame, lines: Range<usize>| {
            let lines = frame.lines.start + lines.start..frame.lines.start + lines.end;
            let bands = self.bands.iter().zip(by_band).filter(|(b, _)| lines.contains(&b.lines.start));
            let sum: f64 = bands.map(|(b, v)| v * b.lines.len() as f64).sum();
            sum / frame.lines.len().max(1) as f64 * frame.full_scale.powi(2)
        };
        let of = |frames: &Vec<Frame>, frame: &Frame| {
            let n = frame.lines.len();
            over(frame, 0..n)
                + match frame.twice {
                    None => 0.0,
                    // Where the lines are the other's, the difference of the two lies between.
                    Some(Twice::Speed { angle, lines }) => over(&frames[angle], 0..lines),
                    Some(Twice::Angle { speed }) => {
                        let lines = frames[speed].lines_of_other();
                        over(&frames[speed], 0..n) - over(frame, 0..lines)
                    }
                }
        };
        self.frames.iter().map(|frames| frames.iter().map(|frame| of(frames, frame)).collect()).collect()
    }
}

impl Frame {
    /// Lines of a speed that are an angle's rate.
    const fn lines_of_other(&self) -> usize {
        match self.twice {
            Some(Twice::Speed { lines, .. }) => lines,
            _ => 0,
        }
    }

    fn transform<'s>(&self, samples: &[f64], of: impl Fn(usize) -> &'s [f64], lines: &mut [f64]) {
        match self.twice {
            None => self.cosines(|k| samples[k], lines),
            Some(Twice::Angle { speed }) => {
                let speed = of(speed);
                self.cosines(|k| samples[k] - speed[k], lines);
            }
            Some(Twice::Speed { angle, lines: slow }) => {
                self.cosines(|k| samples[k], lines);
                if slow > 0 {
                    let angle = of(angle);
                    let mut rates = vec![0.0; lines.len()];
                    self.cosines(|k| angle[k], &mut rates);
                    lines[..slow].copy_from_slice(&rates[..slow]);
                }
            }
        }
    }

    fn cosines(&self, sample: impl Fn(usize) -> f64, lines: &mut [f64]) {
        let n = self.picks.len();
        for (line, k) in lines.iter_mut().zip(&self.picks) {
            *line = sample(*k) / self.full_scale;
        }
        if n == 0 {
            return;
        }
        self.transform.process_dct2(lines);
        // From rustdct's scaling to the orthonormal one.
        let scale = (2.0 / n as f64).sqrt();
        lines.iter_mut().for_each(|v| *v *= scale);
        lines[0] *= std::f64::consts::FRAC_1_SQRT_2;
    }
}

/// Which other channel shows the motion that this one shows. Noise of a speed is as strong in its slow lines as in its fast
/// ones, that of an angle's rate grows with frequency, since what one sample is off the next rate makes up for: below where
/// they are equal the angle tells more.
fn shown_twice(
    recording: &Prepared,
    channel: &Channel,
    picks: &[usize],
    bands: &[Range<usize>],
) -> Option<Twice> {
    let find = |response| {
        let alike = |other: &Channel| other.response == response && other.rows == channel.rows;
        recording.channels.iter().position(alike)
    };
    match channel.response {
        Response::ShaftAngle => find(Response::ShaftSpeed).map(|speed| Twice::Angle { speed }),
        Response::ShaftSpeed => find(Response::ShaftAngle).map(|angle| {
            // Power a line of white noise of a speed, and of samples whose differences are the rates.
            let speed_noise = scatter(&channel.values, picks) / 6.0;
            // The first rate is none.
            let sample_noise =
                scatter(&recording.channels[angle].values, picks.get(1..).unwrap_or_default()) / 20.0;
            let tells_more = |range: &&Range<usize>| {
                let of_sampling = 0.25 * (range.start + range.end - 1) as f64 / picks.len() as f64;
                sample_noise * (2.0 * (std::f64::consts::PI * of_sampling).sin()).powi(2) < speed_noise
            };
            let slow = bands.iter().take_while(tells_more).last();
            Twice::Speed { angle, lines: slow.map_or(0, |range| range.end) }
        }),
        _ => None,
    }
}

/// Whose lines a band holds.
struct Place {
    recording: usize,
    response: Response,
    /// Whether it is the constant.
    constant: bool,
}

/// Counts the lines about each band's frequency in all recordings of the same channel.
fn count_alike(bands: &mut [Band], places: &[Place]) {
    let half_a_band = 0.5 / BANDS_A_DECADE;
    let own: Vec<(f64, usize)> = bands.iter().map(|band| (band.hz.log10(), band.lines.len())).collect();
    let rests: Vec<bool> = bands.iter().map(|band| band.rest).collect();
    for ((band, place), (at, _)) in bands.iter_mut().zip(places).zip(&own) {
        let alike = places
            .iter()
            .zip(&own)
            .zip(&rests)
            .filter(|(_, rest)| **rest == band.rest)
            .map(|(other, _)| other);
        let others = alike.filter(|(other, (hz, _))| {
            other.recording != place.recording
                && other.response == place.response
                && other.constant == place.constant
                && (place.constant || (hz - at).abs() < half_a_band)
        });
        band.alike += others.map(|(_, (_, lines))| lines).sum::<usize>();
    }
}

/// Lines of each band: the constant, then five bands a decade.
fn band_ranges(lines: usize) -> Vec<Range<usize>> {
    let mut ranges = Vec::new();
    if lines > 0 {
        ranges.push(0..1);
    }
    let (mut from, mut edge) = (1, 1.0_f64);
    while from < lines {
        edge *= 10.0_f64.powf(1.0 / BANDS_A_DECADE);
        let to = (edge.round() as usize).max(from + 1).min(lines);
        edge = edge.max(to as f64);
        ranges.push(from..to);
        from = to;
    }
    ranges
}

pub(crate) fn median_interval(times: &[f64]) -> f64 {
    let mut steps: Vec<f64> = times.windows(2).map(|w| w[1] - w[0]).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied().unwrap_or(1.0)
}

/// Whether a sensor is slower than the log.
pub(crate) fn is_slow(interval_s: f64, row_s: f64) -> bool {
    interval_s > 1.5 * row_s
}

/// Mean square of how far a value lies off the line through its neighbours, which is noise's for the most.
fn scatter(values: &[f64], picks: &[usize]) -> f64 {
    let off = |w: &[usize]| (values[w[0]] - 2.0 * values[w[1]] + values[w[2]]).powi(2);
    picks.windows(3).map(off).sum::<f64>() / picks.len().max(1) as f64
}

/// Variance of some of the values.
fn variance(values: &[f64], picks: &[usize]) -> f64 {
    let n = picks.len() as f64;
    let mean = picks.iter().map(|k| values[*k]).sum::<f64>() / n;
    picks.iter().map(|k| (values[*k] - mean).powi(2)).sum::<f64>() / n
}

/// Power that counts of an angle keep at a share of the sampling frequency where their differences are compared, over that of
/// as coarse a converter, whose steps are as many in a slow signal as in a fast one: what a count is short of comes with the
/// next, but for the two at the ends of so many.
fn differenced(response: Response, of_sampling: f64, samples: usize) -> f64 {
    if response == Response::ShaftAngle {
        (2.0 * (std::f64::consts::PI * of_sampling).sin()).powi(2) + 4.0 / samples as f64
    } else {
        1.0
    }
}

/// Least distance between two different values: the step of a coarse converter, nearly nothing of a fine one.
fn quantum(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let mut steps: Vec<f64> = sorted.windows(2).map(|w| w[1] - w[0]).filter(|d| *d > 0.0).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 50).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests;
