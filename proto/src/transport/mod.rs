//! Shared memory between the processes of one deployment: who creates it, who opens it, and ports
//! that stamp what they send and let only new samples through.

mod clock;
mod deployment;
mod error;
mod files;
mod ours;
mod part;
mod ports;
mod rig;
mod room;
mod stillborn;
mod watched;

pub use clock::{Ticker, idle, keep_on, monotonic_ns, ordinary, realtime};
pub use deployment::{Deployment, Owner};
pub use error::TransportError;
pub use part::Part;
pub use ports::{
    ControllerPorts, GatewayPorts, Inbox, Outbox, ServoPorts, SupervisorPorts, Ticks, Waker, create_services,
};
pub use watched::{Latched, Restarts, Stood, Watched};
