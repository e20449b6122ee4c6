//! A measure: a share with its count, its interval, and the bar it is held against.

use serde_json::{Value, json};
use statrs::distribution::{ContinuousCDF, Normal};

/// Where a measure should lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bar {
    /// At least.
    AtLeast(f64),
    /// At most.
    AtMost(f64),
}

/// One measure.
#[derive(Clone, Debug, PartialEq)]
pub struct Measure {
    /// Name in the JSON.
    pub name: &'static str,
    /// What it counts, in words.
    pub what: &'static str,
    /// Cases (or the sum) that count.
    pub numerator: f64,
    /// Cases they are counted over.
    pub denominator: usize,
    /// Value; none over no cases.
    pub value: Option<f64>,
    /// Wilson's 95 % interval of a share; none for what is no share.
    pub wilson_95: Option<[f64; 2]>,
    /// The bar, if there is one.
    pub bar: Option<Bar>,
}

impl Measure {
    /// A share of marks.
    pub fn share(
        name: &'static str,
        what: &'static str,
        bar: Option<Bar>,
        marks: impl Iterator<Item = bool>,
    ) -> Self {
        let (mut hits, mut count) = (0usize, 0usize);
        for mark in marks {
            count += 1;
            hits += usize::from(mark);
        }
        Measure {
            name,
            what,
            numerator: hits as f64,
            denominator: count,
            value: (count > 0).then(|| hits as f64 / count as f64),
            wilson_95: wilson_95(hits, count),
            bar,
        }
    }

    /// A median of values; the numerator counts those that reach the bar.
    pub fn median(name: &'static str, what: &'static str, bar: Bar, mut values: Vec<f64>) -> Self {
        values.sort_by(f64::total_cmp);
        let reaches = |value: &f64| match bar {
            Bar::AtLeast(bar) => *value >= bar,
            Bar::AtMost(bar) => *value <= bar,
        };
        Measure {
            name,
            what,
            numerator: values.iter().filter(|value| reaches(value)).count() as f64,
            denominator: values.len(),
            value: (!values.is_empty()).then(|| values[values.len() / 2]),
            wilson_95: None,
            bar: Some(bar),
        }
    }

    /// A sum over a count.
    pub fn mean(name: &'static str, what: &'static str, bar: Option<Bar>, sum: f64, count: usize) -> Self {
        let value = (count > 0).then(|| sum / count as f64);
        Measure { name, what, numerator: sum, denominator: count, value, wilson_95: None, bar }
    }

    /// The bar is met; none without a bar or over no cases.
    pub fn met(&self) -> Option<bool> {
        self.value.zip(self.bar).map(|(value, bar)| match bar {
            Bar::AtLeast(bar) => value >= bar,
            Bar::AtMost(bar) => value <= bar,
        })
    }

    /// As JSON.
    pub fn json(&self) -> Value {
        let bar = self.bar.map(|bar| match bar {
            Bar::AtLeast(bar) => json!({ "at_least": bar }),
            Bar::AtMost(bar) => json!({ "at_most": bar }),
        });
        json!({ "value": self.value, "numerator": self.numerator, "denominator": self.denominator,
                "wilson_95": self.wilson_95, "what": self.what, "bar": bar, "met": self.met() })
    }
}

/// Measures by name, as JSON.
pub fn by_name(measures: &[Measure]) -> Value {
    measures
        .iter()
        .map(|measure| (measure.name.to_owned(), measure.json()))
        .collect::<serde_json::Map<_, _>>()
        .into()
}

/// Wilson's score interval of a share (Wilson 1927), 95 %; none over no cases.
pub fn wilson_95(hits: usize, count: usize) -> Option<[f64; 2]> {
    if count == 0 {
        return None;
    }
    let z = Normal::standard().inverse_cdf(0.975);
    let (n, share) = (count as f64, hits as f64 / count as f64);
    let middle = share + z * z / (2.0 * n);
    let half = z * (share * (1.0 - share) / n + z * z / (4.0 * n * n)).sqrt();
    let whole = 1.0 + z * z / n;
    // At a share of 0 or 1 the bound is exact; rounding would leave it a hair off.
    let low = if hits == 0 { 0.0 } else { (middle - half) / whole };
    let high = if hits == count { 1.0 } else { (middle + half) / whole };
    Some([low, high])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn wilson_agrees_with_a_worked_example() {
        // Newcombe 1998, Stat. Med. 17:857: 81 of 263 is 0.2553 to 0.3662; 0 of 20 is 0 to 0.1611.
        let [low, high] = wilson_95(81, 263).unwrap();
        assert!((low - 0.2553).abs() < 1e-4 && (high - 0.3662).abs() < 1e-4, "{low} {high}");
        let [low, high] = wilson_95(0, 20).unwrap();
        assert!(low == 0.0 && (high - 0.1611).abs() < 1e-4, "{low} {high}");
        assert_eq!(wilson_95(0, 0), None);
    }

    proptest! {
        #[test]
        fn the_interval_holds_the_share(hits in 0usize..50, more in 0usize..50) {
            if let Some([low, high]) = wilson_95(hits, hits + more) {
                let share = hits as f64 / (hits + more) as f64;
                prop_assert!(0.0 <= low && low <= share && share <= high && high <= 1.0);
            }
        }
    }

    #[test]
    fn bars_are_met_or_not_or_not_asked() {
        let share = |bar| Measure::share("x", "", bar, [true, true, false, true].into_iter());
        assert_eq!(share(Some(Bar::AtLeast(0.75))).met(), Some(true));
        assert_eq!(share(Some(Bar::AtMost(0.5))).met(), Some(false));
        assert_eq!(share(None).met(), None);
        assert_eq!(Measure::share("x", "", Some(Bar::AtMost(0.1)), [].into_iter()).met(), None);
        let median = Measure::median("x", "", Bar::AtLeast(2.0), vec![3.0, 1.0, 2.0]);
        assert_eq!((median.value, median.numerator, median.denominator), (Some(2.0), 2.0, 3));
    }
}
