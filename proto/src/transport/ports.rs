//! Ports of each process. Sending stamps the header; receiving never blocks.

use std::time::Duration;

use iceoryx2::port::{listener::Listener, notifier::Notifier, publisher::Publisher, subscriber::Subscriber};
use iceoryx2::prelude::*;
use iceoryx2::service::builder::publish_subscribe::PublishSubscribeOpenError;
use iceoryx2::service::port_factory::{event, publish_subscribe};

use super::clock::monotonic_ns;
use super::deployment::Deployment;
use super::error::TransportError;
use super::files::allow_files;
use super::room;
use crate::messages::{Command, ControllerState, Message, Reply, Request, Setpoint, Telemetry};
use crate::names::Stream;

/// Ports of one kind that may be open at once: the living, the killed that are not cleared up
/// yet, and guests such as a benchmark.
const MAX_PORTS: usize = 8;
const MAX_NODES: usize = 24;
/// Readers of the two streams whose samples are large or many: gateway, supervisor, controller, as many again that were killed. A
/// sender has room for all that all of them may hold, so each costs megabytes.
const MAX_READERS: usize = 6;

type PubSub<T> = publish_subscribe::PortFactory<ipc::Service, T, ()>;

/// The services of one thruster, held open by their creator.
pub struct Services {
    _setpoint: PubSub<Setpoint>,
    _command: PubSub<Command>,
    _telemetry: PubSub<Telemetry>,
    _state: PubSub<ControllerState>,
    _request: PubSub<Request>,
    _reply: PubSub<Reply>,
    _tick: event::PortFactory<ipc::Service>,
}

/// Receivers that a stream may have at once.
const fn readers(stream: Stream) -> usize {
    match stream {
        Stream::Telemetry | Stream::ControllerState => MAX_READERS,
        _ => MAX_PORTS,
    }
}

fn service_name(stream: Stream, thruster: &str, generation: u64) -> Result<ServiceName, TransportError> {
    let name = stream.service(thruster, generation);
    ServiceName::new(&name).map_err(|e| TransportError::iceoryx(name, e))
}

/// Creates every service of a thruster; the owner's part.
///
/// # Errors
/// [`TransportError::Iceoryx`] with the service's name.
pub fn create_services(
    node: &Node<ipc::Service>,
    thruster: &str,
    generation: u64,
) -> Result<Services, TransportError> {
    fn create<T: Message + ZeroCopySend>(
        node: &Node<ipc::Service>,
        stream: Stream,
        thruster: &str,
        generation: u64,
    ) -> Result<PubSub<T>, TransportError> {
        let name = service_name(stream, thruster, generation)?;
        node.service_builder(&name)
            .publish_subscribe::<T>()
            .max_publishers(MAX_PORTS)
            .max_subscribers(readers(stream))
            .max_nodes(MAX_NODES)
            .enable_safe_overflow(true)
            .history_size(0)
            .subscriber_max_buffer_size(stream.depth())
            .subscriber_max_borrowed_samples(1)
            .create()
            .map_err(|e| TransportError::iceoryx(format!("creating {name}"), e))
    }
    let tick = service_name(Stream::Tick, thruster, generation)?;
    Ok(Services {
        _setpoint: create(node, Stream::Setpoint, thruster, generation)?,
        _command: create(node, Stream::Command, thruster, generation)?,
        _telemetry: create(node, Stream::Telemetry, thruster, generation)?,
        _state: create(node, Stream::ControllerState, thruster, generation)?,
        _request: create(node, Stream::Request, thruster, generation)?,
        _reply: create(node, Stream::Reply, thruster, generation)?,
        _tick: node
            .service_builder(&tick)
            .event()
            .max_notifiers(MAX_PORTS)
            .max_listeners(MAX_PORTS)
            .max_nodes(MAX_NODES)
            .disable_deadline()
            .disable_notifier_created_event()
            .disable_notifier_dropped_event()
            .disable_notifier_dead_event()
            .create()
            .map_err(|e| TransportError::iceoryx(format!("creating {tick}"), e))?,
    })
}

/// Opens ports of one thruster in one generation. What a port takes of shared memory is looked for before it is
/// opened and reserved when it is, see [`room`].
struct Opener<'a> {
    deployment: &'a Deployment,
    node: &'a Node<ipc::Service>,
    thruster: &'a str,
    generation: u64,
    session: u64,
}

