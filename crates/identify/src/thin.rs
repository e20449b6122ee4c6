//! Recordings that tell too little of a thruster.

use kort_thruster::parameters::Parameters;
use kort_thruster::rig::Rig;

use crate::data::{Channel, Driving, Prepared, Response};

/// Fewest rows in all that noise can be learnt from.
const FEWEST_ROWS: usize = 200;
/// Fewest changes of what drives that part physics from parameters.
const FEWEST_CHANGES: usize = 3;
/// A change of what drives, share of its largest.
const CHANGE: f64 = 0.1;
/// Share of what the drive's limit makes below which nothing worth the name moves.
const SMALL: f64 = 0.02;
/// Ratio of von Neumann from which samples are each their own: two for white noise, near none for what moves. Of the fewest rows it
/// scatters by 0.14 (the root of 4 over their number), so this is more than three of those below.
const WHITE: f64 = 1.5;
/// Noise takes no more than this share of what the drive's limit makes.
const LARGEST_NOISE: f64 = 0.2;
/// A correlation from which one follows the other: a table of many points in no order is no noise. Of the fewest rows of two that
/// have nothing to do with each other it scatters by 0.07 (one over the root of their number).
const FOLLOWS: f64 = 0.5;

/// Why recordings cannot tell anything.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Thin {
    /// In words.
    pub why: String,
    /// Nothing moves at all, or nothing as the model does: what they show is the sensors' own, or comes from elsewhere.
    pub still: bool,
    /// Something in the log is to be put right first; another run would show the same.
    pub of_the_log: bool,
}

impl Thin {
    /// What is told of them follows no channel better than a shaft at rest does.
    pub fn unpredicted() -> Self {
        let why = "nothing that was recorded follows what drives: with all that would be told, no channel is followed better than by a machine at rest. The log may be too slow for its command, or its columns may belong to different machines or times";
        Self { why: why.into(), still: true, of_the_log: false }
    }
}

/// Recordings without enough change to tell anything.
pub fn too_thin(recordings: &[Prepared], rig: &Rig) -> Option<Thin> {
    let thin = |why: String| Some(Thin { why, still: false, of_the_log: false });
    let samples: usize = recordings.iter().map(|r| r.time_s.len()).sum();
    if samples < FEWEST_ROWS {
        return thin(format!("{samples} rows in all are too few to learn the noise and hold data out"));
    }
    let limits = Limits::of(rig);
    if recordings.iter().all(|recording| is_still(recording, &limits)) {
        let driver = recordings.first().map_or("", |recording| recording.driving.column());
        let why = format!(
            "nothing moves: {driver} and what answers it show no more than sensors do at rest; record the machine at work"
        );
        return Some(Thin { why, still: true, of_the_log: false });
    }
    if changes(recordings) < FEWEST_CHANGES {
        return thin(
            "the driving signal hardly changes: steady data cannot part physics from parameters".into(),
        );
    }
    None
}

/// Recordings of which the checks left out nearly all: what is compared with so few rows fits anything.
pub fn nothing_left(masked: &[Vec<bool>]) -> Option<Thin> {
    let all: usize = masked.iter().map(Vec::len).sum();
    let left = masked.iter().flatten().filter(|left_out| !**left_out).count();
    (left < FEWEST_ROWS).then(|| Thin {
        why: format!(
            "of {all} rows only {left} are left to compare, too few to learn the noise and hold data out; the notes say why the others were left out"
        ),
        still: false,
        of_the_log: true,
    })
}

/// How often what drives changes by more than a trifle of its largest, within recordings and from one to the next.
fn changes(recordings: &[Prepared]) -> usize {
    let mut drivers: Vec<&str> = recordings.iter().map(|r| r.driving.column()).collect();
    drivers.sort_unstable();
    drivers.dedup();
    let of = |driver: &&str| {
        let driven = recordings.iter().filter(|r| r.driving.column() == *driver);
        let command: Vec<f64> = driven.flat_map(|r| r.command.iter().copied()).collect();
        let top = command.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
        let mut at = command.first().copied().unwrap_or(0.0);
        let changed = |c: &&f64| {
            let changed = (**c - at).abs() > CHANGE * top;
            if changed {
                at = **c;
            }
            changed
        };
        command.iter().filter(changed).count()
    };
    drivers.iter().map(of).sum()
}

/// What the drive's limit makes in bollard pull; infinite where that is not stated, and for what it says nothing of.
struct Limits {
    current_a: f64,
    torque_n_m: f64,
    shaft_speed_rad_s: f64,
    thrust_n: f64,
}

