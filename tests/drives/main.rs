//! The service on emulated drives: armed, commanded, recorded; then with every fault of the link and of the drive.
//! Each ends at zero torque at the motor within its bound, with a fault latched, and nothing is resumed.

mod calibrate;
mod cia402;
#[path = "../common/mod.rs"]
mod common;
mod iio;
mod lies;
mod link;
mod mavlink;
mod moteus;
mod odrive;
mod sensors;
mod two;
mod vesc;
