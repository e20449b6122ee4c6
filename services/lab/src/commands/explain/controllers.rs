//! The laws, observers and estimators of `kort explain`, in the words of their own files.

use kort_control::About;
use kort_control::about::ALL;
use serde::Serialize;

/// One of them as it is printed.
#[derive(Serialize)]
pub struct Entry {
    name: &'static str,
    kind: &'static str,
    what: &'static str,
    text: String,
}

impl Entry {
    /// In full.
    pub fn of(about: About) -> Self {
        Self { name: about.name, kind: about.kind, what: about.title(), text: about.text() }
    }

    /// Every one.
    pub fn all() -> Vec<Self> {
        ALL.iter().copied().map(Self::of).collect()
    }

    /// For a terminal.
    pub fn in_full(&self) -> String {
        format!("{} ({})\n\n{}\n", self.name, self.kind, self.text.trim_end())
    }
}

/// A line each.
pub fn table() -> String {
    let wide = ALL.iter().map(|a| a.name.len()).max().unwrap_or(0);
    let line = |a: &About| format!("{:wide$}  {:9}  {}\n", a.name, a.kind, a.title());
    let lines: String = ALL.iter().map(line).collect();
    format!("{} laws, observers and estimators that `kort soak` compares\n\n{lines}", ALL.len())
}
