//! Play between motor gear and propeller shaft.

use super::memory::EncoderAhead;
use super::{Context, Descriptor, Effect, Hooks, Path, Scale, Sensing, Spec, geared};
use crate::blade::{Inflow, REFERENCE_RADIUS};
use crate::parameters::Parameter as P;
use crate::plant::{Balance, Drive, Local, Sensed, Tick};
use crate::real::Real;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "gear_backlash",
    path: Path::Drive,
    what: "play in the gear: when torque reverses the motor crosses the gap alone, then strikes the other flank",
    equation: "motor against load: x'' = c/(f (1 - f)) - p, c = (1 - f) Om' - tl/I; the flanks press by p = wc^2 e + 2 z wc x' where x \
               is e beyond a gap b, never pull; motor Om + (1 - f) x', load Om - f x', of which the encoder shows one; b [rad], f \
               motor's share of the inertia I [1], wc = 2 pi fc, fc of the teeth and shafts in contact [Hz], z [1], tl load's \
               torque [N m]",
    signature: "lost motion, then a blow, at each reversal of torque; a limit cycle about zero under a speed loop",
    confused_with: &["coulomb_friction", "transport_delay", "command_dead_band"],
    separated_by: "an encoder on the load side; slow reversals of torque",
    reference: "Nordin & Gutman 2002 (Automatica 38:1633), the physical model: dead zone, spring and damper; flanks that do not \
                pull after Hunt & Crossley 1975; dry friction on the motor's side",
    commonness: 0.7,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[],
    parameters,
    starts,
    needs: geared,
    build: both!(build),
};

/// Play of 0.002 to 0.03 rad at a gear's output is as much more at a motor that turns 10 to 300 times as often; which of
/// the two sides a rig's numbers belong to is the owner's choice. A load much lighter than a fifth of the whole would be
/// stopped by the water within a tick, which steps of a tick do not follow.
fn parameters(_: &Scale) -> Vec<Spec> {
    vec![
        Spec::strength("backlash_rad", "rad", 0.1, 0.0, MOST_RAD).sigma(1.5),
        Spec::shape("motor_inertia_share", "1", 0.4, 0.1, 0.8).sigma(0.2),
        // Small gears and belts: between a soft belt and what a tick cannot follow.
        Spec::shape("contact_frequency_hz", "Hz", 60.0, 15.0, 250.0).sigma(40.0),
        // Flanks come off at four tenths of the speed at which they struck at 0.3, hardly at 1.
        Spec::shape("contact_damping_ratio", "1", 0.5, 0.05, 1.5).sigma(0.3),
        Spec::held("encoder_at_load", "1", 0.0, 0.0, 1.0),
    ]
}

/// Play of 0.03 rad at the output of a gear of 300 to one.
const MOST_RAD: f64 = 9.0;

/// When a blow falls moves with the play, and with it every later one: a fit finds its way from a play nearby only.
fn starts(_: &Scale) -> Vec<Vec<f64>> {
    let plays =
        std::iter::successors(Some(0.002), |play| Some(play * 1.5)).take_while(|play| *play < MOST_RAD);
    let sides = |at_load: f64| move |share: f64| [share, at_load];
    let ways: Vec<[f64; 2]> = [0.0, 1.0].into_iter().flat_map(|at| [0.3, 0.55].map(sides(at))).collect();
    plays.flat_map(|play| ways.iter().map(move |[share, at]| vec![play, *share, 60.0, 0.5, *at])).collect()
}

fn build<T: Real>(values: &[T], context: &Context<T>) -> Box<dyn Effect<T>> {
    let step_s = context.tick_s / PARTS as f64;
    // No stiffer than the steps follow.
    let contact_rad_s = (values[2] * std::f64::consts::TAU).min(T::from(SWING_A_STEP_RAD / step_s));
    Box::new(GearBacklash {
        gap_rad: values[0],
        encoder_at_load: values[4],
        motor_share: values[1],
        contact_rad_s,
        damping_1_s: contact_rad_s * values[3] * 2.0,
        soft: values[0] / (values[0] + RIGID_RAD),
        lever_m: context.parameters.get(P::RadiusM) * REFERENCE_RADIUS,
        torque_constant_nm_a: context.parameters.get(P::TorqueConstantNmA),
        step_s,
        before: None,
        apart_rad: None,
        away_rad_s: T::ZERO,
        relative_rad_s: T::ZERO,
        turned_rad: T::ZERO,
        encoder: EncoderAhead::new(context),
    })
}

/// Steps of the relative motion in a tick.
const PARTS: usize = 4;
/// Largest angle of the contact's swing that one of them takes, rad.
const SWING_A_STEP_RAD: f64 = 0.8;
/// Play beside which what the flanks give counts for half, rad: without play there is nothing left of it, a soft drive
/// train is another effect's.
const RIGID_RAD: f64 = 0.01;

