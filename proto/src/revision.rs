//! Revisions of a rig description: told apart by their content, whoever wrote them.

use sha2::{Digest, Sha256};

/// The revision of a text: the first eight bytes of its SHA-256, as messages carry it.
pub fn of(text: &str) -> u64 {
    Sha256::digest(text.as_bytes()).iter().take(8).fold(0, |number, byte| number << 8 | u64::from(*byte))
}

/// A revision as recordings, events and the interface name it: sixteen hexadecimal digits.
pub fn name(revision: u64) -> String {
    format!("{revision:016x}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_revision_is_the_beginning_of_its_sha_256() {
        // FIPS 180-2, appendix B.1.
        assert_eq!(name(of("abc")), "ba7816bf8f01cfea");
        assert_ne!(of("abc"), of("abc\n"));
    }
}
