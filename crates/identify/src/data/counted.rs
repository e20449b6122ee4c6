//! The shaft angle where only its speed was recorded: counted, as an encoder's speed is counted from its angle.

use kort_thruster::rig::Rig;

use super::Series;
use super::fill::filled;
use super::pauses::has_paused;
use crate::checks::is_unsigned_speed;

/// Shaft angle at every row, rad, zero at the first: the recorded speed integrated over time, the stated filter's lag
/// taken back (`y + tau y' = Om`, so `q = int y dt + tau (y - y0)`). None where the angle itself is recorded, and
/// where no count can be kept: no speed, one without its sign, or a log that paused. None too where the shaft usually turns
/// by more than half a turn from row to row: what repeats once a turn is not sampled twice in it then, and a count over so
/// many turns has lost its phase.
pub fn counted_angle(series: &Series, rig: &Rig) -> Option<Vec<f64>> {
    let recorded = series.column("shaft_angle_rad").is_some();
    if recorded || is_unsigned_speed(series) || has_paused(&series.time_s) {
        return None;
    }
    let speed = filled(series.column("shaft_speed_rad_s")?);
    let mut turns: Vec<f64> =
        (series.time_s.windows(2).zip(&speed)).map(|(t, y)| (y * (t[1] - t[0])).abs()).collect();
    turns.sort_by(f64::total_cmp);
    if turns.get(turns.len() / 2).is_none_or(|usual_rad| *usual_rad > std::f64::consts::PI) {
        return None;
    }
    let lag_s = rig.sensors.speed_filter_time_constant_s.unwrap_or(0.0);
    let mut turned = 0.0;
    let rest = series.time_s.windows(2).zip(speed.windows(2)).map(|(t, y)| {
        turned += 0.5 * (y[0] + y[1]) * (t[1] - t[0]);
        turned + lag_s * (y[1] - speed[0])
    });
    Some(std::iter::once(0.0).chain(rest).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A column's name, and its value at a time, s.
    type Column = (&'static str, fn(f64) -> f64);

    fn series(columns: &[Column], pause_s: f64) -> Series {
        let time_s: Vec<f64> =
            (0..400).map(|k| 0.01 * f64::from(k) + if k > 200 { pause_s } else { 0.0 }).collect();
        let column = |(name, of): &Column| ((*name).to_owned(), time_s.iter().map(|t| of(*t)).collect());
        Series { name: "a".into(), columns: columns.iter().map(column).collect(), time_s }
    }

    #[test]
    fn what_turned_is_counted_behind_a_filter() {
        // Om = 30 cos 2t through a lag of 50 ms; the angle is 15 sin 2t.
        fn shown(t: f64) -> f64 {
            let (w, lag): (f64, f64) = (2.0, 0.05);
            30.0 * ((w * t).cos() + w * lag * (w * t).sin()) / (1.0 + w * w * lag * lag)
        }
        let rig = Rig::from_toml(
            "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 1.0\n\
             [sensors]\nspeed_filter_time_constant_s = 0.05\n",
        )
        .unwrap();
        let speed: Column = ("shaft_speed_rad_s", shown);
        let one = series(&[speed], 0.0);
        let angle = counted_angle(&one, &rig).unwrap();
        for (q, t) in angle.iter().zip(&one.time_s) {
            assert!((q - 15.0 * (2.0 * t).sin()).abs() < 0.01, "{t}: {q}");
        }
        assert_eq!(counted_angle(&series(&[speed], 100.0), &rig), None, "a pause loses the count");
        assert_eq!(counted_angle(&series(&[speed, ("shaft_angle_rad", f64::sin)], 0.0), &rig), None);
        assert_eq!(counted_angle(&series(&[("thrust_n", f64::sin)], 0.0), &rig), None);
        let fast: Column = ("shaft_speed_rad_s", |t| 400.0 + t.sin());
        assert_eq!(counted_angle(&series(&[fast], 0.0), &rig), None, "four radians from row to row");
        let unsigned: [Column; 2] =
            [("shaft_speed_rad_s", |t| (30.0 * (2.0 * t).cos()).abs()), ("current_a", |t| (2.0 * t).cos())];
        assert_eq!(counted_angle(&series(&unsigned, 0.0), &rig), None, "a speed without its sign");
    }
}