impl Limits {
    fn of(rig: &Rig) -> Self {
        let current_a = rig.amplifier.current_limit_a;
        let torque_n_m = current_a * rig.motor.torque_constant_nm_a.value;
        let (ct, cq) = match rig.propeller {
            Some(_) => Parameters::stated(rig).bollard_coefficients(),
            None => (1.0, 0.0),
        };
        let shaft_speed_rad_s = (torque_n_m / cq).sqrt();
        Self {
            current_a,
            torque_n_m,
            shaft_speed_rad_s,
            thrust_n: ct * shaft_speed_rad_s * shaft_speed_rad_s,
        }
    }

    fn of_response(&self, response: Response) -> f64 {
        match response {
            Response::Current => self.current_a,
            Response::Torque => self.torque_n_m,
            Response::ShaftSpeed | Response::ShaftAngle => self.shaft_speed_rad_s,
            Response::Thrust => self.thrust_n,
            Response::Flow => f64::INFINITY,
        }
    }

    /// Of what drives, where it is measured: a command is known, however small.
    fn of_driver(&self, driving: Driving) -> f64 {
        match driving {
            Driving::Current => self.current_a,
            Driving::Speed => self.shaft_speed_rad_s,
            Driving::Command(_) | Driving::Power => f64::INFINITY,
        }
    }
}

/// Does neither what drives nor what answers it show more than the noise of a sensor at rest?
fn is_still(recording: &Prepared, limits: &Limits) -> bool {
    let driver = &recording.command;
    let off = match recording.driving {
        Driving::Command(_) => driver.iter().all(|command| *command == 0.0),
        measured => rests(driver, limits.of_driver(measured)),
    };
    let follows = |channel: &Channel| {
        let pairs = channel.rows.iter().zip(&channel.values).map(|(row, value)| (driver[*row], *value));
        correlation(pairs).abs() > FOLLOWS
    };
    off && recording.channels.iter().all(|channel| {
        // The first rate of an angle is none.
        let values = &channel.values[usize::from(channel.response == Response::ShaftAngle)..];
        rests(values, limits.of_response(channel.response)) && !follows(channel)
    })
}

/// Is that a sensor at rest: all of it a trifle of what the drive's limit makes, or each sample its own about zero?
fn rests(values: &[f64], limit: f64) -> bool {
    let (low, high) = range(values);
    let (size, spread) = (low.abs().max(high.abs()), high - low);
    let trifle = size <= SMALL * limit && limit.is_finite();
    let noise = size <= spread.min(LARGEST_NOISE * limit) && neumann(values) > WHITE;
    trifle || noise
}

/// Lowest and highest, a hundredth left out on either side: a spike is no course.
fn range(values: &[f64]) -> (f64, f64) {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let out = sorted.len() / 100;
    let at = |k: usize| sorted.get(k).copied().unwrap_or(0.0);
    (at(out), at(sorted.len().saturating_sub(out + 1)))
}

/// Mean square of the differences from sample to sample over the variance.
fn neumann(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let variance: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    let moves: f64 = values.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum();
    if variance > 0.0 { moves / variance } else { 2.0 }
}

