//! Short text of fixed size, fit for shared memory.

/// UTF-8 text of at most `N` bytes; the rest is zero. What does not fit is cut at a character.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Text<const N: usize>([u8; N]);

// SAFETY: plain bytes, no pointer, any bit pattern is a valid value; the layout is an array's.
#[cfg(feature = "transport")]
unsafe impl<const N: usize> iceoryx2::prelude::ZeroCopySend for Text<N> {}

impl<const N: usize> Text<N> {
    /// No text.
    pub const EMPTY: Self = Self([0; N]);

    /// Copies text in, cut at the last whole character that fits.
    pub fn new(text: &str) -> Self {
        let mut end = text.len().min(N);
        while !text.is_char_boundary(end) {
            end -= 1;
        }
        let mut bytes = [0; N];
        bytes[..end].copy_from_slice(&text.as_bytes()[..end]);
        Self(bytes)
    }

    /// The text; what is not UTF-8 (another process wrote it) is left out.
    pub fn as_str(&self) -> &str {
        let end = self.0.iter().position(|b| *b == 0).unwrap_or(N);
        match std::str::from_utf8(&self.0[..end]) {
            Ok(text) => text,
            Err(e) => std::str::from_utf8(&self.0[..e.valid_up_to()]).unwrap_or(""),
        }
    }

    /// Is there no text?
    pub fn is_empty(&self) -> bool {
        self.0.first().is_none_or(|b| *b == 0)
    }
}

/// Formats without allocation; what does not fit is cut.
impl<const N: usize> std::fmt::Write for Text<N> {
    fn write_str(&mut self, more: &str) -> std::fmt::Result {
        let used = self.0.iter().position(|b| *b == 0).unwrap_or(N);
        let mut end = more.len().min(N - used);
        while !more.is_char_boundary(end) {
            end -= 1;
        }
        if let (Some(room), Some(bytes)) = (self.0.get_mut(used..used + end), more.as_bytes().get(..end)) {
            room.copy_from_slice(bytes);
        }
        Ok(())
    }
}

impl<const N: usize> Default for Text<N> {
    fn default() -> Self {
        Self::EMPTY
    }
}

impl<const N: usize> std::fmt::Debug for Text<N> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        std::fmt::Debug::fmt(self.as_str(), f)
    }
}

impl<const N: usize> std::fmt::Display for Text<N> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn text_comes_back_whole_or_cut_at_a_character(text in "[^\0]{0,40}") {
            let back = Text::<24>::new(&text);
            prop_assert!(text.starts_with(back.as_str()));
            prop_assert!(back.as_str().len() == text.len() || text.len() > 20);
        }

        #[test]
        fn any_bytes_read_without_panic(bytes in prop::array::uniform32(any::<u8>())) {
            let _ = Text::<32>(bytes).as_str();
        }
    }
}
