//! Names of others: the words in them, and the unit that they claim.

use super::Field;
use crate::units::{self, Unit};

/// What instruments of many test stands write in German, Spanish, French, Italian and Dutch, by the English word.
const TONGUES: &[(&str, &[&str])] = &[
    ("time", &["zeit", "messzeit", "uhrzeit", "tiempo", "hora", "temps", "heure", "tempo", "ora", "tijd"]),
    ("timestamp", &["zeitstempel", "horodatage", "tijdstempel"]),
    ("voltage", &["spannung", "voltaje", "tensión", "tension", "tensione", "spanning"]),
    ("current", &["strom", "corriente", "courant", "corrente", "stroom"]),
    ("speed", &["drehzahl", "velocidad", "vitesse", "velocità", "velocita", "snelheid", "toerental"]),
    ("force", &["kraft", "fuerza", "forza", "kracht"]),
    ("thrust", &["schub", "schubkraft", "empuje", "poussée", "poussee", "spinta", "stuwkracht"]),
    ("torque", &["drehmoment", "couple", "coppia", "koppel"]),
    ("angle", &["winkel", "drehwinkel", "ángulo", "angulo", "angolo", "hoek"]),
    ("temperature", &["temperatur", "temperatura", "température", "temperatuur"]),
    ("power", &["leistung", "potencia", "puissance", "potenza", "vermogen"]),
    ("depth", &["tiefe", "profundidad", "profondeur", "profondità", "profondita", "diepte"]),
    ("setpoint", &["soll", "sollwert", "consigna", "consigne"]),
    ("actual", &["ist", "istwert"]),
    (
        "electrical",
        &["elektrisch", "elektrische", "eléctrica", "electrica", "électrique", "electrique", "elettrica"],
    ),
    ("fan", &["lüfter", "luefter"]),
    ("cell", &["zelle", "zell", "zellen"]),
    ("weight", &["gewicht", "peso", "poids"]),
];

/// What German writes at the end of one word, behind what it is of: `Solldrehzahl`, `Motorstrom`.
const COMPOUNDED: &[&str] = &[
    "zeit",
    "spannung",
    "strom",
    "drehzahl",
    "schubkraft",
    "schub",
    "kraft",
    "drehmoment",
    "winkel",
    "temperatur",
    "leistung",
    "tiefe",
    "gewicht",
];

/// What is measured in grams of force, and in kilograms or pounds of it: of all else a `g` is something else, as the gravity of
/// an acceleration.
const WEIGHED: &[&str] = &["thrust", "force", "weight", "load", "loadcell", "pull"];

/// Words of a name, in English where [`TONGUES`] knows them: split at what is no letter, where small letters become large, and
/// where German joins them.
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
    out.iter().filter(|word| !word.is_empty()).flat_map(|word| parts(word)).map(english).collect()
}

/// A word and what it is joined to, if it is no word of its own.
fn parts(word: &str) -> Vec<&str> {
    let known = TONGUES.iter().any(|(_, others)| others.contains(&word));
    let joined = || COMPOUNDED.iter().find_map(|end| Some([word.strip_suffix(end)?, end]));
    match joined().filter(|[before, _]| !known && !before.is_empty()) {
        Some(parts) => parts.to_vec(),
        None => vec![word],
    }
}

fn english(word: &str) -> String {
    let known = TONGUES.iter().find(|(_, others)| others.contains(&word));
    known.map_or(word, |(english, _)| english).to_owned()
}

/// A name without the unit in brackets behind it, or at its end.
pub(super) fn bare(name: &str) -> &str {
    let name = name.trim();
    let in_brackets = [('(', ')'), ('[', ']')]
        .into_iter()
        .find_map(|(open, close)| Some(name.strip_suffix(close)?.rsplit_once(open)?.0));
    in_brackets.or_else(|| Some(units::split_suffix(name)?.0)).unwrap_or(name).trim()
}

/// Whether a name says that its numbers are a multiple of its unit: `rpm/100`, `RPM*10`, `Current x100 (A)`.
pub(super) fn has_factor(name: &str) -> bool {
    let power_of_ten = |digits: &str| {
        let end = digits.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(digits.len());
        let power = digits[..end].parse::<f64>().ok().map(f64::log10);
        power.is_some_and(|power| power != 0.0 && power.is_finite() && power.fract() == 0.0)
    };
    let signs = name.char_indices().filter(|(_, c)| matches!(c, '/' | '*' | '·' | '×' | 'x' | 'X'));
    signs.into_iter().any(|(at, sign)| power_of_ten(name[at + sign.len_utf8()..].trim_start()))
}

/// Whether a word, or several one after the other, stand among these.
pub(super) fn says(names: &[String], phrase: &str) -> bool {
    let parts: Vec<&str> = phrase.split(' ').collect();
    names.windows(parts.len()).any(|window| window.iter().zip(&parts).all(|(name, part)| name == part))
}

