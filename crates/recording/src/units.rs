//! Units at the end of column names, and units of foreign logs with their conversion to SI.

/// A unit: `si = factor * value + offset`, in the SI unit of its dimension.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    /// As written in a column map and in reports.
    pub symbol: &'static str,
    /// End of a column name that means this unit; empty if none does.
    pub suffix: &'static str,
    /// SI unit it converts to.
    pub si: &'static str,
    /// Factor to SI.
    pub factor: f64,
    /// Offset to SI, after the factor.
    pub offset: f64,
}

const fn unit(symbol: &'static str, suffix: &'static str, si: &'static str, factor: f64) -> Unit {
    Unit { symbol, suffix, si, factor, offset: 0.0 }
}

const TURN: f64 = std::f64::consts::TAU;
const DEGREE: f64 = std::f64::consts::PI / 180.0;
/// Standard gravity, m/s^2: what a kilogram-force and a gram-force are defined by.
const GRAVITY: f64 = 9.806_65;

/// Every unit kort reads. Dimensionless is `1`; temperature is in degrees Celsius throughout.
pub const UNITS: &[Unit] = &[
    unit("1", "", "1", 1.0),
    unit("%", "percent", "1", 0.01),
    unit("s", "s", "s", 1.0),
    unit("ms", "ms", "s", 1e-3),
    unit("us", "us", "s", 1e-6),
    unit("ns", "ns", "s", 1e-9),
    unit("min", "min", "s", 60.0),
    unit("A", "a", "A", 1.0),
    unit("mA", "ma", "A", 1e-3),
    unit("V", "v", "V", 1.0),
    unit("mV", "mv", "V", 1e-3),
    unit("W", "w", "W", 1.0),
    unit("kW", "kw", "W", 1e3),
    unit("N", "n", "N", 1.0),
    unit("kN", "kn", "N", 1e3),
    unit("kgf", "kgf", "N", GRAVITY),
    unit("gf", "gf", "N", GRAVITY * 1e-3),
    unit("lbf", "lbf", "N", 4.448_221_615_260_5),
    unit("N m", "n_m", "N m", 1.0),
    unit("mN m", "mn_m", "N m", 1e-3),
    unit("kgf cm", "kgf_cm", "N m", GRAVITY * 1e-2),
    unit("m", "m", "m", 1.0),
    unit("mm", "mm", "m", 1e-3),
    unit("cm", "cm", "m", 1e-2),
    unit("ft", "ft", "m", 0.3048),
    unit("m/s", "m_s", "m/s", 1.0),
    unit("cm/s", "cm_s", "m/s", 1e-2),
    unit("mm/s", "mm_s", "m/s", 1e-3),
    unit("knot", "knots", "m/s", 1852.0 / 3600.0),
    unit("m/s^2", "m_s2", "m/s^2", 1.0),
    unit("rad", "rad", "rad", 1.0),
    unit("deg", "deg", "rad", DEGREE),
    unit("rev", "rev", "rad", TURN),
    unit("rad/s", "rad_s", "rad/s", 1.0),
    unit("deg/s", "deg_s", "rad/s", DEGREE),
    unit("rev/s", "rev_s", "rad/s", TURN),
    unit("rpm", "rpm", "rad/s", TURN / 60.0),
    unit("krpm", "krpm", "rad/s", TURN / 60.0 * 1e3),
    unit("rad/s^2", "rad_s2", "rad/s^2", 1.0),
    unit("C", "c", "C", 1.0),
    Unit { symbol: "K", suffix: "k", si: "C", factor: 1.0, offset: -273.15 },
    Unit { symbol: "F", suffix: "f", si: "C", factor: 5.0 / 9.0, offset: -160.0 / 9.0 },
    unit("Pa", "pa", "Pa", 1.0),
    unit("kPa", "kpa", "Pa", 1e3),
    unit("bar", "bar", "Pa", 1e5),
    unit("mbar", "mbar", "Pa", 1e2),
    unit("Hz", "hz", "Hz", 1.0),
    unit("kHz", "khz", "Hz", 1e3),
    unit("kg", "kg", "kg", 1.0),
    unit("J", "j", "J", 1.0),
    unit("ohm", "ohm", "ohm", 1.0),
    unit("kg/m^3", "kg_m3", "kg/m^3", 1.0),
];

/// The unit of this symbol, as a column map writes it.
pub fn find(symbol: &str) -> Option<&'static Unit> {
    UNITS.iter().find(|u| u.symbol == symbol)
}

/// Splits a column name into its stem and the unit its end means: `shaft_speed_rad_s` is
/// (`shaft_speed`, rad/s). The longest fitting end wins.
pub fn split_suffix(name: &str) -> Option<(&str, &'static Unit)> {
    UNITS
        .iter()
        .filter(|u| !u.suffix.is_empty())
        .filter_map(|u| {
            let stem = name.strip_suffix(u.suffix)?.strip_suffix('_')?;
            (!stem.is_empty()).then_some((stem, u))
        })
        .max_by_key(|(_, u)| u.suffix.len())
}

/// The unit a column's name ends in.
pub fn of_column(name: &str) -> Option<&'static Unit> {
    split_suffix(name).map(|(_, u)| u)
}

/// Symbols of the units that convert to the same SI unit as `si`.
pub fn siblings(si: &str) -> String {
    let names: Vec<String> =
        UNITS.iter().filter(|u| u.si == si).map(|u| format!("\"{}\"", u.symbol)).collect();
    names.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_end_wins() {
        let of = |name: &str| of_column(name).map(|u| u.symbol);
        assert_eq!(of("shaft_speed_rad_s"), Some("rad/s"));
        assert_eq!(of("flow_m_s"), Some("m/s"));
        assert_eq!(of("time_s"), Some("s"));
        assert_eq!(of("torque_n_m"), Some("N m"));
        assert_eq!(of("duty_cmd"), None);
        assert_eq!(of("a"), None);
    }

    #[test]
    fn conversions() {
        let si = |symbol: &str, x: f64| {
            let u = find(symbol).unwrap();
            u.factor * x + u.offset
        };
        assert!((si("rpm", 60.0) - TURN).abs() < 1e-12);
        assert!((si("F", 212.0) - 100.0).abs() < 1e-9);
        assert!((si("K", 273.15)).abs() < 1e-12);
        assert!((si("gf", 1000.0) - GRAVITY).abs() < 1e-12);
    }

    #[test]
    fn symbols_and_ends_are_unique() {
        for (i, a) in UNITS.iter().enumerate() {
            for b in &UNITS[i + 1..] {
                assert_ne!(a.symbol, b.symbol);
                assert!(a.suffix.is_empty() || a.suffix != b.suffix, "{}", a.suffix);
            }
        }
    }
}
