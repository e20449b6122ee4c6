//! Check sums of the ODrive's ASCII protocol: `words*check`, the check being the exclusive or of all characters before the
//! asterisk, in decimal.

fn check(words: &str) -> u8 {
    words.bytes().fold(0, |sum, byte| sum ^ byte)
}

/// Appends a line with its check sum.
pub fn line(words: &str, out: &mut Vec<u8>) {
    out.extend_from_slice(format!("{words}*{}\n", check(words)).as_bytes());
}

/// The words of a line whose check sum is right.
pub fn words(line: &str) -> Option<&str> {
    let (words, sum) = line.rsplit_once('*')?;
    (sum.trim().parse() == Ok(check(words))).then(|| words.trim())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The example of the documentation.
    #[test]
    fn the_documented_line_is_made() {
        let mut out = Vec::new();
        line("r vbus_voltage ", &mut out);
        assert_eq!(String::from_utf8(out).unwrap(), "r vbus_voltage *93\n");
    }

    proptest! {
        #[test]
        fn words_come_back_and_a_changed_one_does_not(text in "[a-z0-9.-]{1,40}", at in any::<prop::sample::Index>()) {
            let mut out = Vec::new();
            line(&text, &mut out);
            let mut sent = String::from_utf8(out).unwrap();
            prop_assert_eq!(words(&sent), Some(text.as_str()));
            let at = at.index(text.len());
            let other = if &text[at..=at] == "x" { "y" } else { "x" };
            sent.replace_range(at..=at, other);
            prop_assert_eq!(words(&sent), None);
        }
    }
}
