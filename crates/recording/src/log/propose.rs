//! A column map for a log that nobody has mapped yet, from the names and units of its fields. It is shown, never used
//! unasked: a name is a claim, and a person must check it.

use std::collections::BTreeMap;
use std::fmt::Write;

use super::names::{has_factor, unit_of, unknown_unit};
use super::rules::{
    COMMANDS, RULES, by_unit, fit, is_asked, is_electrical, is_of_motor, is_of_supply, is_pulse, is_turns,
    is_unchanging,
};
use super::survey::{Example, Proposal};
use super::{Field, Log, Topic, shipped, stamps};
use crate::columns;
use crate::formats;
use crate::map::ColumnMap;

/// Fields chosen for a proposed map: (topic, field) and our column.
pub(super) type Chosen = BTreeMap<(usize, usize), &'static str>;

/// What brings a log in.
pub(super) fn propose(log: &Log) -> (Proposal, Chosen) {
    let table = log.topics.len() == 1 && log.topics[0].name.is_empty();
    // A recording of our own with decimal commas needs a map that says so.
    let named = log.topics.iter().any(is_native);
    let native = named && !log.decimal_comma && !log.perhaps_decimal_comma;
    // So does one whose stamps repeat or begin anew, or with cells that hold no number: it is refused as it is.
    let refused = native && table && (log.resets > 0 || log.topics[0].stale > 0 || !log.lost_in.is_empty());
    let maps = shipped::fitting(log, table);
    let incomplete = if native || table || !maps.is_empty() { Vec::new() } else { shipped::in_part(log) };
    let chosen = match () {
        () if refused => own_and_others(log),
        () if named && table => own(&log.topics[0]),
        () => choose(log, table),
    };
    let map =
        ((!native || refused) && (log.nameless || !chosen.is_empty())).then(|| toml(log, &chosen, table));
    let without_response =
        maps.iter().filter(|map| !shipped::responds(map, log)).map(ColumnMap::call).collect();
    let still = maps.iter().flat_map(|map| shipped::still(map, log)).collect();
    let examples = maps.iter().flat_map(|map| {
        let value =
            |key: &str| map.given.iter().find(|(known, _)| known == key).map(|(_, value)| value.clone());
        map.examples.iter().filter_map(move |(key, meaning)| {
            Some(Example { map: map.call(), key: key.clone(), value: value(key)?, meaning: meaning.clone() })
        })
    });
    let examples = examples.collect();
    let shipped = maps.iter().map(ColumnMap::call).collect();
    let fields = log.topics.iter().flat_map(|topic| topic.fields.iter().map(move |field| (topic, field)));
    let nothing = |_: &_| !native && map.is_none();
    let unchanging = fields.filter(nothing).filter(|(topic, field)| is_unchanging(topic, field, table));
    let unchanging = unchanging.map(|(topic, field)| topic.source(field)).collect();
    let proposal =
        Proposal { native, shipped, examples, without_response, still, incomplete, unchanging, map };
    (proposal, if native && !refused { Chosen::new() } else { chosen })
}

/// Rows that kort reads as they are: stamped in its way, without a name that lacks its unit, and with something beside the
/// stamps that it knows.
fn is_native(topic: &Topic) -> bool {
    let names = || topic.fields.iter().map(|f| f.name.as_str());
    names().any(|n| n == columns::TIME.name)
        && names().all(|n| columns::unit_missing(n).is_none())
        && names().any(|n| n != columns::TIME.name && columns::find(n).is_some())
}

/// The columns of our own names.
fn own(topic: &Topic) -> Chosen {
    let known = |field: &Field| columns::find(&field.name).filter(|known| *known != columns::TIME);
    let fields = topic.fields.iter().enumerate();
    fields.filter_map(|(f, field)| Some(((0, f), known(field)?.name))).collect()
}

