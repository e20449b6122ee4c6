//! The controller: observer, estimator and control law between setpoint and servo.
