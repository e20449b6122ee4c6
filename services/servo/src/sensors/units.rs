//! Units that instruments print, and the SI units of the signal table.

/// Unit printed, SI unit it is a multiple of, how many of those it is, and the zero of its scale in the SI unit.
const UNITS: &[(&str, &str, f64, f64)] = &[
    ("A", "A", 1.0, 0.0),
    ("mA", "A", 1e-3, 0.0),
    ("V", "V", 1.0, 0.0),
    ("mV", "V", 1e-3, 0.0),
    ("N", "N", 1.0, 0.0),
    ("kN", "N", 1e3, 0.0),
    ("gf", "N", 9.806_65e-3, 0.0),
    ("kgf", "N", 9.806_65, 0.0),
    ("lbf", "N", 4.448_221_615_260_5, 0.0),
    ("N m", "N m", 1.0, 0.0),
    ("mN m", "N m", 1e-3, 0.0),
    ("kgf cm", "N m", 9.806_65e-2, 0.0),
    ("rad", "rad", 1.0, 0.0),
    ("deg", "rad", std::f64::consts::PI / 180.0, 0.0),
    ("rev", "rad", std::f64::consts::TAU, 0.0),
    ("rad/s", "rad/s", 1.0, 0.0),
    ("rpm", "rad/s", std::f64::consts::TAU / 60.0, 0.0),
    ("Hz", "rad/s", std::f64::consts::TAU, 0.0),
    ("deg/s", "rad/s", std::f64::consts::PI / 180.0, 0.0),
    ("m/s", "m/s", 1.0, 0.0),
    ("cm/s", "m/s", 1e-2, 0.0),
    ("mm/s", "m/s", 1e-3, 0.0),
    ("kn", "m/s", 1852.0 / 3600.0, 0.0),
    ("degC", "degC", 1.0, 0.0),
    ("K", "degC", 1.0, -273.15),
    ("degF", "degC", 5.0 / 9.0, -160.0 / 9.0),
    ("m", "m", 1.0, 0.0),
    ("cm", "m", 1e-2, 0.0),
];

/// Factor and zero that turn a printed number into SI.
///
/// # Errors
/// The units there are for that SI unit.
pub fn to_si(unit: &str, si: &str) -> Result<(f64, f64), String> {
    let of = |name: &str| UNITS.iter().find(|(printed, base, ..)| *printed == name && *base == si);
    of(unit).map(|(.., factor, zero)| (*factor, *zero)).ok_or_else(|| {
        let known: Vec<&str> =
            UNITS.iter().filter(|(_, base, ..)| *base == si).map(|(name, ..)| *name).collect();
        format!("= \"{unit}\" is no unit of this signal\nhint: known are {}", known.join(", "))
    })
}

/// The unit of this SI unit that a word of an instrument's line is, as it is named above: scales print masses for forces.
pub fn printed(word: &str, si: &str) -> Option<&'static str> {
    let word = match (word, si) {
        ("kg" | "g" | "lb", "N") => format!("{word}f"),
        _ => word.to_owned(),
    };
    UNITS.iter().find(|(printed, base, ..)| *printed == word && *base == si).map(|(name, ..)| *name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use kort_proto::signals::SIGNALS;

    #[test]
    fn every_measured_signal_has_its_si_unit_here() {
        for signal in SIGNALS.iter().filter(|s| s.unit != "1") {
            assert_eq!(to_si(signal.unit, signal.unit), Ok((1.0, 0.0)), "{}", signal.name);
        }
        let (factor, zero) = to_si("degF", "degC").unwrap();
        assert!((212.0 * factor + zero - 100.0).abs() < 1e-9);
        assert!(to_si("rpm", "N").unwrap_err().contains("kgf"));
        assert_eq!([printed("kg", "N"), printed("lbf", "N")], [Some("kgf"), Some("lbf")]);
        assert_eq!([printed("kg", "m/s"), printed("ST", "N")], [None, None]);
    }
}
