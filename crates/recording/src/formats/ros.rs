//! Messages of ROS 2 on their way into a log, whatever file they came in; and the usual types, for files that do not
//! describe theirs.

use std::collections::{BTreeMap, HashMap};

use super::cdr::{Found, Layout};
use crate::log::Gather;

/// A topic whose messages are CDR.
pub(super) struct Topic {
    place: usize,
    name: String,
    layout: Layout,
    fields: HashMap<String, usize>,
    joints: Joints,
}

impl Topic {
    /// A topic under the name that column maps use: without its first slash.
    pub fn new(gather: &mut Gather<'_>, name: &str, layout: Layout) -> Self {
        let name = name.trim_start_matches('/').to_owned();
        Self {
            place: gather.topic(name.as_str()),
            name,
            layout,
            fields: HashMap::new(),
            joints: Joints::default(),
        }
    }

    /// Takes a message; false if it does not fit its type.
    pub fn message(&mut self, gather: &mut Gather<'_>, stamp_s: f64, data: &[u8]) -> bool {
        gather.message(self.place, stamp_s);
        let (topic, fields, joints) = (self.place, &mut self.fields, &mut self.joints);
        joints.now.clear();
        let mut field_of = |gather: &mut Gather<'_>, name: &str| match fields.get(name) {
            Some(field) => *field,
            None => *fields.entry(name.into()).or_insert(gather.field(topic, name, None)),
        };
        let read = self.layout.read(data, &mut |name: &str, found| {
            let field = field_of(gather, name);
            match found {
                Found::Number(value) => match joints.of(name) {
                    Some(Joint { is_first, by_name }) => {
                        if is_first {
                            gather.set(topic, field, value);
                        } else if gather.takes(topic, field) {
                            joints.others(name);
                        }
                        if let Some(by_name) = by_name {
                            let field = field_of(gather, &by_name);
                            gather.set(topic, field, value);
                        }
                    }
                    None => gather.set(topic, field, value),
                },
                Found::Text(text) => {
                    joints.name(name, text);
                    gather.text(topic, field);
                }
            }
        });
        read.is_ok()
    }

    /// Numbers that are left out since they are another joint's than the first at their place.
    pub fn losses(&self) -> Vec<String> {
        let lost = self.joints.others.iter().map(|(place, (count, now))| {
            let (list, at) = place.split_once('[').unwrap_or((place, ""));
            let first = at.strip_suffix(']').and_then(|at| at.parse::<usize>().ok());
            let first = first.and_then(|at| self.joints.first.get(at)).map_or("", String::as_str);
            format!(
                "{count} number(s) of `{topic}.{place}` are those of the joint \"{now}\" or others, and not of \"{first}\", which was there first: left out; by its name `{topic}.{list}[{first}]` is in all of them",
                topic = self.name
            )
        });
        lost.collect()
    }
}

/// Lists of `sensor_msgs/JointState` that go beside its list of names.
const OF_JOINTS: [&str; 3] = ["position", "velocity", "effort"];

/// Names of joints, in a message that tells them: several drivers may publish on one topic, and none need keep an order.
#[derive(Default)]
struct Joints {
    /// Those of the message under way.
    now: Vec<String>,
    /// The first at each place.
    first: Vec<String>,
    /// Numbers left out by their field, and whose the first of them was.
    others: BTreeMap<String, (u64, String)>,
}

/// Whose a number is.
struct Joint {
    /// The joint that was at this place first.
    is_first: bool,
    /// The field by the joint's name; none for a name that would be a place.
    by_name: Option<String>,
}

impl Joints {
    /// Takes a text, if it is a joint's name.
    fn name(&mut self, field: &str, text: &[u8]) {
        if !field.starts_with("name[") {
            return;
        }
        let text = String::from_utf8_lossy(text);
        self.now.push(text.trim_end_matches('\0').to_owned());
        if self.first.len() < self.now.len() {
            self.first.extend(self.now.last().cloned());
        }
    }

