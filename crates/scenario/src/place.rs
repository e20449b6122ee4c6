//! Where in a file that was read a value is wrong.

use std::fmt::Display;

use serde::de::DeserializeOwned;
use toml::Value;

/// Reads a `T`; the error is the line where this is no TOML, or what [`complaint`] says.
pub fn from_toml<T: DeserializeOwned>(text: &str) -> Result<T, String> {
    toml::from_str(text).map_err(|e: toml::de::Error| {
        let tree = toml::from_str(text).map(Value::Table).ok();
        tree.as_ref().and_then(complaint::<T>).unwrap_or_else(|| e.to_string().trim_end().to_owned())
    })
}

/// The place and the words of what a `T` cannot take in this tree: `segments[1].value`, what
/// stands there, what may.
///
/// The path that `serde_path_to_error` keeps ends at an entry that is told apart by its `kind`. Within
/// that entry the key meant is the one without which the complaint is another; without a `kind` it
/// always is, so that counts only if no other key is to blame.
pub fn complaint<T: DeserializeOwned>(tree: &Value) -> Option<String> {
    let (mut path, words) = refused::<T>(tree)?;
    let mut found = at(&mut tree.clone(), &path).cloned();
    while let Some(Value::Table(entry)) = &found {
        let to_blame = |key: &str| {
            let mut without = tree.clone();
            if let Some(Value::Table(entry)) = at(&mut without, &path) {
                entry.remove(key);
            }
            refused::<T>(&without).is_none_or(|(_, other)| other != words)
        };
        let blamed = entry.iter().filter(|(key, _)| to_blame(key)).min_by_key(|(key, _)| *key == "kind");
        // A key that is missing is not there to be blamed.
        let Some((key, value)) = blamed.filter(|_| !words.starts_with("missing field")) else { break };
        path.push(Step::Key(key.clone()));
        found = Some(value.clone());
    }
    let place: String = path.iter().map(ToString::to_string).collect();
    let place = place.trim_start_matches('.');
    let value = match found {
        Some(Value::Table(_) | Value::Array(_)) | None => String::new(),
        Some(value) => format!(" = {value}"),
    };
    let words = words
        .replace("expected f64", "expected a number")
        .replace("expected u64", "expected a whole number")
        .replace("expected u32", "expected a whole number");
    Some(if place.is_empty() { words } else { format!("`{place}`{value}: {words}") })
}

/// A step down the tree.
enum Step {
    Key(String),
    Index(usize),
}

impl Display for Step {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Step::Key(key) => write!(f, ".{key}"),
            Step::Index(index) => write!(f, "[{index}]"),
        }
    }
}

/// Path and words of the refusal; `None` if the tree can be read.
fn refused<T: DeserializeOwned>(tree: &Value) -> Option<(Vec<Step>, String)> {
    use serde_path_to_error::Segment;
    let error = serde_path_to_error::deserialize::<_, T>(tree.clone()).err()?;
    let path = error.path().iter().filter_map(|step| match step {
        Segment::Map { key } | Segment::Enum { variant: key } => Some(Step::Key(key.clone())),
        Segment::Seq { index } => Some(Step::Index(*index)),
        Segment::Unknown => None,
    });
    let path = path.collect();
    Some((path, error.into_inner().message().to_owned()))
}

fn at<'a>(tree: &'a mut Value, path: &[Step]) -> Option<&'a mut Value> {
    path.iter().try_fold(tree, |value, step| match step {
        Step::Key(key) => value.get_mut(key),
        Step::Index(index) => value.get_mut(index),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scenario;

    #[test]
    fn the_key_meant_is_named_down_to_its_entry() {
        let head = "[[segments]]\nkind = \"hold\"\nvalue = 0\nduration_s = 1\n";
        for (more, words) in [
            (
                "[[segments]]\nkind = \"hold\"\nvalue = \"big\"\nduration_s = 1",
                "`segments[1].value` = \"big\": invalid type: string \"big\", expected a number",
            ),
            (
                "[[segments]]\nkind = \"hold\"\nvalue = 1\nduration = 1",
                "`segments[1].duration` = 1: unknown field `duration`, expected `value` or `duration_s`",
            ),
            (
                "[[segments]]\nkind = \"steps\"\neach_s = 1\nvalues = [1, true]",
                "`segments[1].values`: invalid type: boolean `true`, expected a number",
            ),
            ("[[segments]]\nkind = \"hold\"\nvalue = 1", "`segments[1]`: missing field `duration_s`"),
            (
                "[turbulence]\nsigma_m_s = \"x\"\ntime_constant_s = 1",
                "`turbulence.sigma_m_s` = \"x\": invalid type: string \"x\", expected a number",
            ),
            (
                "[[effects]]\neffect = \"coulomb_friction\"\nparameters = { a = [] }",
                "`effects[0].parameters.a`: invalid type: sequence, expected a number",
            ),
        ] {
            assert_eq!(from_toml::<Scenario>(&format!("{head}{more}\n")).unwrap_err(), words);
        }
        let said = from_toml::<Scenario>(&head.replace("[[segments]]", "[[segments")).unwrap_err();
        assert!(said.contains("line 1"), "{said}");
        assert!(
            from_toml::<Scenario>(&format!("seed = -1\n{head}")).unwrap_err().starts_with("`seed` = -1: ")
        );
    }
}
