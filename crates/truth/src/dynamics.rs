//! Time derivatives of the true thruster with its hidden physics, and the integrator.
//!
//! The integrator is Heun's method with a step of a fraction of a millisecond: other order, other
//! step and other form of the equations than any fitted model.

use crate::hidden::{Hidden, Unknown};
use crate::thruster::{BladeForce, Thruster};
use std::f64::consts::TAU;

/// Places in the state vector.
#[derive(Clone, Copy, Debug)]
#[repr(usize)]
pub enum At {
    /// Shaft angle, rad.
    Angle,
    /// Shaft speed, rad/s.
    Speed,
    /// Axial flow at the blades, m/s.
    Flow,
    /// Motor current, A.
    Current,
    /// Tangential flow at 0.7 r, m/s.
    Swirl,
    /// Recirculated ambient flow, m/s.
    Returned,
    /// Winding temperature over its final value at full current.
    Warmth,
    /// Separated share of the flow over the blades.
    Separation,
    /// Fast and slow memory of the lift.
    LiftFast,
    /// Slow memory of the lift.
    LiftSlow,
    /// Ventilated share.
    Ventilated,
    /// Stand deflection as a force, N.
    Stand,
    /// Its rate, N/s.
    StandRate,
    /// Thrust after a lag of the sensor, N.
    LaggedThrust,
    /// Thrust after the force filter, N.
    FilteredThrust,
    /// Torque after its filter, N m.
    FilteredTorque,
    /// Flow at the meter, m/s.
    MeterFlow,
}

/// Number of states.
pub const STATES: usize = 17;

/// State vector, indexed by [`At`].
#[derive(Clone, Copy, Debug)]
pub struct State(pub [f64; STATES]);

impl State {
    /// All at rest.
    pub fn rest() -> Self {
        State([0.0; STATES])
    }

    /// One value.
    pub fn get(&self, at: At) -> f64 {
        self.0[at as usize]
    }

    fn set(&mut self, at: At, value: f64) {
        self.0[at as usize] = value;
    }
}

/// Largest values of the run without hidden physics: scales for hidden terms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Shaft speed, rad/s.
    pub speed_rad_s: f64,
    /// Axial flow, m/s.
    pub flow_m_s: f64,
    /// Thrust, N.
    pub thrust_n: f64,
    /// Blade torque, N m.
    pub torque_n_m: f64,
}

/// The true system under one command and one ambient flow, held over a control tick.
pub struct Plant<'a> {
    /// Thruster.
    pub thruster: &'a Thruster,
    /// Hidden physics.
    pub hidden: &'a Hidden,
    /// Scales.
    pub scale: Scale,
    /// Corner of the force filter, Hz.
    pub thrust_filter_hz: f64,
    /// Corner of the torque filter, Hz.
    pub torque_filter_hz: f64,
    /// Length of the run, s.
    pub duration_s: f64,
}

