//! A truth for the blind proof. It shares no equation code with the models that kort fits; only
//! `kort prove` and tests may use it.
//!
//! [`case`] builds recordings, the rig file stated for them, and the sealed answer:
//!
//! 1. a machine is drawn ([`machines`]): a thruster of some size, or a dry shaft, perhaps with a load that
//!    the rig states ([`load`]);
//! 2. an excitation ([`excitation`]), perhaps inside a closed loop ([`controller`]);
//! 3. what is hidden: effects, each from a family of forms ([`families`]), or terms of a random
//!    grammar that no catalogue holds ([`grammar`]);
//! 4. each is given a size as a share of full scale ([`sizing`]);
//! 5. the machine runs ([`run`]) with noise of several kinds ([`noises`]) and is logged ([`log`]);
//! 6. the rig is stated, wrong by a few percent to a factor of two, with honest tolerances ([`statement`]).
//!
//! The same kind, seed and selection give the same bytes.

mod answer;
pub mod blades;
mod case;
mod confounded;
pub mod controller;
pub mod dice;
pub mod excitation;
pub mod families;
pub mod grammar;
pub mod load;
pub mod log;
pub mod machine;
pub mod machines;
mod memory;
pub mod noises;
pub mod physics;
mod plan;
mod refit;
pub mod run;
pub mod sensors;
pub mod sizing;
pub mod statement;

pub use answer::{Answer, CaseKind, HiddenEffect, Nuisance};
pub use case::{Case, case};
pub use plan::{MachineKind, Selection};

/// Seeds below this are for tuning; what is reported uses seeds from here on.
pub const REPORTING_SEED: u64 = 1_000_000;
