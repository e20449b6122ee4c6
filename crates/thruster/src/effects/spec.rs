//! What an effect is given to go by: the sizes of a rig in use, and its parameters with bounds and priors.

/// Unit of what is in that of the command: what a rig's drive is told, A, V or rad/s (of a duty, the volts that it makes of the
/// supply).
pub const OF_THE_COMMAND: &str = "of the command";

/// Sizes of a rig in use, from which an effect takes the scale of its parameters.
#[derive(Clone, Copy, Debug)]
pub struct Scale {
    /// Largest shaft speed seen, rad/s.
    pub shaft_speed_rad_s: f64,
    /// Largest motor torque, N m.
    pub torque_n_m: f64,
    /// Largest thrust, N.
    pub thrust_n: f64,
    /// Largest axial flow, m/s.
    pub flow_m_s: f64,
    /// Largest current, A.
    pub current_a: f64,
    /// Largest command, in the unit of the command.
    pub command: f64,
    /// Nominal supply, V (zero if not stated).
    pub supply_v: f64,
    /// Stated limit of the current, A (infinite if not stated).
    pub current_limit_a: f64,
    /// Stated winding resistance, ohm (zero if not stated).
    pub winding_resistance_ohm: f64,
    /// Stated inertia, kg m^2.
    pub inertia_kg_m2: f64,
    /// Control period, s.
    pub tick_s: f64,
    /// Length of the recording, s.
    pub duration_s: f64,
    /// First and last instant of the recordings on their own clocks, s: a log need not begin at zero.
    pub clock_s: [f64; 2],
    /// Whether the shaft angle was recorded, or counted from a recorded speed, so that what follows it can be kept in phase.
    pub angle_known: bool,
    /// Way of the shaft's known angle between its furthest ends, rad; infinite where none is known.
    pub turned_rad: f64,
    /// Least and greatest shaft angle of all recordings, rad; nothing where it is not known.
    pub angle_rad: [f64; 2],
    /// Whether command or shaft speed ever went astern.
    pub reverses: bool,
}

impl Scale {
    /// What a quantity with this largest size ranges over: both ways, or ahead alone where the shaft never went astern.
    pub fn both_ways(&self, size: f64) -> [f64; 2] {
        [if self.reverses { -size } else { 0.0 }, size]
    }

    /// A rig of no size: names and units of parameters do not depend on it.
    pub const ANY: Self = Self {
        shaft_speed_rad_s: 1.0,
        torque_n_m: 1.0,
        thrust_n: 1.0,
        flow_m_s: 1.0,
        current_a: 1.0,
        command: 1.0,
        supply_v: 1.0,
        current_limit_a: 1.0,
        winding_resistance_ohm: 1.0,
        inertia_kg_m2: 1.0,
        tick_s: 0.002,
        duration_s: 1.0,
        clock_s: [0.0, 1.0],
        angle_known: true,
        turned_rad: f64::INFINITY,
        angle_rad: [0.0; 2],
        reverses: true,
    };
}

/// One parameter of an effect.
///
/// Its prior is normal, cut off at the bounds, and wide: one rule for all. A strength's mean is zero and its
/// sigma the size that the effect commonly has where it is present (docs/theory.md names the sources; the
/// ranges are those of machines of the same kind, no recording's), so that three sigma hold the largest a
/// sound machine shows. A shape's mean is its usual value and two sigma reach the ends of what is plausible.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spec {
    /// Name, unit last.
    pub name: &'static str,
    /// Unit for reports.
    pub unit: &'static str,
    /// Where a fit starts: a value at which the effect is small but visible.
    pub start: f64,
    /// Smallest allowed value.
    pub low: f64,
    /// Largest allowed value.
    pub high: f64,
    /// A shape parameter does nothing alone; the effect vanishes when all its strength
    /// parameters are zero.
    pub shape: bool,
    /// Not to be fitted: a whole number or a grid. The starts try its values, a fit holds them.
    pub held: bool,
    /// For a strength that acts only for a while: when.
    pub acts: Option<Stretch>,
    /// Prior mean: zero of a strength, the usual value of a shape.
    pub mean: f64,
    /// Prior standard deviation, in the unit of the value.
    pub sigma: f64,
}

/// A stretch of time that comes again after a period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// Its beginning, s.
    pub from_s: f64,
    /// Its length, s.
    pub length_s: f64,
    /// Time to its next beginning, s.
    pub period_s: f64,
}

impl Spec {
    /// A strength: the effect vanishes at zero. Where no [`Spec::sigma`] is said, a third of its reach.
    pub const fn strength(name: &'static str, unit: &'static str, start: f64, low: f64, high: f64) -> Self {
        let reach = if -low > high { -low } else { high };
        let (mean, sigma) = (0.0, reach / 3.0);
        Self { name, unit, start, low, high, shape: false, held: false, acts: None, mean, sigma }
    }

    /// A shape: where, how fast, how sharp. Its usual value is its start; where no [`Spec::sigma`] is said, a
    /// quarter of its range.
    pub const fn shape(name: &'static str, unit: &'static str, start: f64, low: f64, high: f64) -> Self {
        let (mean, sigma) = (start, 0.25 * (high - low));
        Self { name, unit, start, low, high, shape: true, held: false, acts: None, mean, sigma }
    }

    /// A shape that a fit holds at its start.
    pub const fn held(name: &'static str, unit: &'static str, start: f64, low: f64, high: f64) -> Self {
        Self { held: true, ..Self::shape(name, unit, start, low, high) }
    }

    /// A strength that is there (1) or not (0) and is never fitted.
    pub const fn switch(name: &'static str) -> Self {
        Self { held: true, mean: 1.0, ..Self::strength(name, "1", 1.0, 0.0, 1.0) }
    }

    /// What is taken for a quantity that the rig does not state, and never fitted; zero where the rig states it.
    pub const fn taken(name: &'static str, unit: &'static str, value: f64) -> Self {
        Self { held: true, mean: value, ..Self::strength(name, unit, value, 0.0, f64::INFINITY) }
    }

    /// Another prior standard deviation.
    pub const fn sigma(self, sigma: f64) -> Self {
        Self { sigma, ..self }
    }

    /// Another prior mean and standard deviation.
    pub const fn prior(self, mean: f64, sigma: f64) -> Self {
        Self { mean, sigma, ..self }
    }
}
