//! What the kernel shows of a device as files, each a short text: channels of Industrial I/O, counters, lines of a GPIO.
//!
//! Read for this: the kernel's `Documentation/ABI/testing/sysfs-bus-iio` and `sysfs-bus-counter`. A channel `in_voltage0` or
//! `out_voltage0` has `in_voltage0_raw`, and mostly a scale and an offset of its own (`in_voltage0_scale`) or of its kind
//! (`in_voltage_scale`); (raw + offset) scale is in millivolts, milliamperes for currents.
//!
//! Each is opened anew for each reading: one that was unplugged and comes back under its name is found again, and what
//! is gone is gone at once. A reading or a writing allocates nothing unless it fails.

use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

/// Longest text of a number.
const TEXT_MAX: usize = 64;

/// A channel that was found: its file, and the kernel's own offset and scale.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// The file of the raw value.
    pub file: PathBuf,
    /// Added to the raw value.
    pub offset: f64,
    /// Millivolts, or milliamperes, of a count; none where the kernel says nothing.
    pub scale: Option<f64>,
}

impl Channel {
    /// A channel by its name in its device's folder.
    ///
    /// # Errors
    /// It is not there, or what the kernel says of it is no number.
    pub fn find(folder: &Path, channel: &str) -> Result<Self, String> {
        let with = |end: &str| folder.join(format!("{channel}{end}"));
        // A raw value comes with offset and scale; a processed one, and a counter's file, stand for themselves.
        if with("_raw").exists() {
            let said = |end: &str| said(folder, channel, end);
            return Ok(Self {
                file: with("_raw"),
                offset: said("_offset")?.unwrap_or(0.0),
                scale: said("_scale")?,
            });
        }
        let file = [with("_input"), with("")].into_iter().find(|file| file.is_file());
        let file = file.ok_or_else(|| {
            format!(
                "{}: there is neither {channel}_raw nor {channel}_input nor {channel}\nhint: `ls` there shows the channels",
                folder.display()
            )
        })?;
        Ok(Self { file, offset: 0.0, scale: None })
    }

    /// What it shows, in the kernel's unit.
    ///
    /// # Errors
    /// It is gone, or shows no number.
    pub fn read(&self) -> Result<f64, String> {
        Ok((number(&self.file)? + self.offset) * self.scale.unwrap_or(1.0))
    }
}

/// What the kernel says of a channel, or of all of its kind: `in_voltage0_scale`, else `in_voltage_scale`.
fn said(folder: &Path, channel: &str, end: &str) -> Result<Option<f64>, String> {
    let kind: String = channel.chars().filter(|c| !c.is_ascii_digit()).collect();
    let names = [channel, &kind].map(|name| folder.join(format!("{name}{end}")));
    names.iter().find(|file| file.exists()).map(|file| number(file)).transpose()
}

/// A file's number, which is finite.
///
/// # Errors
/// It cannot be read, or holds none.
pub fn number(file: &Path) -> Result<f64, String> {
    let finite = |text: &str| text.parse::<f64>().ok().filter(|value| value.is_finite());
    read(file, finite, "a number")
}

/// A file's count.
///
/// # Errors
/// It cannot be read, or holds none.
pub fn count(file: &Path) -> Result<u64, String> {
    read(file, |text| text.parse().ok(), "a count")
}

/// A line that is 0 or 1.
///
/// # Errors
/// It cannot be read, or shows something else.
pub fn is_on(file: &Path) -> Result<bool, String> {
    let line = |text: &str| match text {
        "0" => Some(false),
        "1" => Some(true),
        _ => None,
    };
    read(file, line, "0 or 1")
}

/// A file's words.
///
/// # Errors
/// It cannot be read, or is empty.
pub fn words(file: &Path) -> Result<String, String> {
    read(file, |text| Some(text.to_owned()).filter(|text| !text.is_empty()), "a name")
}

