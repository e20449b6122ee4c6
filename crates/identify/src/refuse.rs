//! What no log of a thruster holds, refused before a simulation would need endless memory or leave
//! the range of floating-point numbers.

use crate::data::{DataError, KNOWN, Series, pause_s};

/// Largest size that a value of the contract's columns may have, in their units.
const MOST: f64 = 1e6;
/// The same for the unwrapped shaft angle, rad.
const MOST_ANGLE_RAD: f64 = 1e9;
/// The same for a duty, a share of the supply from -1 to 1, with room for a supply that is stated low. Pulse widths and per
/// cent are not brought in yet, or by a wrong scale and offset.
const MOST_DUTY: f64 = 2.0;
/// Shortest usual log interval, s.
const SHORTEST_INTERVAL_S: f64 = 1e-5;
/// Most control ticks that a recording may span: five and a half hours at 500 Hz.
const MOST_TICKS: f64 = 1e7;

/// Refuses values and log intervals that no thruster gives.
///
/// # Errors
/// Names the column, the instant, the value found and what is allowed.
pub fn implausible(series: &Series, interval_s: f64) -> Result<(), DataError> {
    let recording = series.name.clone();
    for (column, values) in series.columns.iter().filter(|c| KNOWN.contains(&c.0.as_str())) {
        let most = match column.as_str() {
            "shaft_angle_rad" => MOST_ANGLE_RAD,
            "duty_cmd" => MOST_DUTY,
            _ => MOST,
        };
        if let Some(row) = values.iter().position(|v| v.abs() > most) {
            let (column, time_s, value) = (column.clone(), series.time_s[row], values[row]);
            return Err(DataError::Implausible { recording, column, time_s, value, most });
        }
    }
    if interval_s < SHORTEST_INTERVAL_S {
        return Err(DataError::TooFast { recording, interval_s, least_s: SHORTEST_INTERVAL_S });
    }
    Ok(())
}

/// Refuses a recording that spans more control ticks than can be simulated.
///
/// # Errors
/// Names the span, its longest gap and what is allowed.
pub fn too_long(series: &Series, tick_s: f64) -> Result<(), DataError> {
    let pause_s = pause_s(&series.time_s);
    let steps = series.time_s.windows(2).map(|w| w[1] - w[0]);
    let seconds: f64 = steps.filter(|step| *step <= pause_s).sum();
    if seconds / tick_s <= MOST_TICKS {
        return Ok(());
    }
    let gaps = series.time_s.windows(2).filter(|w| w[1] - w[0] <= pause_s);
    let longest = gaps.max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])));
    Err(DataError::TooLong {
        recording: series.name.clone(),
        seconds,
        most_s: MOST_TICKS * tick_s,
        gap_s: longest.map_or([series.time_s[0]; 2], |w| [w[0], w[1]]),
    })
}

#[cfg(test)]
mod tests {
    use super::implausible;
    use crate::data::Series;

    #[test]
    fn a_duty_beyond_the_supply_is_no_duty() {
        let log = |duty: f64| Series {
            name: "log".into(),
            time_s: vec![0.0, 0.01],
            columns: vec![("duty_cmd".into(), vec![0.0, duty])],
        };
        assert!(implausible(&log(-1.02), 0.01).is_ok());
        // A pulse width less its middle, scaled before and not after.
        let words = implausible(&log(-998.5), 0.01).unwrap_err().to_string();
        assert!(words.contains("duty_cmd = -998.5") && words.contains("scale * source + offset"), "{words}");
    }
}
