//! The files of an analogue amplifier: what is put into them, and what they tell.

use std::f64::consts::TAU;
use std::path::PathBuf;

use kort_proto::signals::Signals;
use kort_proto::transport::monotonic_ns;

use super::{Counter, Iio, Monitor, Place, Watchdog};
use crate::sysfs::{self, Channel};

/// Files that were found.
pub struct Files {
    dac: Dac,
    limit_v: f64,
    sign: f64,
    watchdog: Option<Watchdog>,
    /// What the watchdog's line was set to last.
    level: bool,
    current: Option<(Channel, Monitor)>,
    counter: Option<Counting>,
}

impl Files {
    /// Which DAC it is, in the kernel's word.
    ///
    /// # Errors
    /// There is none.
    pub fn name(iio: &Iio) -> Result<String, String> {
        sysfs::words(&iio.dac.folder.join("name"))
    }

    /// Finds everything, and puts out zero volts.
    ///
    /// # Errors
    /// What is not there, or not as it must be.
    pub fn find(iio: &Iio, name: &str) -> Result<Self, String> {
        if !iio.identity.is_empty() && iio.identity != name {
            return Err(format!(
                "`drive.identity` = {}, but {} is {name}\nhint: devices are numbered as they are found: name it by its place, /sys/devices/…, or put that name there",
                iio.identity,
                iio.dac.folder.display()
            ));
        }
        let files = Self {
            dac: Dac::find(iio)?,
            limit_v: iio.limit_v,
            sign: iio.sign,
            watchdog: iio.watchdog.clone(),
            level: false,
            current: iio.current.clone().map(monitor).transpose()?,
            counter: iio.counter.as_ref().map(|counter| Counting::find(counter, iio.sign)).transpose()?,
        };
        files.put(0.0)?;
        files.dac.power_up()?;
        Ok(files)
    }

    /// Puts out these volts.
    ///
    /// # Errors
    /// They are no number, or the kernel does not take them.
    pub fn put(&self, volts: f64) -> Result<(), String> {
        if !volts.is_finite() {
            return Err(format!("{volts} V are asked for\nhint: this is a defect of kort; please report it"));
        }
        sysfs::write(&self.dac.file, self.dac.counts(volts.clamp(-self.limit_v, self.limit_v)))
    }

    /// Is the amplifier enabled? None where nothing shows it.
    ///
    /// # Errors
    /// The input is gone, or shows neither 0 nor 1.
    pub fn enabled(&self) -> Result<Option<bool>, String> {
        self.watchdog.as_ref().map(|watchdog| sysfs::is_on(&watchdog.enabled)).transpose()
    }

    /// Changes the watchdog's line.
    ///
    /// # Errors
    /// It is gone.
    pub fn pulse(&mut self) -> Result<(), String> {
        let Some(watchdog) = &self.watchdog else { return Ok(()) };
        self.level = !self.level;
        sysfs::write(&watchdog.pulse, i64::from(self.level))
    }

    /// Reads the monitors.
    ///
    /// # Errors
    /// One is gone, or shows no number.
    pub fn measure(&mut self) -> Result<Signals, String> {
        let mut signals = Signals::UNKNOWN;
        if let Some((adc, monitor)) = &self.current {
            let volts = adc.read()? * 1e-3;
            signals.current_a = self.sign * (volts - monitor.zero_v) * monitor.gain_a_per_v;
        }
        if let Some(counter) = &mut self.counter {
            (signals.shaft_angle_rad, signals.shaft_speed_rad_s) = counter.read()?;
        }
        Ok(signals)
    }
}

/// A DAC's channel.
struct Dac {
    file: PathBuf,
    offset: f64,
    scale_mv: f64,
    /// Counts that it takes, where the kernel says so.
    range: Option<(f64, f64)>,
    /// Where it is switched off and on, if it can be.
    power_down: Option<PathBuf>,
}

