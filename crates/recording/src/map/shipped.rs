//! The maps of `config/columns/`, built in so that the program needs no folder beside it.

macro_rules! shipped {
    ($($name:literal),* $(,)?) => {
        /// Name and text of each.
        pub const ALL: &[(&str, &str)] =
            &[$(($name, include_str!(concat!("../../../../config/columns/", $name, ".toml")))),*];
    };
}

shipped![
    "motor-step-acoustic-air",
    "quarter_drone",
    "rcbench-air-static",
    "rosa-rotor-air",
    "t200-static",
    "vortex-auv-pool",
];
