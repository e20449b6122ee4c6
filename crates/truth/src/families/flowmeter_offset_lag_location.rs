//! A flow meter with a wrong zero, downstream, or behind mixing water.

use super::{Family, wet};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::memory::Lag;
use crate::physics::{Now, Path, Physics, Reading};

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Sensor,
    forms: &["zero", "carried downstream", "mixing on the way", "zero and carried", "gain of the contraction"],
    anchors: &[crate::statement::Quantity::Flux, crate::statement::Quantity::Lift],
    fits: wet,
    draw,
    ..Family::new("flowmeter_offset_lag_location")
};

struct Meter {
    /// Zero, distance, mixing length, gain; per strength.
    parts: [f64; 4],
    strength: f64,
    /// Way the water has made at each past tick, m, and the flow then.
    way_m: f64,
    carried: Vec<(f64, f64)>,
    mixed: Lag,
}

fn draw(form: usize, _: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let side = dice.side();
    let parts = match form {
        0 => [side, 0.0, 0.0, 0.0],
        1 => [0.0, 1.0, 0.0, 0.0],
        2 => [0.0, 0.0, 1.0, 0.0],
        3 => [side * dice.between(0.3, 0.8), 0.7, 0.0, 0.0],
        _ => [0.0, 0.0, 0.0, side],
    };
    Box::new(Meter { parts, strength: 0.0, way_m: 0.0, carried: Vec::new(), mixed: Lag::default() })
}

impl Physics for Meter {
    fn set(&mut self, strength: f64) {
        self.strength = strength;
    }

    fn rest(&mut self) {
        self.way_m = 0.0;
        self.carried.clear();
        self.mixed = Lag::default();
    }

    fn sense(&mut self, now: &Now, reading: &mut Reading, tick_s: f64) {
        let full = now.full.flow_m_s;
        let [zero, distance, mixing, gain] = self.parts.map(|part| part * self.strength);
        let speed = now.flow_m_s.abs() + 0.04 * full;
        let mut flow = reading.flow_m_s;
        if distance > 0.0 {
            // What is at the meter passed the blades one distance of way ago; 2 s of full flow at most.
            self.way_m += speed * tick_s;
            self.carried.push((self.way_m, flow));
            let since = self.way_m - 2.0 * distance * full;
            let at = self.carried.partition_point(|(way, _)| *way <= since);
            flow = if at == 0 { 0.0 } else { self.carried[at - 1].1 };
        }
        if mixing > 0.0 {
            flow = self.mixed.follow(flow, 2.0 * mixing * full / speed, tick_s);
        }
        reading.flow_m_s = (1.0 + gain) * flow + zero * full;
    }
}