impl Dac {
    fn find(iio: &Iio) -> Result<Self, String> {
        let Place { folder, channel } = &iio.dac;
        let found = Channel::find(folder, channel)?;
        let file = found.file.display();
        let scale_mv = match (found.scale, iio.scale_mv) {
            (Some(said), None) | (None, Some(said)) if said > 0.0 => said,
            (Some(said), Some(_)) => {
                return Err(format!(
                    "`drive.scale_mv` is given, but the kernel says {said} mV a count for {file}\nhint: leave the key out"
                ));
            }
            _ => {
                return Err(format!(
                    "the kernel says no scale for {file}\nhint: scale_mv = millivolts of a count, full scale over the number of counts"
                ));
            }
        };
        let other = |end: &str| Some(folder.join(format!("{channel}{end}"))).filter(|file| file.exists());
        let range = other("_raw_available").map(|file| sysfs::range(&file)).transpose()?.flatten();
        let dac = Self {
            offset: found.offset,
            scale_mv,
            range,
            power_down: other("_powerdown"),
            file: found.file.clone(),
        };
        for volts in [-iio.limit_v, 0.0, iio.limit_v] {
            let counts = dac.exact(volts).round();
            // Full scale is a count beyond the largest.
            if let Some((least, most)) =
                range.filter(|(least, most)| !(least - 1.0..=most + 1.0).contains(&counts))
            {
                let volts_of = |counts: f64| (counts + dac.offset) * dac.scale_mv * 1e-3;
                return Err(format!(
                    "{file} gives {:.3} to {:.3} V, and {volts} V are asked for\nhint: a smaller `limit_v`, or a DAC with both signs: zero volts are zero torque",
                    volts_of(least),
                    volts_of(most)
                ));
            }
        }
        Ok(dac)
    }

    fn exact(&self, volts: f64) -> f64 {
        volts * 1e3 / self.scale_mv - self.offset
    }

    fn counts(&self, volts: f64) -> i64 {
        let counts = self.exact(volts).round();
        self.range.map_or(counts, |(least, most)| counts.clamp(least, most)) as i64
    }

    /// Ends a power-down that it began with.
    fn power_up(&self) -> Result<(), String> {
        match &self.power_down {
            Some(file) if sysfs::is_on(file)? => sysfs::write(file, 0),
            _ => Ok(()),
        }
    }
}

fn monitor(monitor: Monitor) -> Result<(Channel, Monitor), String> {
    let adc = Channel::find(&monitor.adc.folder, &monitor.adc.channel)?;
    let file = adc.file.display();
    if adc.scale.is_none() && adc.file.to_string_lossy().ends_with("_raw") {
        return Err(format!(
            "the kernel says no scale for {file}\nhint: give current_a by a sensor of kind \"iio\", whose `scale` takes counts"
        ));
    }
    Ok((adc, monitor))
}

/// A counter's turns.
struct Counting {
    file: PathBuf,
    rad: f64,
    /// Counts after which it begins anew; none: those of 64 bits.
    modulus: Option<i128>,
    /// The count read last, and the one that the speed is reckoned from, with the instant of that, ns.
    last: Option<u64>,
    from: (i64, u64),
    /// Counts since the first.
    turned: i64,
}

impl Counting {
    fn find(counter: &Counter, sign: f64) -> Result<Self, String> {
        let other = |name: &str| Some(counter.folder.join(name)).filter(|file| file.exists());
        if let Some(file) = other("enable")
            && !sysfs::is_on(&file)?
        {
            return Err(format!(
                "{} = 0: the counter is paused\nhint: echo 1 into it, as root, at boot",
                file.display()
            ));
        }
        if let Some(file) = other("count_mode") {
            let mode = sysfs::words(&file)?;
            if !["normal", "modulo-n"].contains(&mode.as_str()) {
                return Err(format!(
                    "{} = {mode}: the counter would stand at its ends\nhint: echo normal into it, as root, at boot",
                    file.display()
                ));
            }
        }
        let number = |name: &str| other(name).map(|file| sysfs::count(&file)).transpose();
        let (floor, ceiling) = (number("floor")?.unwrap_or(0), number("ceiling")?.or(counter.ceiling));
        let modulus = ceiling.map(|ceiling| i128::from(ceiling) - i128::from(floor) + 1);
        if modulus.is_some_and(|modulus| (modulus as f64) < 2.0 * counter.counts_per_turn.abs()) {
            return Err(format!(
                "{}: the counter begins anew within two turns\nhint: raise its ceiling, as root, at boot",
                counter.folder.display()
            ));
        }
        let rad = sign * TAU / counter.counts_per_turn;
        Ok(Self { file: counter.folder.join("count"), rad, modulus, last: None, from: (0, 0), turned: 0 })
    }

