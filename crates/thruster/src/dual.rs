//! Dual numbers: a value and its derivatives by several parameters, under the rules of calculus.

use std::cmp::Ordering;
use std::iter::Sum;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use wide::f64x4;

/// Derivatives that a number carries.
pub const LANES: usize = 4;

/// A number and its derivatives by up to [`LANES`] parameters.
#[derive(Clone, Copy, Debug)]
pub struct Dual {
    /// The number.
    pub value: f64,
    slopes: f64x4,
}

impl Dual {
    /// A number that no parameter changes.
    pub const fn constant(value: f64) -> Self {
        Self { value, slopes: f64x4::ZERO }
    }

    /// The parameter itself that a lane is about.
    pub fn parameter(value: f64, lane: usize) -> Self {
        let slopes = std::array::from_fn(|k| if k == lane { 1.0 } else { 0.0 });
        Self { value, slopes: f64x4::new(slopes) }
    }

    /// The same derivatives with another value.
    #[inline(always)]
    pub fn with(self, value: f64) -> Self {
        Self { value, ..self }
    }

    /// Whether the derivatives are the same.
    #[inline(always)]
    pub fn same_slopes(self, other: Self) -> bool {
        self.slopes == other.slopes
    }

    /// Its derivatives, by lane.
    pub fn slopes(self) -> [f64; LANES] {
        self.slopes.to_array()
    }
}

impl From<f64> for Dual {
    #[inline(always)]
    fn from(value: f64) -> Self {
        Self::constant(value)
    }
}

impl Neg for Dual {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { value: -self.value, slopes: -self.slopes }
    }
}

impl Add for Dual {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { value: self.value + other.value, slopes: self.slopes + other.slopes }
    }
}

impl Sub for Dual {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { value: self.value - other.value, slopes: self.slopes - other.slopes }
    }
}

impl Mul for Dual {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        let (a, b) = (f64x4::splat(self.value), f64x4::splat(other.value));
        Self { value: self.value * other.value, slopes: self.slopes.mul_add(b, other.slopes * a) }
    }
}

impl Div for Dual {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        let (quotient, per) = (f64x4::splat(value), f64x4::splat(1.0 / other.value));
        Self { value, slopes: (self.slopes - other.slopes * quotient) * per }
    }
}

impl Add<f64> for Dual {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: f64) -> Self {
        Self { value: self.value + other, ..self }
    }
}

impl Sub<f64> for Dual {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: f64) -> Self {
        Self { value: self.value - other, ..self }
    }
}

impl Mul<f64> for Dual {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: f64) -> Self {
        Self { value: self.value * other, slopes: self.slopes * f64x4::splat(other) }
    }
}

impl Div<f64> for Dual {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: f64) -> Self {
        (self * (1.0 / other)).with(self.value / other)
    }
}

macro_rules! assigned {
    ($($name:ident $function:ident $sign:tt)*) => {
        $(impl $name for Dual {
            #[inline(always)]
            fn $function(&mut self, other: Self) {
                *self = *self $sign other;
            }
        })*
    };
}

assigned! { AddAssign add_assign + SubAssign sub_assign - MulAssign mul_assign * DivAssign div_assign / }

impl Sum for Dual {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::from(0.0), |sum, one| sum + one)
    }
}

impl PartialEq for Dual {
    #[inline(always)]
    fn eq(&self, other: &Self) -> bool {
        self.value == other.value
    }
}

impl PartialOrd for Dual {
    #[inline(always)]
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        self.value.partial_cmp(&other.value)
    }
}

impl PartialEq<f64> for Dual {
    #[inline(always)]
    fn eq(&self, other: &f64) -> bool {
        self.value == *other
    }
}

impl PartialOrd<f64> for Dual {
    #[inline(always)]
    fn partial_cmp(&self, other: &f64) -> Option<Ordering> {
        self.value.partial_cmp(other)
    }
}
