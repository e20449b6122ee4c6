//! Numbers as tables write them where the decimal mark is a comma.

/// The number of a text in which a decimal comma may stand, and no point: a point would be a mark for thousands there, or a
/// sign that the comma is one.
pub(crate) fn with_comma(text: &str) -> Option<f64> {
    if text.contains('.') {
        return None;
    }
    text.replacen(',', ".", 1).parse().ok()
}

/// Whether it can be nothing but a number with a decimal comma.
pub(crate) fn has_comma(text: &str) -> bool {
    let digit_behind = |(_, behind): (&str, &str)| behind.starts_with(|c: char| c.is_ascii_digit());
    text.split_once(',').is_some_and(digit_behind) && with_comma(text).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_comma_among_digits_is_a_decimal_comma() {
        for (text, number) in [("1,5", 1.5), ("-0,25", -0.25), ("+1,5e-3", 1.5e-3), (",5", 0.5)] {
            assert_eq!((with_comma(text), has_comma(text)), (Some(number), true), "{text}");
        }
        assert_eq!((with_comma("15"), has_comma("15")), (Some(15.0), false));
        for text in ["1.5", "1.234,5", "1,234,5", "1,", "a,5", "12:00:00,5", "", ","] {
            assert!(!has_comma(text), "{text}");
        }
    }
}
