//! The servo: the amplifier loop, real or simulated.