/// Those, and of the others what they lack: `motor_rpm` beside `thrust_n`.
fn own_and_others(log: &Log) -> Chosen {
    let mut chosen = own(&log.topics[0]);
    for (place, column) in choose(log, true) {
        if !chosen.contains_key(&place) && !chosen.values().any(|there| *there == column) {
            chosen.insert(place, column);
        }
    }
    chosen
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
                .filter(|(place, topic, field)| {
                    let elsewhere = log.other_clocks.iter().any(|other| other.contains(&place.1));
                    !elsewhere && !chosen.contains_key(place) && asked == is_asked(topic, field)
                })
                .filter_map(|(place, topic, field)| Some((fit(rule, topic, field, table)?, place)))
                .min();
            if let Some((_, place)) = best.filter(|_| !chosen.values().any(|there| *there == column)) {
                chosen.insert(place, column);
            }
        }
    }
    if table {
        reread(&log.topics[0], &mut chosen);
    } else if is_of_vehicle(log) {
        of_controllers(log, &mut chosen);
    }
    chosen
}

/// Logs of vehicles whose speed controllers tell what they take out of the supply.
fn is_of_vehicle(log: &Log) -> bool {
    [formats::ULOG, formats::DATAFLASH].contains(&log.format)
}

/// The current that a vehicle's speed controller tells flows out of the supply, and is no motor's; the battery's is that of all.
fn of_controllers(log: &Log, chosen: &mut Chosen) {
    let current = chosen.iter().find(|((topic, field), column)| {
        **column == "current_a" && !is_of_motor(&log.topics[*topic].fields[*field])
    });
    if let Some(place) = current.map(|(place, _)| *place) {
        chosen.retain(|_, column| *column != "supply_current_a");
        chosen.insert(place, "supply_current_a");
    }
}

/// What the columns of a table tell of each other.
fn reread(topic: &Topic, chosen: &mut Chosen) {
    let place = |chosen: &Chosen, column: &str| {
        chosen.iter().find(|(_, there)| **there == column).map(|(place, _)| *place)
    };
    let field = |place: (usize, usize)| &topic.fields[place.1];
    // What a stand measures beside its pulses, or multiplies to electrical power, flows out of the supply.
    if let Some(current) = place(chosen, "current_a").filter(|at| !is_of_motor(field(*at)))
        && place(chosen, "supply_current_a").or(place(chosen, "current_cmd_a")).is_none()
        && (place(chosen, "power_w").is_some()
            || place(chosen, "duty_cmd").is_some_and(|at| is_pulse(topic, field(at))))
    {
        chosen.insert(current, "supply_current_a");
    }
    // No supply turns about.
    if let Some(voltage) = place(chosen, "supply_v").filter(|at| !is_of_supply(topic, field(*at)))
        && place(chosen, "voltage_cmd_v").is_none()
        && field(voltage).range.is_some_and(|(low, _)| low < 0.0)
    {
        chosen.insert(voltage, "voltage_cmd_v");
    }
}

fn toml(log: &Log, chosen: &Chosen, table: bool) -> String {
    let mut out = String::from(
        "description = \"\"\"\nProposed by kort from the names and units in the log. Check every line: sign, unit, scale; write what a line with a # asks for.\n\"\"\"\n",
    );
    if table && log.delimiter != b',' {
        let _ = writeln!(out, "delimiter = {:?}", char::from(log.delimiter).to_string());
    }
    if log.decimal_comma {
        out += "decimal = \",\"   # in the whole file\n";
    } else if log.perhaps_decimal_comma {
        out += "# decimal = \",\"   take out the # if the commas in the numbers are decimal marks; where they part thousands, save the file without\n";
    }
    if !log.without_cells.is_empty() {
        let _ = writeln!(
            out,
            "# without_cells = {:?}   every row has fewer cells than the header has names: write which names have none, mend what was read of the others, and take out the #",
            log.without_cells
        );
    }
    out += "\n[time]\n";
    if log.nameless {
        out += BY_PLACE;
        out += &by_place(&log.topics[0]);
        return out;
    }
    out += &if table { stamps::proposed(log) } else { "clock = \"log\"\n".into() };
    let commanded = chosen.values().any(|column| *column == "current_cmd_a");
    for ((topic, field), column) in chosen {
        let (topic, field) = (&log.topics[*topic], &log.topics[*topic].fields[*field]);
        let _ = write!(out, "\n[columns.{column}]\nsource = {:?}\n", topic.source(field));
        let doubts = table && !(commanded && *column == "current_a");
        out += &unit_lines(column, topic, field, doubts);
        if *column == "supply_current_a" && is_of_vehicle(log) && !is_of_supply(topic, field) {
            out += "# taken for what flows out of the supply, as most speed controllers tell it; current_a if it is the motor's\n";
        }
        if column.contains("_cmd") && field.no_numbers > 0 && !table {
            let _ = writeln!(
                out,
                "{}no_value = 0.0   # what it is where it holds no number, as in {} message(s) of this log: at rest?",
                if log.format == formats::ULOG { "" } else { "# " },
                field.no_numbers
            );
        }
    }
    out
}

