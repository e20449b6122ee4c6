use super::*;

fn gathered(stamps: &[f64]) -> Log {
    let wanted = ["esc.rpm".to_string()];
    let mut gather = Gather::new("test", "s", Some(&wanted));
    let topic = gather.topic("esc[0]");
    let field = gather.field(topic, "rpm", None);
    for stamp in stamps {
        gather.message(topic, *stamp);
        gather.set(topic, field, *stamp * 2.0);
    }
    gather.finish()
}

#[test]
fn the_first_instance_is_called_with_and_without_its_number() {
    assert!(same_source("battery_status.voltage_v", "battery_status[0].voltage_v"));
    assert!(same_source("a[0].b[0]", "a.b[0]"));
    assert!(!same_source("battery_status[1].voltage_v", "battery_status.voltage_v"));
    assert!(!same_source("esc_status.esc[0].rpm", "esc_status.esc.rpm"));
}

#[test]
fn a_clock_that_begins_anew_begins_a_stretch_and_disorder_does_not() {
    let log = gathered(&[5.0, 6.0, 5.9, 7.0, 0.1, 0.2, 0.2]);
    let topic = &log.topics[0];
    assert_eq!(log.resets, 1);
    assert_eq!(topic.stretch(0), 0..3);
    assert_eq!(topic.stretch(1), 3..5);
    assert_eq!(topic.stretch(2), 0..0);
    assert_eq!(topic.fields[0].values, [10.0, 12.0, 14.0, 0.2, 0.4]);
    assert_eq!(topic.stale, 2);
    assert_eq!(log.losses.len(), 1);
}

#[test]
fn one_damaged_stamp_is_no_new_clock() {
    let log = gathered(&[5.0, 6.0, 9e9, 7.0, 8.0]);
    assert_eq!((log.resets, log.topics[0].stale), (0, 1));
    assert_eq!(log.topics[0].fields[0].values, [10.0, 12.0, 14.0, 16.0]);
}

#[test]
fn a_field_that_comes_late_is_empty_before() {
    let wanted = ["t.b".to_string()];
    let mut gather = Gather::new("test", "s", Some(&wanted));
    let topic = gather.topic("t");
    gather.message(topic, 0.0);
    let late = gather.field(topic, "b", None);
    gather.message(topic, 1.0);
    gather.set(topic, late, 4.0);
    let log = gather.finish();
    assert!(log.topics[0].fields[0].values[0].is_nan());
    assert_eq!(log.topics[0].fields[0].values[1], 4.0);
}

#[test]
fn gaps_and_usual_step() {
    let mut stamps: Vec<f64> = (0..50).map(|k| f64::from(k) * 0.1).collect();
    stamps.extend((0..50).map(|k| 20.0 + f64::from(k) * 0.1));
    let (usual, gaps) = steps(&stamps);
    assert!((usual - 0.1).abs() < 1e-9);
    assert_eq!(gaps.len(), 1);
    assert_eq!(gaps[0].1, 20.0);
}
