//! A column map for a log that nobody has mapped yet, from the names and units of its fields. It is shown, never used
//! unasked: a name is a claim, and a person must check it.

use std::collections::BTreeMap;
use std::fmt::Write;

use super::survey::Proposal;
use super::{Field, Log, Topic, shipped, stamps};
use crate::columns;
use crate::map::ColumnMap;
use crate::units::{self, Unit};

/// Fields chosen for a proposed map: (topic, field) and our column.
pub(super) type Chosen = BTreeMap<(usize, usize), &'static str>;

/// One of our columns, and words in a field's name that speak for it, most telling first, and against it: English, and German
/// as the instruments of many test stands write.
struct Rule {
    column: &'static str,
    words: &'static [&'static str],
    without: &'static [&'static str],
}

pub(super) const ASKED: &[&str] = &[
    "cmd",
    "command",
    "ref",
    "reference",
    "set",
    "setpoint",
    "target",
    "desired",
    "goal",
    "soll",
    "sollwert",
];
const SUPPLY: &[&str] = &["supply", "bat", "battery", "in", "input", "bus", "dc"];

const RULES: &[Rule] = &[
    Rule {
        column: "shaft_speed_rad_s",
        words: &["erpm", "rpm", "omega", "rotorspeed", "velocity", "speed", "drehzahl"],
        without: &["air", "ground", "wind", "wheel", "fan", "gps", "gnss"],
    },
    Rule {
        column: "current_a",
        words: &["current", "curr", "iq", "amps", "motorstrom", "strom"],
        without: SUPPLY,
    },
    Rule {
        column: "supply_v",
        words: &["voltage", "volt", "vbus", "vbat", "vcc", "spannung"],
        without: &["axis", "cell"],
    },
    Rule {
        column: "supply_current_a",
        words: &["current", "curr", "amps"],
        without: &["axis", "motor", "phase"],
    },
    Rule {
        column: "duty_cmd",
        words: &["duty", "throttle", "pwm", "control", "output", "out"],
        without: &[],
    },
    Rule {
        column: "thrust_n",
        words: &["thrust", "force", "loadcell", "schub", "schubkraft", "kraft"],
        without: &[],
    },
    Rule { column: "torque_n_m", words: &["torque", "drehmoment"], without: &[] },
    Rule {
        column: "shaft_angle_rad",
        words: &["angle", "position", "encoder", "winkel", "drehwinkel"],
        without: &["gps", "gnss"],
    },
    Rule {
        column: "temperature_c",
        words: &["temperature", "temp", "temperatur"],
        without: &["air", "baro"],
    },
    Rule { column: "power_w", words: &["power", "leistung"], without: &[] },
    Rule { column: "depth_m", words: &["depth", "tiefe"], without: &[] },
    Rule { column: "flow_m_s", words: &["flow"], without: &["optical"] },
];

/// Words of a field that is about a signal and not the signal.
const ABOUT: &[&str] = &[
    "valid",
    "enabled",
    "flag",
    "timestamp",
    "stamp",
    "seq",
    "count",
    "counter",
    "error",
    "errorcount",
    "failsafe",
    "alarm",
    "inconsistency",
    "innovation",
    "test",
    "ratio",
    "ratios",
    "delta",
    "offset",
    "scale",
    "limit",
    "fault",
    "id",
];
/// Words of what belongs to a drive: in a log of a whole vehicle a field without a unit must have one of them.
pub(super) const DRIVE: &[&str] = &[
    "esc",
    "motor",
    "motors",
    "thruster",
    "thrusters",
    "actuator",
    "rotor",
    "propeller",
    "servo",
    "rcou",
    "drive",
    "vesc",
    "odrive",
    "moteus",
    "shaft",
    "battery",
    "bat",
];

/// Commands: the words of the measured value, and one of [`ASKED`].
const COMMANDS: &[(&str, &str)] = &[
    ("shaft_speed_rad_s", "speed_cmd_rad_s"),
    ("current_a", "current_cmd_a"),
    ("supply_v", "voltage_cmd_v"),
    ("thrust_n", "thrust_cmd_n"),
    ("duty_cmd", "duty_cmd"),
];

