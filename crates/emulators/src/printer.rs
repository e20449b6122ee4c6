//! An instrument that prints a line of numbers some times a second, as force cells' amplifiers and flow meters do: a
//! count, a value with its unit, separated by semicolons.

use crate::bench::{Device, Truth};

/// An emulated instrument.
pub struct Printer {
    value: f64,
    period_s: f64,
    next_s: f64,
    count: u32,
}

impl Printer {
    /// One that prints `value` at `rate_hz`.
    pub fn new(value: f64, rate_hz: f64) -> Self {
        Self { value, period_s: 1.0 / rate_hz, next_s: 0.0, count: 0 }
    }
}

impl Device for Printer {
    fn hear(&mut self, _: f64, _: &[u8]) -> Vec<Vec<u8>> {
        Vec::new()
    }

    fn live(&mut self, now_s: f64) -> Vec<Vec<u8>> {
        if now_s < self.next_s {
            return Vec::new();
        }
        self.next_s = now_s + self.period_s;
        self.count += 1;
        vec![format!("{}; {:.4} kgf\r\n", self.count, self.value).into_bytes()]
    }

    fn restart(&mut self, _: f64) {
        self.count = 0;
    }

    fn report(&mut self, code: u32) {
        self.value = f64::from(code);
    }

    fn truth(&self) -> Truth {
        Truth::default()
    }
}