/// Correlation of two columns; zero where one is constant.
fn correlation(pairs: impl Iterator<Item = (f64, f64)> + Clone) -> f64 {
    let n = pairs.clone().count() as f64;
    let (a, b) = pairs.clone().fold((0.0, 0.0), |(a, b), (x, y)| (a + x / n, b + y / n));
    let (mut xx, mut yy, mut xy) = (0.0, 0.0, 0.0);
    for (x, y) in pairs {
        xx += (x - a).powi(2);
        yy += (y - b).powi(2);
        xy += (x - a) * (y - b);
    }
    if xx > 0.0 && yy > 0.0 { xy / (xx * yy).sqrt() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use rand::{Rng as _, SeedableRng};

    use super::*;
    use crate::data::Series;

    const WET: &str = include_str!("../../../config/thrusters/whitcomb-yoerger-1999.toml");
    const DRY: &str =
        "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 0.1\n";

    /// What is said of a log of 400 rows in which the current, speed and thrust are these, and noise.
    fn said(rig: &str, driver: &str, row: impl Fn(usize) -> [f64; 3], noise: [f64; 3]) -> Option<bool> {
        let rig = Rig::from_toml(rig).unwrap();
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let mut columns = vec![Vec::new(); 3];
        for k in 0..400 {
            for (column, (value, noise)) in columns.iter_mut().zip(row(k).into_iter().zip(noise)) {
                column.push(value + noise * rng.random_range(-1.0..1.0));
            }
        }
        let names = [driver, "shaft_speed_rad_s", "thrust_n"].map(str::to_owned);
        let series = Series {
            name: "log".into(),
            time_s: (0..400).map(|k| 0.01 * f64::from(k)).collect(),
            columns: names.into_iter().zip(columns).collect(),
        };
        let prepared = Prepared::new(&series, &rig, false).unwrap();
        too_thin(&[prepared], &rig).map(|thin| thin.still)
    }

    #[test]
    fn what_the_checks_left_nothing_of_tells_nothing() {
        let words = nothing_left(&[vec![true; 900], [vec![false; 99], vec![true; 1]].concat()]);
        assert!(words.unwrap().why.starts_with("of 1000 rows only 99 are left"));
        assert!(nothing_left(&[vec![true; 900], vec![false; 200]]).is_none());
    }

    #[test]
    fn a_thruster_at_rest_tells_nothing_whatever_its_sensors_show() {
        for rig in [WET, DRY] {
            let thrust = |newton: f64| if rig == WET { newton } else { 0.0 };
            let at_rest = |noise: [f64; 3]| said(rig, "current_a", |_| [0.0; 3], noise);
            assert_eq!(at_rest([0.02, 0.3, thrust(0.5)]), Some(true));
        }
        assert_eq!(said(WET, "current_cmd_a", |_| [0.0; 3], [0.0, 0.1, 0.5]), Some(true));
        assert_eq!(
            said(WET, "current_cmd_a", |_| [0.0; 3], [0.0; 3]),
            Some(true),
            "nor if they show nothing"
        );
        // The speed is constant, and sensors are off zero by a trifle of what the drive can do.
        assert_eq!(said(WET, "current_a", |_| [0.0; 3], [0.02, 0.0, 0.5]), Some(true));
        assert_eq!(said(WET, "current_a", |_| [0.05, 0.0, -2.0], [0.02, 0.1, 0.5]), Some(true));
        // Noise that a filter has made slow is a trifle of what the drive can do.
        let slow = |k: usize| {
            let wave = |rate: f64| (rate * k as f64).sin();
            [0.05 * wave(0.1), 0.1 * wave(0.17), 0.5 * wave(0.23)]
        };
        assert_eq!(said(WET, "current_a", slow, [0.001; 3]), Some(true));
    }

    #[test]
    fn runs_from_rest_at_several_levels_change_together_what_one_alone_does_not() {
        let rig = Rig::from_toml(DRY).unwrap();
        // An angle alone answers as well as a speed.
        let run = |level: f64, answer: &str| {
            let turned = (0..400).map(|k| level * f64::from(k * k) * 1e-4).collect();
            let columns = vec![("current_cmd_a".to_owned(), vec![level; 400]), (answer.to_owned(), turned)];
            let time_s = (0..400).map(|k| 0.01 * f64::from(k)).collect();
            Prepared::new(&Series { name: "run".into(), time_s, columns }, &rig, false).unwrap()
        };
        for answer in ["shaft_speed_rad_s", "shaft_angle_rad"] {
            let runs = |levels: [f64; 4]| levels.map(|level| run(level, answer));
            assert_eq!(too_thin(&runs([1.0, 2.0, 3.0, 4.0]), &rig), None);
            assert!(
                too_thin(&runs([2.0; 4]), &rig).is_some_and(|thin| !thin.still),
                "one level tells one point"
            );
        }
    }

    #[test]
    fn one_at_work_is_not_at_rest() {
        let waves = |k: usize| {
            let level = ((k / 25 * 7919) % 13) as f64 / 13.0 - 0.5;
            [8.0 * level, 60.0 * level, 150.0 * level]
        };
        let noise = [0.02, 0.1, 0.5];
        assert_eq!(said(WET, "current_a", waves, noise), None);
        assert_eq!(said(WET, "current_cmd_a", waves, noise), None);
        // A dead drive is asked for much and does nothing; a mill in a stream does what nobody asked for.
        assert_eq!(said(WET, "current_cmd_a", |k| [waves(k)[0], 0.0, 0.0], [0.0, 0.1, 0.5]), None);
        assert_ne!(said(WET, "current_cmd_a", |k| [0.0, waves(k)[1], 0.0], [0.0, 0.1, 0.5]), Some(true));
        // Points in no order: each row is another, and the shaft follows.
        let point = |k: usize| {
            let level = ((k * 7919) % 101) as f64 / 101.0;
            [level, 8.0 * level, 20.0 * level]
        };
        assert_eq!(said(WET, "current_a", point, noise), None);
        // Steady work tells one point.
        assert_eq!(said(WET, "current_cmd_a", |_| [5.0, 40.0, 90.0], [0.0, 0.1, 0.5]), Some(false));
        assert_eq!(said(WET, "current_a", |_| [5.0, 40.0, 90.0], noise), Some(false));
        assert_eq!(said(WET, "current_cmd_a", |_| [5.0, 40.0, 90.0], [0.0; 3]), Some(false));
    }
}
