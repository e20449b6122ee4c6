//! Thruster physics: models, motor, sensors, and the effects a model may leave out.
//!
//! Pure: no clock, thread, file or socket. The same functions serve the live servo's simulated
//! stand, soak tests on virtual time, identification and diagnosis.
//!
//! Sign convention: positive shaft speed, positive axial flow and positive thrust agree in
//! bollard ahead; blade torque is positive when it opposes positive shaft speed.

pub mod blade;
pub mod dual;
pub mod effects;
pub mod integrate;
pub mod models;
pub mod momentum;
pub mod motor;
pub mod parameters;
pub mod plant;
pub mod real;
pub mod rig;

pub use kort_complaints as place;
