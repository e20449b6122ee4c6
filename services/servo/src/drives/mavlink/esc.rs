//! What the ESC behind one output tells, through the autopilot.

use std::f64::consts::TAU;

use mavlink::dialects::ardupilotmega::{ESC_INFO_DATA, ESC_STATUS_DATA, ESC_TELEMETRY_1_TO_4_DATA};
use mavlink::{MavlinkVersion, MessageData};

/// ESCs in a message.
const IN_ONE: usize = 4;
/// ArduPilot's messages of the first sixteen, in their order; one layout.
const TELEMETRY: [u32; 4] = [11030, 11031, 11032, 11040];
/// Below this a shaft is as good as standing, turns a minute.
const STANDS_RPM: f64 = 100.0;
/// A speed that rises by so much is no noise: share, and turns a minute.
const RISES: (f64, f64) = (1.02, 10.0);
/// Least share that a supply's current is divided by.
const SHARE_MIN: f64 = 0.05;

/// A telemetry that was not there before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Shaft speed, rad/s; positive the way the output drives ahead.
    pub shaft_speed_rad_s: f64,
    /// Motor current, A; likewise.
    pub current_a: f64,
    /// Supply of the ESC, V.
    pub supply_v: f64,
    /// Temperature of the ESC, deg C.
    pub temperature_c: f64,
    /// The vehicle's clock then at the latest that is sure, us.
    pub clock_us: u64,
}

/// The ESC of one output.
#[derive(Clone, Debug)]
pub struct Esc {
    /// Its place among all, from zero: the output's.
    place: usize,
    /// Counter of ArduPilot's telemetry, and clock of `ESC_STATUS`: what does not grow is old.
    count: Option<u16>,
    stamp: Option<u64>,
    temperature_c: f64,
    /// Which way the shaft is taken to turn, and how fast it did, turns a minute.
    way: f64,
    rpm: f64,
    fresh: Option<Reading>,
    /// The vehicle's clock when it was told last, us.
    clock_us: u64,
}

impl Esc {
    /// Nothing heard yet.
    pub fn new(place: usize) -> Self {
        Self {
            place,
            count: None,
            stamp: None,
            temperature_c: f64::NAN,
            way: 1.0,
            rpm: 0.0,
            fresh: None,
            clock_us: 0,
        }
    }

    /// The messages in which it stands.
    pub fn messages(&self) -> impl Iterator<Item = u32> {
        TELEMETRY
            .get(self.place / IN_ONE)
            .copied()
            .into_iter()
            .chain([ESC_STATUS_DATA::ID, ESC_INFO_DATA::ID])
    }

    /// What came since the last call.
    pub fn take(&mut self) -> Option<Reading> {
        self.fresh.take()
    }

    /// Takes a message, under the share of the supply that the output gives, -1 to 1, and behind the vehicle's clock as it
    /// was told last: it was sent after that. Others are passed over.
    pub fn hear(&mut self, id: u32, payload: &[u8], share: f64, clock_us: u64) {
        self.clock_us = clock_us;
        let column = self.place % IN_ONE;
        let first = self.place - column;
        match id {
            ESC_STATUS_DATA::ID => {
                let Ok(all) = ESC_STATUS_DATA::deser(MavlinkVersion::V2, payload) else { return };
                if usize::from(all.index) != first || self.stamp.replace(all.time_usec) == Some(all.time_usec)
                {
                    return;
                }
                let (Some(rpm), Some(supply_v), Some(supply_a)) =
                    (all.rpm.get(column), all.voltage.get(column), all.current.get(column))
                else {
                    return;
                };
                let told = (f64::from(*rpm), f64::from(*supply_v), f64::from(*supply_a));
                self.tell(told.0 / 60.0 * TAU, told.1, told.2, share);
            }
            ESC_INFO_DATA::ID => {
                let Ok(all) = ESC_INFO_DATA::deser(MavlinkVersion::V2, payload) else { return };
                let told = all.temperature.get(column).filter(|_| usize::from(all.index) == first);
                // The largest number stands for none.
                if let Some(told) = told.filter(|told| **told != i16::MAX) {
                    self.temperature_c = f64::from(*told) * 0.01;
                }
            }
            id if TELEMETRY.get(self.place / IN_ONE) == Some(&id) => {
                let Ok(all) = ESC_TELEMETRY_1_TO_4_DATA::deser(MavlinkVersion::V2, payload) else { return };
                let (Some(count), Some(rpm), Some(volts), Some(amperes), Some(temperature)) = (
                    all.count.get(column),
                    all.rpm.get(column),
                    all.voltage.get(column),
                    all.current.get(column),
                    all.temperature.get(column),
                ) else {
                    return;
                };
                // Zero is an ESC that never said anything.
                if *count == 0 || self.count.replace(*count) == Some(*count) {
                    return;
                }
                self.temperature_c = f64::from(*temperature);
                let signed = self.signed(f64::from(*rpm), share);
                self.tell(signed / 60.0 * TAU, f64::from(*volts) * 0.01, f64::from(*amperes) * 0.01, share);
            }
            _ => (),
        }
    }

