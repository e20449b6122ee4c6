//! Channels of the kernel's Industrial I/O and counter subsystems: an analogue force cell or flow meter on an ADC, a
//! quadrature counter. The kernel shows them as files; one read of one file is one conversion, which may take
//! milliseconds, so a thread of its own reads them.
//!
//! Read for this: the kernel's `Documentation/ABI/testing/sysfs-bus-iio` and `sysfs-bus-counter`. A channel `in_voltage0` has
//! `in_voltage0_raw`, and mostly `in_voltage0_scale` and `in_voltage0_offset`; (raw + offset) scale is in millivolts
//! (milliamperes for currents). A counter is the file `count0/count`, in counts. What a millivolt or a count means is the bench's
//! own: `scale` and `offset` say it.

use std::path::{Path, PathBuf};

use kort_proto::signals::{SIGNALS, Signals};

use super::Channel;

/// A folder of channels as the configuration describes it.
#[derive(Clone, Debug)]
pub struct Iio {
    /// The device's folder.
    pub path: PathBuf,
    /// How often it is read, Hz.
    pub rate_hz: f64,
    /// Which channel is which signal.
    pub channels: Vec<Channel<String>>,
}

/// A channel that was found: its file, and the kernel's own offset and scale.
struct Open {
    file: PathBuf,
    offset: f64,
    scale: f64,
}

/// All channels of a folder.
pub struct Reader {
    iio: Iio,
    open: Vec<Open>,
}

impl Reader {
    /// Before the first reading.
    pub fn new(iio: Iio) -> Self {
        Self { iio, open: Vec::new() }
    }

    /// Reads every channel once.
    ///
    /// # Errors
    /// The file that is not there or holds no number, with a hint.
    pub fn read(&mut self) -> Result<Signals, String> {
        if self.open.is_empty() {
            let channels = self.iio.channels.iter();
            self.open =
                channels.map(|channel| open(&self.iio.path, &channel.from)).collect::<Result<_, _>>()?;
        }
        let mut signals = Signals::UNKNOWN;
        for (channel, open) in self.iio.channels.iter().zip(&self.open) {
            let raw = number(&open.file)?;
            if let Some(signal) = SIGNALS.get(channel.place) {
                (signal.set)(&mut signals, channel.si((raw + open.offset) * open.scale));
            }
        }
        Ok(signals)
    }

    /// Finds everything anew: the device was gone.
    pub fn reopen(&mut self) {
        self.open.clear();
    }

    /// How often to read, Hz.
    pub fn rate_hz(&self) -> f64 {
        self.iio.rate_hz
    }
}

fn open(folder: &Path, channel: &str) -> Result<Open, String> {
    let with = |end: &str| folder.join(format!("{channel}{end}"));
    let optional = |end: &str, without: f64| {
        let file = with(end);
        if file.exists() { number(&file) } else { Ok(without) }
    };
    // A raw value comes with offset and scale; a processed one, and a counter's file, stand for themselves.
    if with("_raw").exists() {
        return Ok(Open {
            file: with("_raw"),
            offset: optional("_offset", 0.0)?,
            scale: optional("_scale", 1.0)?,
        });
    }
    let file = [with("_input"), with("")].into_iter().find(|file| file.is_file());
    let file = file.ok_or_else(|| {
        format!(
            "{}: there is neither {channel}_raw nor {channel}_input nor {channel}\nhint: `ls` there shows the channels",
            folder.display()
        )
    })?;
    Ok(Open { file, offset: 0.0, scale: 1.0 })
}

fn number(file: &Path) -> Result<f64, String> {
    let text = std::fs::read_to_string(file).map_err(|e| {
        format!("{}: {e}\nhint: is the device there, and may this user read it?", file.display())
    })?;
    let value = text.trim().parse::<f64>().ok().filter(|value| value.is_finite());
    value.ok_or_else(|| {
        format!("{} = \"{}\" is no number\nhint: is it the right file?", file.display(), text.trim())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensors::place;

    /// A folder that looks like a device.
    fn device(files: &[(&str, &str)]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            let file = folder.path().join(name);
            std::fs::create_dir_all(file.parent().unwrap()).unwrap();
            std::fs::write(file, text).unwrap();
        }
        folder
    }

    fn reader(folder: &Path, channels: &[(&str, &str, f64)]) -> Reader {
        let channels = channels.iter().map(|(from, signal, scale)| Channel {
            from: (*from).to_owned(),
            place: place(signal).unwrap(),
            scale: *scale,
            offset: 0.0,
        });
        Reader::new(Iio { path: folder.to_owned(), rate_hz: 100.0, channels: channels.collect() })
    }

    #[test]
    fn raw_values_take_the_kernels_offset_and_scale_and_counters_stand_for_themselves() {
        let folder = device(&[
            ("in_voltage0_raw", "1000\n"),
            ("in_voltage0_scale", "0.5\n"),
            ("in_voltage0_offset", "-200\n"),
            ("in_temp_input", "21500\n"),
            ("count0/count", "4096\n"),
        ]);
        let channels = [
            ("in_voltage0", "thrust_n", 0.1),
            ("in_temp", "temperature_c", 1e-3),
            ("count0/count", "shaft_angle_rad", std::f64::consts::TAU / 4096.0),
        ];
        let read = reader(folder.path(), &channels).read().unwrap();
        assert!((read.thrust_n - 40.0).abs() < 1e-9, "(1000 - 200) 0.5 mV at 0.1 N/mV: {}", read.thrust_n);
        assert!((read.temperature_c - 21.5).abs() < 1e-9);
        assert!((read.shaft_angle_rad - std::f64::consts::TAU).abs() < 1e-9);
    }

    #[test]
    fn what_is_missing_or_no_number_is_named() {
        let folder = device(&[("in_voltage0_raw", "busy\n")]);
        for (channel, words) in [("in_voltage0", "busy"), ("in_voltage7", "in_voltage7_raw")] {
            let error = reader(folder.path(), &[(channel, "thrust_n", 1.0)]).read().unwrap_err();
            assert!(error.contains(words) && error.contains("hint:"), "{error}");
        }
    }
}
