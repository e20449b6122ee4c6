//! Messages of ROS 2 on their way into a log, whatever file they came in; and the usual types, for files that do not
//! describe theirs.

use std::collections::HashMap;

use super::cdr::{Found, Layout};
use crate::log::Gather;

/// A topic whose messages are CDR.
pub(super) struct Topic {
    place: usize,
    layout: Layout,
    fields: HashMap<String, usize>,
}

impl Topic {
    /// A topic under the name that column maps use: without its first slash.
    pub fn new(gather: &mut Gather<'_>, name: &str, layout: Layout) -> Self {
        Self { place: gather.topic(name.trim_start_matches('/')), layout, fields: HashMap::new() }
    }

    /// Takes a message; false if it does not fit its type.
    pub fn message(&mut self, gather: &mut Gather<'_>, stamp_s: f64, data: &[u8]) -> bool {
        gather.message(self.place, stamp_s);
        let (topic, fields) = (self.place, &mut self.fields);
        let read = self.layout.read(data, &mut |name: &str, found| {
            let field = match fields.get(name) {
                Some(field) => *field,
                None => *fields.entry(name.into()).or_insert(gather.field(topic, name, None)),
            };
            match found {
                Found::Number(value) => gather.set(topic, field, value),
                Found::Text => gather.text(topic, field),
            }
        });
        read.is_ok()
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

    #[test]
    fn every_usual_type_is_whole() {
        for (name, _) in USUAL {
            assert!(usual(name).is_some(), "{name}");
            assert!(usual(&name.replace('/', "/msg/")).is_some(), "{name}");
        }
        assert!(usual("my_msgs/msg/Thruster").is_none());
    }
}
