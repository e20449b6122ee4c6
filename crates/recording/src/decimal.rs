//! Numbers as tables write them: with a decimal point, with a decimal comma, with another sign for minus.

/// The number of a text with a decimal point; typography's minus is one.
pub(crate) fn with_point(text: &str) -> Option<f64> {
    if text.contains('−') { text.replace('−', "-").parse().ok() } else { text.parse().ok() }
}

/// The number of a text in which a decimal comma may stand, and no point: a point would be a mark for thousands there, or a
/// sign that the comma is one.
pub(crate) fn with_comma(text: &str) -> Option<f64> {
    if text.contains('.') {
        return None;
    }
    with_point(&text.replacen(',', ".", 1))
}

/// Whether it can be nothing but a number with a decimal comma.
pub(crate) fn has_comma(text: &str) -> bool {
    let digit_behind = |(_, behind): (&str, &str)| behind.starts_with(|c: char| c.is_ascii_digit());
    text.split_once(',').is_some_and(digit_behind) && with_comma(text).is_some()
}

/// Whether its commas may be marks for thousands, and how many there are: each before three digits, and no zero in front.
pub(crate) fn thousands(text: &str) -> Option<usize> {
    let (first, rest) = text.trim_start_matches(['-', '+', '−']).split_once(',')?;
    let digits = |part: &str| part.bytes().all(|b| b.is_ascii_digit());
    let front = (1..=3).contains(&first.len()) && digits(first) && !first.starts_with('0');
    let marked = rest.split(',').all(|part| part.len() == 3 && digits(part));
    (front && marked).then(|| rest.split(',').count())
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

    #[test]
    fn a_comma_before_three_digits_may_be_one_for_thousands() {
        for (text, marks) in [("1,029", 1), ("-12,500", 1), ("1,234,567", 2)] {
            assert_eq!(thousands(text), Some(marks), "{text}");
        }
        for text in ["0,125", "1,5", "1234,567", "1,0290", ",125", "1029", "1,02a", "1,029,5", "1.029"] {
            assert_eq!(thousands(text), None, "{text}");
        }
    }

    #[test]
    fn a_typographic_minus_is_one() {
        assert_eq!(
            (with_point("−354.5"), with_comma("−354,5"), with_point("3−5")),
            (Some(-354.5), Some(-354.5), None)
        );
    }
}
