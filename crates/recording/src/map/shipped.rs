//! The maps of `config/columns/`, built in so that the program needs no folder beside it.

macro_rules! shipped {
    ($($name:literal),* $(,)?) => {
        /// Name and text of each.
        pub const ALL: &[(&str, &str)] =
            &[$(($name, include_str!(concat!("../../../../config/columns/", $name, ".toml")))),*];
    };
}

shipped![
    "ardupilot",
    "ardupilot-old",
    "ardupilot-vehicle",
    "betaflight",
    "betaflight-vehicle",
    "canopen-402",
    "moteus",
    "moteus-tview",
    "motor-step-acoustic-air",
    "px4",
    "px4-outputs",
    "px4-uavcan",
    "px4-vehicle",
    "quarter_drone",
    "rcbench-air-static",
    "ros2",
    "rosa-rotor-air",
    "t200-static",
    "vesc",
    "vesc-can",
    "vortex-auv-pool",
];
