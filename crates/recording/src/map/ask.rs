//! What a map cannot know and only the user can say: which motor, how many pole pairs. `{name}` in a source stands for
//! it, `{name+1}` for the number after it.

use std::collections::BTreeMap;

use serde::Deserialize;

use super::read::Wrong;
use super::{MapError, fail};

/// One thing asked for.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Ask {
    /// In words.
    meaning: String,
    /// Taken where the user says nothing; without it the user must say it.
    default: Option<String>,
    /// A usual value, to check the map with and to show.
    example: Option<String>,
}

/// What stands behind the colon of `NAME:…`.
pub(super) struct Asked(Vec<(Option<String>, String)>);

impl Asked {
    pub fn parse(text: &str) -> Self {
        if text.is_empty() {
            return Self(Vec::new());
        }
        if !text.contains('=') {
            return Self(vec![(None, text.into())]);
        }
        let one = |part: &str| match part.split_once('=') {
            Some((key, value)) => (Some(key.trim().to_string()), value.trim().to_string()),
            None => (None, part.trim().to_string()),
        };
        Self(text.split(',').map(one).collect())
    }

    /// A value without a name: the run of a file that holds several.
    pub fn run(&self) -> Option<&str> {
        self.0.iter().find(|(key, _)| key.is_none()).map(|(_, value)| value.as_str())
    }
}

/// Names with their values.
pub(super) struct Given {
    values: BTreeMap<String, String>,
    /// Those that have what another was given, with that one.
    follow: BTreeMap<String, String>,
}

impl Given {
    /// From what the map asks and the user says; without a user the examples stand.
    pub fn new(map: &str, asks: &BTreeMap<String, Ask>, said: Option<&Asked>, wrong: &mut Wrong) -> Self {
        let list = |wanted: &dyn Fn(&Ask) -> bool| {
            let of = |(key, ask): (&String, &Ask)| {
                wanted(ask).then(|| {
                    format!("{key}={}", ask.example.as_deref().or(ask.default.as_deref()).unwrap_or("…"))
                })
            };
            asks.iter().filter_map(of).collect::<Vec<_>>().join(",")
        };
        let pairs: Vec<(&str, &str)> = said
            .iter()
            .flat_map(|said| &said.0)
            .filter_map(|(key, value)| Some((key.as_deref()?, value.as_str())))
            .collect();
        for (key, _) in pairs.iter().filter(|(key, _)| !asks.contains_key(*key)) {
            let known: Vec<&str> = asks.keys().map(String::as_str).collect();
            let known = if known.is_empty() { "nothing".into() } else { known.join(", ") };
            wrong.say(fail(
                map,
                format!("`{key}` is nothing that the map asks for; it asks for: {known}"),
                "correct what follows the colon of --columns",
            ));
        }
        let value = |key: &String, ask: &Ask| {
            let stated = pairs.iter().find(|(name, _)| name == key).map(|(_, value)| *value);
            let spare = if said.is_none() { ask.example.as_deref() } else { None };
            stated.or(ask.default.as_deref()).or(spare).map(str::to_owned).ok_or_else(|| match said {
                Some(_) => fail(
                    map,
                    format!("`{key}` is not given: {}", ask.meaning),
                    &format!("--columns {map}:{}", list(&|ask| ask.default.is_none())),
                ),
                None => fail(
                    map,
                    format!("`ask.{key}`: neither `default` nor `example` is given"),
                    "an example lets the map be checked",
                ),
            })
        };
        // What is lacking was told: with a number in its place all else can be read.
        let given = asks.iter().map(|(key, ask)| {
            let value = wrong.take(value(key, ask)).unwrap_or_else(|| "1".into());
            (key.clone(), value)
        });
        let mut all = Self { values: given.collect(), follow: BTreeMap::new() };
        all.follow(map, wrong);
        all
    }

    /// Gives a key whose default is another key, `place = { default = "{joint}" }`, what that one was given.
    fn follow(&mut self, map: &str, wrong: &mut Wrong) {
        for (key, value) in self.values.clone() {
            let Some(other) = value.strip_prefix('{').and_then(|rest| rest.strip_suffix('}')) else {
                continue;
            };
            match self.values.get(other).filter(|leader| !leader.starts_with('{')).cloned() {
                Some(leader) => {
                    self.values.insert(key.clone(), leader);
                    self.follow.insert(key, other.to_owned());
                }
                None => wrong.say(fail(
                    map,
                    format!("`ask.{key}.default` = \"{value}\" is outside what is allowed: a text, or the name of another thing asked for in braces"),
                    "[ask] lists what the user is asked for",
                )),
            }
        }
    }

    /// Keys that have what another was given, with that one.
    pub fn following(&self) -> impl Iterator<Item = (&str, &str)> {
        self.follow.iter().map(|(key, other)| (key.as_str(), other.as_str()))
    }

    /// A text with what is given in the place of `{name}` and `{name+1}`.
    pub fn fill(&self, map: &str, text: &str) -> Result<String, MapError> {
        let mut out = String::new();
        let mut rest = text;
        while let Some((before, after)) = rest.split_once('{') {
            out.push_str(before);
            let Some((inside, behind)) = after.split_once('}') else {
                return Err(fail(
                    map,
                    format!("\"{text}\": `{{` without `}}`"),
                    "{name} stands for what is asked for",
                ));
            };
            let (key, plus) = match inside.split_once('+') {
                Some((key, plus)) => (key, plus.trim().parse::<u64>().ok()),
                None => (inside, Some(0)),
            };
            let value = self.values.get(key.trim());
            let filled = match (value, plus) {
                (Some(value), Some(0)) => Some(value.clone()),
                (Some(value), Some(plus)) => value
                    .parse::<u64>()
                    .ok()
                    .and_then(|number| number.checked_add(plus))
                    .map(|sum| sum.to_string()),
                _ => None,
            };
            let Some(filled) = filled else {
                let words = match value {
                    Some(value) => format!("\"{text}\" needs a whole number for `{key}`; found: \"{value}\""),
                    None => format!("\"{text}\": the map does not ask for `{key}`"),
                };
                return Err(fail(map, words, "[ask] lists what the user is asked for"));
            };
            out.push_str(&filled);
            rest = behind;
        }
        out.push_str(rest);
        Ok(out)
    }

    /// What the map asks for without a default, and the value is that of its example: key and meaning.
    pub fn examples(&self, asks: &BTreeMap<String, Ask>) -> Vec<(String, String)> {
        let is_example = |(key, ask): &(&String, &Ask)| {
            ask.default.is_none() && ask.example.as_ref() == self.values.get(*key)
        };
        asks.iter().filter(is_example).map(|(key, ask)| (key.clone(), ask.meaning.clone())).collect()
    }

    /// What was given, without what follows from it.
    pub fn into_pairs(self) -> Vec<(String, String)> {
        self.values.into_iter().filter(|(key, _)| !self.follow.contains_key(key)).collect()
    }
}
