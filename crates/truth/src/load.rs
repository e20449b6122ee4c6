//! What else hangs on the shaft of a dry machine: a weight on an arm, a fan, a carriage on an incline.

use std::f64::consts::TAU;

/// Standard gravity, m/s2.
const GRAVITY_M_S2: f64 = 9.806_65;

/// A load, with what its owner has weighed and measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Load {
    /// Nothing.
    None,
    /// A weight on an arm that hangs down at angle zero.
    Arm {
        /// Mass, kg.
        mass_kg: f64,
        /// Shaft to centre of mass, m.
        length_m: f64,
    },
    /// Blades in air: torque against the turning as the square of the speed.
    Fan {
        /// Torque over squared speed, N m s2.
        drag_nm_s2: f64,
    },
    /// A carriage on a screw or belt that lifts while the shaft turns ahead.
    Carriage {
        /// Mass that moves, kg.
        mass_kg: f64,
        /// Way in a turn, m.
        lead_m_rev: f64,
        /// Incline, rad.
        incline_rad: f64,
    },
}

impl Load {
    /// Inertia that it adds to the shaft, kg m2.
    pub fn inertia_kg_m2(&self) -> f64 {
        match *self {
            Load::Arm { mass_kg, length_m } => mass_kg * length_m.powi(2),
            Load::Carriage { mass_kg, lead_m_rev, .. } => mass_kg * (lead_m_rev / TAU).powi(2),
            Load::None | Load::Fan { .. } => 0.0,
        }
    }

    /// Torque that it takes from the shaft, N m.
    pub fn torque_n_m(&self, angle_rad: f64, speed_rad_s: f64) -> f64 {
        match *self {
            Load::None => 0.0,
            Load::Arm { .. } => self.largest_weight_n_m() * angle_rad.sin(),
            Load::Fan { drag_nm_s2 } => drag_nm_s2 * speed_rad_s * speed_rad_s.abs(),
            Load::Carriage { .. } => self.largest_weight_n_m(),
        }
    }

    /// Torque of its weight where that is largest, N m.
    pub fn largest_weight_n_m(&self) -> f64 {
        match *self {
            Load::Arm { mass_kg, length_m } => mass_kg * GRAVITY_M_S2 * length_m,
            Load::Carriage { mass_kg, lead_m_rev, incline_rad } => {
                mass_kg * GRAVITY_M_S2 * incline_rad.sin() * lead_m_rev / TAU
            }
            Load::None | Load::Fan { .. } => 0.0,
        }
    }

    /// Whether the shaft swings about a place of rest instead of turning round and round.
    pub fn swings(&self) -> bool {
        matches!(self, Load::Arm { .. })
    }

    /// The load with its mass (of a fan: its drag) scaled.
    pub fn scaled(self, factor: f64) -> Load {
        match self {
            Load::None => Load::None,
            Load::Arm { mass_kg, length_m } => Load::Arm { mass_kg: factor * mass_kg, length_m },
            Load::Fan { drag_nm_s2 } => Load::Fan { drag_nm_s2: factor * drag_nm_s2 },
            Load::Carriage { mass_kg, lead_m_rev, incline_rad } => {
                Load::Carriage { mass_kg: factor * mass_kg, lead_m_rev, incline_rad }
            }
        }
    }
}
