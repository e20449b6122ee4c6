use super::channels::Sign;
use super::*;
use crate::model::tests::stand;

/// Standard deviations in which a sign of 0.25 is told once a minute more of it has come, of a mean and spread of zero and
/// 0.1 that the first blocks had.
fn after_a_minute_more(off: bool) -> f64 {
    let mut monitor = Monitor::new(&stand(), 1.0);
    let sign = |value| Sign { value, excitation: 1.0 };
    (0..LEARNT).for_each(|k| monitor.usual[0].take(sign(if k % 2 == 0 { 0.1 } else { -0.1 })));
    let shown = std::array::from_fn(|i| (i == 0).then(|| sign(0.25)));
    monitor.to_learn = [shown; KEPT];
    monitor.off[0] = u32::from(off);
    for oldest in 0..KEPT {
        monitor.oldest = oldest;
        monitor.learn_oldest();
    }
    monitor.usual[0].standardised(sign(0.25), 0.0)
}

/// An operator reads it as the instant at which something broke.
#[test]
fn an_onset_stays_where_it_was_while_nothing_is_driven() {
    let model = stand();
    let mut monitor = Monitor::new(&model, 1.0);
    let measured = Measurement { shaft_speed_rad_s: Some(0.0), ..Measurement::default() };
    let run = |monitor: &mut Monitor, ticks: u32, dt_s: f64, driving: bool| {
        for _ in 0..ticks {
            monitor.passes(dt_s);
            monitor.tick(&Seen { model: &model, measured: &measured, drive_a: None, driving, dt_s });
        }
    };
    run(&mut monitor, 100, 0.1, true);
    monitor.goes_off(0, 0, Onset { driven_s: 4.0, at_s: 7.0 });
    assert!((monitor.mismatch().since_s - 3.0).abs() < 1e-6, "{:?}", monitor.mismatch());
    run(&mut monitor, 6000, 0.1, false);
    assert!((monitor.mismatch().since_s - 603.0).abs() < 1e-6, "{:?}", monitor.mismatch());
    // A shaft that tells nothing stops no clock either.
    let silent = Measurement::default();
    monitor.passes(60.0);
    monitor.tick(&Seen { model: &model, measured: &silent, drive_a: None, driving: true, dt_s: 0.1 });
    assert!((monitor.mismatch().since_s - 663.0).abs() < 1e-6, "{:?}", monitor.mismatch());
    let driven_s = monitor.cusums[0].level().1.driven_s;
    assert!((driven_s - 4.0).abs() < 1e-9, "what the path is named from counts driven time: {driven_s}");
}

#[test]
fn what_a_minute_showed_becomes_usual_unless_something_is_off() {
    assert!((after_a_minute_more(true) - 2.5).abs() < 0.02);
    assert!(after_a_minute_more(false) < 1.7, "{}", after_a_minute_more(false));
}