    fn tell(&mut self, shaft_speed_rad_s: f64, supply_v: f64, supply_a: f64, share: f64) {
        let current_a =
            if share == 0.0 { 0.0 } else { supply_a / share.abs().max(SHARE_MIN) * share.signum() };
        let (temperature_c, clock_us) = (self.temperature_c, self.clock_us);
        self.fresh = Some(Reading { shaft_speed_rad_s, current_a, supply_v, temperature_c, clock_us });
    }

    /// A speed that was told without sign, with the one it has: after the output has changed sides the shaft first slows down the
    /// way it turned, and turns the other way from where it no longer does.
    fn signed(&mut self, rpm: f64, share: f64) -> f64 {
        let turned_over = share != 0.0 && share.signum() != self.way;
        if turned_over && (rpm < STANDS_RPM || rpm > RISES.0 * self.rpm + RISES.1) {
            self.way = share.signum();
        }
        self.rpm = rpm;
        self.way * rpm
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn said(count: u16, rpm: u16, amperes: u16) -> Vec<u8> {
        let all = ESC_TELEMETRY_1_TO_4_DATA {
            voltage: [1600; 4],
            current: [0, 0, amperes, 0],
            rpm: [0, 0, rpm, 0],
            count: [9, 9, count, 9],
            temperature: [0, 0, 31, 0],
            ..Default::default()
        };
        let mut bytes = vec![0; 255];
        let length = all.ser(MavlinkVersion::V2, &mut bytes);
        bytes.truncate(length);
        bytes
    }

    /// Third of the second four, unsigned: the sign follows the output, once the shaft has slowed down.
    #[test]
    fn the_sign_turns_with_the_shaft_and_not_with_the_command() {
        let mut esc = Esc::new(6);
        let mut told = |count, rpm, share| {
            esc.hear(11031, &said(count, rpm, 200), share, 0);
            esc.take().map(|r| ((r.shaft_speed_rad_s * 60.0 / TAU).round(), r.current_a))
        };
        assert_eq!(told(1, 1000, 0.5), Some((1000.0, 4.0)));
        assert_eq!(told(1, 1000, 0.5), None, "an old one");
        assert_eq!(told(2, 800, -0.5), Some((800.0, -4.0)), "it still turns ahead");
        assert_eq!(told(3, 300, -0.5), Some((300.0, -4.0)));
        assert_eq!(told(4, 350, -0.5), Some((-350.0, -4.0)), "faster again: the other way");
        assert_eq!(told(5, 900, 0.0), Some((-900.0, 0.0)), "coasting");
        assert_eq!(told(6, 50, 0.5), Some((50.0, 4.0)), "as good as standing");
        let mut other = Esc::new(6);
        other.hear(11030, &said(1, 1000, 200), 0.5, 0);
        assert_eq!(other.take(), None, "another four");
    }

    #[test]
    fn what_is_told_with_a_sign_keeps_it() {
        let all = ESC_STATUS_DATA {
            time_usec: 5,
            rpm: [0, -600, 0, 0],
            voltage: [0.0, 15.5, 0.0, 0.0],
            current: [0.0, 1.5, 0.0, 0.0],
            index: 4,
        };
        let mut bytes = vec![0; 255];
        all.ser(MavlinkVersion::V2, &mut bytes);
        let mut esc = Esc::new(5);
        esc.hear(ESC_STATUS_DATA::ID, &bytes, 0.5, 7);
        let told = esc.take().unwrap();
        assert!((told.shaft_speed_rad_s + 10.0 * TAU).abs() < 1e-9 && told.current_a == 3.0, "{told:?}");
        assert_eq!((told.supply_v, told.clock_us), (15.5, 7));
        esc.hear(ESC_STATUS_DATA::ID, &bytes, 0.5, 7);
        assert_eq!(esc.take(), None, "an old one");
    }

    proptest! {
        /// Any payload: no panic, and no reading that is not a number.
        #[test]
        fn any_payload_is_endured(
            place in 0usize..16,
            id in prop::sample::select(vec![290u32, 291, 11030, 11031, 11032, 11040]),
            payloads in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..255), 1..5),
            share in -1.0..1.0,
        ) {
            let mut esc = Esc::new(place);
            for payload in payloads {
                esc.hear(id, &payload, share, 0);
                if let Some(told) = esc.take().filter(|_| id != ESC_STATUS_DATA::ID) {
                    prop_assert!(told.shaft_speed_rad_s.is_finite() && told.current_a.is_finite());
                }
            }
        }
    }
}
