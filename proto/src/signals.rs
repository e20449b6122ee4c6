//! The one table of signals. A row here is a field of the message, a column of the recording, a
//! name in the JSON state and a metric. SI, unit last; NaN means "not measured".

#[cfg(feature = "transport")]
use iceoryx2::prelude::ZeroCopySend;

/// Whether a signal is asked for or measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// What was commanded.
    Command,
    /// What a sensor showed.
    Measured,
    /// What the controller's observer or estimator believes.
    Estimated,
}

/// One row of a signal table over a message part `T`.
#[derive(Clone, Copy, Debug)]
pub struct Signal<T: 'static> {
    /// Column of the recording and key in the JSON state.
    pub name: &'static str,
    /// SI unit.
    pub unit: &'static str,
    /// Meaning and sign convention.
    pub meaning: &'static str,
    /// Metric without the prefix `kort_`, base unit spelled out.
    pub metric: &'static str,
    /// Commanded, measured or estimated.
    pub kind: Kind,
    /// Reads it; NaN if not measured.
    pub get: fn(&T) -> f64,
    /// Writes it.
    pub set: fn(&mut T, f64),
}

macro_rules! table {
    ($(#[$doc:meta])* $part:ident, $table:ident, $type_name:literal;
     $($name:ident, $unit:literal, $kind:ident, $metric:literal, $meaning:literal;)*) => {
        $(#[$doc])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, PartialEq)]
        #[cfg_attr(feature = "transport", derive(ZeroCopySend))]
        #[cfg_attr(feature = "transport", type_name($type_name))]
        pub struct $part {
            $(#[doc = concat!($meaning, " Unit: ", $unit, ".")] pub $name: f64,)*
        }

        impl $part {
            /// Nothing measured.
            pub const UNKNOWN: Self = Self { $($name: f64::NAN,)* };

            /// How many there are.
            pub const COUNT: usize = [$(stringify!($name)),*].len();

            /// All values, in the order of the table.
            #[inline]
            pub fn values(&self) -> [f64; Self::COUNT] {
                [$(self.$name),*]
            }

            /// From all values, in the order of the table.
            #[inline]
            pub fn from_values(values: [f64; Self::COUNT]) -> Self {
                let [$($name),*] = values;
                Self { $($name),* }
            }
        }

        impl Default for $part {
            fn default() -> Self {
                Self::UNKNOWN
            }
        }

        /// The rows of the table, in the order of the recording's columns.
        pub static $table: &[Signal<$part>] = &[
            $(Signal {
                name: stringify!($name),
                unit: $unit,
                meaning: $meaning,
                metric: $metric,
                kind: Kind::$kind,
                get: |part| part.$name,
                set: |part, value| part.$name = value,
            },)*
        ];
    };
}

table! {
    /// Every column of a recording but its time.
    Signals, SIGNALS, "kort.Signals";
    current_cmd_a, "A", Command, "current_command_amperes", "Motor current commanded; positive drives ahead.";
    current_a, "A", Measured, "current_amperes", "Motor current; positive drives ahead.";
    voltage_cmd_v, "V", Command, "voltage_command_volts", "Motor voltage commanded; positive drives ahead.";
    duty_cmd, "1", Command, "duty_command_ratio", "Duty commanded, share of the supply, -1 to 1; positive drives ahead.";
    speed_cmd_rad_s, "rad/s", Command, "speed_command_radians_per_second", "Shaft speed commanded; positive turns ahead.";
    thrust_cmd_n, "N", Command, "thrust_command_newtons", "Thrust commanded; positive pushes ahead.";
    shaft_angle_rad, "rad", Measured, "shaft_angle_radians", "Shaft angle, unwrapped; grows when turning ahead.";
    shaft_speed_rad_s, "rad/s", Measured, "shaft_speed_radians_per_second", "Shaft speed; positive turns ahead.";
    thrust_n, "N", Measured, "thrust_newtons", "Thrust; positive pushes ahead.";
    torque_n_m, "N m", Measured, "torque_newton_meters", "Blade torque; positive opposes positive shaft speed.";
    flow_m_s, "m/s", Measured, "flow_meters_per_second", "Axial flow through the propeller; positive in bollard ahead.";
    ambient_m_s, "m/s", Measured, "ambient_meters_per_second", "Ambient axial flow; positive feeds the propeller ahead.";
    supply_v, "V", Measured, "supply_volts", "Supply at the amplifier.";
    temperature_c, "degC", Measured, "temperature_celsius", "Motor temperature.";
    depth_m, "m", Measured, "depth_meters", "Depth of the propeller's axis below the surface.";
}

table! {
    /// What the controller believes.
    Estimates, ESTIMATES, "kort.Estimates";
    thrust_n, "N", Estimated, "estimated_thrust_newtons", "Estimated thrust; positive pushes ahead.";
    flow_m_s, "m/s", Estimated, "estimated_flow_meters_per_second", "Estimated axial flow through the propeller; positive in bollard ahead.";
    ambient_m_s, "m/s", Estimated, "estimated_ambient_meters_per_second", "Estimated ambient axial flow; positive feeds the propeller ahead.";
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_reads_its_own_field() {
        for row in SIGNALS {
            let mut signals = Signals::UNKNOWN;
            (row.set)(&mut signals, 1.5);
            let read: Vec<_> =
                SIGNALS.iter().filter(|r| !(r.get)(&signals).is_nan()).map(|r| r.name).collect();
            assert_eq!(read, [row.name]);
            let place = SIGNALS.iter().position(|r| r.name == row.name).unwrap();
            assert_eq!(signals.values()[place], 1.5);
            assert_eq!((row.get)(&Signals::from_values(signals.values())), 1.5);
        }
    }

    #[test]
    fn names_and_metrics_are_unique_and_carry_their_unit() {
        let all: Vec<_> = SIGNALS
            .iter()
            .map(|s| (s.name, s.metric))
            .chain(ESTIMATES.iter().map(|s| (s.name, s.metric)))
            .collect();
        for (i, (_, metric)) in all.iter().enumerate() {
            assert!(all[i + 1..].iter().all(|(_, other)| other != metric), "{metric} twice");
            assert!(metric.bytes().all(|b| b.is_ascii_lowercase() || b == b'_'), "{metric}");
        }
    }
}
