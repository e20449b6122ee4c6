use kort_recording::Column;
use serde_json::json;

use super::*;

/// Ten seconds of a current that swings, a speed and a thrust that follow.
fn recording() -> Recording {
    let time_s: Vec<f64> = (0..1000).map(|row| 0.01 * f64::from(row)).collect();
    let of = |at: fn(f64) -> f64| time_s.iter().map(|t| at(*t)).collect::<Vec<f64>>();
    Recording {
        name: "run.csv".into(),
        columns: vec![
            Column::new("current_cmd_a", of(|t| if (0.5 * t).fract() < 0.5 { 4.0 } else { -3.0 })),
            Column::new("shaft_speed_rad_s", of(|t| 20.0 * (2.0 * t).sin())),
            Column::new("shaft_angle_rad", of(|t| 60.0 * t)),
            Column::new("thrust_n", of(|t| 50.0 * (2.0 * t).sin())),
            Column::new("supply_v", of(|t| 12.0 - 0.1 * t)),
            Column::new("ambient_m_s", of(|t| 0.1 * t)),
        ],
        time_s,
        ..Recording::default()
    }
}

fn made(name: &str) -> (Recording, Option<Made>) {
    let change = ALL.iter().find(|change| change.name == name).unwrap();
    let (mut changed, mut other) = (recording(), recording());
    other.columns[0].values.iter_mut().for_each(|cell| *cell = 0.5 * cell.abs());
    let made = (change.make)(&mut changed, &other);
    (changed, made)
}

#[test]
fn every_change_changes_what_it_says_and_leaves_rows_alone() {
    let before = recording();
    for change in ALL {
        let (after, made) = made(change.name);
        assert_eq!(after.time_s, before.time_s, "{}", change.name);
        if made.is_none() {
            assert_eq!(after.columns, before.columns, "{} changed without saying", change.name);
            continue;
        }
        assert_ne!(after.columns, before.columns, "{} changed nothing", change.name);
    }
}

#[test]
fn a_delayed_command_drives_as_before_once_it_is_late() {
    let (after, made) = made("delayed_command");
    assert!(made.unwrap().what.contains("30 ms"));
    let (earlier, own) = (after.column("current_cmd_a").unwrap(), recording());
    let own = own.column("current_cmd_a").unwrap();
    // Three rows of 10 ms.
    assert_eq!(earlier[..997], own[3..]);
}

#[test]
fn a_dead_band_gives_back_what_drove() {
    let (after, made) = made("dead_band");
    assert_eq!(made.unwrap().expects, Expected::Named(vec!["command_dead_band", "coulomb_friction"]));
    let half = 0.4;
    for (asked, drove) in
        after.column("current_cmd_a").unwrap().iter().zip(recording().column("current_cmd_a").unwrap())
    {
        let through = asked.signum() * (asked.abs() - half).max(0.0);
        assert!((through - drove).abs() < 1e-12, "{asked} gives {through}, not {drove}");
    }
}

#[test]
fn a_bent_throttle_gives_back_what_drove() {
    let (after, _) = made("throttle_curve");
    for (asked, drove) in
        after.column("current_cmd_a").unwrap().iter().zip(recording().column("current_cmd_a").unwrap())
    {
        let x = asked / 4.0;
        let through = 4.0 * (0.65 * x + 0.35 * x * x.abs());
        assert!((through - drove).abs() < 1e-9, "{asked} gives {through}, not {drove}");
    }
}

#[test]
fn a_lag_of_a_column_is_of_first_order() {
    let time_s: Vec<f64> = (0..100).map(|row| 0.01 * f64::from(row)).collect();
    let step: Vec<f64> = time_s.iter().map(|t| f64::from(*t >= 0.1)).collect();
    let late = columns::lagged(&time_s, &step, 0.05);
    // Five rows after the edge, six intervals have acted.
    assert!((late[15] - (1.0 - (-1.2_f64).exp())).abs() < 1e-9, "{}", late[15]);
}

#[test]
fn what_was_there_before_does_not_count() {
    let finding = |effect: &str, probability: f64| json!({ "effect": effect, "probability": probability });
    let base = json!({ "verdict": "explained", "findings": [finding("coulomb_friction", 0.95)] });
    let named = |names: Vec<&'static str>| Made { what: String::new(), expects: Expected::Named(names) };
    let changed = json!({ "verdict": "explained", "findings": [
        finding("coulomb_friction", 0.95), finding("transport_delay", 0.95), finding("windage_drag", 0.95)] });
    let delay = judge("s", "r", "c", &named(vec!["transport_delay"]), &base, &changed);
    assert!(delay.found && !delay.already_there);
    assert_eq!(delay.sure_and_wrong, ["windage_drag"]);
    let friction = judge("s", "r", "c", &named(vec!["coulomb_friction"]), &base, &changed);
    assert!(friction.already_there && !friction.found);
    let same = judge("s", "r", "c", &Made { what: String::new(), expects: Expected::TheSame }, &base, &base);
    assert!(same.found);
    let load = Made { what: String::new(), expects: Expected::Nameless(&["shaft"], &[]) };
    let flagged = json!({ "verdict": "unexplained", "findings": [], "empirical_term": { "path": "shaft" } });
    assert!(judge("s", "r", "c", &load, &base, &flagged).found);
    assert!(!judge("s", "r", "c", &load, &base, &changed).found);
}
