//! One column of a recording from one column of its source, and what a reader should know of its numbers.

use crate::cell::{Cell, Odd};
use crate::columns::RESPONSES;
use crate::error::Place;
use crate::map::Mapped;

/// A share goes this far beyond -1 to 1 by the steps of its pulses.
const BEYOND: f64 = 0.02;
/// Pulses of a speed controller, us.
const PULSES_US: (f64, f64) = (500.0, 2500.0);

/// One column to fill, from one source column.
pub(super) struct Take<'m> {
    pub index: usize,
    how: Option<&'m Mapped>,
    pub sign_of: Option<(usize, f64)>,
    pub command: bool,
    /// Cells without a value, for which the map says what the column is then.
    rests: Odd,
    /// Least and greatest of the source's numbers.
    raw: Option<(f64, f64)>,
    /// Numbers so far, more than one.
    several: bool,
}

impl<'m> Take<'m> {
    /// A column of a recording of our own.
    pub fn own(index: usize) -> Self {
        Self {
            index,
            how: None,
            sign_of: None,
            command: false,
            rests: Odd::default(),
            raw: None,
            several: false,
        }
    }

    /// A column of a log of others.
    pub fn mapped(index: usize, how: &'m Mapped, sign_of: Option<(usize, f64)>) -> Self {
        Self { how: Some(how), sign_of, command: how.name.contains("_cmd"), ..Self::own(index) }
    }

    /// Whether the map takes this number of the source for no value.
    pub fn is_none(&self, raw: f64) -> bool {
        self.how.is_some_and(|how| how.none == Some(raw))
    }

    /// Counts a cell that holds no value, where the map says what the column is then.
    pub fn rest(&mut self, place: Place, cell: Cell) -> Option<()> {
        self.how?.no_value?;
        self.rests.add(place, &cell.text());
        Some(())
    }

    /// Our value, SI, from the source's, which may say that there is none.
    pub fn value(&mut self, raw: f64, says_none: bool) -> f64 {
        let Some(how) = self.how else { return raw };
        if says_none {
            return how.no_value.unwrap_or(f64::NAN);
        }
        if !raw.is_nan() {
            self.several = self.raw.is_some();
            self.raw = Some(self.raw.map_or((raw, raw), |(low, high)| (low.min(raw), high.max(raw))));
        }
        how.apply(raw)
    }

    /// What a reader should know of it.
    pub fn notes(&self) -> Vec<String> {
        let rests = || {
            let how = self.how?;
            let (name, value) = (&how.name, how.no_value?);
            self.rests.said(&format!(
                "cell(s) of `{}` hold no value: {name} is {value} there, as the column map says (no_value)",
                how.source
            ))
        };
        [rests(), self.unmoved(), self.beyond()].into_iter().flatten().collect()
    }

    fn unmoved(&self) -> Option<String> {
        let how = self.how.filter(|how| RESPONSES.contains(&how.name.as_str()))?;
        let (low, high) = self.raw.filter(|_| self.several)?;
        (low == high).then(|| {
            format!(
                "column `{}` never changes: `{}` is {low} throughout; is it the one that was meant?",
                how.name, how.source
            )
        })
    }

    /// A share that goes beyond -1 to 1 is read by numbers of another drive.
    fn beyond(&self) -> Option<String> {
        let how = self.how.filter(|how| how.name == "duty_cmd")?;
        let (from, to) = self.raw?;
        let (low, high) = (how.apply(from).min(how.apply(to)), how.apply(from).max(how.apply(to)));
        if low >= -1.0 - BEYOND && high <= 1.0 + BEYOND {
            return None;
        }
        let pulses = PULSES_US.0 <= from && to <= PULSES_US.1;
        let way = if pulses {
            "pulses of a motor that runs one way? A copy of the column map with scale = 0.001, offset = -1.0 makes 0 to 1 of 1000 to 2000 us"
        } else {
            "correct scale and offset in the column map, or choose another source"
        };
        Some(format!(
            "duty_cmd is {low:.3} to {high:.3}, and a share is -1 to 1: the column map makes it of {from} to {to} in `{}`; {way} (docs/recordings.md)",
            how.source
        ))
    }
}

#[cfg(test)]
mod tests {
    use crate::log::{Gather, join};
    use crate::map::ColumnMap;
    use crate::recording::Recording;