/// The shaft's state is the speed of motor and load together, which what passes between them does not change. Here is
/// how the motor moves against the load.
struct GearBacklash<T> {
    gap_rad: T,
    /// 0 where the encoder sits on the motor, 1 where it sits on the load.
    encoder_at_load: T,
    motor_share: T,
    contact_rad_s: T,
    damping_1_s: T,
    /// Share of what the flanks give that counts.
    soft: T,
    lever_m: T,
    torque_constant_nm_a: T,
    step_s: f64,
    /// Shaft speed and own state at the end of the last tick.
    before: Option<(T, T)>,
    /// Way of the motor from the middle of the gap; none before the first torque, which finds the flank in contact.
    apart_rad: Option<T>,
    /// Its rate.
    away_rad_s: T,
    /// Speed of the motor against the load, ahead positive.
    relative_rad_s: T,
    /// Angle of the motor against the load since the start.
    turned_rad: T,
    encoder: EncoderAhead<T>,
}

impl<T: Real> GearBacklash<T> {
    /// Moves on by a tick in which the motor, let alone, would gain this on the load, rad/s^2.
    fn advance(&mut self, acceleration: T) {
        let half_gap = self.gap_rad * 0.5;
        let Some(mut apart) = self.apart_rad else {
            if acceleration.re() != 0.0 {
                self.apart_rad = Some(half_gap * acceleration.re().signum());
            }
            return;
        };
        let began = self.counts(apart);
        for _ in 0..PARTS {
            let free = self.away_rad_s + acceleration * self.step_s;
            let side = apart.re().signum();
            let beyond = apart.abs() - half_gap;
            self.away_rad_s = if beyond > 0.0 {
                let stiff = self.contact_rad_s.squared() * beyond * side;
                let held = (free - stiff * self.step_s) / (self.damping_1_s * self.step_s + 1.0);
                // Flanks push, they do not pull.
                if (held - free) * side < 0.0 { held } else { free }
            } else {
                free
            };
            apart += self.away_rad_s * self.step_s;
        }
        self.apart_rad = Some(apart);
        self.turned_rad += self.counts(apart) - began;
        self.relative_rad_s =
            if apart.abs() > half_gap { self.away_rad_s * self.soft } else { self.away_rad_s };
    }

    /// The way that counts: within the gap all of it.
    fn counts(&self, apart_rad: T) -> T {
        let half_gap = self.gap_rad * 0.5;
        let within = apart_rad.clamp(-half_gap, half_gap);
        within + (apart_rad - within) * self.soft
    }
}

impl<T: Real> Effect<T> for GearBacklash<T> {
    /// The load's own torque over the whole inertia, summed over time, rad/s.
    fn states(&self) -> usize {
        1
    }

    fn hooks(&self) -> Hooks {
        Hooks { drive: true, inflow: true, balance: true, sense: true, ..Hooks::NONE }
    }

    fn sensing(&self) -> Sensing {
        Sensing::Mounting
    }

    /// The back-EMF is of the motor's own speed.
    fn drive(&mut self, _: &Tick, drive: &mut Drive<T>) {
        drive.back_emf_v += self.torque_constant_nm_a * (T::ONE - self.motor_share) * self.relative_rad_s;
    }

    /// The blades turn with the load.
    fn inflow(&self, _: &Local<T>, _: &[T], inflow: &mut Inflow<T>) {
        inflow.tangential_m_s += self.lever_m * self.motor_share * self.relative_rad_s;
    }

    fn balance(&self, _: &Local<T>, _: &[T], balance: &mut Balance<T>, rates: &mut [T]) {
        rates[0] = (balance.load_torque_n_m - balance.blade_torque_n_m) / balance.inertia_kg_m2;
    }

    fn arrive(&mut self, at: &Local<T>, own: &[T]) {
        let now = (at.shaft_speed_rad_s, own[0]);
        let Some((speed, sum)) = self.before.replace(now) else { return };
        let load_share = T::ONE - self.motor_share;
        let between = load_share * (now.0 - speed) - (now.1 - sum);
        self.advance(between / (self.motor_share * load_share * (self.step_s * PARTS as f64)));
    }

    fn sense(&mut self, _: &Tick, sensed: &mut Sensed<T>) {
        let ahead = T::ONE - self.encoder_at_load - self.motor_share;
        let ahead_rad = ahead * self.turned_rad;
        sensed.shaft_speed_rad_s += self.encoder.step(ahead_rad, ahead * self.relative_rad_s);
        sensed.shaft_angle_rad += ahead_rad;
    }
}