    /// The place of a number of a joint, `velocity[1]`, and its list.
    fn place(field: &str) -> Option<(&str, usize)> {
        let (list, at) = field.strip_suffix(']')?.split_once('[')?;
        OF_JOINTS.contains(&list).then_some((list, at.parse().ok()?))
    }

    /// Whose the number is; none where no name tells.
    fn of(&self, field: &str) -> Option<Joint> {
        let (list, at) = Self::place(field)?;
        let name = self.now.get(at)?;
        let is_place = name.is_empty() || name.bytes().all(|byte| byte.is_ascii_digit());
        Some(Joint {
            is_first: self.first.get(at) == Some(name),
            by_name: (!is_place).then(|| format!("{list}[{name}]")),
        })
    }

    /// Counts a number that is another joint's.
    fn others(&mut self, field: &str) {
        let name = Self::place(field).and_then(|(_, at)| self.now.get(at)).cloned().unwrap_or_default();
        self.others.entry(field.to_owned()).or_insert((0, name)).0 += 1;
    }
}

/// A usual type's layout, by its name in either form.
pub(super) fn usual(name: &str) -> Option<Layout> {
    let plain = name.replace("/msg/", "/");
    let own = USUAL.iter().find(|(known, _)| *known == plain)?.1;
    let others = USUAL.iter().map(|(name, text)| format!("========\nMSG: {name}\n{text}"));
    Layout::parse(name, &format!("{own}{}", others.collect::<String>())).ok()
}

/// Types of std_msgs, geometry_msgs and sensor_msgs (ROS 2 Humble, the same in Foxy and Jazzy) that tell of thrusters, power
/// and motion.
const USUAL: [(&str, &str); 25] = [
    ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"),
    ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n"),
    ("std_msgs/Bool", "bool data\n"),
    ("std_msgs/Int16", "int16 data\n"),
    ("std_msgs/UInt16", "uint16 data\n"),
    ("std_msgs/Int32", "int32 data\n"),
    ("std_msgs/Int64", "int64 data\n"),
    ("std_msgs/Float32", "float32 data\n"),
    ("std_msgs/Float64", "float64 data\n"),
    ("std_msgs/String", "string data\n"),
    ("std_msgs/MultiArrayDimension", "string label\nuint32 size\nuint32 stride\n"),
    ("std_msgs/MultiArrayLayout", "MultiArrayDimension[] dim\nuint32 data_offset\n"),
    ("std_msgs/Int32MultiArray", "MultiArrayLayout layout\nint32[] data\n"),
    ("std_msgs/Float32MultiArray", "MultiArrayLayout layout\nfloat32[] data\n"),
    ("std_msgs/Float64MultiArray", "MultiArrayLayout layout\nfloat64[] data\n"),
    ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n"),
    ("geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"),
    ("geometry_msgs/Twist", "Vector3 linear\nVector3 angular\n"),
    ("geometry_msgs/Wrench", "Vector3 force\nVector3 torque\n"),
    ("geometry_msgs/WrenchStamped", "std_msgs/Header header\nWrench wrench\n"),
    ("sensor_msgs/Temperature", "std_msgs/Header header\nfloat64 temperature\nfloat64 variance\n"),
    ("sensor_msgs/FluidPressure", "std_msgs/Header header\nfloat64 fluid_pressure\nfloat64 variance\n"),
    (
        "sensor_msgs/Imu",
        "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n\
         geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n\
         geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n",
    ),
    (
        "sensor_msgs/JointState",
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n",
    ),
    (
        "sensor_msgs/BatteryState",
        "std_msgs/Header header\nfloat32 voltage\nfloat32 temperature\nfloat32 current\nfloat32 charge\n\
         float32 capacity\nfloat32 design_capacity\nfloat32 percentage\nuint8 power_supply_status\n\
         uint8 power_supply_health\nuint8 power_supply_technology\nbool present\nfloat32[] cell_voltage\n\
         float32[] cell_temperature\nstring location\nstring serial_number\n",
    ),
];