    /// Commands and speeds at 100 Hz.
    fn recording(keys: &str, command: impl Fn(u32) -> f64, speed: impl Fn(u32) -> f64) -> Recording {
        let text = format!(
            "[time]\nclock = \"log\"\n[columns.duty_cmd]\nsource = \"out.pulse\"\nunit = \"1\"\n{keys}\n\
             [columns.shaft_speed_rad_s]\nsource = \"esc.rpm\"\nunit = \"rpm\"\n"
        );
        let map = ColumnMap::from_toml("m", &text).unwrap();
        let sources: Vec<String> = map.sources().map(|(source, _)| source.to_owned()).collect();
        let mut gather = Gather::new("test", "seconds", Some(&sources));
        let (out, esc) = (gather.topic("out"), gather.topic("esc"));
        let (pulse, rpm) = (gather.field(out, "pulse", None), gather.field(esc, "rpm", None));
        for k in 0..100 {
            let stamp_s = f64::from(k) * 0.01;
            gather.message(out, stamp_s);
            gather.set(out, pulse, command(k));
            gather.message(esc, stamp_s);
            gather.set(esc, rpm, speed(k));
        }
        join::recording("r", &gather.finish(), &map).unwrap()
    }

    fn disarmed(k: u32) -> f64 {
        if k < 50 { 0.5 } else { f64::NAN }
    }

    #[test]
    fn a_command_ends_where_the_log_says_that_there_is_none() {
        let r = recording("no_value = 0.0", disarmed, f64::from);
        let duty = r.column("duty_cmd").unwrap();
        assert_eq!((duty[49], duty[50], duty[99]), (0.5, 0.0, 0.0));
        let said = r.notes.join("; ");
        assert!(
            said.contains("50 cell(s) of `out.pulse` hold no value: duty_cmd is 0 there")
                && said.contains("no_value"),
            "{said}"
        );
        assert!(r.losses.is_empty(), "{:?}", r.losses);
    }

    #[test]
    fn without_a_word_in_the_map_such_a_command_is_lost_and_not_held() {
        let r = recording("", disarmed, f64::from);
        let duty = r.column("duty_cmd").unwrap();
        assert!(duty[49] == 0.5 && duty[50..].iter().all(|duty| duty.is_nan()), "{duty:?}");
        assert!(r.losses.join("; ").contains("50 cell(s) of `out.pulse` hold no value"), "{:?}", r.losses);
    }

    #[test]
    fn a_number_may_stand_for_none() {
        let pulse = |k: u32| if k < 20 { 0.0 } else { 1500.0 + f64::from(k) };
        let keys = "scale = 0.0025\noffset = -3.75\nnone = 0";
        let r = recording(&format!("{keys}\nno_value = 0.0"), pulse, f64::from);
        let duty = r.column("duty_cmd").unwrap();
        assert_eq!(duty[..20], [0.0; 20]);
        assert!((duty[99] - 0.2475).abs() < 1e-12, "{}", duty[99]);
        let said = r.notes.join("; ");
        assert!(said.contains("20 cell(s) of `out.pulse`") && !said.contains("a share is"), "{said}");
        let r = recording(keys, pulse, f64::from);
        assert!(r.column("duty_cmd").unwrap()[..20].iter().all(|duty| duty.is_nan()));
        assert!(r.losses.join("; ").contains("20 cell(s) of `out.pulse`"), "{:?}", r.losses);
    }

    #[test]
    fn a_share_beyond_what_a_share_is_and_a_speed_that_stands_are_said() {
        let one_way = |k: u32| 1000.0 + 6.0 * f64::from(k);
        let said = recording("scale = 0.0025\noffset = -3.75", one_way, |_| 40.0).notes.join("; ");
        for words in [
            "duty_cmd is -1.250 to 0.235",
            "of 1000 to 1594 in `out.pulse`",
            "runs one way",
            "column `shaft_speed_rad_s` never changes: `esc.rpm` is 40 throughout",
        ] {
            assert!(said.contains(words), "{words}: {said}");
        }
        let said = recording("scale = 0.001\noffset = -1.0", one_way, f64::from).notes.join("; ");
        assert!(!said.contains("a share is") && !said.contains("never changes"), "{said}");
    }
}
