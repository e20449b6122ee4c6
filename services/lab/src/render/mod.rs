//! Self-contained HTML pages: no script, no outside file; readable at phone and desktop width.

pub mod calibration;
mod curves;
pub mod diagnosis;
pub mod fit;
mod page;
mod plot;
pub mod text;
pub mod verdict;

pub use page::{Page, bars, facts, heat_map, note, table};
pub use plot::{Chart, Mark, Series};

/// A number for people: four significant digits, plain where that is short.
pub fn number(x: f64) -> String {
    if !x.is_finite() {
        return if x.is_nan() { "-".into() } else { x.to_string() };
    }
    let size = x.abs();
    if size == 0.0 {
        return "0".into();
    }
    if !(1e-3..1e5).contains(&size) {
        return format!("{x:.3e}");
    }
    let digits = (3 - size.log10().floor() as i32).clamp(0, 6) as usize;
    let text = format!("{x:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_string() } else { text }
}

#[cfg(test)]
mod tests {
    #[test]
    fn numbers_are_short() {
        for (x, text) in [
            (0.0, "0"),
            (1.0, "1"),
            (0.012345, "0.01235"),
            (123.456, "123.5"),
            (-2.5, "-2.5"),
            (100.0, "100"),
            (1e-7, "1.000e-7"),
            (f64::NAN, "-"),
        ] {
            assert_eq!(super::number(x), text);
        }
    }
}
