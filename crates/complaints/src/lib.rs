//! Where in a file that was read values are wrong: all that is, at once.

use std::collections::BTreeMap;

use serde::de::DeserializeOwned;
use toml::Value;

/// How like two words are of which one may be the other misspelt, by Jaro and Winkler.
const NEAR: f64 = 0.75;

/// Reads a `T`, or says all that no `T` can take: each as [`complaints`] has it, or the line where this is no TOML.
///
/// # Errors
/// What is wrong; at least one.
pub fn from_toml_with_all<T: DeserializeOwned>(text: &str) -> Result<T, Vec<String>> {
    toml::from_str(text).map_err(|e: toml::de::Error| {
        let tree = toml::from_str(text).map(Value::Table).ok();
        let said = tree.map(complaints::<T>).unwrap_or_default();
        if said.is_empty() { vec![e.to_string().trim_end().to_owned()] } else { said }
    })
}

/// All that a `T` cannot take in this tree: the place (`segments[1].value`), what stands there, what may. What was told is taken
/// out of the tree and the rest read again, so a key that is told as wrong, or as unknown for one that is much like it, is not
/// told as missing too. Of one list of numbers the first is told.
pub fn complaints<T: DeserializeOwned>(tree: Value) -> Vec<String> {
    read_with_all::<T>(tree).1
}

/// The `T` of what is left once all that is wrong is taken out, as [`complaints`] tells it; none where a key that it needs is
/// missing or wrong.
pub fn read_with_all<T: DeserializeOwned>(tree: Value) -> (Option<T>, Vec<String>) {
    let read = as_far_as_it_goes(tree);
    (read.value.filter(|_| read.whole), read.said)
}

/// A file as far as it can be read, and all that cannot be.
pub struct Read<T> {
    /// What is left, with something made up in the place of a key that it needs and that is missing or wrong. Whoever looks on for
    /// what is wrong with its values asks [`Read::in_file`] which of that is true of the file.
    pub value: Option<T>,
    /// All that cannot be read, as [`complaints`] tells it.
    pub said: Vec<String>,
    /// Whether nothing that it needs is missing.
    whole: bool,
    /// Table and key of what is made up.
    made_up: Vec<(String, String)>,
    left: Left,
}

impl<T> Read<T> {
    /// Whether something was made up for a key at the top.
    pub fn made_up(&self, key: &str) -> bool {
        self.made_up.iter().any(|(table, made_up)| table.is_empty() && made_up == key)
    }

    /// Words on a value, `` `segments[1].value` = … `` or `segments[1]: …`, by its place in the file; none if they may be due to
    /// what is made up beside it, or to an entry that was left out.
    pub fn in_file(&self, words: &str) -> Option<String> {
        let quoted = words.strip_prefix('`');
        let rest = quoted.unwrap_or(words);
        let (key, behind) = rest.split_at(rest.find(if quoted.is_some() { '`' } else { ':' }).unwrap_or(0));
        let key = self.left.file_place(key);
        let within = |whole: &str| {
            key == whole || key.strip_prefix(whole).is_some_and(|rest| rest.starts_with(['.', '[']))
        };
        let due = |(table, made_up): &(String, String)| {
            if table.is_empty() { within(made_up) } else { within(table) }
        };
        let (table, last) = key.rsplit_once('.').unwrap_or(("", &key));
        let doubtful = self.made_up.iter().any(due)
            || self.left.entries.contains_key(&key)
            || self.left.told(table, last);
        (!doubtful).then(|| format!("{}{key}{behind}", if quoted.is_some() { "`" } else { "" }))
    }
}

/// A `T` of what is left of a text's tree, and all that is wrong with the rest; the line where this is no TOML.
pub fn text_as_far_as_it_goes<T: DeserializeOwned>(text: &str) -> Read<T> {
    match text.parse() {
        Ok(tree) => as_far_as_it_goes(Value::Table(tree)),
        Err(error) => Read {
            value: None,
            said: vec![error.to_string().trim_end().to_owned()],
            whole: false,
            made_up: Vec::new(),
            left: Left::default(),
        },
    }
}

/// The same of a tree.
pub fn as_far_as_it_goes<T: DeserializeOwned>(mut tree: Value) -> Read<T> {
    let mut said = Vec::new();
    let mut left = Left::default();
    let (mut whole, mut made_up) = (true, Vec::new());
    while let Some(Complaint { path, found, words }) = complaint::<T>(&tree) {
        let place = left.place(&path);
        let missing = missing(&words);
        if !missing.is_some_and(|key| left.told(&place, key)) {
            said.push(told(&place, found.as_ref(), &words));
        }
        whole &= missing.is_none();
        if let Some(key) = missing.filter(|key| filled::<T>(&mut tree, &path, key)) {
            made_up.push((place, key.to_owned()));
            continue;
        }
        // Without a key that it needs a table can say no more.
        if !left.take_out(&mut tree, &path, words.starts_with("unknown field")) {
            break;
        }
    }
    Read { value: tree.try_into().ok(), said, whole, made_up, left }
}

