//! Channels of the kernel's Industrial I/O and counter subsystems: an analogue force cell or flow meter on an ADC, a
//! quadrature counter. The kernel shows them as files; one read of one file is one conversion, which may take
//! milliseconds, so a thread of its own reads them.
//!
//! What the kernel's scale and offset make of a raw value is in millivolts, of a current in milliamperes, and a counter
//! (`count0/count`) is in counts ([`crate::sysfs`]). What a millivolt or a count means is the bench's own: `scale` and
//! `offset` say it.

use std::path::PathBuf;

use kort_proto::signals::{SIGNALS, Signals};

use super::Channel;
use crate::sysfs;

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

/// All channels of a folder.
pub struct Reader {
    iio: Iio,
    open: Vec<sysfs::Channel>,
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
            let find = |channel: &Channel<String>| sysfs::Channel::find(&self.iio.path, &channel.from);
            self.open = self.iio.channels.iter().map(find).collect::<Result<_, _>>()?;
        }
        let mut signals = Signals::UNKNOWN;
        for (channel, open) in self.iio.channels.iter().zip(&self.open) {
            let value = open.read()?;
            if let Some(signal) = SIGNALS.get(channel.place) {
                let si = channel.si(value);
                (signal.set)(&mut signals, si.map_err(|words| beyond(&channel.from, &words))?);
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

/// Why a channel's number is none.
fn beyond(channel: &str, words: &str) -> String {
    format!("`{channel}` {words}\nhint: its `scale`, or a broken wire?")
}

#[cfg(test)]
mod tests {
    use std::path::Path;

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
            most: f64::INFINITY,
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
