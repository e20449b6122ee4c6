//! What the processes say to each other: fixed-layout messages, signals, service names.
