//! Thruster physics: models, motor, sensors, and the effects a model may leave out. Pure: no clock, thread, file or socket.
