//! The published models, by name.

use serde::{Deserialize, Serialize};

/// A thruster model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ModelName {
    /// Static map: thrust and torque proportional to shaft speed squared.
    Model0,
    /// Yoerger, Cooke and Slotine 1990: shaft speed driven by torque.
    Model1,
    /// Healey et al. 1995: shaft speed and axial flow, blades with lift and drag.
    Model2,
    /// Whitcomb and Yoerger: Model 2 with the shaft speed as input.
    Model3,
    /// Model 2 with the swirl of the wake as a third state.
    RotationalFlow,
}

impl ModelName {
    /// Every model.
    pub const ALL: [Self; 5] = [Self::Model0, Self::Model1, Self::Model2, Self::Model3, Self::RotationalFlow];

    /// Name as on the command line and in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Model0 => "model0",
            Self::Model1 => "model1",
            Self::Model2 => "model2",
            Self::Model3 => "model3",
            Self::RotationalFlow => "rotational_flow",
        }
    }
}

impl std::fmt::Display for ModelName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl std::str::FromStr for ModelName {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::ALL.into_iter().find(|m| m.name() == text).ok_or_else(|| {
            format!("`{text}` is not a model; known are {}", Self::ALL.map(Self::name).join(", "))
        })
    }
}
