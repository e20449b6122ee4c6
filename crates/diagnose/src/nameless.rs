//! What descriptors of terms without a name have in common: no words of a catalogue, and prior odds of a fifth.

/// Odds that physics without a name is at work, before any data: rarer than what the catalogue holds.
pub const COMMONNESS: f64 = 0.2;

macro_rules! nameless {
    ($($field:ident: $value:expr,)*) => {
        Descriptor {
            signature: "",
            confused_with: &[],
            separated_by: "",
            reference: "",
            commonness: crate::nameless::COMMONNESS,
            shifts_time: false,
            nonparametric: true,
            same_as: &[],
            holds: &[],
            forms: &[],
            $($field: $value,)*
        }
    };
}
pub(crate) use nameless;
