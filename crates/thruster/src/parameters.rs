//! The plant's parameters: name, unit, meaning. Values live in rig descriptions, never here.

use serde::{Deserialize, Serialize};

use crate::real::Real;
use crate::rig::{Quantity, Rig};

/// One parameter of the plant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Parameter {
    /// Radius of the duct, m.
    RadiusM,
    /// Length of the duct, m.
    DuctLengthM,
    /// Pitch angle at 0.7 radius, rad.
    PitchRad,
    /// `CLmax` of equation (17).
    LiftMax,
    /// `CDmax` of equation (17).
    DragMax,
    /// Density of the water, kg/m^3.
    DensityKgM3,
    /// Flux coefficient `dbeta` of equation (6).
    FluxCoefficient,
    /// Added-mass coefficient `gamma` of equation (2).
    AddedMassCoefficient,
    /// Inertia of everything that turns, kg m^2.
    InertiaKgM2,
    /// Torque constant, N m/A; the back-EMF constant has the same number in V s.
    TorqueConstantNmA,
    /// Winding resistance, ohm.
    WindingResistanceOhm,
    /// Viscous friction of the shaft, N m s.
    ViscousFrictionNmS,
    /// First-order lag of the drive, s.
    TimeConstantS,
    /// Largest current of the drive, A; infinite where none is stated.
    CurrentLimitA,
    /// First-order filter of the measured shaft speed, s.
    SpeedFilterTimeConstantS,
    /// `C0` of Model 0: thrust over shaft speed squared, N s^2.
    ThrustCoefficientNS2,
    /// `C1` of Model 0: torque over shaft speed squared, N m s^2.
    TorqueCoefficientNmS2,
    /// `eta` of Model 1.
    Efficiency,
    /// Swirl flux coefficient `dbr` of the rotational-flow model.
    SwirlFluxCoefficient,
    /// Swirl added-mass coefficient `gr` of the rotational-flow model.
    SwirlMassCoefficient,
    /// Mass that hangs on the shaft, kg: the pendulum's weight, what a slide moves.
    LoadMassKg,
    /// Shaft to the pendulum's centre of mass, m.
    LoadLengthM,
    /// Inertia of the load's side of two masses, kg m^2.
    LoadInertiaKgM2,
    /// Torque over twist between two masses, N m/rad.
    LoadStiffnessNmRad,
    /// Torque over rate of twist between two masses, N m s.
    LoadDampingNmS,
    /// Torque of a fan over the square of shaft speed, N m s^2.
    FanCoefficientNmS2,
}

use Parameter as P;

impl Parameter {
    /// Every parameter, in the order of storage.
    pub const ALL: [P; 26] = [
        P::RadiusM,
        P::DuctLengthM,
        P::PitchRad,
        P::LiftMax,
        P::DragMax,
        P::DensityKgM3,
        P::FluxCoefficient,
        P::AddedMassCoefficient,
        P::InertiaKgM2,
        P::TorqueConstantNmA,
        P::WindingResistanceOhm,
        P::ViscousFrictionNmS,
        P::TimeConstantS,
        P::CurrentLimitA,
        P::SpeedFilterTimeConstantS,
        P::ThrustCoefficientNS2,
        P::TorqueCoefficientNmS2,
        P::Efficiency,
        P::SwirlFluxCoefficient,
        P::SwirlMassCoefficient,
        P::LoadMassKg,
        P::LoadLengthM,
        P::LoadInertiaKgM2,
        P::LoadStiffnessNmRad,
        P::LoadDampingNmS,
        P::FanCoefficientNmS2,
    ];

