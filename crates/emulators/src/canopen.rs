//! A CANopen node after CiA 301: an object dictionary behind an SDO server, network states, PDOs as they are mapped, heartbeats
//! both ways, emergency messages. What the objects mean is the device's.

use std::collections::BTreeMap;

use crate::slcan::Frame;

/// Index and sub-index.
pub type At = (u16, u8);

// Reasons why an access is refused, by CiA 301.
const NO_SUCH_OBJECT: u32 = 0x0602_0000;
const READ_ONLY: u32 = 0x0601_0002;
const WRONG_LENGTH: u32 = 0x0607_0010;
const NOT_MAPPABLE: u32 = 0x0604_0041;
const TOO_MUCH_MAPPED: u32 = 0x0604_0042;
const NOT_NOW: u32 = 0x0800_0022;

/// The emergency of a heartbeat that did not come.
const HEARTBEAT_LOST: u16 = 0x8130;

/// One object.
#[derive(Clone, Copy, Debug)]
struct Object {
    value: u32,
    bytes: u8,
    writable: bool,
    mappable: bool,
}

/// State of the network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Network {
    PreOperational,
    Operational,
    Stopped,
}

/// What happened, for the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// An object was written, by SDO or PDO.
    Written(At),
    /// The heartbeat of the node that is listened for did not come.
    HeartbeatLost,
}

/// The node.
pub struct CanOpen {
    id: u16,
    objects: BTreeMap<At, Object>,
    network: Network,
    /// Data of PDOs that wait for the SYNC.
    pending: BTreeMap<u16, Vec<u8>>,
    heard_s: Option<f64>,
    beat_s: f64,
    /// The device's, in order.
    pub events: Vec<Event>,
}

impl CanOpen {
    /// A node with the objects of communication, as it is delivered.
    pub fn new(id: u8) -> Self {
        let mut node = Self {
            id: id.into(),
            objects: BTreeMap::new(),
            network: Network::PreOperational,
            pending: BTreeMap::new(),
            heard_s: None,
            beat_s: 0.0,
            events: Vec::new(),
        };
        node.object((0x1001, 0), 1, 0, false);
        node.object((0x1016, 1), 4, 0, true);
        node.object((0x1017, 0), 2, 0, true);
        node.object((0x1029, 1), 1, 0, true);
        for n in 0..2 {
            for (at, base, flag) in [(0x1400, 0x200, 0), (0x1800, 0x180, 0x4000_0000)] {
                node.object((at + n, 1), 4, flag | u32::from(base + 0x100 * n + node.id), true);
                node.object((at + n, 2), 1, 255, true);
                (0..=8).for_each(|sub| {
                    node.object((at + 0x200 + n, sub), if sub == 0 { 1 } else { 4 }, 0, true)
                });
            }
        }
        node
    }

    /// Adds an object.
    pub fn object(&mut self, at: At, bytes: u8, value: u32, writable: bool) {
        self.objects.insert(at, Object { value, bytes, writable, mappable: at.0 >= 0x2000 });
    }

    /// Makes an object read only.
    pub fn lock(&mut self, at: At) {
        self.objects.entry(at).and_modify(|object| object.writable = false);
    }

    /// Takes an object away.
    pub fn remove(&mut self, at: At) {
        self.objects.remove(&at);
    }

    /// Value of an object, as it stands in its bytes; zero for one that is not there.
    pub fn get(&self, at: At) -> u32 {
        self.objects.get(&at).map_or(0, |object| object.value)
    }

    /// Sets an object from inside.
    pub fn set(&mut self, at: At, value: u32) {
        self.objects.entry(at).and_modify(|object| object.value = value & mask(object.bytes));
    }

    /// It was just powered: its boot-up message.
    pub fn boot(&self) -> Frame {
        Frame::new(0x700 + self.id, [0])
    }

    /// An emergency message; zero is the end of one.
    pub fn emergency(&mut self, code: u16, register: u8) -> Frame {
        self.set((0x1001, 0), register.into());
        let [low, high] = code.to_le_bytes();
        Frame::new(0x80 + self.id, [low, high, register, 0, 0, 0, 0, 0])
    }

    /// Takes a frame; what it sends.
    pub fn frame(&mut self, now_s: f64, frame: &Frame) -> Vec<Frame> {
        let data = frame.data.as_slice();
        match (frame.id, data) {
            (0x000, &[order, node]) if node == 0 || u16::from(node) == self.id => self.order(order),
            (0x080, []) if self.network == Network::Operational => self.sync(),
            (id, data) if id == 0x600 + self.id && self.network != Network::Stopped => self.sdo(data),
            (0x701..=0x77f, [_]) if u32::from(frame.id - 0x700) == self.get((0x1016, 1)) >> 16 => {
                self.heard_s = Some(now_s);
                Vec::new()
            }
            (id, data) if self.network == Network::Operational => {
                self.received(id, data);
                Vec::new()
            }
            _ => Vec::new(),
        }
    }

    /// Lives on: its own heartbeat, and the one it listens for.
    pub fn live(&mut self, now_s: f64) -> Vec<Frame> {
        let mut said = Vec::new();
        let time_s = f64::from(self.get((0x1016, 1)) & 0xffff) * 1e-3;
        if time_s > 0.0 && self.heard_s.is_some_and(|heard_s| now_s - heard_s > time_s) {
            self.heard_s = None;
            said.push(self.emergency(HEARTBEAT_LOST, 0x11));
            self.events.push(Event::HeartbeatLost);
            if self.get((0x1029, 1)) == 0 && self.network == Network::Operational {
                self.network = Network::PreOperational;
            }
        }
        let period_s = f64::from(self.get((0x1017, 0))) * 1e-3;
        if period_s > 0.0 && now_s - self.beat_s >= period_s {
            self.beat_s = now_s;
            let state = match self.network {
                Network::PreOperational => 0x7f,
                Network::Operational => 0x05,
                Network::Stopped => 0x04,
            };
            said.push(Frame::new(0x700 + self.id, [state]));
        }
        said
    }