    /// Angle since the start, rad, and speed, rad/s; NaN where it was read too slowly to be known.
    fn read(&mut self) -> Result<(f64, f64), String> {
        let before_ns = monotonic_ns();
        let count = sysfs::count(&self.file)?;
        let after_ns = monotonic_ns();
        Ok(self.take(count, before_ns, after_ns))
    }

    fn take(&mut self, count: u64, before_ns: u64, after_ns: u64) -> (f64, f64) {
        let first = self.last.is_none();
        let last = self.last.replace(count).unwrap_or(count);
        self.turned = self.turned.wrapping_add(way(last, count, self.modulus));
        let angle = self.turned as f64 * self.rad;
        // It was counted somewhere between: a reading that took long is no instant.
        let at_ns = before_ns.midpoint(after_ns);
        let (from, from_ns) = self.from;
        let passed_ns = at_ns.saturating_sub(from_ns);
        if first {
            self.from = (self.turned, at_ns);
            return (angle, f64::NAN);
        }
        if passed_ns == 0 || after_ns.saturating_sub(before_ns) > passed_ns / 8 {
            return (angle, f64::NAN);
        }
        self.from = (self.turned, at_ns);
        (angle, self.turned.wrapping_sub(from) as f64 * self.rad / (passed_ns as f64 * 1e-9))
    }
}

/// The shorter way from one count to the next.
fn way(from: u64, to: u64, modulus: Option<i128>) -> i64 {
    let Some(modulus) = modulus else { return to.wrapping_sub(from) as i64 };
    let ahead = (i128::from(to) - i128::from(from)).rem_euclid(modulus);
    let way = if ahead * 2 > modulus { ahead - modulus } else { ahead };
    i64::try_from(way).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_counter_goes_over_its_end_both_ways() {
        for (from, to, ceiling, ways) in [
            (10, 15, Some(65535), 5),
            (65535, 2, Some(65535), 3),
            (2, 65535, Some(65535), -3),
            (0, u64::MAX, None, -1),
            (u64::MAX, 4, None, 5),
            (3, 0, Some(u64::MAX), -3),
        ] {
            assert_eq!(
                way(from, to, ceiling.map(|ceiling: u64| i128::from(ceiling) + 1)),
                ways,
                "{from} to {to}"
            );
        }
    }

    #[test]
    fn speed_is_counts_over_the_time_between_them_and_unknown_where_that_is() {
        const MS: u64 = 1_000_000;
        let (rad, modulus) = (TAU / 4096.0, Some(65536));
        let mut counter =
            Counting { file: PathBuf::new(), rad, modulus, last: None, from: (0, 0), turned: 0 };
        assert!(counter.take(65530, 0, 0).1.is_nan());
        let (angle, speed) = counter.take(4, 5 * MS, 5 * MS);
        assert!((angle - 10.0 * rad).abs() < 1e-12 && (speed - 10.0 * rad / 5e-3).abs() < 1e-9, "{speed}");
        assert!(counter.take(14, 9 * MS, 11 * MS).1.is_nan(), "read for 2 ms of 5");
        let (angle, speed) = counter.take(24, 15 * MS, 15 * MS);
        assert!((angle - 30.0 * rad).abs() < 1e-12 && (speed - 20.0 * rad / 10e-3).abs() < 1e-9, "{speed}");
    }
}