impl Opener<'_> {
    fn open<T: Message + ZeroCopySend>(&self, stream: Stream) -> Result<PubSub<T>, TransportError> {
        let name = service_name(stream, self.thruster, self.generation)?;
        self.node.service_builder(&name).publish_subscribe::<T>().open().map_err(|e| match e {
            // Type, size or alignment: a peer of the same version by name, of another by what it sends.
            PublishSubscribeOpenError::IncompatibleTypes => {
                TransportError::Layout { service: name.to_string() }
            }
            e => TransportError::iceoryx(format!("opening {name}"), e),
        })
    }

    fn outbox<T: Message + ZeroCopySend>(&self, stream: Stream) -> Result<Outbox<T>, TransportError> {
        // A sample for each place in each receiver's queue, and those in hand.
        room::room_for((size_of::<T>() * readers(stream) * (stream.depth() + 4)) as u64)?;
        let publisher = self
            .open::<T>(stream)?
            .publisher_builder()
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|e| TransportError::iceoryx(format!("sending {}", stream.name()), e))?;
        self.deployment.reserve(self.generation)?;
        Ok(Outbox { publisher, session: self.session, sequence: 0 })
    }

    fn inbox<T: Message + ZeroCopySend>(
        &self,
        stream: Stream,
        depth: usize,
    ) -> Result<Inbox<T>, TransportError> {
        // Two words for each place, one there and one back, with each sender.
        room::room_for((2 * size_of::<u64>() * MAX_PORTS * (depth + stream.depth() + 64)) as u64)?;
        let subscriber = self
            .open::<T>(stream)?
            .subscriber_builder()
            .buffer_size(depth)
            .create()
            .map_err(|e| TransportError::iceoryx(format!("receiving {}", stream.name()), e))?;
        self.deployment.reserve(self.generation)?;
        Ok(Inbox { subscriber })
    }

    fn tick(&self) -> Result<event::PortFactory<ipc::Service>, TransportError> {
        let name = service_name(Stream::Tick, self.thruster, self.generation)?;
        self.node
            .service_builder(&name)
            .event()
            .open()
            .map_err(|e| TransportError::iceoryx(format!("opening {name}"), e))
    }
}

/// Sends messages of one stream and stamps their headers.
pub struct Outbox<T: Message + ZeroCopySend> {
    publisher: Publisher<ipc::Service, T, ()>,
    session: u64,
    sequence: u64,
}

impl<T: Message + ZeroCopySend> Outbox<T> {
    /// Stamps and sends; a full receiver loses its oldest sample, a dead one loses this one.
    ///
    /// # Errors
    /// [`TransportError::Iceoryx`] if the sample cannot be sent at all.
    pub fn send(&mut self, mut message: T) -> Result<(), TransportError> {
        self.send_mut(&mut message)
    }

    /// As [`Self::send`]; the caller keeps the message with its stamped header.
    ///
    /// # Errors
    /// As [`Self::send`].
    pub fn send_mut(&mut self, message: &mut T) -> Result<(), TransportError> {
        self.sequence += 1;
        let header = message.header_mut();
        header.sequence = self.sequence;
        header.session = self.session;
        header.stamp_ns = monotonic_ns();
        match self.publisher.send_copy(*message) {
            Ok(_) => Ok(()),
            // In words of its own: a servo that cannot send has no time to count its open files.
            Err(e) => Err(TransportError::Iceoryx { what: "sending".into(), error: format!("{e:?}") }),
        }
    }

    /// Session that goes into the headers: this process's start on CLOCK_MONOTONIC, ns.
    pub fn session(&self) -> u64 {
        self.session
    }
}

/// Receives messages of one stream.
pub struct Inbox<T: Message + ZeroCopySend> {
    subscriber: Subscriber<ipc::Service, T, ()>,
}

impl<T: Message + ZeroCopySend> Inbox<T> {
    /// Next unread message, oldest first for each sender.
    pub fn next(&self) -> Option<T> {
        // An error here means a connection to a dead peer: nothing to read, and nothing to do.
        self.subscriber.receive().ok().flatten().map(|sample| *sample.payload())
    }

    /// Reads everything unread (at most `8 * depth` messages) and returns the one sent last.
    pub fn latest(&self) -> Option<T> {
        let mut newest: Option<T> = None;
        for _ in 0..MAX_PORTS * self.subscriber.buffer_size() {
            let Some(message) = self.next() else { break };
            if newest.as_ref().is_none_or(|n| n.header().stamp_ns <= message.header().stamp_ns) {
                newest = Some(message);
            }
        }
        newest
    }
}

/// Wakes those who wait for a tick of the servo.
pub struct Waker(Notifier<ipc::Service>);

impl Waker {
    /// Never blocks; a dead listener is nobody's error.
    pub fn wake(&self) {
        let _ = self.0.notify();
    }
}

/// Waits for a tick of the servo.
pub struct Ticks(Listener<ipc::Service>);

impl Ticks {
    /// Waits until the servo ticked, at most `timeout`; true if it did.
    pub fn wait(&self, timeout: Duration) -> bool {
        self.0.timed_wait(|_| {}, timeout).is_ok_and(|n| n > 0)
    }
}

