use super::super::{Gather, Log};
use super::propose;
use crate::formats;
use crate::map::ColumnMap;
use crate::recording::Recording;

/// Topic, field and its number in the k-th message.
type Given = (&'static str, &'static str, fn(u32) -> f64);

/// A log of messages; those of a topic are one after the other in the list.
fn log(format: &'static str, fields: &[Given]) -> Log {
    let mut gather = Gather::new(format, "seconds", None);
    for of_topic in fields.chunk_by(|a, b| a.0 == b.0) {
        let topic = gather.topic(of_topic[0].0);
        let places: Vec<usize> =
            of_topic.iter().map(|(_, name, _)| gather.field(topic, *name, None)).collect();
        for k in 0..50 {
            gather.message(topic, f64::from(k) * 0.02);
            for (place, (_, _, value)) in places.iter().zip(of_topic) {
                gather.set(topic, *place, value(k));
            }
        }
    }
    gather.finish()
}

const PX4: [Given; 5] = [
    ("actuator_outputs[0]", "output[0]", |_| 0.0),
    ("actuator_outputs[1]", "output[0]", |k| f64::from(k * 100)),
    ("esc_status[0]", "esc[0].esc_rpm", |k| f64::from(k)),
    ("esc_status[0]", "esc[0].esc_voltage", |k| 15.0 + f64::from(k) * 0.01),
    ("esc_status[0]", "esc[0].esc_current", |k| f64::from(k) * 0.1),
];

#[test]
fn a_map_whose_command_stands_comes_behind_one_whose_command_moves() {
    let (proposal, _) = propose(&log(formats::ULOG, &PX4));
    assert_eq!(
        proposal.shipped,
        ["px4-uavcan:bank=1,motor=0", "px4-outputs:bank=0,motor=0,output=0"],
        "{proposal:?}"
    );
    let [still] = &proposal.still[..] else { panic!("{:?}", proposal.still) };
    assert_eq!(
        (still.map.as_str(), still.column.as_str(), still.source.as_str(), still.value),
        ("px4-outputs:bank=0,motor=0,output=0", "duty_cmd", "actuator_outputs[0].output[0]", 0.0)
    );
}

#[test]
fn the_current_of_a_vehicles_speed_controller_is_the_supplys_and_a_doubt_says_so() {
    let (proposal, _) = propose(&log(formats::ULOG, &PX4));
    let map = proposal.map.unwrap();
    let lines = "[columns.supply_current_a]\nsource = \"esc_status[0].esc[0].esc_current\"\n";
    assert!(map.contains(lines) && !map.contains("[columns.current_a]"), "{map}");
    assert!(map.contains("# taken for what flows out of the supply"), "{map}");
}

#[test]
fn of_ardupilot_the_outputs_are_the_command() {
    let fields: [Given; 4] = [
        ("RCOU", "C1", |k| if k < 5 { 0.0 } else { 1400.0 + f64::from(k) }),
        ("ESC[0]", "RPM", |k| f64::from(k)),
        ("ESC[0]", "Curr", |k| f64::from(k) * 0.1),
        ("BAT[0]", "Curr", |k| f64::from(k) * 0.2),
    ];
    let map = propose(&log(formats::DATAFLASH, &fields)).0.map.unwrap();
    for lines in [
        "[columns.duty_cmd]\nsource = \"RCOU.C1\"\n# unit = \"1\"\n# table = [[1000, 0.0], [2000, 1.0]]",
        "none = 0   # no pulse\nno_value = 0.0\n",
        "[columns.supply_current_a]\nsource = \"ESC[0].Curr\"\n",
    ] {
        assert!(map.contains(lines), "{lines}: {map}");
    }
    assert!(!map.contains("[columns.current_a]") && !map.contains("BAT"), "{map}");
}

#[test]
fn a_command_without_a_number_is_said_to_be_at_rest_then() {
    let mut fields = PX4;
    fields[0] = ("actuator_motors", "control[0]", |k| if k < 5 { f64::NAN } else { f64::from(k) * 0.01 });
    let map = propose(&log(formats::ULOG, &fields[..3])).0.map.unwrap();
    assert!(
        map.contains("\nno_value = 0.0   # what it is where it holds no number, as in 5 message(s)"),
        "{map}"
    );
}

/// A table with `time_s` and one name of ours is a recording of kort by its names. Where it is refused as it is, a map brings it in.
#[test]
fn what_is_refused_as_a_recording_of_kort_has_a_map_proposed() {
    let text = |step_s: f64| {
        let mut text = String::from("time_s,motor_rpm,thrust_n,current_a\n");
        for k in 0..100 {
            let time_s = (f64::from(k) * step_s * 10.0).round() / 10.0;
            text += &format!("{time_s:.1},{},{},{}\n", 100 * (k % 9), k, k % 5);
        }
        text
    };
    let survey = |text: &str| super::super::survey("r.csv", text.as_bytes()).unwrap();
    let found = survey(&text(0.06));
    assert!(found.proposal.native, "{found:?}");
    let map = found.proposal.map.expect("a way in");
    for lines in
        ["stale_rows = \"drop\"", "[columns.shaft_speed_rad_s]\nsource = \"motor_rpm\"\nunit = \"rpm\""]
    {
        assert!(map.contains(lines), "{lines}: {map}");
    }
    let map = ColumnMap::from_toml("m", &map).unwrap();
    let r = Recording::decode("r.csv", text(0.06).as_bytes(), Some(&map)).unwrap();
    assert_eq!((r.rows(), r.columns.len()), (60, 3), "{:?}", r.losses);
    assert!(survey(&text(0.1)).proposal.map.is_none(), "it needs none");
}