#[cfg(test)]
mod tests {
    use super::*;

    /// A JointState of these joints and their speeds.
    fn joint_state(joints: &[(&str, f64)]) -> Vec<u8> {
        let mut out = Vec::new();
        let align = |out: &mut Vec<u8>, size: usize| out.resize(out.len().next_multiple_of(size), 0);
        let count = |out: &mut Vec<u8>, count: usize| {
            align(out, 4);
            out.extend((count as u32).to_le_bytes());
        };
        let text = |out: &mut Vec<u8>, text: &str| {
            count(out, text.len() + 1);
            out.extend(text.as_bytes());
            out.push(0);
        };
        out.extend([0; 8]);
        text(&mut out, "");
        count(&mut out, joints.len());
        for (name, _) in joints {
            text(&mut out, name);
        }
        count(&mut out, 0);
        count(&mut out, joints.len());
        align(&mut out, 8);
        for (_, speed) in joints {
            out.extend(speed.to_le_bytes());
        }
        count(&mut out, 0);
        [vec![0, 1, 0, 0], out].concat()
    }

    /// Speeds by source, and what was lost.
    fn read(messages: &[&[(&str, f64)]]) -> (HashMap<String, Vec<f64>>, Vec<String>) {
        let wanted = ["velocity[0]", "velocity[port]", "velocity[starboard]"]
            .map(|field| format!("joint_states.{field}"));
        let mut gather = Gather::new("test", "seconds", Some(&wanted));
        let mut topic =
            Topic::new(&mut gather, "/joint_states", usual("sensor_msgs/msg/JointState").unwrap());
        for (k, joints) in messages.iter().enumerate() {
            assert!(topic.message(&mut gather, k as f64, &joint_state(joints)));
        }
        let lost = topic.losses();
        let log = gather.finish();
        let fields = log.topics[0].fields.iter().filter(|field| !field.values.is_empty());
        (fields.map(|field| (field.name.clone(), field.values.clone())).collect(), lost)
    }

    #[test]
    fn joints_of_two_drivers_on_one_topic_are_not_mixed() {
        let (port, starboard): (&[_], &[_]) = (&[("port", 1.0)], &[("starboard", -9.0)]);
        let (speeds, lost) = read(&[port, starboard, port, starboard]);
        let present =
            |name: &str| speeds[name].iter().copied().filter(|speed| !speed.is_nan()).collect::<Vec<_>>();
        assert_eq!(present("velocity[0]"), [1.0, 1.0]);
        assert_eq!(present("velocity[port]"), [1.0, 1.0]);
        assert_eq!(present("velocity[starboard]"), [-9.0, -9.0]);
        assert_eq!(lost.len(), 1, "{lost:?}");
        for words in
            ["2 number(s) of `joint_states.velocity[0]`", "\"starboard\"", "`joint_states.velocity[port]`"]
        {
            assert!(lost[0].contains(words), "{words}: {lost:?}");
        }
    }

    #[test]
    fn a_joint_is_found_by_its_name_wherever_it_stands() {
        let (first, then): (&[_], &[_]) =
            (&[("port", 1.0), ("starboard", -9.0)], &[("starboard", -8.0), ("port", 2.0)]);
        let (speeds, lost) = read(&[first, then]);
        assert_eq!(speeds["velocity[port]"], [1.0, 2.0]);
        assert_eq!(speeds["velocity[starboard]"], [-9.0, -8.0]);
        assert_eq!((speeds["velocity[0]"][0], lost.len()), (1.0, 1));
        assert!(speeds["velocity[0]"][1].is_nan());
        let (_, lost) = read(&[first, first]);
        assert!(lost.is_empty(), "{lost:?}");
    }

    #[test]
    fn every_usual_type_is_whole() {
        for (name, _) in USUAL {
            assert!(usual(name).is_some(), "{name}");
            assert!(usual(&name.replace('/', "/msg/")).is_some(), "{name}");
        }
        assert!(usual("my_msgs/msg/Thruster").is_none());
    }
}
