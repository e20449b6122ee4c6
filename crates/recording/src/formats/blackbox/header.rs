//! The lines before the frames: which fields there are, how they are written, and what their numbers mean.

use std::collections::HashMap;

use super::fields::{Frame, Predict};

/// Standard gravity, m/s^2.
const GRAVITY: f64 = 9.806_65;
/// Lines that tell of motor speeds: how many poles a motor has, and whether it answers.
const TOLD: [&str; 3] = ["motor_poles", "dshot_bidir", "motorOutput"];

/// What the header of one log says.
pub(super) struct Header {
    /// Main frames.
    pub main: Frame,
    /// Frames that are passed over.
    pub slow: Frame,
    pub gps: Frame,
    pub home: Frame,
    /// Place of `time` in the main frame.
    pub time: usize,
    /// Place of `motor[0]`, which other motors are predicted from.
    pub motor: Option<usize>,
    /// What predictions begin from.
    pub throttle_min: i64,
    pub motor_min: i64,
    pub supply: i64,
    /// Factor and unit of each main field, where it has one.
    pub scales: Vec<Option<(f64, &'static str)>>,
    /// In the firmware's own words.
    pub firmware: String,
    lines: HashMap<String, String>,
}

impl Header {
    /// The header of a log, and what follows it.
    ///
    /// # Errors
    /// What is missing, in words.
    pub fn read(data: &[u8]) -> Result<(Self, &[u8]), String> {
        let mut lines = HashMap::new();
        let mut rest = data;
        while rest.starts_with(b"H ") {
            let Some(end) = rest.iter().position(|byte| *byte == b'\n') else {
                return Err("its header is cut off".into());
            };
            let line = String::from_utf8_lossy(&rest[2..end]);
            if let Some((name, value)) = line.split_once(':') {
                lines.insert(name.trim().to_owned(), value.trim().to_owned());
            }
            rest = &rest[end + 1..];
        }
        match lines.get("Data version").map(String::as_str) {
            Some("2") => {}
            other => return Err(format!("its data version is {}; allowed: 2", other.unwrap_or("not said"))),
        }
        let main = Frame::read(&lines, "I", "P")?;
        let time = main.names.iter().position(|name| name == "time").ok_or("its frames have no time")?;
        let first = |name: &str| {
            lines.get(name).and_then(|value| value.split(',').next()?.trim().parse::<i64>().ok()).unwrap_or(0)
        };
        let beside = |kind: &str| Frame::read(&lines, kind, kind).unwrap_or_default();
        let header = Self {
            time,
            motor: main.names.iter().position(|name| name == "motor[0]"),
            throttle_min: first("minthrottle"),
            motor_min: first("motorOutput"),
            supply: first("vbatref"),
            scales: scales(&main.names, &lines),
            firmware: lines.get("Firmware revision").cloned().unwrap_or_else(|| "firmware not said".into()),
            slow: beside("S"),
            gps: beside("G"),
            home: beside("H"),
            main,
            lines,
        };
        // Home is not kept: what is predicted from it would be wrong, and is in frames that are passed over.
        if header.main.predicts(Predict::Home) {
            return Err("its main frames are predicted from a position".into());
        }
        Ok((header, rest))
    }

    /// What a column map may need to know.
    pub fn told(&self) -> String {
        let said: Vec<String> =
            TOLD.iter().filter_map(|name| Some(format!("{name} = {}", self.lines.get(*name)?))).collect();
        if said.is_empty() { String::new() } else { format!("; its header says {}", said.join(", ")) }
    }
}

/// Betaflight 4.0 and INAV 2.0 began to count voltage and current in hundredths.
fn counts_hundredths(lines: &HashMap<String, String>) -> bool {
    let mut words = lines.get("Firmware revision").map_or("", String::as_str).split_whitespace();
    let (name, version) = (words.next().unwrap_or(""), words.next().unwrap_or(""));
    let major: u32 = version.split('.').next().and_then(|major| major.parse().ok()).unwrap_or(0);
    match name.to_ascii_lowercase().as_str() {
        "betaflight" => major >= 4,
        "inav" => major >= 2,
        _ => false,
    }
}

fn scales(names: &[String], lines: &HashMap<String, String>) -> Vec<Option<(f64, &'static str)>> {
    let gyro = lines.get("gyro_scale").or_else(|| lines.get("gyro.scale")).and_then(|text| {
        let bits = text
            .strip_prefix("0x")
            .map_or_else(|| text.parse().ok(), |hex| u32::from_str_radix(hex, 16).ok());
        Some(f64::from(f32::from_bits(bits?)).to_radians()).filter(|scale| scale.is_normal())
    });
    let one_g: Option<f64> = lines.get("acc_1G").and_then(|text| text.parse().ok()).filter(|one| *one > 0.0);
    let hundredths = counts_hundredths(lines);
    let of = |name: &String| match name.split('[').next().unwrap_or_default() {
        "vbatLatest" | "vbat" if hundredths => Some((0.01, "V")),
        "amperageLatest" | "amperage" if hundredths => Some((0.01, "A")),
        "gyroADC" | "gyroUnfilt" => gyro.map(|scale| (scale, "rad/s")),
        "accSmooth" => one_g.map(|one| (GRAVITY / one, "m/s^2")),
        _ => None,
    };
    names.iter().map(of).collect()
}
