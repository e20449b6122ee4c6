//! An instrument that prints a line of numbers some times a second, as force cells' amplifiers and flow meters do: a
//! count, a value with its unit, separated by semicolons.

use crate::bench::{Device, Lie, Mischief, Truth};

/// An emulated instrument.
pub struct Printer {
    value: Box<dyn Fn() -> f64 + Send>,
    unit: &'static str,
    period_s: f64,
    next_s: f64,
    count: u32,
    lie: Lie,
}

impl Printer {
    /// One that prints `value` at `rate_hz`.
    pub fn new(value: f64, rate_hz: f64) -> Self {
        Self::of(move || value, "kgf", rate_hz)
    }

    /// One that prints what this is at each instant.
    pub fn of(value: impl Fn() -> f64 + Send + 'static, unit: &'static str, rate_hz: f64) -> Self {
        let period_s = 1.0 / rate_hz;
        Self { value: Box::new(value), unit, period_s, next_s: 0.0, count: 0, lie: Lie::default() }
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
        let shown = self.lie.shown((self.value)());
        vec![format!("{}; {shown:.4} {}\r\n", self.count, self.unit).into_bytes()]
    }

    fn restart(&mut self, _: f64) {
        self.count = 0;
    }

    fn report(&mut self, code: u32) {
        self.value = Box::new(move || f64::from(code));
    }

    fn truth(&self) -> Truth {
        Truth::default()
    }

    fn mislead(&mut self, mischief: Mischief) {
        self.lie.tell(mischief);
    }
}