    /// Name as in the rig description where it stands there, unit last.
    pub const fn name(self) -> &'static str {
        match self {
            P::RadiusM => "radius_m",
            P::DuctLengthM => "duct_length_m",
            P::PitchRad => "pitch_rad",
            P::LiftMax => "lift_max",
            P::DragMax => "drag_max",
            P::DensityKgM3 => "density_kg_m3",
            P::FluxCoefficient => "flux_coefficient",
            P::AddedMassCoefficient => "added_mass_coefficient",
            P::InertiaKgM2 => "inertia_kg_m2",
            P::TorqueConstantNmA => "torque_constant_nm_a",
            P::WindingResistanceOhm => "winding_resistance_ohm",
            P::ViscousFrictionNmS => "viscous_friction_nm_s",
            P::TimeConstantS => "time_constant_s",
            P::CurrentLimitA => "current_limit_a",
            P::SpeedFilterTimeConstantS => "speed_filter_time_constant_s",
            P::ThrustCoefficientNS2 => "thrust_coefficient_n_s2",
            P::TorqueCoefficientNmS2 => "torque_coefficient_nm_s2",
            P::Efficiency => "efficiency",
            P::SwirlFluxCoefficient => "swirl_flux_coefficient",
            P::SwirlMassCoefficient => "swirl_mass_coefficient",
            P::LoadMassKg => "load_mass_kg",
            P::LoadLengthM => "load_length_m",
            P::LoadInertiaKgM2 => "load_inertia_kg_m2",
            P::LoadStiffnessNmRad => "load_stiffness_nm_rad",
            P::LoadDampingNmS => "load_damping_nm_s",
            P::FanCoefficientNmS2 => "fan_coefficient_nm_s2",
        }
    }

    /// Unit for reports.
    pub const fn unit(self) -> &'static str {
        match self {
            P::RadiusM | P::DuctLengthM | P::LoadLengthM => "m",
            P::LoadMassKg => "kg",
            P::LoadInertiaKgM2 => "kg m^2",
            P::LoadStiffnessNmRad => "N m/rad",
            P::LoadDampingNmS => "N m s",
            P::FanCoefficientNmS2 => "N m s^2",
            P::PitchRad => "rad",
            P::DensityKgM3 => "kg/m^3",
            P::InertiaKgM2 => "kg m^2",
            P::TorqueConstantNmA => "N m/A",
            P::WindingResistanceOhm => "ohm",
            P::ViscousFrictionNmS => "N m s",
            P::TimeConstantS | P::SpeedFilterTimeConstantS => "s",
            P::CurrentLimitA => "A",
            P::ThrustCoefficientNS2 => "N s^2",
            P::TorqueCoefficientNmS2 => "N m s^2",
            _ => "1",
        }
    }

    /// May a fit drive this parameter to the edge of what is physical (a symptom, not a value)?
    pub const fn positive(self) -> bool {
        !matches!(self, P::ViscousFrictionNmS | P::LoadDampingNmS)
    }
}

/// Values of all parameters, SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters<T = f64>([T; P::ALL.len()]);

impl Parameters {
    /// The stated values of a rig. `C0`, `C1` and `eta`, which a rig description does not hold,
    /// are those at which the steady state of Model 2 gives the same thrust and torque.
    pub fn stated(rig: &Rig) -> Self {
        let mut p = Self([0.0; P::ALL.len()]);
        for parameter in P::ALL {
            p.set(parameter, Self::quantity(rig, parameter).map_or(0.0, |q| q.value));
        }
        p.set(P::SwirlFluxCoefficient, 1.0);
        p.set(P::SwirlMassCoefficient, 0.5);
        if rig.propeller.is_some() {
            let (thrust, torque) = p.bollard_coefficients();
            p.set(P::ThrustCoefficientNS2, thrust);
            p.set(P::TorqueCoefficientNmS2, torque);
            // (7): T = rho a r^2 eta^2 tan^2(p) Om^2
            let r = p.get(P::RadiusM);
            let slip = r * p.get(P::PitchRad).tan();
            p.set(
                P::Efficiency,
                (thrust / (p.get(P::DensityKgM3) * p.area_m2() * slip * slip)).max(0.0).sqrt(),
            );
        }
        p
    }

