//! A drive that speaks CANopen with the drive profile CiA 402: on a CAN interface of the system (SocketCAN), or behind an adapter on
//! a serial port that speaks slcan.
//!
//! Read for this: what is public of CiA 301 (SDO, PDO, NMT, SYNC, EMCY, heartbeat) and CiA 402 (state machine, modes, option
//! codes) in the object dictionaries of Elmo (DS 301 implementation guide), Kollmorgen S300, Synapticon, Nanotec and Trinamic,
//! and Lawicel's description of slcan. No drive of any of them was connected.
//!
//! Units on the wire: torque in thousandths of the rated torque, current in mA (0x6075), supply in mV (0x6079), angle in
//! position units, of which a turn of the shaft has `units_per_turn`, speed in velocity units, `speed_units` at a turn a second. Where the
//! drive tells its velocity unit (0x60A9), it must be that one. Signs are the drive's; `reversed` turns all of them. A rig of kind
//! `current` is driven by cyclic synchronous torque (mode 10): rated torque is taken as the torque of the rated current, so a
//! thousandth of the one is commanded, and told, as a thousandth of the other, in whatever the drive means by its rated current (amplitude
//! or root mean square). `speed` is cyclic synchronous velocity (mode 9). Volts it does not take.
//!
//! At each start, and stored nowhere: the node is taken out of operation and its output off; mode, watchdog and PDOs are set by SDO, one at a
//! time; then it is started. Each exchange is one PDO with control word and target, and a SYNC, on which the drive takes the target and answers
//! with two PDOs: status, mode and torque; position and speed. Only both together are a reading.
//!
//! Its own watchdog: its consumer heartbeat time (0x1016:1) is set to `timeout_ms` for kort's node, which is 128 less the drive's: each
//! drive on a bus listens for the servo that drives it, and no other one's heartbeat keeps it going. It goes out with
//! commands only, four times in that time. What the drive does after it is its abort connection option code (0x6007), which must be 2,
//! disable voltage: the shaft coasts; or 1, fault, where its fault reaction (0x605E) is 0, which coasts too. Both are read back, and
//! again while it is driven.
//!
//! Output off is disable voltage: the shaft coasts. A drive in fault is reset while the output is off, which succeeds when the cause is gone. A
//! drive that leaves `operation enabled` by itself is `amplifier_fault`, and so is an emergency message, by its code in the log. A
//! reset shows by its boot-up message, and by a watchdog that is not the one that was set. Unplugged, an adapter hangs up, and an interface
//! goes down; a broken bus falls silent: `drive_lost`, and the drive's heartbeat consumer takes the torque away.

mod protocol;
mod sdo;
mod setup;
mod state;
mod told;

use kort_proto::config::{Config, ConfigError, Thruster};
use kort_proto::messages::DriveKind;
use kort_thruster::rig::Rig;

pub use protocol::Protocol;

use super::forms::{DEVICE_OR_INTERFACE, NUMBER_OF_CANOPEN};
use super::wired::LIFE_MS;
use super::{Own, Wired, current_or_speed};
use crate::claims::Claim;
use crate::link::Medium;
use crate::link::can::Carrier;

/// Highest node of a drive; beyond it are kort's own.
const NODE_MAX: u8 = 63;
/// Bit rates that an adapter has a digit for; by 7 some mean 750 and some 800 kbit/s.
const BITRATES: [(u32, char); 8] = [
    (10_000, '0'),
    (20_000, '1'),
    (50_000, '2'),
    (100_000, '3'),
    (125_000, '4'),
    (250_000, '5'),
    (500_000, '6'),
    (1_000_000, '8'),
];
/// Bits of an exchange on the bus, stuffed: target, SYNC, two answers, and a share of heartbeats and SDOs.
const EXCHANGE_BITS: f64 = 500.0;
/// Share of the bus that one drive may take.
const SHARE: f64 = 0.7;

/// What of the section `drive` is its own.
const OWN: Own = Own {
    keys: &["address", "bitrate", "units_per_turn", "speed_units"],
    port: DEVICE_OR_INTERFACE,
    identity: NUMBER_OF_CANOPEN,
    reading_life_ms: LIFE_MS,
};

