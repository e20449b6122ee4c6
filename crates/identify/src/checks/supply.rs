//! A supply that sags, as recorded.

use crate::data::Series;

/// A recorded supply that falls with the load.
pub struct Sag {
    /// At no load, V.
    rest_v: f64,
    /// At the largest load, V.
    full_v: f64,
    /// Of supply and load.
    correlation: f64,
    /// What rises, in words.
    load: String,
    /// What stands for the load, in words.
    measure: &'static str,
}

impl Sag {
    /// Share of the supply that is lost at the largest load; zero where supply and load have little to
    /// do with each other.
    pub fn share(&self) -> f64 {
        if self.correlation < -0.4 { (1.0 - self.full_v / self.rest_v).max(0.0) } else { 0.0 }
    }

    /// In words, if it is large enough to speak of.
    pub fn words(&self) -> Option<String> {
        (self.share() > 0.01).then(|| {
            format!(
                "supply_v sags as {}: about {:.2} V at rest, {:.2} V at the largest load (correlation {:.2} with {}); a constant supply would be wrong here",
                self.load, self.rest_v, self.full_v, self.correlation, self.measure
            )
        })
    }
}

/// How the recorded supply follows the load: power where current and shaft speed are recorded, else the
/// cube of a duty or a speed; every thruster whose command is recorded loads the same supply.
pub fn supply_sag(series: &Series) -> Option<Sag> {
    let supply = series.column("supply_v")?;
    let current = series.column("current_a").or_else(|| series.column("current_cmd_a"));
    let (load, measure, rows): (String, &str, Vec<(f64, f64)>) =
        match (current, series.column("shaft_speed_rad_s")) {
            (Some(current), Some(speed)) => {
                let power = (0..supply.len()).map(|k| (current[k] * speed[k]).max(0.0));
                (
                    "the load rises".into(),
                    "current times shaft speed",
                    power.zip(supply.iter().copied()).collect(),
                )
            }
            _ => {
                let commands: Vec<&[f64]> = series
                    .columns
                    .iter()
                    .filter(|c| {
                        ["duty_cmd", "speed_cmd_rad_s", "voltage_cmd_v"].iter().any(|n| c.0.starts_with(n))
                    })
                    .filter_map(|c| series.column(&c.0))
                    .collect();
                let cubes = (0..supply.len()).map(|k| commands.iter().map(|c| c[k].abs().powi(3)).sum());
                let words = match commands.len() {
                    0 => return None,
                    1 => "the command rises".into(),
                    n => format!("the {n} commands together rise"),
                };
                (words, "the commands cubed", cubes.zip(supply.iter().copied()).collect())
            }
        };
    let rows: Vec<(f64, f64)> = rows.into_iter().filter(|r| r.0.is_finite() && r.1.is_finite()).collect();
    let n = rows.len() as f64;
    if rows.len() < 50 {
        return None;
    }
    let (mx, my) = (rows.iter().map(|r| r.0).sum::<f64>() / n, rows.iter().map(|r| r.1).sum::<f64>() / n);
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for (x, y) in &rows {
        xx += (x - mx).powi(2);
        xy += (x - mx) * (y - my);
        yy += (y - my).powi(2);
    }
    let slope = xy / xx.max(1e-300);
    let top = rows.iter().map(|r| r.0).fold(0.0, f64::max);
    Some(Sag {
        rest_v: my - slope * mx,
        full_v: my + slope * (top - mx),
        correlation: xy / (xx * yy).sqrt().max(1e-300),
        load,
        measure,
    })
}
