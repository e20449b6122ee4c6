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
    ("weight", &["gewicht", "peso", "poids"]),
];

/// What is measured in grams of force: of all else a `g` is something else, as the gravity of an acceleration.
const WEIGHED: &[&str] = &["thrust", "force", "weight", "load", "loadcell", "pull"];

/// Words of a name, in English where [`TONGUES`] knows them: split at what is no letter, and where small letters become large.
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
    for word in &mut out {
        if let Some((english, _)) = TONGUES.iter().find(|(_, others)| others.contains(&word.as_str())) {
            *word = (*english).to_owned();
        }
    }
    out
}

/// Whether a word, or several one after the other, stand among these.
pub(super) fn says(names: &[String], phrase: &str) -> bool {
    let parts: Vec<&str> = phrase.split(' ').collect();
    names.windows(parts.len()).any(|window| window.iter().zip(&parts).all(|(name, part)| name == part))
}

/// The unit that a name claims: in brackets or parentheses behind it, or as its end.
pub(super) fn unit_in(name: &str) -> Option<&'static Unit> {
    let name = name.trim();
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
    units::of_column(&name.to_lowercase()).or_else(last)
}

/// The unit that a symbol beside a name means.
fn symbol_beside(name: &str, text: &str) -> Option<&'static Unit> {
    let weighed = || words(name).iter().any(|word| WEIGHED.contains(&word.as_str()));
    symbol(text.trim()).filter(|_| text.trim() != "g" || weighed())
}

/// A unit by its symbol, as other programs spell it.
pub(crate) fn symbol(text: &str) -> Option<&'static Unit> {
    // `output[1]` is the second output, not one without a dimension.
    if text.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    let ours = match text {
        "RPM" | "r/min" | "rev/min" | "U/min" | "1/min" | "min^-1" | "min-1" | "tr/min" | "giri/min" => "rpm",
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

pub(super) fn unit_of(field: &Field) -> Option<&'static Unit> {
    field.unit.as_deref().map_or_else(|| unit_in(&field.name), |unit| symbol_beside(&field.name, unit))
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
            ("t_ms", "ms"),
            ("cmd_pct", "%"),
            ("Batt. Volts", "V"),
            ("Amps", "A"),
            ("position [turns]", "rev"),
        ] {
            assert_eq!(unit_in(name).map(|u| u.symbol), Some(unit), "{name}");
        }
        assert_eq!(unit_in("output[1]").map(|u| u.symbol), None);
        assert_eq!(unit_in("erpm").map(|u| u.symbol), None, "electrical turns are no turns of the shaft");
        assert_eq!(unit_in("Vibration (g)").map(|u| u.symbol), None, "gravity, and no force");
    }
}
