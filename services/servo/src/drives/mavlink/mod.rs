//! One thruster of an ArduSub vehicle, through its autopilot: on a serial port or USB, or by UDP.
//!
//! Read for this: `common.xml` and `ardupilotmega.xml` of MAVLink with the serialization page of its guide, and what `motors.cpp`,
//! `failsafe.cpp` and `GCS_MAVLink_Sub.cpp` of ArduSub (ArduPilot/ardupilot, several states from 3.5.3 to 4.8-dev) and `AP_ESC_Telem.cpp`
//! say. Messages, framing and check sums are the crate `mavlink`'s.
//!
//! What drives is the motor test (`MAV_CMD_DO_MOTOR_TEST`), with a pulse width for one motor. Passed over: `MAV_CMD_DO_SET_SERVO` (not
//! for motors, and no time-out at all), `RC_CHANNELS_OVERRIDE` and `MANUAL_CONTROL` (the whole vehicle through its mixer, not a thruster),
//! `MAV_CMD_ACTUATOR_TEST` (PX4's).
//!
//! Units on the wire: pulse width in us, 1500 is zero, 1100 and 1900 are full astern and ahead; from the ESC: turns a minute, 0.01 V,
//! 0.01 A of its *supply* current, deg C of the ESC. A rig of kind `voltage` is driven: volts over the supply, as a share of 400 us.
//! The motor's current is reckoned from the supply's by the balance of power (over the share given, 0.05 at least).
//! **`ESC_TELEMETRY` has no sign**: the speed is given that of the output, and changes it when it no longer falls after the output has
//! changed its own. So kort cannot see a motor that turns against its command here; `ESC_STATUS` is signed and believed. An ESC without
//! telemetry tells nothing: shaft speed and current must then come from instruments (`sensors`).
//!
//! Its own watchdog: a motor test without a command for 500 ms ends, and the vehicle is disarmed, all motors at zero; for 10 s after that it
//! begins no other. Both are compiled in: they are no setting, and cannot be read. kort confirms that it is an ArduSub of a version whose
//! source says so; any other is `drive_unguarded`, and nobody can arm. `timeout_ms` must be 510 or more, to be written down by somebody who
//! knows that torque may outlive a broken cable by half a second. The first hour (docs/hardware.md) sees it happen. The time-out is
//! one for all motors: a second program that tests another motor would feed it, so one that moves is `amplifier_fault`.
//!
//! Output on is: armed by kort, in MANUAL, motor test under way. Output off is zero, then disarmed, then silence, which gives the vehicle back
//! to its pilot: until the cool-down of 10 s is over kort cannot drive again. A vehicle that somebody else has armed, or that
//! is in another mode, is not driven. Its fail-safes stay in force: what disarms it or changes its mode (pilot's stick lost, leak, battery,
//! a ground station's word) is `amplifier_fault`, with its own words. kort speaks as the vehicle's onboard computer (component 191),
//! so its heartbeat does not stand in for a lost ground station's. While the motor test holds the motors no fail-safe can
//! move them: **a vehicle that is driven so does not come up by itself**.
//!
//! Age: a reading is told by the vehicle's own clock, which stands in `SERVO_OUTPUT_RAW`, and `TIMESYNC` tells how that one stands to
//! ours (`GCS_Common.cpp`: answered with the time since start at which the question came). Telemetry of an ESC carries no
//! clock, or that of its sending: it is as old as the outputs told before it; how long the autopilot had it is not known.
//!
//! Unplugged: `drive_lost`, and its time-out. By UDP a cable's end shows only by silence (`reading_life_ms`). A reset
//! shows by its clock, which stands in every message of the outputs.

mod esc;
pub mod frame;
mod mouth;
mod protocol;
mod vehicle;

use std::net::SocketAddr;

use kort_proto::config::{Config, ConfigError, Thruster};
use kort_proto::messages::DriveKind;
use kort_thruster::rig::Rig;

pub use protocol::Protocol;

use super::forms::{DEVICE_OR_UDP, NUMBER_OF_36_OR_16};
use super::wired::LIFE_MS;
use super::{Own, Wired, kind_of};
use crate::claims::Claim;
use crate::link::Medium;

/// What a port that is an address begins with.
const UDP: &str = "udp:";
/// The motor test's time-out, and a turn of the vehicle's main loop that looks at it, s.
const TIMEOUT_S: f64 = 0.51;
/// Most motors that ArduSub has.
const MOTORS: u32 = 12;

/// What of the section `drive` is its own.
const OWN: Own = Own {
    keys: &["address", "motor"],
    port: DEVICE_OR_UDP,
    identity: NUMBER_OF_36_OR_16,
    reading_life_ms: LIFE_MS,
};

/// One thruster of an ArduSub vehicle as the configuration describes it.
#[derive(Clone, Debug, PartialEq)]
pub struct Mavlink {
    /// The wire.
    pub wired: Wired,
    /// The vehicle's system number.
    pub system: u8,
    /// The motor as ArduSub counts them, from 1.
    pub motor: u32,
    /// Supply that volts are reckoned with until one is told, V.
    pub supply_v: f64,
}