    fn order(&mut self, order: u8) -> Vec<Frame> {
        match order {
            0x01 => self.network = Network::Operational,
            0x02 => self.network = Network::Stopped,
            0x80 => self.network = Network::PreOperational,
            _ => (),
        }
        Vec::new()
    }

    /// SDO, expedited.
    fn sdo(&mut self, data: &[u8]) -> Vec<Frame> {
        let &[command, low, high, sub, a, b, c, d] = data else { return Vec::new() };
        let index = u16::from_le_bytes([low, high]);
        let at = (index, sub);
        let refuse = |code: u32| {
            let [a, b, c, d] = code.to_le_bytes();
            [0x80, low, high, sub, a, b, c, d]
        };
        let answer = match (command & 0xe0, self.objects.get(&at).copied()) {
            (0x20 | 0x40, None) => refuse(NO_SUCH_OBJECT),
            (0x40, Some(object)) => {
                let [a, b, c, d] = object.value.to_le_bytes();
                [0x43 | (4 - object.bytes) << 2, low, high, sub, a, b, c, d]
            }
            (0x20, Some(object)) => {
                let bytes = if command & 1 != 0 { 4 - (command >> 2 & 3) } else { object.bytes };
                let value = u32::from_le_bytes([a, b, c, d]) & mask(object.bytes);
                match self.may_write(at, object, bytes, value) {
                    Ok(()) => {
                        self.set(at, value);
                        self.events.push(Event::Written(at));
                        [0x60, low, high, sub, 0, 0, 0, 0]
                    }
                    Err(code) => refuse(code),
                }
            }
            _ => refuse(0x0504_0001),
        };
        vec![Frame::new(0x580 + self.id, answer)]
    }

    fn may_write(&self, at: At, object: Object, bytes: u8, value: u32) -> Result<(), u32> {
        if !object.writable {
            return Err(READ_ONLY);
        }
        if bytes != object.bytes {
            return Err(WRONG_LENGTH);
        }
        let (0x1600..=0x17ff | 0x1a00..=0x1bff) = at.0 else { return Ok(()) };
        // A mapping is changed while its PDO is off and nothing is mapped.
        let on = self.get((at.0 - 0x200, 1)) >> 31 == 0;
        if on || (at.1 != 0 && self.get((at.0, 0)) != 0) {
            return Err(NOT_NOW);
        }
        let mapped = |entry: u32| self.objects.get(&((entry >> 16) as u16, (entry >> 8) as u8));
        if at.1 != 0 {
            let fits = mapped(value).is_some_and(|o| o.mappable && u32::from(o.bytes) * 8 == value & 0xff);
            return if fits { Ok(()) } else { Err(NOT_MAPPABLE) };
        }
        let bits: u32 = (1..=value as u8).map(|sub| self.get((at.0, sub)) & 0xff).sum();
        if bits <= 64 { Ok(()) } else { Err(TOO_MUCH_MAPPED) }
    }

    /// Objects of a mapping.
    fn mapping(&self, at: u16) -> Vec<At> {
        (1..=self.get((at, 0)) as u8)
            .map(|sub| self.get((at, sub)))
            .map(|entry| ((entry >> 16) as u16, (entry >> 8) as u8))
            .collect()
    }

    /// A PDO for this node: at once, or at the next SYNC, as its transmission type says.
    fn received(&mut self, id: u16, data: &[u8]) {
        for at in [0x1400, 0x1401] {
            let identifier = self.get((at, 1));
            if identifier >> 31 == 0 && identifier & 0x7ff == u32::from(id) {
                if self.get((at, 2)) <= 240 {
                    self.pending.insert(at, data.to_vec());
                } else {
                    self.unpack(at, data);
                }
            }
        }
    }

    /// One that is shorter than its mapping is not taken.
    fn unpack(&mut self, at: u16, data: &[u8]) {
        let objects = self.mapping(at + 0x200);
        let bytes = |at: &At| self.objects.get(at).map_or(0, |object| usize::from(object.bytes));
        let widths: Vec<usize> = objects.iter().map(bytes).collect();
        if data.len() < widths.iter().sum() {
            return;
        }
        let mut rest = data;
        for (at, width) in objects.into_iter().zip(widths) {
            let (value, after) = rest.split_at(width);
            rest = after;
            self.set(at, value.iter().rev().fold(0, |sum, byte| sum << 8 | u32::from(*byte)));
            self.events.push(Event::Written(at));
        }
    }

    /// Targets that wait are taken, and what is to be sent on every SYNC is.
    fn sync(&mut self) -> Vec<Frame> {
        for (at, data) in std::mem::take(&mut self.pending) {
            self.unpack(at, &data);
        }
        let mut said = Vec::new();
        for at in [0x1800, 0x1801] {
            let identifier = self.get((at, 1));
            if identifier >> 31 != 0 || !(1..=240).contains(&self.get((at, 2))) {
                continue;
            }
            let mut data = Vec::new();
            for at in self.mapping(at + 0x200) {
                if let Some(object) = self.objects.get(&at) {
                    data.extend(object.value.to_le_bytes().into_iter().take(object.bytes.into()));
                }
            }
            said.push(Frame::new((identifier & 0x7ff) as u16, data));
        }
        said
    }
}

fn mask(bytes: u8) -> u32 {
    u32::MAX >> (32 - 8 * u32::from(bytes.clamp(1, 4)))
}