/// The ends of what a file says is allowed, as `[least step most]`; none where it says something else.
///
/// # Errors
/// It cannot be read.
pub fn range(file: &Path) -> Result<Option<(f64, f64)>, String> {
    let ends = |text: &str| {
        let mut numbers = text.strip_prefix('[')?.strip_suffix(']')?.split_ascii_whitespace().map(str::parse);
        let (least, _, most) = (numbers.next()?.ok()?, numbers.next()?, numbers.next()?.ok()?);
        (least < most).then_some((least, most))
    };
    read(file, |text| Some(ends(text)), "a range")
}

fn read<T>(file: &Path, make: impl Fn(&str) -> Option<T>, what: &str) -> Result<T, String> {
    let mut bytes = [0; TEXT_MAX];
    let n = File::open(file).and_then(|mut open| open.read(&mut bytes)).map_err(|e| {
        format!("{}: {e}\nhint: is the device there, and may this user read it?", file.display())
    })?;
    let text = bytes.get(..n).unwrap_or_default();
    let made = std::str::from_utf8(text).ok().map(str::trim).and_then(make);
    made.ok_or_else(|| {
        let text = text.trim_ascii().escape_ascii();
        format!("{} = \"{text}\" is not {what}\nhint: is it the right file?", file.display())
    })
}

/// Writes a whole number into a file that is there.
///
/// # Errors
/// It is gone, or the kernel does not take it.
pub fn write(file: &Path, value: i64) -> Result<(), String> {
    let mut text = [0; TEXT_MAX];
    let mut rest = text.as_mut_slice();
    // The longest number is shorter than the array.
    let _ = writeln!(rest, "{value}");
    let length = TEXT_MAX - rest.len();
    // In one piece: the kernel takes each writing for a whole value.
    let written = OpenOptions::new()
        .write(true)
        .truncate(true)
        .open(file)
        .and_then(|mut open| open.write_all(text.get(..length).unwrap_or_default()));
    written.map_err(|e| {
        format!("{}: {value} is not taken: {e}\nhint: is the device there, may this user write it, and is that within its range?", file.display())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scale_and_offset_are_the_channels_own_or_its_kinds() {
        let folder = tempfile::tempdir().unwrap();
        let put = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        put("in_voltage3_raw", "2000\n");
        let find = || Channel::find(folder.path(), "in_voltage3").unwrap();
        assert_eq!((find().scale, find().read()), (None, Ok(2000.0)));
        put("in_voltage_scale", "0.5\n");
        put("in_voltage_offset", "-100\n");
        assert_eq!(find().read(), Ok(950.0));
        put("in_voltage3_scale", "2\n");
        assert_eq!(find().read(), Ok(3800.0));
    }

    #[test]
    fn a_range_is_its_ends() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("out_voltage0_raw_available");
        for (text, ends) in [
            ("[-32768 1 32767]\n", Some((-32768.0, 32767.0))),
            ("0 1 2 3\n", None),
            ("[5 1 1]\n", None),
            ("[]\n", None),
            ("", None),
        ] {
            std::fs::write(&file, text).unwrap();
            assert_eq!(range(&file), Ok(ends), "{text}");
        }
    }

    #[test]
    fn what_is_written_is_what_is_read_and_nothing_is_made() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("out_voltage0_raw");
        assert!(write(&file, 1).unwrap_err().contains("out_voltage0_raw"), "it is not there");
        std::fs::write(&file, "a longer text than that\n").unwrap();
        for value in [0, 1, i64::MIN, i64::MAX] {
            write(&file, value).unwrap();
            assert_eq!(std::fs::read_to_string(&file).unwrap(), format!("{value}\n"));
        }
        write(&file, 1).unwrap();
        assert_eq!((is_on(&file), count(&file), number(&file)), (Ok(true), Ok(1), Ok(1.0)));
        for text in ["", "\n", "2\n", "on\n", "\u{1b}[2J", "nan\n", "-1\n"] {
            std::fs::write(&file, text).unwrap();
            let error = is_on(&file).unwrap_err();
            assert!(error.contains("hint:") && !error.contains('\u{1b}'), "{error}");
            assert!(count(&file).is_err() || text == "2\n");
        }
    }
}