/// The unit that a name claims: in brackets or parentheses behind it, or as its end.
pub(super) fn unit_in(name: &str) -> Option<&'static Unit> {
    let name = name.trim();
    if has_factor(name) {
        return None;
    }
    for (open, close) in [('(', ')'), ('[', ']')] {
        if let Some((_, inside)) = name.strip_suffix(close).and_then(|rest| rest.rsplit_once(open)) {
            return symbol_beside(name, inside);
        }
    }
    let last = || match words(name).last()?.as_str() {
        "rpm" => units::find("rpm"),
        "amps" => units::find("A"),
        "volts" => units::find("V"),
        "watts" => units::find("W"),
        "pct" => units::find("%"),
        _ => None,
    };
    units::of_column(&name.to_lowercase()).map(|unit| of_force(name, unit)).or_else(last)
}

/// The unit that a symbol beside a name means.
fn symbol_beside(name: &str, text: &str) -> Option<&'static Unit> {
    if is_weighed(name) && matches!(text.trim(), "lb" | "lbs") {
        return units::find("lbf");
    }
    let unit = symbol(text.trim()).filter(|_| text.trim() != "g" || is_weighed(name))?;
    Some(of_force(name, unit))
}

fn is_weighed(name: &str) -> bool {
    words(name).iter().any(|word| WEIGHED.contains(&word.as_str()))
}

/// A scale that shows a force in kilograms means those of force.
fn of_force(name: &str, unit: &'static Unit) -> &'static Unit {
    if unit.symbol == "kg" && is_weighed(name) { units::find("kgf").unwrap_or(unit) } else { unit }
}

/// A unit by its symbol, as other programs spell it.
pub(crate) fn symbol(text: &str) -> Option<&'static Unit> {
    // `output[1]` is the second output, not one without a dimension.
    if text.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    let ours = match text {
        "RPM" | "r/min" | "rev/min" | "U/min" | "1/min" | "min^-1" | "min-1" | "tr/min" | "giri/min" => "rpm",
        "kRPM" | "KRPM" => "krpm",
        "Kgf" | "KGF" | "kg f" | "Kg f" | "kg-f" | "kp" => "kgf",
        "turn" | "turns" | "revs" => "rev",
        "turn/s" | "turns/s" | "revs/s" | "rps" => "rev/s",
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

/// What a log says of a field's unit that no unit of ours is: its own word, or what stands in brackets behind the name.
pub(super) fn unknown_unit(field: &Field) -> Option<&str> {
    let in_brackets = || {
        let name = field.name.trim();
        let inside = |(open, close)| Some(name.strip_suffix(close)?.rsplit_once::<char>(open)?.1.trim());
        [('(', ')'), ('[', ']')].into_iter().find_map(inside)
    };
    let said = field.unit.as_deref().map(str::trim).or_else(in_brackets)?;
    let digits = said.bytes().all(|b| b.is_ascii_digit());
    (!digits && symbol(said).is_none()).then_some(said)
}

pub(super) fn unit_of(field: &Field) -> Option<&'static Unit> {
    let beside = || field.unit.as_deref().map(|unit| symbol_beside(&field.name, unit));
    beside().unwrap_or_else(|| unit_in(&field.name)).filter(|_| !has_factor(&field.name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_fall_into_words_and_units() {
        assert_eq!(words("escRPM[0]"), ["esc", "rpm"]);
        assert_eq!(words("current_motor"), ["current", "motor"]);
        assert_eq!(words("Tensión (V)"), ["voltage", "v"]);
        assert!(says(&words("a1 q-axis cmd [A]"), "q axis") && !says(&words("axis q"), "q axis"));
        for (name, unit) in [
            ("Speed (rpm)", "rpm"),
            ("voltage [V]", "V"),
            ("RPM", "rpm"),
            ("thrust_gf", "gf"),
            ("Thrust (g)", "gf"),
            ("Speed (krpm)", "krpm"),
            ("Thrust (Kg f)", "kgf"),
            ("t_ms", "ms"),
            ("cmd_pct", "%"),
            ("Batt. Volts", "V"),
            ("Amps", "A"),
            ("position [turns]", "rev"),
        ] {
            assert_eq!(unit_in(name).map(|u| u.symbol), Some(unit), "{name}");
        }
        assert_eq!(words("Solldrehzahl_Motorstrom"), ["setpoint", "speed", "motor", "current"]);
        assert_eq!(words("Drehmoment Istwert"), ["torque", "actual"]);
        for (name, unit) in
            [("thrust(kg)", "kgf"), ("Thrust (lbs)", "lbf"), ("thrust_kg", "kgf"), ("mass (kg)", "kg")]
        {
            assert_eq!(unit_in(name).map(|u| u.symbol), Some(unit), "{name}");
        }
        for name in ["rpm/100", "RPM*10", "Current x100 (A)", "Thrust × 0.1 (N)"] {
            assert!(has_factor(name) && unit_in(name).is_none(), "{name}");
        }
        for name in ["n [1/min]", "speed (r/min)", "max1 (A)", "flow m/s", "Ch 1/2", "x1 (A)"] {
            assert!(!has_factor(name), "{name}");
        }
        assert_eq!(
            (bare("Speed SP (rpm)"), bare("rpm_des"), bare("speed_rad_s")),
            ("Speed SP", "rpm_des", "speed")
        );
        assert_eq!(unit_in("output[1]").map(|u| u.symbol), None);
        assert_eq!(unit_in("erpm").map(|u| u.symbol), None, "electrical turns are no turns of the shaft");
        assert_eq!(unit_in("Vibration (g)").map(|u| u.symbol), None, "gravity, and no force");
    }
}
