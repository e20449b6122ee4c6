//! All that is wrong with a section: a reader goes on where it can.

use kort_proto::config::{Config, ConfigError};

/// What is wrong so far, each beginning with its key, behind the section's name.
#[derive(Debug, Default)]
pub(crate) struct Wrong(Vec<String>);

impl Wrong {
    /// What was read, or else what is wrong is kept.
    pub(crate) fn of<T>(&mut self, read: Result<T, String>) -> Option<T> {
        read.map_err(|words| self.0.push(words)).ok()
    }

    /// Keeps more.
    pub(crate) fn say(&mut self, words: impl Into<String>) {
        self.0.push(words.into());
    }

    /// Keeps all of these.
    pub(crate) fn all(&mut self, words: Vec<String>) {
        self.0.extend(words);
    }

    /// Whether nothing is.
    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The same as errors of a section.
    pub(crate) fn of_section(self, config: &Config, section: &str) -> Vec<ConfigError> {
        self.0.into_iter().map(|words| config.error(format!("`{section}.{words}"))).collect()
    }
}
