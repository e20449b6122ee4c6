//! How often which error: bins in octaves, so that a percentile of hours takes no memory to speak of.

/// Bins of the error histogram: 64 an octave, from 2^-20 of full scale to 4 times it.
const BIN_BITS: u32 = 6;
const BINS: usize = 22 << BIN_BITS;
/// 2^-20 as the exponent of a number in memory.
const LEAST_EXPONENT: u64 = 1023 - 20;

/// Errors counted, as shares of full scale.
pub(super) struct Histogram {
    bins: Vec<u32>,
}

impl Histogram {
    pub(super) fn new() -> Self {
        Self { bins: vec![0; BINS] }
    }

    pub(super) fn count(&mut self, share: f64) {
        self.bins[bin(share)] += 1;
    }

    /// Upper edge of the bin below which this share of all that was counted lies.
    pub(super) fn percentile(&self, share: f64) -> f64 {
        let all: u64 = self.bins.iter().map(|count| u64::from(*count)).sum();
        let target = (share * all as f64) as u64;
        let mut below = 0;
        for (i, count) in self.bins.iter().enumerate() {
            below += u64::from(*count);
            if below > target {
                return edge(i + 1);
            }
        }
        0.0
    }
}

/// The exponent and the leading bits of the fraction are a logarithmic scale, straight within an octave.
fn bin(share: f64) -> usize {
    let place = share.to_bits() >> (52 - BIN_BITS);
    (place.saturating_sub(LEAST_EXPONENT << BIN_BITS) as usize).min(BINS - 1)
}

/// Lower edge of a bin.
fn edge(bin: usize) -> f64 {
    f64::from_bits((bin as u64 + (LEAST_EXPONENT << BIN_BITS)) << (52 - BIN_BITS))
}