/// What a person must fill in where a table has no names.
const BY_PLACE: &str = "\
# The file has no names of columns: they are counted from the left. Write what each is, as docs/recordings.md calls it, with
# its unit, and take out the #; leave out what is none of them.
# source = \"column_…\"   the column of stamps; settle_s = 2.0 instead for settled points
# unit = \"…\"
";

/// A frame for every column.
fn by_place(topic: &Topic) -> String {
    let mut out = String::new();
    for field in &topic.fields {
        let found = field.range.map_or("no number".into(), |(low, high)| format!("{low} to {high}"));
        let _ = write!(
            out,
            "\n# [columns.…]   shaft_speed_rad_s, duty_cmd, …\n# source = {:?}   {found} in this log\n# unit = \"…\"\n",
            field.name
        );
    }
    out
}

/// The lines below a column's source: what it is read in, or what must be said before it can be read.
fn unit_lines(column: &str, topic: &Topic, field: &Field, doubts: bool) -> String {
    let (low, high) = field.range.unwrap_or_default();
    let seen = format!("{low} to {high} in this log");
    if column == "duty_cmd" && is_pulse(topic, field) {
        let none = if low == 0.0 { "none = 0   # no pulse\nno_value = 0.0\n" } else { "" };
        return format!(
            "# unit = \"1\"\n# table = [[1000, 0.0], [2000, 1.0]]   pulses of {seen}: write which of them ask for nothing and for all ([1500, 0.0] in the middle of a drive that reverses), and take out both #\n{none}"
        );
    }
    if is_turns(column, field) {
        return format!(
            "# unit = \"rev/s\"   the log says Hz: turns of the shaft per second? {seen}; then take out the #\n"
        );
    }
    let Some(unit) = unit_of(field) else {
        let factor = if has_factor(&field.name) { FACTOR } else { "" };
        let poles = if is_electrical(column, field) { POLES } else { "" };
        let more: String =
            [factor, poles].iter().filter(|line| !line.is_empty()).map(|line| format!("\n{line}")).collect();
        let why = match unknown_unit(field) {
            Some(unit) => format!("the log says {unit:?}, which is no unit that kort knows"),
            None => "the log does not say it".into(),
        };
        return format!("# unit = \"…\"   {why}; {seen}{more}\n");
    };
    let whence = match (&field.unit, by_unit(column, field)) {
        (_, true) => "only its unit speaks for it",
        (Some(_), false) => "as the log says",
        (None, false) => "as its name says",
    };
    if is_electrical(column, field) {
        return format!("# unit = {:?}   {whence}; {seen}\n{POLES}\n", unit.symbol);
    }
    format!(
        "unit = {:?}   # {whence}; {seen}{}\n",
        unit.symbol,
        if doubts { doubt(column, topic, field) } else { "" }
    )
}

/// The numbers are a multiple of the unit in the name.
const FACTOR: &str = "# scale = …   its name speaks of a factor: what the numbers are to be multiplied with; then take out both #";

/// Turns of the field are as many times those of the shaft as the motor has pole pairs.
const POLES: &str = "# divide_by = …   electrical turns: the motor's pole pairs, 1 if the logger has divided already; then take out both #";

/// What a name leaves open.
fn doubt(column: &str, topic: &Topic, field: &Field) -> &'static str {
    match column {
        _ if is_of_supply(topic, field) || is_of_motor(field) => "",
        "supply_v" => "; the supply's? voltage_cmd_v if the drive was given it",
        "voltage_cmd_v" => "; below 0, as no supply is: what the drive was given?",
        "supply_current_a" => "; out of the supply? current_a if it is the motor's",
        "current_a" => "; the motor's? supply_current_a if it flows out of the supply",
        _ => "",
    }
}

#[cfg(test)]
mod tests;
