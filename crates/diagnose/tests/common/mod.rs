//! What simulations of these tests share.

/// Noise that is the same in every run: a linear congruential generator (Knuth, MMIX).
pub struct Draws(pub u64);

impl Draws {
    /// From -1 to 1.
    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as f64 / f64::from(1_u32 << 30) - 1.0
    }
}
