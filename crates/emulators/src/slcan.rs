//! A CAN adapter on a serial port, after Lawicel's description, with one node on its bus.
//!
//! As there: commands end with a carriage return; the answer to one that is taken is a carriage return, to a frame `z` before it, to
//! anything else a bell. The bit rate is set while the channel is closed, frames are sent while it is open. On a bus of another bit rate
//! than the node's nothing is heard.

use crate::bench::{Device, Truth};

/// A frame on the bus: identifier and data.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Identifier, eleven bits.
    pub id: u16,
    /// Up to eight bytes.
    pub data: Vec<u8>,
}

impl Frame {
    /// A frame.
    pub fn new(id: u16, data: impl Into<Vec<u8>>) -> Self {
        Self { id, data: data.into() }
    }
}

/// A node on the bus; see [`Device`].
pub trait Node: Send {
    /// Digit of its bit rate, as the adapter's command `S` has it.
    fn bitrate(&self) -> u8;

    /// Takes a frame; what it sends in answer.
    fn frame(&mut self, now_s: f64, frame: &Frame) -> Vec<Frame>;

    /// Lives on to this instant. What it sends unasked.
    fn live(&mut self, now_s: f64) -> Vec<Frame>;

    /// Its supply was cut and came back.
    fn restart(&mut self, now_s: f64);

    /// It reports this fault of its own from now on; zero: none.
    fn report(&mut self, code: u32);

    /// What is true at its motor.
    fn truth(&self) -> Truth;
}

/// The adapter, and the node behind it.
pub struct Adapter<N> {
    node: N,
    held: Vec<u8>,
    bitrate: Option<u8>,
    open: bool,
}

impl<N: Node> Adapter<N> {
    /// One that was just plugged in.
    pub fn new(node: N) -> Self {
        Self { node, held: Vec::new(), bitrate: None, open: false }
    }

    /// The bus is one for both.
    fn together(&self) -> bool {
        self.open && self.bitrate == Some(self.node.bitrate())
    }

    fn command(&mut self, now_s: f64, command: &str) -> Vec<Vec<u8>> {
        const TAKEN: &[u8] = b"\r";
        const REFUSED: &[u8] = b"\x07";
        let (name, rest) = command.split_at_checked(1).unwrap_or_default();
        let taken = match name {
            "" => return Vec::new(),
            "S" if !self.open => {
                let rate = rest.parse::<u8>().ok().filter(|rate| *rate <= 8);
                self.bitrate = rate.or(self.bitrate);
                rate.is_some()
            }
            "O" if !self.open && self.bitrate.is_some() => {
                self.open = true;
                true
            }
            "C" if self.open => {
                self.open = false;
                true
            }
            "V" => return vec![b"V1013\r".to_vec()],
            "t" if self.open => match parse(rest) {
                Some(frame) => {
                    let mut said = vec![b"z\r".to_vec()];
                    if self.together() {
                        said.extend(self.node.frame(now_s, &frame).iter().map(line));
                    }
                    return said;
                }
                None => false,
            },
            _ => false,
        };
        vec![if taken { TAKEN.to_vec() } else { REFUSED.to_vec() }]
    }
}

impl<N: Node> Device for Adapter<N> {
    fn hear(&mut self, now_s: f64, bytes: &[u8]) -> Vec<Vec<u8>> {
        self.held.extend(bytes);
        let mut answers = Vec::new();
        while let Some(end) = self.held.iter().position(|byte| *byte == b'\r') {
            let command: Vec<u8> = self.held.drain(..=end).collect();
            answers.extend(self.command(now_s, String::from_utf8_lossy(&command).trim_end()));
        }
        answers
    }

    fn live(&mut self, now_s: f64) -> Vec<Vec<u8>> {
        let said = self.node.live(now_s);
        if self.together() { said.iter().map(line).collect() } else { Vec::new() }
    }

    fn restart(&mut self, now_s: f64) {
        self.node.restart(now_s);
    }

    fn report(&mut self, code: u32) {
        self.node.report(code);
    }

    fn truth(&self) -> Truth {
        self.node.truth()
    }
}

fn line(frame: &Frame) -> Vec<u8> {
    let data: String = frame.data.iter().map(|byte| format!("{byte:02X}")).collect();
    format!("t{:03X}{}{data}\r", frame.id, frame.data.len()).into_bytes()
}

/// `iiildd…`
fn parse(text: &str) -> Option<Frame> {
    let id = u16::from_str_radix(text.get(..3)?, 16).ok().filter(|id| *id <= 0x7ff)?;
    let length: usize = text.get(3..4)?.parse().ok().filter(|length| *length <= 8)?;
    if text.len() != 4 + 2 * length {
        return None;
    }
    let data: Option<Vec<u8>> =
        (0..length).map(|n| u8::from_str_radix(text.get(4 + 2 * n..6 + 2 * n)?, 16).ok()).collect();
    Some(Frame { id, data: data? })
}