    /// What a rig description states of a parameter.
    pub fn quantity(rig: &Rig, parameter: P) -> Option<Quantity> {
        let propeller = rig.propeller.as_ref();
        match parameter {
            P::RadiusM => propeller.map(|x| x.radius_m),
            P::DuctLengthM => propeller.map(|x| x.duct_length_m),
            P::PitchRad => propeller.map(|x| x.pitch_rad),
            P::LiftMax => propeller.map(|x| x.lift_max),
            P::DragMax => propeller.map(|x| x.drag_max),
            P::DensityKgM3 => Some(rig.flow.density_kg_m3),
            P::FluxCoefficient => propeller.map(|_| rig.flow.flux_coefficient),
            P::AddedMassCoefficient => propeller.map(|_| rig.flow.added_mass_coefficient),
            P::InertiaKgM2 => Some(rig.motor.inertia_kg_m2),
            P::TorqueConstantNmA => Some(rig.motor.torque_constant_nm_a),
            P::WindingResistanceOhm => rig.motor.winding_resistance_ohm,
            P::ViscousFrictionNmS => rig.motor.viscous_friction_nm_s,
            P::TimeConstantS => Some(rig.amplifier.time_constant_s),
            P::CurrentLimitA => {
                Some(Quantity { value: rig.amplifier.current_limit_a, tol: rig.amplifier.current_limit_tol })
            }
            P::SpeedFilterTimeConstantS => rig
                .sensors
                .speed_filter_time_constant_s
                .map(|value| Quantity { value, tol: rig.sensors.speed_filter_tol }),
            P::LoadMassKg
            | P::LoadLengthM
            | P::LoadInertiaKgM2
            | P::LoadStiffnessNmRad
            | P::LoadDampingNmS
            | P::FanCoefficientNmS2 => rig.load.quantity(parameter),
            _ => None,
        }
    }

    /// `T/Om^2` and `Q/Om^2` of Model 2 in bollard pull, from its one steady inflow angle:
    /// `T = dbeta rho a vp^2` solved for the advance `vp/(0.7 r Om)` by bisection.
    pub fn bollard_coefficients(&self) -> (f64, f64) {
        let blade = self.blade();
        let flux = self.get(P::FluxCoefficient) * self.get(P::DensityKgM3) * self.area_m2();
        let lever = blade.lever_m();
        let load = |vp: f64| blade.load(blade.inflow(1.0, vp, 0.0));
        let (mut low, mut high) = (0.0, lever * self.get(P::PitchRad).tan());
        for _ in 0..80 {
            let mid = 0.5 * (low + high);
            if load(mid).thrust_n > flux * mid * mid { low = mid } else { high = mid }
        }
        let steady = load(0.5 * (low + high));
        (steady.thrust_n, steady.torque_n_m)
    }

    /// The blade row with these values.
    pub fn blade(&self) -> crate::blade::Blade {
        crate::blade::Blade {
            radius_m: self.get(P::RadiusM),
            pitch_rad: self.get(P::PitchRad),
            lift_max: self.get(P::LiftMax),
            drag_max: self.get(P::DragMax),
            density_kg_m3: self.get(P::DensityKgM3),
        }
    }
}

impl<T: Real> Parameters<T> {
    /// The same values as other numbers.
    pub fn lift(plain: &Parameters) -> Self {
        Self(plain.0.map(T::from))
    }

    /// Value of one parameter.
    pub fn get(&self, parameter: P) -> T {
        self.0[parameter as usize]
    }

    /// Sets one parameter.
    pub fn set(&mut self, parameter: P, value: T) {
        self.0[parameter as usize] = value;
    }

    /// Disc area, m^2.
    pub fn area_m2(&self) -> T {
        self.get(P::RadiusM).squared() * std::f64::consts::PI
    }

    /// Mass of water in the duct, `rho a l`, kg.
    pub fn duct_mass_kg(&self) -> T {
        self.get(P::DensityKgM3) * self.area_m2() * self.get(P::DuctLengthM)
    }
}