/// A CiA 402 drive as the configuration describes it.
#[derive(Clone, Debug, PartialEq)]
pub struct Cia402 {
    /// The wire.
    pub wired: Wired,
    /// Unit of the drive.
    pub kind: DriveKind,
    /// Its node on the bus.
    pub node: u8,
    /// How frames get there.
    pub carrier: Carrier,
    /// Digit of the bit rate, for an adapter.
    pub bitrate: char,
    /// Position units of a turn of the shaft.
    pub units_per_turn: f64,
    /// Velocity units at a turn a second.
    pub speed_units: f64,
}

impl Cia402 {
    /// Reads the section `drive`.
    ///
    /// # Errors
    /// [`ConfigError`] names key, value and what is allowed.
    pub fn new(config: &Config, id: &str, thruster: &Thruster, rig: &Rig) -> Result<Self, ConfigError> {
        let mut wrong = Vec::new();
        let mut wired = Wired::read(config, id, thruster, &OWN, &mut wrong)?;
        let kind = current_or_speed(config, id, thruster, rig, &mut wrong);
        let mut fail = |key: &str, words: String| {
            wrong.push(config.error(format!("`thrusters.{id}.drive.{key}` {words}")))
        };
        let node = wired.address.unwrap_or(1);
        if !(1..=i64::from(NODE_MAX)).contains(&node) {
            fail(
                "address",
                format!(
                    "= {node} is outside 1 to {NODE_MAX}\nhint: the drive's node, by its switches or tool; those above are kort's"
                ),
            );
        }
        if wired.units_per_turn.is_none() {
            fail(
                "units_per_turn",
                "is missing: what a turn of the shaft is in 0x6064 is a setting of the drive\nhint: counts of its encoder in a turn, four a line, unless 0x6091 or 0x6092 were changed".into(),
            );
        }
        for (key, value, hint) in [
            ("units_per_turn", wired.units_per_turn, "counts of the encoder in a turn, for example 4096"),
            ("speed_units", wired.speed_units, "60 for a drive that tells turns a minute"),
        ] {
            if let Some(value) = value.filter(|value| !(1.0..=1e9).contains(value)) {
                fail(key, format!("= {value} is outside 1 to 1e9\nhint: {hint}"));
            }
        }
        let units_per_turn = wired.units_per_turn.unwrap_or(1.0);
        let speed_units = wired.speed_units.unwrap_or(units_per_turn);
        let on_interface = !wired.port.to_string_lossy().contains('/');
        let bitrate = wired.bitrate.unwrap_or(1_000_000);
        let digit =
            BITRATES.into_iter().find(|(known, _)| i64::from(*known) == bitrate).map(|(_, digit)| digit);
        let most_hz = SHARE * bitrate as f64 / EXCHANGE_BITS;
        let port = wired.port.display();
        if on_interface && wired.bitrate.is_some() && !wired.port.as_os_str().is_empty() {
            fail(
                "bitrate",
                format!(
                    "= {bitrate}: {port} is an interface of the system, which has its own\nhint: ip link set {port} up type can bitrate {bitrate}; or a port under /dev, for an adapter"
                ),
            );
        } else if digit.is_none() {
            let known = BITRATES.map(|(known, _)| known.to_string()).join(", ");
            fail("bitrate", format!("= {bitrate} is none of {known}\nhint: the bus's, in bits a second"));
        } else if !on_interface && wired.rate_hz > most_hz {
            fail(
                "rate_hz",
                format!(
                    "= {} is beyond {most_hz}, what a bus of {bitrate} bit/s carries\nhint: a lower rate_hz with a longer timeout_ms and reading_life_ms, or a faster bus",
                    wired.rate_hz
                ),
            );
        }
        config.first_of(wrong.into_iter()).map_or(Ok(()), Err)?;
        let node = u8::try_from(node).unwrap_or(1);
        if on_interface {
            wired.medium = Medium::Can { interface: wired.port.clone(), node };
            // Others may be on the bus: the node is its own.
            let interface = wired.port.display();
            wired.claims.retain(|claim| claim.key != "port");
            wired.claims.push(Claim {
                key: "address",
                value: node.to_string(),
                thing: format!("{interface} node {node}"),
                allowed: format!("one drive a node on {interface}"),
                hint: "another node for one of them, 1 to 63, by its switches or its own tool",
            });
        }
        // Drives without a serial number of their own all tell the same.
        if wired.identity.ends_with(":0") {
            wired.claims.retain(|claim| claim.key != "identity");
        }
        let carrier = if on_interface { Carrier::Socket } else { Carrier::Slcan };
        Ok(Self {
            wired,
            kind,
            node,
            carrier,
            bitrate: digit.unwrap_or_default(),
            units_per_turn,
            speed_units,
        })
    }

