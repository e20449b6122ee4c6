//! `[columns.NAME]` of a column map: one of our columns and how it is made.

use std::fmt;

use serde::Deserialize;
use serde::de::{Deserializer, Error, Visitor};

use super::ask::Given;
use super::read::Wrong;
use super::{MapError, Mapped, fail};
use crate::columns;
use crate::units::{self, Unit};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawColumn {
    pub source: String,
    unit: Option<String>,
    #[serde(default)]
    optional: bool,
    sign: Option<f64>,
    scale: Option<f64>,
    divide_by: Option<Divisor>,
    offset: Option<f64>,
    #[serde(default)]
    table: Vec<[f64; 2]>,
    none: Option<f64>,
    no_value: Option<f64>,
    sign_of: Option<String>,
    sign_zero: Option<f64>,
}

/// As the file has it: a number, or a text with one or with the name of one.
struct Divisor(String);

impl<'de> Deserialize<'de> for Divisor {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct NumberOrText;

        impl Visitor<'_> for NumberOrText {
            type Value = Divisor;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a number that is not 0, or the name of one asked for, as \"{pole_pairs}\"")
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<Divisor, E> {
                Ok(Divisor(text.into()))
            }

            fn visit_i64<E: Error>(self, number: i64) -> Result<Divisor, E> {
                Ok(Divisor(number.to_string()))
            }

            fn visit_u64<E: Error>(self, number: u64) -> Result<Divisor, E> {
                Ok(Divisor(number.to_string()))
            }

            fn visit_f64<E: Error>(self, number: f64) -> Result<Divisor, E> {
                Ok(Divisor(number.to_string()))
            }
        }

        from.deserialize_any(NumberOrText)
    }
}

impl RawColumn {
    pub fn check(self, map: &str, name: String, given: &Given, wrong: &mut Wrong) -> Option<Mapped> {
        let at = At { map, column: &name };
        let unit = wrong.take(at.unit(self.unit.as_deref()));
        let sign = wrong.take(at.sign(self.sign));
        let scale = wrong.take(at.scale(self.scale, self.divide_by.as_ref().map(|by| by.0.as_str()), given));
        let offset = wrong.take(at.finite("offset", self.offset, 0.0));
        let table = wrong.take(at.table(self.table));
        let none = wrong.take(at.finite_if_any("none", self.none));
        let no_value = wrong.take(at.finite_if_any("no_value", self.no_value));
        let sign_of = wrong.take(at.sign_of(self.sign_of.as_deref(), self.sign_zero, given));
        let source = wrong.take(given.fill(map, &self.source));
        Some(Mapped {
            source: source?,
            unit: unit?,
            optional: self.optional,
            sign: sign?,
            scale: scale?,
            offset: offset?,
            table: table?,
            none: none?,
            no_value: no_value?,
            sign_of: sign_of?,
            name,
        })
    }
}

/// A column in its map, for messages.
struct At<'a> {
    map: &'a str,
    column: &'a str,
}

impl At<'_> {
    fn fail(&self, key: &str, words: &str, hint: &str) -> MapError {
        fail(self.map, format!("`columns.{}.{key}` {words}", self.column), hint)
    }

    fn unit(&self, symbol: Option<&str>) -> Result<Unit, MapError> {
        let target_si = self.target_si()?;
        let symbol = symbol.ok_or_else(|| {
            let hint = "write the unit of the source column; it is never guessed (\"1\" if it has none)";
            self.fail("unit", "is missing", hint)
        })?;
        units::find(symbol).filter(|unit| unit.si == target_si).copied().ok_or_else(|| {
            let allowed = units::siblings(target_si);
            let words = format!("= \"{symbol}\" is outside what is allowed: {allowed}");
            let hint = format!("`unit` is the unit after sign, scale and offset; it becomes {target_si}");
            self.fail("unit", &words, &hint)
        })
    }

    /// The SI unit that the name ends in.
    fn target_si(&self) -> Result<&'static str, MapError> {
        let name = self.column;
        if name == "time_s" {
            let words = "`columns.time_s`: time has its own table";
            return Err(fail(self.map, words, "name the column of stamps in [time]"));
        }
        if let Some(known) = columns::find(name) {
            return Ok(known.unit);
        }
        let Some(near) = columns::unit_missing(name) else {
            return Ok(units::of_column(name).map_or("1", |unit| unit.si));
        };
        let hint = near
            .map_or("end the name in its SI unit".into(), |known| format!("did you mean `{}`?", known.name));
        let words = format!("`columns.{name}`: no SI unit stands at the end of its name");
        Err(fail(self.map, words, &hint))
    }

    fn finite(&self, key: &str, value: Option<f64>, default: f64) -> Result<f64, MapError> {
        let value = value.unwrap_or(default);
        if value.is_finite() {
            return Ok(value);
        }
        let words = format!("= {value} is outside what is allowed: a finite number");
        Err(self.fail(key, &words, "correct the number"))
    }

    fn finite_if_any(&self, key: &str, value: Option<f64>) -> Result<Option<f64>, MapError> {
        value.map(|value| self.finite(key, Some(value), value)).transpose()
    }

    fn sign(&self, sign: Option<f64>) -> Result<f64, MapError> {
        let sign = self.finite("sign", sign, 1.0)?;
        if sign.abs() == 1.0 {
            return Ok(sign);
        }
        let words = format!("= {sign} is outside what is allowed: 1 or -1");
        Err(self.fail("sign", &words, "use `scale` for a factor"))
    }

    fn scale(&self, scale: Option<f64>, divide_by: Option<&str>, given: &Given) -> Result<f64, MapError> {
        let scale = self.finite("scale", scale, 1.0)?;
        let scale = match divide_by {
            Some(by) => scale / self.divisor(by, given)?,
            None => scale,
        };
        if scale == 0.0 {
            let words = "= 0 is outside what is allowed: any other finite number";
            return Err(self.fail("scale", words, "remove the column instead"));
        }
        Ok(scale)
    }

    fn divisor(&self, by: &str, given: &Given) -> Result<f64, MapError> {
        let number = given.fill(self.map, by)?.trim().parse::<f64>().ok();
        number.filter(|by| by.is_finite() && *by != 0.0).ok_or_else(|| {
            let words = format!(
                "= \"{by}\" is outside what is allowed: a number that is not 0, or the name of one asked for"
            );
            self.fail("divide_by", &words, "divide_by = \"{pole_pairs}\" divides by what the user gives")
        })
    }

    fn table(&self, table: Vec<[f64; 2]>) -> Result<Vec<[f64; 2]>, MapError> {
        let rising = table.windows(2).all(|pair| pair[1][0] > pair[0][0]);
        if table.len() != 1 && rising && table.iter().flatten().all(|value| value.is_finite()) {
            return Ok(table);
        }
        let words = "needs at least two pairs of finite numbers, first numbers rising";
        Err(self.fail("table", words, "table = [[1100, -40.0], [1500, 0.0], [1900, 50.0]]"))
    }

    fn sign_of(
        &self,
        source: Option<&str>,
        zero: Option<f64>,
        given: &Given,
    ) -> Result<Option<(String, f64)>, MapError> {
        match (source, zero) {
            (Some(source), zero) => {
                Ok(Some((given.fill(self.map, source)?, self.finite("sign_zero", zero, 0.0)?)))
            }
            (None, None) => Ok(None),
            (None, Some(_)) => Err(self.fail("sign_of", "is missing", "sign_zero belongs to sign_of")),
        }
    }
}