impl Mavlink {
    /// Reads the section `drive`.
    ///
    /// # Errors
    /// [`ConfigError`] names key, value and what is allowed.
    pub fn new(config: &Config, id: &str, thruster: &Thruster, rig: &Rig) -> Result<Self, ConfigError> {
        let mut wrong = Vec::new();
        let mut wired = Wired::read(config, id, thruster, &OWN, &mut wrong)?;
        if kind_of(rig) != DriveKind::Voltage {
            wrong.push(config.error(format!(
                "`thrusters.{id}.amplifier` = \"mavlink\" takes volts (as pulse width), but the rig's amplifier is of another kind\nhint: amplifier.kind = \"voltage\" in the rig, with its supply_v"
            )));
        }
        let mut fail = |key: &str, words: String| {
            wrong.push(config.error(format!("`thrusters.{id}.drive.{key}` {words}")))
        };
        let motor = wired.motor.unwrap_or_default();
        if wired.motor.is_none() {
            fail(
                "motor",
                "is missing: which of the vehicle's thrusters?\nhint: as QGroundControl counts them, from 1"
                    .into(),
            );
        } else if !(1..=i64::from(MOTORS)).contains(&motor) {
            fail("motor", format!("= {motor} is outside 1 to {MOTORS}\nhint: as QGroundControl counts them"));
        }
        let system = wired.address.unwrap_or(1);
        if !(1..=255).contains(&system) {
            let whose = if system == 0 { "everybody" } else { "nobody" };
            let words = format!(
                "= {system} is {whose}; allowed is 1 to 255\nhint: the vehicle's MAV_SYSID, 1 unless changed"
            );
            fail("address", words);
        }
        if wired.timeout_s < TIMEOUT_S {
            fail(
                "timeout_ms",
                format!(
                    "= {}, but a motor test of ArduSub ends 500 ms after its last command, and that is no setting\nhint: timeout_ms = 510 accepts that torque outlives a broken cable by half a second",
                    (wired.timeout_s * 1e3).round()
                ),
            );
        }
        let port = wired.port.to_string_lossy();
        if let Some(address) = port.strip_prefix(UDP) {
            match address.parse::<SocketAddr>() {
                Ok(address) if address.port() != 0 => wired.medium = Medium::Udp(address),
                _ => fail(
                    "port",
                    format!(
                        "= \"{port}\" is no address and port\nhint: \"udp:192.168.2.2:14550\", an endpoint of the vehicle that waits for clients"
                    ),
                ),
            }
        }
        config.first_of(wrong.into_iter()).map_or(Ok(()), Err)?;
        let (motor, system) = (u32::try_from(motor).unwrap_or(1), u8::try_from(system).unwrap_or(1));
        let udp = matches!(wired.medium, Medium::Udp(_));
        // A vehicle has several motors, and by UDP several may ask it: the motor is its own.
        let vehicles = [
            udp.then(|| format!("{} system {system}", wired.medium)),
            Some(format!("vehicle {}", wired.identity)).filter(|_| !wired.identity.is_empty()),
        ];
        wired.claims.retain(|claim| claim.key == "port" && !udp);
        wired.claims.extend(vehicles.into_iter().flatten().map(|vehicle| Claim {
            key: "motor",
            value: motor.to_string(),
            thing: format!("{vehicle} motor {motor}"),
            allowed: "one thruster a motor of a vehicle".to_owned(),
            hint: "its other motors by their numbers, as QGroundControl counts them",
        }));
        Ok(Self { wired, system, motor, supply_v: rig.amplifier.supply_v.unwrap_or(f64::NAN) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drives::{Chosen, choose};

    fn chosen(keys: &str, rig: &str) -> Result<Chosen, String> {
        let text =
            format!("[thrusters.t1]\nrig = \"r\"\namplifier = \"mavlink\"\n[thrusters.t1.drive]\n{keys}");
        let config = Config::parse(&text, None).unwrap();
        let thruster = config.thruster("t1").unwrap();
        choose(&config, "t1", thruster, &Rig::from_toml(rig).unwrap()).map_err(|e| e.to_string())
    }

    const VEHICLE: &str = include_str!("../../../../../config/thrusters/t200-vehicle.toml");
    const CURRENT: &str = include_str!("../../../../../config/thrusters/whitcomb-yoerger-1999.toml");

    #[test]
    fn a_port_is_a_device_or_an_address() {
        for (port, udp) in [("/dev/ttyACM0", false), ("udp:127.0.0.1:14550", true)] {
            let keys = format!("port = \"{port}\"\nmotor = 1\ntimeout_ms = 510");
            let Ok(Chosen::OnWire(wired, _)) = chosen(&keys, VEHICLE) else { panic!("{port}") };
            assert_eq!(matches!(wired.medium, Medium::Udp(_)), udp);
        }
    }

    #[test]
    fn each_bad_key_is_named_with_a_hint() {
        let good = "port = \"/dev/a\"\nmotor = 1\ntimeout_ms = 510";
        for (keys, rig, words) in [
            ("port = \"/dev/a\"\ntimeout_ms = 510", VEHICLE, "`thrusters.t1.drive.motor` is missing"),
            ("port = \"/dev/a\"\nmotor = 0\ntimeout_ms = 510", VEHICLE, "`thrusters.t1.drive.motor` = 0 is"),
            ("port = \"/dev/a\"\nmotor = 1", VEHICLE, "`thrusters.t1.drive.timeout_ms` = 100, but a motor"),
            (
                "port = \"udp:here\"\nmotor = 1\ntimeout_ms = 510",
                VEHICLE,
                "`thrusters.t1.drive.port` = \"udp:here\" is no address",
            ),
            (good, CURRENT, "takes volts"),
        ] {
            let Err(error) = chosen(keys, rig) else { panic!("{keys}") };
            assert!(error.contains(words) && error.contains("\nhint: "), "{error}");
        }
    }
}