impl Plant<'_> {
    /// One step of `step_s` by Heun's method.
    pub fn step(
        &self,
        state: &State,
        time_s: f64,
        step_s: f64,
        command_a: f64,
        turbulence_m_s: f64,
    ) -> State {
        let first = self.rate(state, time_s, command_a, turbulence_m_s);
        let mut guess = *state;
        for (value, rate) in guess.0.iter_mut().zip(&first.0) {
            *value += step_s * rate;
        }
        let second = self.rate(&guess, time_s + step_s, command_a, turbulence_m_s);
        let mut next = *state;
        for ((value, a), b) in next.0.iter_mut().zip(&first.0).zip(&second.0) {
            *value += 0.5 * step_s * (a + b);
        }
        next
    }

    fn rate(&self, state: &State, time_s: f64, command_a: f64, turbulence_m_s: f64) -> State {
        let (t, h) = (self.thruster, self.hidden);
        let (speed, flow, current) = (state.get(At::Speed), state.get(At::Flow), state.get(At::Current));
        let mut rate = State::rest();
        rate.set(At::Angle, speed);

        // Drive and motor.
        let target = self.current_target(command_a, current, speed);
        rate.set(At::Current, (target - current) / (t.amplifier_time_constant_s + h.extra_lag_s));
        let load = (current / t.current_limit_a).powi(2);
        if h.thermal_loss > 0.0 {
            rate.set(At::Warmth, (load - state.get(At::Warmth)) / h.thermal_time_s);
        }
        let constant = t.torque_constant_nm_a / (1.0 + h.saturation * load)
            * (1.0 - h.thermal_loss * state.get(At::Warmth));
        let motor = constant * current;

        // Blades, and the water they move.
        let blade = self.blades(state, time_s, &mut rate);
        let extra = self.unknown_thrust(speed, flow);
        let thrust = blade.thrust_n + extra;
        let ambient = turbulence_m_s + self.ambient(state, time_s, &mut rate);
        let density = t.density_kg_m3 * (1.0 + h.density_error);
        let flux = (t.flux_coefficient + 0.5 * h.duct_loss) * density * t.area_m2();
        let mass = t.added_mass_kg() * (1.0 + h.density_error) * (1.0 + h.extra_added_mass);
        rate.set(At::Flow, (thrust - flux * (flow - ambient) * flow.abs()) / mass);

        // Shaft.
        let drag = self.shaft_drag(state, motor, time_s);
        rate.set(
            At::Speed,
            (motor + h.torque_bias_nm - blade.torque_n_m - drag) / (t.inertia_kg_m2 + h.extra_inertia_kg_m2),
        );

        self.sensors(state, thrust, blade.torque_n_m, &mut rate);
        rate
    }

    fn current_target(&self, command_a: f64, current: f64, speed: f64) -> f64 {
        let (t, h) = (self.thruster, self.hidden);
        let mut target = command_a;
        if h.dead_band_a > 0.0 {
            target = command_a.signum() * (command_a.abs() - h.dead_band_a).max(0.0);
        }
        let limit = t.current_limit_a * (1.0 - h.limit_loss);
        target = target.clamp(-limit, limit);
        if h.voltage_limit_v > 0.0 {
            let emf = t.torque_constant_nm_a * speed;
            let mut available = h.voltage_limit_v;
            if h.source_resistance_ohm > 0.0 {
                let power = (t.winding_resistance_ohm * current + emf) * current;
                available -= h.source_resistance_ohm * (power / t.supply_v).max(0.0);
            }
            let room = available.max(0.0);
            target = target
                .clamp((-room - emf) / t.winding_resistance_ohm, (room - emf) / t.winding_resistance_ohm);
        }
        target
    }

    fn ambient(&self, state: &State, time_s: f64, rate: &mut State) -> f64 {
        let h = self.hidden;
        if h.recirculation > 0.0 {
            let wanted = h.recirculation * state.get(At::Flow);
            rate.set(At::Returned, (wanted - state.get(At::Returned)) / h.recirculation_time_s);
        }
        let waves: f64 = if h.wave_m_s > 0.0 {
            h.wave_hz
                .iter()
                .zip(&h.wave_phase_rad)
                .map(|(hz, phase)| (TAU * hz * time_s + phase).sin())
                .sum::<f64>()
                / 3.0
        } else {
            0.0
        };
        h.ambient_m_s + h.wave_m_s * waves + state.get(At::Returned)
    }

    fn blades(&self, state: &State, time_s: f64, rate: &mut State) -> BladeForce {
        let (t, h) = (self.thruster, self.hidden);
        let (speed, flow, swirl) = (state.get(At::Speed), state.get(At::Flow), state.get(At::Swirl));
        let arm = 0.7 * t.radius_m;
        let tangential = arm * speed - swirl;
        let relative = tangential.hypot(flow);
        let chords_per_s = relative / if h.chord_m > 0.0 { h.chord_m } else { 0.25 * t.radius_m };

        // Loss of everything at once: cavitation, air.
        let mut whole = 1.0;
        if h.cavitation_loss > 0.0 {
            let sigma = (h.cavitation_speed_m_s / relative.max(1e-6)).powi(2);
            whole -= h.cavitation_loss * (1.0 - sigma).max(0.0);
        }
        if h.air_fraction > 0.0 {
            let gust: f64 = h
                .air_hz
                .iter()
                .enumerate()
                .map(|(index, hz)| (TAU * hz * time_s + 1.7 * index as f64).sin())
                .sum();
            whole *= 1.0 - h.air_fraction * (0.5 + 0.25 * gust);
        }
        let vented = state.get(At::Ventilated);
        if h.ventilation_loss > 0.0 {
            let threshold = h.ventilation_speed_rad_s * (1.0 - 0.3 * vented);
            let wanted = if speed.abs() > threshold { 1.0 } else { 0.0 };
            rate.set(At::Ventilated, (wanted - vented) / if wanted > vented { 0.08 } else { 0.25 });
            whole *= 1.0 - h.ventilation_loss * vented;
        }
        whole *= 1.0 + h.density_error;

        let reverse = if speed < 0.0 { h.reverse_loss } else { (0.0, 0.0) };
        let separation = state.get(At::Separation);
        if h.stall_loss > 0.0 {
            let attack = wrapped_attack(t.pitch_rad, flow, tangential);
            let wanted = 1.0 / (1.0 + (-(attack.abs() - h.stall_angle_rad) / 0.03).exp());
            rate.set(
                At::Separation,
                (wanted - separation) * (chords_per_s / h.stall_chords.max(0.5)).max(0.5),
            );
        }
        let side = tangential.signum();
        let (fast, slow) = (state.get(At::LiftFast), state.get(At::LiftSlow));
        let polar = |attack: f64, lift: f64, drag: f64| {
            let four = 4.0 * attack;
            let mut lift =
                lift * (1.0 - h.stall_loss * separation) * (1.0 - reverse.0) + h.lift_harmonic * four.sin();
            let drag = drag * (1.0 - reverse.1) + h.profile_drag + h.drag_harmonic * (1.0 - four.cos());
            if h.chord_m > 0.0 {
                lift = 0.5 * lift + side * (0.165 * slow + 0.335 * fast);
            }
            (lift * whole, drag * whole)
        };
        let force = t.blade_force(speed, flow, swirl, &polar);

        if h.chord_m > 0.0 {
            let attack = wrapped_attack(t.pitch_rad, flow, tangential);
            let circulation = side * t.lift_max * (2.0 * attack).sin();
            rate.set(At::LiftSlow, 0.0455 * 2.0 * chords_per_s * (circulation - slow));
            rate.set(At::LiftFast, 0.3 * 2.0 * chords_per_s * (circulation - fast));
        }
        if h.swirl > 0.0 {
            let water = t.density_kg_m3 * t.area_m2();
            let damping = water * flow.abs() * swirl / h.swirl;
            rate.set(
                At::Swirl,
                (force.torque_n_m / arm - damping) / (water * t.duct_length_m * h.swirl_inertia),
            );
        }
        if h.cross_flow_m_s > 0.0 {
            let across = h.cross_flow_m_s.powi(2);
            let share = 1.0 - h.cross_flow_loss * across / (flow * flow + across);
            return BladeForce { thrust_n: force.thrust_n * share, ..force };
        }
        force
    }

    fn shaft_drag(&self, state: &State, motor: f64, time_s: f64) -> f64 {
        let (h, scale) = (self.hidden, self.scale);
        let (speed, flow, angle) = (state.get(At::Speed), state.get(At::Flow), state.get(At::Angle));
        let relative = speed / scale.speed_rad_s;
        let sign = (speed / (0.004 * scale.speed_rad_s)).tanh();
        let mut drag = h.viscous_nm_s * speed + h.windage_nm_s2 * speed * speed.abs();
        if h.coulomb_nm > 0.0 {
            let rise = (h.stribeck_ratio - 1.0) * (-(speed / h.stribeck_speed_rad_s).powi(2)).exp();
            drag += h.coulomb_nm * (1.0 + rise) * sign;
        }
        if h.cogging_order > 0.0 {
            drag += (h.cogging_nm + h.ripple_ratio * motor)
                * (h.cogging_order * angle + h.cogging_phase_rad).cos();
        }
        drag + h.unknown_size
            * match h.unknown {
                Unknown::SineLoad => (h.unknown_shape * relative).sin(),
                Unknown::FlowLoad => flow.abs() / scale.flow_m_s * sign,
                Unknown::FadingRub => {
                    sign * (1.0 + (TAU * angle / h.unknown_shape).sin())
                        * (-3.0 * time_s / self.duration_s).exp()
                }
                Unknown::SwitchedLoad => f64::from(time_s > h.unknown_shape * self.duration_s) * sign,
                Unknown::OneWayBrake => (flow / scale.flow_m_s - h.unknown_shape).max(0.0).powi(3) * 8.0,
                Unknown::None | Unknown::CrossThrust | Unknown::FlowStep => 0.0,
            }
    }

    fn unknown_thrust(&self, speed: f64, flow: f64) -> f64 {
        let h = self.hidden;
        let relative = flow / self.scale.flow_m_s;
        h.unknown_size
            * match h.unknown {
                Unknown::CrossThrust => (speed / self.scale.speed_rad_s).powi(2) * relative,
                Unknown::FlowStep => relative.signum() * f64::from(relative.abs() > h.unknown_shape),
                _ => 0.0,
            }
    }

    fn sensors(&self, state: &State, thrust: f64, torque: f64, rate: &mut State) {
        let h = self.hidden;
        let mut force = thrust;
        if h.stand_share > 0.0 {
            let natural = TAU * h.stand_hz;
            let (place, speed) = (state.get(At::Stand), state.get(At::StandRate));
            rate.set(At::Stand, speed);
            rate.set(
                At::StandRate,
                natural * natural * (thrust - place) - 2.0 * h.stand_damping * natural * speed,
            );
            force += h.stand_share * (place - thrust);
        }
        if h.thrust_lag_s > 0.0 {
            let lagged = state.get(At::LaggedThrust);
            rate.set(At::LaggedThrust, (force - lagged) / h.thrust_lag_s);
            force = lagged;
        }
        rate.set(At::FilteredThrust, TAU * self.thrust_filter_hz * (force - state.get(At::FilteredThrust)));
        rate.set(At::FilteredTorque, TAU * self.torque_filter_hz * (torque - state.get(At::FilteredTorque)));
        if h.flow_distance_m > 0.0 {
            let (flow, meter) = (state.get(At::Flow), state.get(At::MeterFlow));
            let carry = flow.abs() + 0.05 * self.scale.flow_m_s;
            rate.set(At::MeterFlow, (flow - meter) * carry / h.flow_distance_m);
        }
    }
}

fn wrapped_attack(pitch: f64, flow: f64, tangential: f64) -> f64 {
    use std::f64::consts::PI;
    (pitch - flow.atan2(tangential) + 0.5 * PI).rem_euclid(PI) - 0.5 * PI
}
