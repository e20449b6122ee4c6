//! The sealed answer of a case.

use serde::Serialize;

/// What a case hides.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CaseKind {
    /// One effect.
    Single,
    /// Nothing.
    Clean,
    /// Two effects.
    Pair,
    /// Three to six effects.
    Several,
    /// One effect under an excitation that cannot part it from its rivals.
    Confounded,
    /// Physics outside the catalogue.
    Outside,
}

impl CaseKind {
    /// All kinds.
    pub const ALL: [CaseKind; 6] = [
        CaseKind::Single,
        CaseKind::Clean,
        CaseKind::Pair,
        CaseKind::Several,
        CaseKind::Confounded,
        CaseKind::Outside,
    ];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            CaseKind::Single => "single",
            CaseKind::Clean => "clean",
            CaseKind::Pair => "pair",
            CaseKind::Several => "several",
            CaseKind::Confounded => "confounded",
            CaseKind::Outside => "outside",
        }
    }
}

/// One hidden effect.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HiddenEffect {
    /// Catalogue id; no catalogue id for physics outside it.
    pub effect: String,
    /// The form it takes, in words, or the expression of a term outside the catalogue.
    pub form: String,
    /// Ids that name the same physics.
    pub same_physics: Vec<&'static str>,
    /// Sets of ids that together do the same.
    pub same_sets: Vec<Vec<&'static str>>,
    /// Path on which it acts.
    pub path: &'static str,
    /// Share of full scale that was wanted.
    pub wanted: f64,
    /// Root-mean-square change on its best channel over full scale, as made.
    pub share_of_full_scale: f64,
    /// That channel.
    pub channel: &'static str,
    /// What a re-fit of the stated quantities within tolerances leaves of it.
    pub visible_after_refit: f64,
}

/// Noise of a kind that a name could be given.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Nuisance {
    /// Kind of noise.
    pub noise: &'static str,
    /// Ids that name it rightly, should it be found.
    pub names: Vec<&'static str>,
}

/// The sealed answer.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Answer {
    /// What the case hides.
    pub kind: CaseKind,
    /// Seed of the case.
    pub seed: u64,
    /// Machine class.
    pub class: &'static str,
    /// There is no water.
    pub dry: bool,
    /// Blade sections of the truth.
    pub sections: usize,
    /// Excitation.
    pub excitation: String,
    /// Loop that was closed around it, if any.
    pub closed_loop: Option<&'static str>,
    /// Stamps of the log.
    pub stamps: String,
    /// Kinds of noise, and what they may be called.
    pub noises: Vec<Nuisance>,
    /// Hidden effects.
    pub effects: Vec<HiddenEffect>,
    /// Ids that this excitation cannot part, the hidden one among them.
    pub confounded: Vec<&'static str>,
}

impl Answer {
    /// Short name for folders.
    pub fn label(&self) -> String {
        let ids: Vec<&str> = self.effects.iter().map(|effect| effect.effect.as_str()).collect();
        if ids.is_empty() { "none".to_owned() } else { ids.join("+") }
    }
}
