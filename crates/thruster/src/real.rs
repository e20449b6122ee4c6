//! What the plant computes with: plain numbers, or numbers that carry their derivatives along.
//!
//! One simulation in [`Dual`] numbers gives the response and its derivatives by up to
//! [`LANES`](crate::dual::LANES) parameters, exact to rounding.

use std::iter::Sum;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use crate::dual::Dual;
use crate::effects::{Context, Descriptor, Effect};
use crate::plant::{Plant, Tick};

/// `f64` or [`Dual`]: comparisons look at the value, arithmetic takes the derivatives along.
///
/// Where a value lies on a kink, `max` and `min` go on with the first of their numbers and `clamp` with
/// the bound, so that a strength at zero shows the slope into its range.
pub trait Real:
    Copy
    + Send
    + Sync
    + std::fmt::Debug
    + From<f64>
    + Neg<Output = Self>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Add<f64, Output = Self>
    + Sub<f64, Output = Self>
    + Mul<f64, Output = Self>
    + Div<f64, Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
    + DivAssign
    + Sum
    + PartialEq
    + PartialOrd
    + PartialOrd<f64>
    + 'static
{
    /// Zero.
    const ZERO: Self;
    /// One.
    const ONE: Self;

    /// The value.
    fn re(self) -> f64;
    /// The same derivatives with another value.
    fn with(self, value: f64) -> Self;
    /// Whether the derivatives are the same.
    fn same_slopes(self, other: Self) -> bool;
    /// An effect at work on these numbers.
    fn build(effect: &Descriptor, values: &[Self], context: &Context<Self>) -> Box<dyn Effect<Self>>;

    /// Control ticks of a plant in these numbers. What is generic is compiled anew in every crate that says for which numbers;
    /// through this, the plant's copies of its inner loop are compiled once, in this one.
    fn advance(plant: &mut Plant<Self>, ticks: &[Tick], commands: Option<&[f64]>);
    /// The loads of a plant in these numbers, and what its sensors show, in the state that it starts from.
    fn settle(plant: &mut Plant<Self>);

    /// A function of this number, from its value and its slope.
    #[inline(always)]
    fn chain(self, value: f64, slope: f64) -> Self {
        (self * slope).with(value)
    }
    /// The larger one; this one if the other is no number.
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        let value = self.re().max(other.re());
        if value == self.re() { self } else { other }
    }
    /// The smaller one; this one if the other is no number.
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        let value = self.re().min(other.re());
        if value == self.re() { self } else { other }
    }
    /// Held between two bounds; on a bound it is the bound that counts.
    #[inline(always)]
    fn clamp(self, low: Self, high: Self) -> Self {
        if self <= low {
            low
        } else if self >= high {
            high
        } else {
            self
        }
    }
    /// Absolute value.
    #[inline(always)]
    fn abs(self) -> Self {
        self.chain(self.re().abs(), self.re().signum())
    }
    /// `1/x`
    #[inline(always)]
    fn recip(self) -> Self {
        let value = 1.0 / self.re();
        self.chain(value, -value * value)
    }
    /// `x^2`
    #[inline(always)]
    fn squared(self) -> Self {
        self * self
    }
    /// Square root.
    #[inline(always)]
    fn sqrt(self) -> Self {
        let value = self.re().sqrt();
        self.chain(value, 0.5 / value)
    }
    /// `e^x`
    #[inline(always)]
    fn exp(self) -> Self {
        let value = self.re().exp();
        self.chain(value, value)
    }
    /// `x^y` for positive x.
    #[inline(always)]
    fn powf(self, y: Self) -> Self {
        let (base, power) = (self.re(), y.re());
        let value = base.powf(power);
        (self * (value * power / base) + y * (value * base.ln())).with(value)
    }
    /// Sine and cosine.
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.re().sin_cos();
        (self.chain(sin, cos), self.chain(cos, -sin))
    }
    /// Tangent.
    #[inline(always)]
    fn tan(self) -> Self {
        let value = self.re().tan();
        self.chain(value, 1.0 + value * value)
    }
    /// Hyperbolic tangent.
    #[inline(always)]
    fn tanh(self) -> Self {
        let value = self.re().tanh();
        self.chain(value, 1.0 - value * value)
    }
    /// Angle of the point (x, y = this number), rad.
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        let (b, a) = (self.re(), x.re());
        let square = (a * a + b * b).max(f64::MIN_POSITIVE);
        (self * (a / square) - x * (b / square)).with(b.atan2(a))
    }
    /// A smooth step from 0 to 1 about zero, `1/(1 + exp(-x))`.
    #[inline(always)]
    fn logistic(self) -> Self {
        let value = 1.0 / (1.0 + (-self.re()).exp());
        self.chain(value, value * (1.0 - value))
    }
}

impl Real for f64 {
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;

    #[inline(always)]
    fn re(self) -> f64 {
        self
    }
    #[inline(always)]
    fn with(self, value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn same_slopes(self, _: Self) -> bool {
        true
    }
    fn build(effect: &Descriptor, values: &[Self], context: &Context) -> Box<dyn Effect> {
        (effect.build.plain)(values, context)
    }
    fn advance(plant: &mut Plant<Self>, ticks: &[Tick], commands: Option<&[f64]>) {
        plant.advance(ticks, commands);
    }
    fn settle(plant: &mut Plant<Self>) {
        plant.settle();
    }
}

impl Real for Dual {
    const ZERO: Self = Self::constant(0.0);
    const ONE: Self = Self::constant(1.0);

    #[inline(always)]
    fn re(self) -> f64 {
        self.value
    }
    #[inline(always)]
    fn with(self, value: f64) -> Self {
        Self::with(self, value)
    }
    #[inline(always)]
    fn same_slopes(self, other: Self) -> bool {
        Self::same_slopes(self, other)
    }
    fn build(effect: &Descriptor, values: &[Self], context: &Context<Self>) -> Box<dyn Effect<Self>> {
        (effect.build.dual)(values, context)
    }
    fn advance(plant: &mut Plant<Self>, ticks: &[Tick], commands: Option<&[f64]>) {
        plant.advance(ticks, commands);
    }
    fn settle(plant: &mut Plant<Self>) {
        plant.settle();
    }
}