/// Words of a name: split at what is no letter, and where small letters become large.
pub(super) fn words(name: &str) -> Vec<String> {
    let mut out = vec![String::new()];
    let mut small = false;
    for c in name.chars() {
        if !c.is_alphabetic() || (c.is_uppercase() && small) {
            out.push(String::new());
        }
        small = c.is_lowercase();
        if c.is_alphabetic()
            && let Some(last) = out.last_mut()
        {
            last.extend(c.to_lowercase());
        }
    }
    out.retain(|word| !word.is_empty());
    out
}

/// The unit that a name claims: in brackets or parentheses behind it, or as its end.
pub(super) fn unit_in(name: &str) -> Option<&'static Unit> {
    let name = name.trim();
    for (open, close) in [('(', ')'), ('[', ']')] {
        if let Some((_, inside)) = name.strip_suffix(close).and_then(|rest| rest.rsplit_once(open)) {
            return symbol(inside.trim());
        }
    }
    let lower = name.to_lowercase();
    units::of_column(&lower).or_else(|| (lower == "rpm").then(|| units::find("rpm")).flatten())
}

/// A unit by its symbol, as other programs spell it.
pub(crate) fn symbol(text: &str) -> Option<&'static Unit> {
    // `output[1]` is the second output, not one without a dimension.
    if text.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    let ours = match text {
        "RPM" | "r/min" | "rev/min" | "U/min" | "1/min" | "min^-1" | "min-1" => "rpm",
        "°C" | "degC" | "℃" => "C",
        "µs" | "μs" | "usec" | "microseconds" => "us",
        "sec" | "seconds" => "s",
        "msec" | "milliseconds" => "ms",
        "deg/s" | "degree/s" | "deg/sec" => "deg/s",
        "°" => "deg",
        "Ω" | "Ohm" => "ohm",
        "m/s/s" | "m/s2" | "m/s²" => "m/s^2",
        "Nm" | "N·m" | "N*m" => "N m",
        "g" => "gf",
        "kt" | "knots" => "knot",
        other => other,
    };
    units::find(ours)
}

pub(super) fn unit_of(field: &Field) -> Option<&'static Unit> {
    field.unit.as_deref().map_or_else(|| unit_in(&field.name), symbol)
}

/// Whether a field may be a signal of a drive at all.
fn possible(topic: &Topic, field: &Field, table: bool) -> bool {
    let names = [words(&topic.name), words(&field.name)].concat();
    let has = |list: &[&str]| names.iter().any(|name| list.contains(&name.as_str()));
    field.range.is_some_and(|(low, high)| low < high)
        && !has(ABOUT)
        && (table || unit_of(field).is_some() || has(DRIVE))
}

/// How well a field suits a rule: lower is better.
fn fit(rule: &Rule, topic: &Topic, field: &Field) -> Option<(bool, usize, bool)> {
    let names = words(&field.name);
    let has = |list: &[&str], names: &[String]| list.iter().position(|w| names.iter().any(|n| n == w));
    let place = has(rule.words, &names)?;
    let beside = words(&topic.name);
    if has(rule.without, &names).is_some() || rule.column == "current_a" && has(SUPPLY, &beside).is_some() {
        return None;
    }
    let si = columns::find(rule.column)
        .map_or_else(|| units::of_column(rule.column).map_or("1", |u| u.si), |k| k.unit);
    let unit = unit_of(field);
    if unit.is_some_and(|unit| unit.si != si) {
        return None;
    }
    let supply = matches!(rule.column, "supply_v" | "supply_current_a");
    let elsewhere = supply && has(SUPPLY, &names).or(has(SUPPLY, &beside)).is_none();
    if rule.column == "supply_current_a" && elsewhere {
        return None;
    }
    Some((unit.is_none(), place, elsewhere))
}

