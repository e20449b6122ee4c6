//! Control laws, observers and estimators for marine thrusters. Pure: no clock, thread, file or socket.