macro_rules! ports {
    ($(#[$doc:meta])* $name:ident, $node:literal; $($(#[$field_doc:meta])* $field:ident: $type:ty = |$o:ident| $make:expr;)*) => {
        $(#[$doc])*
        pub struct $name {
            $($(#[$field_doc])* pub $field: $type,)*
            /// Generation these ports belong to; open anew when the deployment's has moved on.
            pub generation: u64,
            _node: Node<ipc::Service>,
        }

        impl $name {
            /// Opens the ports of a thruster in the deployment's present generation.
            ///
            /// # Errors
            /// [`TransportError::NoGeneration`] if nobody owns the deployment, [`TransportError::Version`] and
            /// [`TransportError::Layout`] if it speaks otherwise,
            /// [`TransportError::Room`] if `/dev/shm` is full, [`TransportError::Iceoryx`] if a service is not there or full.
            pub fn open(deployment: &Deployment, thruster: &str) -> Result<Self, TransportError> {
                allow_files(1)?;
                let generation = deployment.generation_of_our_version()?;
                let node = deployment.node($node, generation)?;
                let opener = Opener { deployment, node: &node, thruster, generation, session: monotonic_ns() };
                $(let $field = { let $o = &opener; $make };)*
                Ok(Self { $($field,)* generation, _node: node })
            }
        }
    };
}

ports! {
    /// The servo's ports.
    ServoPorts, "servo";
    /// From the controller.
    command: Inbox<Command> = |o| o.inbox(Stream::Command, 1)?;
    /// From gateway and supervisor.
    request: Inbox<Request> = |o| o.inbox(Stream::Request, Stream::Request.depth())?;
    /// To all.
    telemetry: Outbox<Telemetry> = |o| o.outbox(Stream::Telemetry)?;
    /// To the asker.
    reply: Outbox<Reply> = |o| o.outbox(Stream::Reply)?;
    /// Wakes the controller.
    waker: Waker = |o| Waker(
        o.tick()?.notifier_builder().create().map_err(|e| TransportError::iceoryx("notifying tick", e))?
    );
}

ports! {
    /// The controller's ports.
    ControllerPorts, "controller";
    /// From the gateway.
    setpoint: Inbox<Setpoint> = |o| o.inbox(Stream::Setpoint, 1)?;
    /// From the servo; some samples deep, so that slow sensors' values between two ticks count.
    telemetry: Inbox<Telemetry> = |o| o.inbox(Stream::Telemetry, 64)?;
    /// From gateway and supervisor.
    request: Inbox<Request> = |o| o.inbox(Stream::Request, Stream::Request.depth())?;
    /// To the servo.
    command: Outbox<Command> = |o| o.outbox(Stream::Command)?;
    /// To the gateway.
    state: Outbox<ControllerState> = |o| o.outbox(Stream::ControllerState)?;
    /// To the asker.
    reply: Outbox<Reply> = |o| o.outbox(Stream::Reply)?;
    /// The servo's ticks.
    ticks: Ticks = |o| Ticks(
        o.tick()?.listener_builder().create().map_err(|e| TransportError::iceoryx("waiting for tick", e))?
    );
}

ports! {
    /// The gateway's ports; the supervisor uses them too.
    GatewayPorts, "gateway";
    /// To the controller.
    setpoint: Outbox<Setpoint> = |o| o.outbox(Stream::Setpoint)?;
    /// To servo and controller.
    request: Outbox<Request> = |o| o.outbox(Stream::Request)?;
    /// From the servo, every sample for recordings.
    telemetry: Inbox<Telemetry> = |o| o.inbox(Stream::Telemetry, Stream::Telemetry.depth())?;
    /// From the controller.
    state: Inbox<ControllerState> = |o| o.inbox(Stream::ControllerState, Stream::ControllerState.depth())?;
    /// From servo and controller.
    reply: Inbox<Reply> = |o| o.inbox(Stream::Reply, Stream::Reply.depth())?;
}

impl GatewayPorts {
    /// Opens the ports of requests and answers anew, under the same session and with the sequence going on. A port that opens
    /// makes every peer look for its counterparts again: a connection that failed to come about when they all
    /// started is not tried again otherwise (iceoryx2, issue 129), and requests then go unanswered for good.
    ///
    /// # Errors
    /// As [`Self::open`]; the ports are as before then.
    pub fn reconnect_requests(
        &mut self,
        deployment: &Deployment,
        thruster: &str,
    ) -> Result<(), TransportError> {
        let (generation, session) = (self.generation, self.request.session);
        let opener = Opener { deployment, node: &self._node, thruster, generation, session };
        let request = opener.outbox(Stream::Request)?;
        let reply = opener.inbox(Stream::Reply, Stream::Reply.depth())?;
        self.request = Outbox { sequence: self.request.sequence, ..request };
        self.reply = reply;
        Ok(())
    }
}

ports! {
    /// The supervisor's ports: it listens to everybody's beat, and may ask for rest and disarming.
    SupervisorPorts, "supervisor";
    /// To servo and controller.
    request: Outbox<Request> = |o| o.outbox(Stream::Request)?;
    /// From the servo.
    telemetry: Inbox<Telemetry> = |o| o.inbox(Stream::Telemetry, 64)?;
    /// From the controller.
    state: Inbox<ControllerState> = |o| o.inbox(Stream::ControllerState, 1)?;
    /// From the gateway: one a heartbeat.
    setpoint: Inbox<Setpoint> = |o| o.inbox(Stream::Setpoint, 1)?;
}