/// The name that a word is a near spelling of; none where it is like no other.
pub fn near<'a>(word: &str, names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let like = names.into_iter().map(|name| (strsim::jaro_winkler(name, word), name));
    like.filter(|(like, _)| *like > NEAR).max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, name)| name)
}

/// The key that these words miss.
fn missing(words: &str) -> Option<&str> {
    words.strip_prefix("missing field `")?.split('`').next()
}

/// Puts something in the place of a key that a table lacks, so that its other keys can be read; false where nothing will do.
fn filled<T: DeserializeOwned>(tree: &mut Value, path: &[Step], key: &str) -> bool {
    let fillers = [
        Value::Integer(1),
        Value::String(String::new()),
        Value::Array(Vec::new()),
        Value::Table(toml::Table::new()),
        Value::Boolean(false),
    ];
    for filler in fillers {
        let Some(Value::Table(table)) = at(tree, path) else { return false };
        table.insert(key.to_owned(), filler);
        let of_it = complaint::<T>(tree).is_some_and(|next| match next.path.strip_prefix(path) {
            Some([Step::Key(first), ..]) => first == key,
            Some([]) => missing(&next.words) == Some(key),
            _ => false,
        });
        if !of_it {
            return true;
        }
    }
    if let Some(Value::Table(table)) = at(tree, path) {
        table.remove(key);
    }
    false
}

/// What is left of a tree once some of it was taken out.
#[derive(Default)]
struct Left {
    /// Entries that are left of a list, by their places in the file.
    entries: BTreeMap<String, Vec<usize>>,
    /// Table and key of what was taken out, and whether the key was none of the table's.
    out: Vec<(String, String, bool)>,
}

impl Left {
    /// A path as it is in the file.
    fn place(&self, path: &[Step]) -> String {
        path.iter().fold(String::new(), |place, step| match step {
            Step::Key(key) if place.is_empty() => key.clone(),
            Step::Key(key) => format!("{place}.{key}"),
            Step::Index(at) => {
                let at = self.entries.get(&place).and_then(|left| left.get(*at)).unwrap_or(at);
                format!("{place}[{at}]")
            }
        })
    }

    /// A place among what is left, `segments[1].value`, as it is in the file.
    fn file_place(&self, place: &str) -> String {
        let mut out = String::new();
        for part in place.split_inclusive(']') {
            let index = part.strip_suffix(']').and_then(|part| part.rsplit_once('['));
            match index.and_then(|(list, at)| Some((list, at.parse::<usize>().ok()?))) {
                Some((list, at)) => {
                    out += list;
                    let at = self.entries.get(&out).and_then(|left| left.get(at)).copied().unwrap_or(at);
                    out += &format!("[{at}]");
                }
                None => out += part,
            }
        }
        out
    }

    /// Whether a table lacks this key since it was taken out, or misspelt it.
    fn told(&self, table: &str, key: &str) -> bool {
        self.out
            .iter()
            .any(|(of, out, unknown)| of == table && (out == key || *unknown && near(out, [key]).is_some()))
    }

    /// Takes out the key at a path, or the entry of a list of tables; false for the whole tree.
    fn take_out(&mut self, tree: &mut Value, path: &[Step], unknown: bool) -> bool {
        let table = |tree: &mut Value, path: &[Step]| at(tree, path).is_some_and(|value| value.is_table());
        let Some(last) = (0..path.len())
            .rev()
            .find(|last| matches!(path[*last], Step::Key(_)) || table(tree, &path[..=*last]))
        else {
            return false;
        };
        let (above, place) = (&path[..last], self.place(&path[..last]));
        match (&path[last], at(tree, above)) {
            (Step::Key(key), Some(Value::Table(table))) => {
                self.out.push((place, key.clone(), unknown));
                table.remove(key).is_some()
            }
            (Step::Index(at), Some(Value::Array(list))) if *at < list.len() => {
                let left = self.entries.entry(place).or_insert_with(|| (0..list.len()).collect());
                left.remove(*at);
                list.remove(*at);
                true
            }
            _ => false,
        }
    }
}

/// What is wrong first: where, what stands there, and the reader's words.
struct Complaint {
    path: Vec<Step>,
    found: Option<Value>,
    words: String,
}

/// The first of what a `T` cannot take.
///
/// The path that `serde_path_to_error` keeps ends at an entry that is told apart by its `kind`. Within
/// that entry the key meant is the one without which the complaint is another; without a `kind` it
/// always is, so that counts only if no other key is to blame.
fn complaint<T: DeserializeOwned>(tree: &Value) -> Option<Complaint> {
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
    Some(Complaint { path, found, words })
}

/// A complaint in words.
fn told(place: &str, found: Option<&Value>, words: &str) -> String {
    let value = match found {
        Some(Value::Table(_) | Value::Array(_)) | None => String::new(),
        Some(value) => format!(" = {value}"),
    };
    let mut words = words.replace("expected f64", "expected a number");
    for whole in ["u8", "u32", "u64", "usize", "i32", "i64"] {
        words = words.replace(&format!("expected {whole}"), "expected a whole number");
    }
    if place.is_empty() { words } else { format!("`{place}`{value}: {words}") }
}

/// A step down the tree.
#[derive(PartialEq)]
enum Step {
    Key(String),
    Index(usize),
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