/// What brings a log in.
pub(super) fn propose(log: &Log) -> (Proposal, Chosen) {
    let table = log.topics.len() == 1 && log.topics[0].name.is_empty();
    let native = log.topics.iter().any(is_native);
    let maps = shipped::fitting(log, table);
    let incomplete = if native || table || !maps.is_empty() { Vec::new() } else { shipped::in_part(log) };
    let chosen = choose(log, table);
    let map = (!native && !chosen.is_empty()).then(|| toml(log, &chosen, table));
    let without_response =
        maps.iter().filter(|map| !shipped::responds(map, log)).map(ColumnMap::call).collect();
    let shipped = maps.iter().map(ColumnMap::call).collect();
    let proposal = Proposal { native, shipped, without_response, incomplete, map };
    (proposal, if native { Chosen::new() } else { chosen })
}

fn is_native(topic: &Topic) -> bool {
    let mut names = topic.fields.iter().map(|f| f.name.as_str());
    names.clone().any(|n| n == "time_s") && names.all(|n| columns::unit_missing(n).is_none())
}

fn choose(log: &Log, table: bool) -> Chosen {
    let mut chosen = Chosen::new();
    for rule in RULES {
        for asked in [true, false] {
            let column = if asked {
                let Some((_, command)) = COMMANDS.iter().find(|(of, _)| *of == rule.column) else { continue };
                *command
            } else {
                rule.column
            };
            let candidates = log.topics.iter().enumerate().flat_map(|(t, topic)| {
                topic.fields.iter().enumerate().map(move |(f, field)| ((t, f), topic, field))
            });
            let best = candidates
                .filter(|(place, topic, field)| possible(topic, field, table) && !chosen.contains_key(place))
                .filter(|(_, topic, field)| {
                    let own = words(&field.name);
                    // moteus' control_velocity is what its trajectory asks for.
                    let control = own.len() > 1 && own[0] == "control";
                    let names = [words(&topic.name), own].concat();
                    asked == (control || names.iter().any(|n| ASKED.contains(&n.as_str())))
                })
                .filter_map(|(place, topic, field)| Some((fit(rule, topic, field)?, place)))
                .min();
            if let Some((_, place)) = best.filter(|_| !chosen.values().any(|there| *there == column)) {
                chosen.insert(place, column);
            }
        }
    }
    chosen
}

fn toml(log: &Log, chosen: &Chosen, table: bool) -> String {
    let mut out = String::from(
        "description = \"\"\"\nProposed by kort from the names and units in the log. Check every line: sign, unit, scale.\n\"\"\"\n",
    );
    if table && log.delimiter != b',' {
        let _ = writeln!(out, "delimiter = {:?}", char::from(log.delimiter).to_string());
    }
    if log.decimal_comma {
        out += "decimal = \",\"   # in the whole file\n";
    }
    out += "\n[time]\n";
    out += &if table { stamps::proposed(log) } else { "clock = \"log\"\n".into() };
    for ((topic, field), column) in chosen {
        let (topic, field) = (&log.topics[*topic], &log.topics[*topic].fields[*field]);
        let _ = write!(out, "\n[columns.{column}]\nsource = {:?}\n", topic.source(field));
        let (low, high) = field.range.unwrap_or_default();
        match unit_of(field) {
            Some(unit) => {
                let whence = if field.unit.is_some() { "as the log says" } else { "as its name says" };
                let _ = writeln!(out, "unit = {:?}   # {whence}; {low} to {high} in this log", unit.symbol);
            }
            None => {
                let _ =
                    writeln!(out, "# unit = \"…\"   the log does not say it; {low} to {high} in this log");
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_fall_into_words_and_units() {
        assert_eq!(words("escRPM[0]"), ["esc", "rpm"]);
        assert_eq!(words("current_motor"), ["current", "motor"]);
        for (name, unit) in [
            ("Speed (rpm)", "rpm"),
            ("voltage [V]", "V"),
            ("RPM", "rpm"),
            ("thrust_gf", "gf"),
            ("t_ms", "ms"),
        ] {
            assert_eq!(unit_in(name).map(|u| u.symbol), Some(unit), "{name}");
        }
        assert_eq!(unit_in("output[1]").map(|u| u.symbol), None);
        assert_eq!(unit_in("erpm").map(|u| u.symbol), None, "electrical turns are no turns of the shaft");
    }
}