    /// Number of the mode of operation.
    fn mode(&self) -> u8 {
        if self.kind == DriveKind::Speed { 9 } else { 10 }
    }

    /// kort's own node, for this drive.
    fn ours(&self) -> u8 {
        128 - self.node.clamp(1, NODE_MAX)
    }

    /// The drive's time-out in ms, as it is set.
    fn timeout_ms(&self) -> u32 {
        (self.wired.timeout_s * 1e3).round() as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drives::{Chosen, choose};

    /// What comes of these keys of `drive`.
    fn chosen(keys: &str) -> Result<Chosen, String> {
        let rig = include_str!("../../../../../config/thrusters/whitcomb-yoerger-1999.toml");
        let text = format!(
            "[thrusters.t1]\nrig = \"r\"\namplifier = \"cia402\"\n[thrusters.t1.drive]\nunits_per_turn = 4096\n{keys}"
        );
        let config = Config::parse(&text, None).unwrap();
        let thruster = config.thruster("t1").unwrap();
        choose(&config, "t1", thruster, &Rig::from_toml(rig).unwrap()).map_err(|e| e.to_string())
    }

    #[test]
    fn a_port_without_a_folder_is_an_interface() {
        for (port, node) in [("can0", Some(7)), ("/dev/ttyACM0", None)] {
            let Ok(Chosen::OnWire(wired, _)) = chosen(&format!("port = \"{port}\"\naddress = 7")) else {
                panic!("{port}")
            };
            let found = if let Medium::Can { node, .. } = wired.medium { Some(node) } else { None };
            assert_eq!(found, node);
        }
    }

    /// A wire that turns a bit of an answer looks like a drive that is not to be driven.
    #[test]
    fn a_refused_drive_is_asked_again_after_a_while() {
        let keys = "port = \"/dev/ttyACM0\"\naddress = 5\nbitrate = 500000";
        let Ok(Chosen::OnWire(_, mut protocol)) = chosen(keys) else { panic!("on a wire") };
        let mut said = |bytes: &[u8]| {
            let (mut out, mut words) = (Vec::new(), Vec::new());
            let mut heard = |what| {
                if let crate::link::Heard::Unguarded(why) = what {
                    words.push(why);
                }
            };
            if bytes.is_empty() {
                protocol.ask(&mut out, &mut heard);
            } else {
                protocol.hear(bytes, &mut heard);
            }
            (String::from_utf8_lossy(&out).contains("t6058400010"), words)
        };
        assert!(said(&[]).0, "its device type is asked for");
        // Profile 403 in the place of 402.
        let (_, words) = said(b"t58584300100093010200\r");
        assert!(words.iter().any(|why| why.contains("profile 403")), "{words:?}");
        let silent = (0..100).take_while(|_| !said(&[]).0).count();
        assert_eq!(silent, 20, "turns of asking that the refusal stands");
    }

    #[test]
    fn each_bad_key_is_named_with_a_hint() {
        for (keys, words) in [
            ("port = \"can0\"\naddress = 64", "`thrusters.t1.drive.address` = 64 is outside 1 to 63"),
            ("port = \"can0\"\nbitrate = 500000", "ip link set can0 up type can bitrate 500000"),
            ("port = \"/dev/a\"\nbitrate = 800000", "`thrusters.t1.drive.bitrate` = 800000 is none of 10000"),
            ("port = \"/dev/a\"\nbitrate = 125000", "`thrusters.t1.drive.rate_hz` = 200 is beyond 175"),
            (
                "port = \"/dev/a\"\nspeed_units = 0",
                "`thrusters.t1.drive.speed_units` = 0 is outside 1 to 1e9",
            ),
            (
                "port = \"/dev/a\"\npole_pairs = 7",
                "`thrusters.t1.drive.pole_pairs` = 7: this drive tells the speed",
            ),
        ] {
            let Err(error) = chosen(keys) else { panic!("{keys}") };
            assert!(error.contains(words) && error.contains("\nhint: "), "{error}");
        }
    }
}
