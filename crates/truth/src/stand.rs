//! The test stand: runs the plant under a command programme and logs it.
//!
//! Conventions: the command changes on the 500 Hz control tick and holds; a log row holds the command
//! that starts at its instant and the state just before that command acts. Shaft speed is the encoder
//! count differenced at 500 Hz, then a first-order 10 ms filter. Thrust passes a first-order 163 Hz
//! filter and a 12-bit converter. Flow is sampled at 20 Hz; cells between are empty.

use crate::chain::{Chain, Reading, TICK_S};
use crate::dynamics::{At, Plant, Scale, State};
use crate::hidden::Hidden;
use crate::noise::{Disturbance, Noise};
use crate::thruster::Thruster;

/// Control ticks in a log interval.
pub const TICKS_PER_ROW: usize = 5;
/// Log rows between flow samples.
pub const ROWS_PER_FLOW: usize = 5;
/// Corner of the stated force filter, Hz.
pub const THRUST_FILTER_HZ: f64 = 163.0;
/// Corner of the stated torque filter, Hz.
pub const TORQUE_FILTER_HZ: f64 = 99.5;
/// Bits of the force converter.
pub const THRUST_BITS: u32 = 12;

/// What is on the stand, and how it is recorded.
pub struct Stand<'a> {
    /// Thruster.
    pub thruster: &'a Thruster,
    /// Hidden physics.
    pub hidden: &'a Hidden,
    /// Scales of hidden terms.
    pub scale: Scale,
    /// Full scale of the force converter, N.
    pub thrust_full_scale_n: f64,
    /// Integration steps in a control tick.
    pub steps_per_tick: usize,
}

/// Log rows, a vector per channel; flow stands at every row, the file keeps one in [`ROWS_PER_FLOW`].
#[derive(Clone, Debug, Default, PartialEq)]
#[allow(missing_docs)]
pub struct Rows {
    pub command_a: Vec<f64>,
    pub current_a: Vec<f64>,
    pub angle_rad: Vec<f64>,
    pub speed_rad_s: Vec<f64>,
    pub thrust_n: Vec<f64>,
    pub torque_n_m: Vec<f64>,
    pub flow_m_s: Vec<f64>,
    pub supply_v: Vec<f64>,
}

impl Stand<'_> {
    /// Records with noise, turbulence, encoder counts and converter steps.
    pub fn record(&self, command_a: &[f64], noise: Noise, seed: u64) -> Rows {
        self.run(command_a, Disturbance::new(noise, seed), true)
    }

    /// Records as ideal sensors of the same bandwidth would.
    pub fn record_smooth(&self, command_a: &[f64]) -> Rows {
        self.run(command_a, Disturbance::new(Noise::default(), 0), false)
    }

    fn run(&self, command_a: &[f64], mut disturbance: Disturbance, quantise: bool) -> Rows {
        let plant = Plant {
            thruster: self.thruster,
            hidden: self.hidden,
            scale: self.scale,
            thrust_filter_hz: THRUST_FILTER_HZ,
            torque_filter_hz: TORQUE_FILTER_HZ,
            duration_s: command_a.len() as f64 * TICK_S,
        };
        let mut chain = Chain::new(self.hidden, quantise);
        let mut rows = Rows::default();
        let mut state = State::rest();
        let step_s = TICK_S / self.steps_per_tick as f64;
        for (tick, &command) in command_a.iter().enumerate() {
            let time_s = tick as f64 * TICK_S;
            let reading = chain.tick(&state, time_s);
            if tick % TICKS_PER_ROW == 0 {
                rows.command_a.push(command);
                self.log(&state, &reading, &mut disturbance, quantise, &mut rows);
            }
            for step in 0..self.steps_per_tick {
                let at_s = time_s + step as f64 * step_s;
                let issued = ((at_s - self.hidden.delay_s) / TICK_S + 1e-6).floor();
                let delayed = if issued < 0.0 { 0.0 } else { command_a[issued as usize] };
                state = plant.step(&state, at_s, step_s, delayed, disturbance.turbulence_m_s);
            }
            disturbance.tick(TICK_S);
        }
        rows
    }

    fn log(
        &self,
        state: &State,
        reading: &Reading,
        disturbance: &mut Disturbance,
        quantise: bool,
        rows: &mut Rows,
    ) {
        let thruster = self.thruster;
        let current = state.get(At::Current);
        rows.current_a.push(current + disturbance.white(|noise| noise.current_a));
        rows.angle_rad.push(reading.angle_rad);
        rows.speed_rad_s.push(reading.speed_rad_s);
        let thrust = reading.thrust_n + disturbance.thrust_zero_n + disturbance.white(|noise| noise.thrust_n);
        rows.thrust_n.push(if quantise { self.convert(thrust) } else { thrust });
        rows.torque_n_m.push(state.get(At::FilteredTorque) + disturbance.white(|noise| noise.torque_n_m));
        rows.flow_m_s.push(reading.flow_m_s + disturbance.white(|noise| noise.flow_m_s));
        let droop = 0.004 * thruster.supply_v * current.abs() / thruster.current_limit_a;
        let emf = thruster.torque_constant_nm_a * state.get(At::Speed);
        let power = (thruster.winding_resistance_ohm * current + emf) * current;
        let cable = self.hidden.source_resistance_ohm * (power / thruster.supply_v).max(0.0);
        rows.supply_v.push(thruster.supply_v - droop - cable + disturbance.white(|noise| noise.supply_v));
    }

    /// The converter: 12 bits over plus and minus full scale.
    fn convert(&self, thrust_n: f64) -> f64 {
        let step = 2.0 * self.thrust_full_scale_n / f64::from(1u32 << THRUST_BITS);
        let code = (thrust_n / step).round();
        let end = f64::from(1u32 << (THRUST_BITS - 1));
        code.clamp(-end, end - 1.0) * step + 0.0
    }
}
