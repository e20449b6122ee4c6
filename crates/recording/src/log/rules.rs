//! Which of our columns a field of others may be: by the words in its name, by its unit.

use super::names::{bare, says, unit_of, words};
use super::{Field, Topic};
use crate::columns;
use crate::units;

/// One of our columns, and words in a field's name that speak for it, most telling first, and against it.
pub(super) struct Rule {
    pub column: &'static str,
    words: &'static [&'static str],
    without: &'static [&'static str],
}

pub(super) const ASKED: &[&str] = &[
    "cmd",
    "command",
    "commanded",
    "ref",
    "reference",
    "set",
    "setpoint",
    "sp",
    "target",
    "desired",
    "goal",
    "demand",
    "demanded",
    "req",
    "request",
    "requested",
];
/// Words of what was measured, where something else of its kind was not.
const ACTUAL: &[&str] = &["actual", "act", "measured", "meas"];
pub(super) const SUPPLY: &[&str] = &["supply", "bat", "batt", "battery", "in", "input", "bus", "dc"];

pub(super) const RULES: &[Rule] = &[
    Rule {
        column: "shaft_speed_rad_s",
        words: &["erpm", "rpm", "omega", "rotorspeed", "velocity", "speed"],
        without: &["air", "ground", "wind", "wheel", "fan", "gps", "gnss"],
    },
    Rule { column: "current_a", words: &["current", "curr", "iq", "q axis", "amps"], without: SUPPLY },
    Rule {
        column: "supply_v",
        words: &["voltage", "volt", "volts", "vbus", "vbat", "vcc"],
        without: &["axis", "cell", "motor", "phase"],
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
    Rule { column: "thrust_n", words: &["thrust", "force", "loadcell"], without: &[] },
    Rule { column: "torque_n_m", words: &["torque"], without: &[] },
    Rule { column: "shaft_angle_rad", words: &["angle", "position", "encoder"], without: &["gps", "gnss"] },
    Rule { column: "temperature_c", words: &["temperature", "temp"], without: &["air", "baro"] },
    Rule { column: "power_w", words: &["power"], without: &["mechanical", "mech"] },
    Rule { column: "depth_m", words: &["depth"], without: &[] },
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
    "constant",
    "efficiency",
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

/// What "current" before it says is the one now, and no amperes.
const NOW: &[&str] = &["position", "angle", "velocity", "speed", "torque", "force", "temperature"];

/// Commands: the words of the measured value, and one of [`ASKED`].
pub(super) const COMMANDS: &[(&str, &str)] = &[
    ("shaft_speed_rad_s", "speed_cmd_rad_s"),
    ("current_a", "current_cmd_a"),
    ("supply_v", "voltage_cmd_v"),
    ("thrust_n", "thrust_cmd_n"),
    ("duty_cmd", "duty_cmd"),
];

/// Words of a pulse that tells a speed controller what to do.
pub(super) const PULSES: &[&str] = &["esc", "throttle", "pwm", "thruster", "pulse", "signal"];
/// Words of turns that are not those of the shaft.
const ELECTRICAL: &[&str] = &["erpm", "e rpm", "electrical", "elec", "el rpm", "el speed"];
/// Words of the motor's own current.
const OF_MOTOR: &[&str] = &["motor", "phase", "iq", "q axis", "winding", "coil"];

/// Units that tell what a field of a table is, where no word of its name does. Degrees may be those of a vehicle.
const TELLING: &[(&str, &[&str])] = &[
    ("shaft_speed_rad_s", &["rpm", "rad/s", "rev/s"]),
    ("current_a", &["A", "mA"]),
    ("supply_v", &["V", "mV"]),
    ("duty_cmd", &["%"]),
    ("thrust_n", &["N", "kN", "kgf", "gf", "lbf"]),
    ("torque_n_m", &["N m", "mN m", "kgf cm"]),
    ("shaft_angle_rad", &["rad", "rev"]),
    ("temperature_c", &["C"]),
    ("power_w", &["W", "kW"]),
];

pub(super) fn has(names: &[String], list: &[&str]) -> bool {
    list.iter().any(|phrase| says(names, phrase))
}

/// Whether a name tells of the present value of something else.
fn is_of_now(names: &[String]) -> bool {
    names.windows(2).any(|two| two[0] == "current" && NOW.contains(&two[1].as_str()))
}

/// A pulse of milliseconds for a speed controller; ArduPilot calls its outputs `RCOU.C1` and so on.
pub(super) fn is_pulse(topic: &Topic, field: &Field) -> bool {
    let number = field.name.strip_prefix('C').is_some_and(|number| number.parse::<u8>().is_ok());
    let output = number && topic.name.split('[').next() == Some("RCOU");
    output
        || unit_of(field).is_some_and(|unit| matches!(unit.symbol, "us" | "ms"))
            && has(&words(&field.name), PULSES)
}

/// A speed, or an angle, of electrical turns.
pub(super) fn is_electrical(column: &str, field: &Field) -> bool {
    let turns = ["shaft_speed_rad_s", "speed_cmd_rad_s", "shaft_angle_rad"].contains(&column);
    turns && has(&words(&field.name), ELECTRICAL)
}

/// Whether the name says whose current it is.
pub(super) fn is_of_motor(field: &Field) -> bool {
    has(&words(&field.name), OF_MOTOR)
}

/// Whether the name, or its topic's, says that it belongs to the supply.
pub(super) fn is_of_supply(topic: &Topic, field: &Field) -> bool {
    has(&words(&field.name), SUPPLY) || has(&words(&topic.name), SUPPLY)
}

/// Whether a field is what was asked for, and not what was measured.
pub(super) fn is_asked(topic: &Topic, field: &Field) -> bool {
    let own = words(&field.name);
    // moteus' control_velocity is what its trajectory asks for.
    let control = own.len() > 1 && own[0] == "control";
    // Within a name `des` is an article of French.
    let bare = words(bare(&field.name));
    let desired = [bare.first(), bare.last()].into_iter().flatten().any(|word| word == "des");
    control || desired || has(&own, ASKED) || has(&words(&topic.name), ASKED)
}

/// Whether a field may be a signal of a drive at all. A value that never changes is a channel that nobody uses, if it is not
/// the steady supply of a table, or what was asked for all the while.
fn possible(rule: &Rule, topic: &Topic, field: &Field, table: bool) -> bool {
    let names = [words(&topic.name), words(&field.name)].concat();
    let steady = table && (matches!(rule.column, "supply_v" | "duty_cmd") || is_asked(topic, field));
    field.range.is_some_and(|(low, high)| low < high || steady && low != 0.0)
        && !has(&names, ABOUT)
        && (table || unit_of(field).is_some() || has(&names, DRIVE))
}

/// Whether a field would be a signal of a drive if its numbers were not all one.
pub(super) fn is_unchanging(topic: &Topic, field: &Field, table: bool) -> bool {
    let suits = |field: &Field| RULES.iter().any(|rule| fit(rule, topic, field, table).is_some());
    let moved = field.range.map(|(low, _)| (low, low + 1.0));
    field.range.is_some_and(|(low, high)| low == high)
        && !suits(field)
        && suits(&Field { range: moved, ..field.clone() })
}

/// Whether nothing but its unit tells what a field is.
pub(super) fn by_unit(column: &str, field: &Field) -> bool {
    let names = words(&field.name);
    let known = RULES.iter().any(|rule| has(&names, rule.words));
    let tells = |symbol: &str| TELLING.iter().any(|(of, units)| *of == column && units.contains(&symbol));
    !known && unit_of(field).is_some_and(|unit| tells(unit.symbol))
}

/// How well a field suits a rule: lower is better.
pub(super) type Fit = (bool, bool, bool, bool, usize, usize, bool);

/// How far a name is from the plain one of a measured value: what says that it was measured comes first, and behind the plain
/// name what says more than that, as `estimated_rpm`.
fn qualified(rule: &Rule, field: &Field) -> usize {
    let names = words(bare(&field.name));
    let plain = |name: &String| {
        let within = |list: &[&str]| list.iter().any(|phrase| phrase.split(' ').any(|word| word == name));
        within(rule.words)
            || within(DRIVE)
            || within(ELECTRICAL)
            || rule.column.split('_').any(|word| word == name)
    };
    match () {
        () if has(&names, ACTUAL) => 0,
        () if names.iter().all(plain) => 1,
        () => 2,
    }
}

/// Whether a shaft's speed, or what was asked of it, is given in hertz, which may be its turns per second.
pub(super) fn is_turns(column: &str, field: &Field) -> bool {
    matches!(column, "shaft_speed_rad_s" | "speed_cmd_rad_s")
        && unit_of(field).is_some_and(|unit| unit.symbol == "Hz")
}

/// How well a field suits a rule, if it does.
pub(super) fn fit(rule: &Rule, topic: &Topic, field: &Field, table: bool) -> Option<Fit> {
    if !possible(rule, topic, field, table) {
        return None;
    }
    let names = words(&field.name);
    let beside = words(&topic.name);
    if matches!(rule.column, "current_a" | "supply_current_a") && is_of_now(&names) {
        return None;
    }
    if has(&names, rule.without) || rule.column == "current_a" && has(&beside, SUPPLY) {
        return None;
    }
    let unit = unit_of(field);
    let pulse = rule.column == "duty_cmd" && is_pulse(topic, field);
    // A share of something is a command only where the name says so.
    let unit_tells =
        || table && by_unit(rule.column, field) && (rule.column != "duty_cmd" || is_asked(topic, field));
    let place = match rule.words.iter().position(|phrase| says(&names, phrase)) {
        Some(place) => Some(place),
        None if pulse => Some(rule.words.len()),
        None => None,
    };
    let by_unit = place.is_none();
    let place = place.or_else(|| unit_tells().then_some(0))?;
    let si = columns::find(rule.column)
        .map_or_else(|| units::of_column(rule.column).map_or("1", |u| u.si), |k| k.unit);
    let turns = table && is_turns(rule.column, field);
    if unit.is_some_and(|unit| unit.si != si) && !pulse && !turns {
        return None;
    }
    let supply = matches!(rule.column, "supply_v" | "supply_current_a");
    let elsewhere = supply && !is_of_supply(topic, field);
    if rule.column == "supply_current_a" && elsewhere {
        return None;
    }
    let steady = field.range.is_none_or(|(low, high)| low == high);
    let electrical = is_electrical(rule.column, field);
    Some((by_unit, steady, unit.is_none() || turns, electrical, qualified(rule, field), place, elsewhere))
}
