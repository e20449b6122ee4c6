//! `[time]` of a column map: where the instants come from.

use serde::Deserialize;

use super::ask::Given;
use super::read::Wrong;
use super::{MapError, Stamps, Time, fail};
use crate::dates::{self, Order};
use crate::units;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawTime {
    source: Option<String>,
    unit: Option<String>,
    time_of_day: Option<String>,
    order: Option<String>,
    stale_rows: Option<String>,
    settle_s: Option<f64>,
    clock: Option<String>,
    rows_of: Option<String>,
}

impl RawTime {
    pub fn check(self, map: &str, given: &Given, wrong: &mut Wrong) -> Option<Time> {
        if let Some(clock) = &self.clock {
            return wrong.take(self.of_messages(map, clock, given));
        }
        if self.rows_of.is_some() {
            wrong.say(fail(
                map,
                "`time.rows_of` needs clock = \"log\"",
                "it names a message of a log of messages",
            ));
        }
        match (self.source, self.settle_s) {
            (Some(source), None) => {
                let unit = self.unit.as_deref();
                let stamps = stamps(map, unit, self.order.as_deref(), wrong);
                if self.time_of_day.is_some() && unit != Some(dates::UNIT) {
                    wrong.say(fail(
                        map,
                        "`time.time_of_day` needs unit = \"date\"",
                        "it is the column with the time of day that belongs to the dates in `source`; a time of day without a date is a `source` with unit = \"time of day\"",
                    ));
                }
                let drop_stale = wrong.take(drop_stale(map, self.stale_rows.as_deref()));
                Some(Time::Column {
                    source,
                    time_of_day: self.time_of_day,
                    stamps: stamps?,
                    drop_stale: drop_stale?,
                })
            }
            (None, Some(settle_s)) => wrong.take(settled(map, settle_s)),
            (found, _) => {
                let words = if found.is_some() {
                    "[time] has both `source` and `settle_s`; allowed: one of them"
                } else {
                    "[time] has neither `source` nor `settle_s`"
                };
                let hint =
                    "name the column of stamps in `source`; `settle_s` is for tables of settled points";
                wrong.take(Err(fail(map, words, hint)))
            }
        }
    }

    fn of_messages(&self, map: &str, clock: &str, given: &Given) -> Result<Time, MapError> {
        if clock != "log" {
            return Err(fail(
                map,
                format!("`time.clock` = \"{clock}\" is outside what is allowed: \"log\""),
                "the stamps that the log of messages has; a table names its column of stamps in `source`",
            ));
        }
        let of_a_table = [&self.source, &self.unit, &self.time_of_day, &self.order, &self.stale_rows];
        if of_a_table.iter().any(|key| key.is_some()) || self.settle_s.is_some() {
            return Err(fail(
                map,
                "[time] has both `clock` and keys of a table; allowed beside `clock`: `rows_of`",
                "a log of messages has its stamps in seconds already",
            ));
        }
        let rows_of = self.rows_of.as_deref().map(|topic| given.fill(map, topic)).transpose()?;
        Ok(Time::Clock { rows_of })
    }
}

fn stamps(map: &str, unit: Option<&str>, order: Option<&str>, wrong: &mut Wrong) -> Option<Stamps> {
    let stated = wrong.take(order.map(|wanted| named_order(map, wanted)).transpose());
    if unit == Some(dates::UNIT) {
        return Some(Stamps::Dates { order: stated? });
    }
    if order.is_some() {
        wrong.say(fail(map, "`time.order` needs unit = \"date\"", "it says what a date begins with"));
    }
    if unit == Some(dates::OF_DAY) {
        return Some(Stamps::OfDay);
    }
    wrong.take(to_s(map, unit)).map(|to_s| Stamps::Numbers { to_s })
}

fn named_order(map: &str, wanted: &str) -> Result<Order, MapError> {
    Order::ALL.into_iter().find(|order| order.name() == wanted).ok_or_else(|| {
        let allowed = Order::ALL.map(|order| format!("\"{}\"", order.name())).join(", ");
        let words = format!("`time.order` = \"{wanted}\" is outside what is allowed: {allowed}");
        fail(map, words, "what a date begins with")
    })
}

fn to_s(map: &str, unit: Option<&str>) -> Result<f64, MapError> {
    let Some(symbol) = unit else {
        return Err(fail(
            map,
            "`time.unit` is missing",
            "write unit = \"s\", \"ms\", \"us\" or \"ns\", \"date\" for dates with their time of day, or \"time of day\" for one without a date; it is never guessed",
        ));
    };
    let unit = units::find(symbol).filter(|unit| unit.si == "s").ok_or_else(|| {
        let allowed = units::siblings("s");
        let words = format!(
            "`time.unit` = \"{symbol}\" is outside what is allowed: {allowed}, \"{}\", \"{}\"",
            dates::UNIT,
            dates::OF_DAY
        );
        fail(map, words, "write the unit of the stamps")
    })?;
    Ok(unit.factor)
}

fn drop_stale(map: &str, wanted: Option<&str>) -> Result<bool, MapError> {
    match wanted {
        None | Some("refuse") => Ok(false),
        Some("drop") => Ok(true),
        Some(other) => Err(fail(
            map,
            format!("`time.stale_rows` = \"{other}\" is outside what is allowed: \"refuse\", \"drop\""),
            "\"drop\" skips rows whose stamp does not come after the one before",
        )),
    }
}

fn settled(map: &str, settle_s: f64) -> Result<Time, MapError> {
    if settle_s.is_finite() && settle_s > 0.0 {
        return Ok(Time::Settled { settle_s });
    }
    Err(fail(
        map,
        format!("`time.settle_s` = {settle_s} is outside what is allowed: above 0"),
        "seconds that a point of the table is held",
    ))
}
