//! Machines, a file each: what is true of one specimen of a class.

mod belt_drive;
mod blower;
mod free_motor;
mod gear_motor;
mod hoist;
mod large;
mod servo_axis;
mod small;
mod stand;
mod survey;
mod swing_arm;
mod tiny;

use crate::blades::Blades;
use crate::dice::Dice;
use crate::machine::{Machine, Sensors};

/// Draws a specimen.
pub type Specimen = fn(&mut Dice) -> Machine;

/// Thrusters, by what is drawn how often.
pub const THRUSTERS: [Specimen; 6] =
    [stand::specimen, stand::specimen, survey::specimen, small::specimen, large::specimen, tiny::specimen];

/// Dry shafts.
pub const DRY: [Specimen; 4] =
    [servo_axis::specimen, gear_motor::specimen, belt_drive::specimen, free_motor::specimen];

/// Dry shafts with a load that the rig states.
pub const LOADED: [Specimen; 4] =
    [swing_arm::specimen, swing_arm::specimen, blower::specimen, hoist::specimen];

/// Sensors of a thruster stand: 500 Hz control, 100 Hz log, 20 Hz flow meter.
fn stand_sensors(thrust_full_scale_n: f64) -> Sensors {
    Sensors {
        tick_s: 0.002,
        ticks_per_row: 5,
        encoder_counts: 4096.0,
        speed_filter_s: 0.010,
        tachometer_noise: 0.0,
        thrust_filter_hz: 163.0,
        thrust_full_scale_n,
        thrust_bits: 12,
        torque_filter_hz: 99.5,
        flow_rate_hz: 20.0,
    }
}

/// Sensors of a dry bench: control and log periods, encoder counts, speed filter.
fn bench_sensors(tick_s: f64, ticks_per_row: usize, encoder_counts: f64, speed_filter_s: f64) -> Sensors {
    Sensors { tick_s, ticks_per_row, encoder_counts, speed_filter_s, ..stand_sensors(1.0) }
}

/// Ducted blades of a size; lift and drag drawn within ranges, pitch 21 to 25 degrees.
fn ducted(radius_m: f64, duct_length_m: f64, lift: (f64, f64), drag: (f64, f64), dice: &mut Dice) -> Blades {
    let pitch_rad = dice.between(0.37, 0.43);
    let mut blades = Blades {
        radius_m,
        duct_length_m,
        pitch_rad,
        lift_max: dice.between(lift.0, lift.1),
        drag_max: dice.between(drag.0, drag.1),
        density_kg_m3: dice.pick(&[998.0, 998.0, 1000.0, 1025.0]),
        flux_coefficient: dice.between(1.8, 2.05),
        added_mass_coefficient: dice.between(1.5, 2.4),
        sections: Vec::new(),
        section_gain: (1.0, 1.0),
    };
    blades.lump();
    blades
}
