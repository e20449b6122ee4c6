//! What descriptors of terms without a name have in common: no words of a catalogue, and prior odds of a fifth.

macro_rules! nameless {
    ($($field:ident: $value:expr,)*) => {
        Descriptor {
            signature: "",
            confused_with: &[],
            separated_by: "",
            reference: "",
            commonness: 0.2,
            shifts_time: false,
            nonparametric: true,
            same_as: &[],
            forms: &[],
            $($field: $value,)*
        }
    };
}
pub(crate) use nameless;
