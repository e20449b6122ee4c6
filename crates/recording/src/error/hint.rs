//! What to do about it.

use super::{Place, Problem};
use crate::dates::{is_date, is_day, is_time_of_day};
use crate::decimal::has_comma;
use crate::log::names::symbol;

impl Problem {
    /// The way out.
    pub fn hint(&self) -> String {
        match self {
            Problem::Unreadable { .. } => "check the path and that the file may be read".into(),
            Problem::Folder { inside: Some(log) } => format!("name {log}; the files of a bag in several parts are read one by one, and all recordings of a folder at once by `fit` and `diagnose` only"),
            Problem::Folder { inside: None } => "name the log itself; no file in this folder is called like a recording or a log (.csv, .mcap, .ulg, .bin, .db3, .bfl, .bbl, .log; plain or .gz)".into(),
            Problem::Packed { hint, .. } => (*hint).into(),
            Problem::UnknownFormat { .. } => "name the file REC.csv, REC.csv.gz, REC.mcap or REC.parquet".into(),
            Problem::Empty => "was the logger stopped before its first row?".into(),
            Problem::NotText { .. } => {
                "a table, or a spreadsheet, must be saved as CSV in UTF-8; a log of another format must be converted to one of these".into()
            }
            Problem::Utf16Unmarked => {
                "save it as CSV in UTF-8; or `iconv -f UTF-16LE -t UTF-8 FILE` (UTF-16BE where the zero comes first)".into()
            }
            Problem::Delimiter { .. } => {
                "save the file with a delimiter that is allowed, or correct `delimiter` in the column map".into()
            }
            Problem::NoNames { .. } => {
                "write a line of names above the rows; or bring the file in with a column map that calls its columns column_1, column_2 and so on: `kort columns LOG -o MAP` writes its frame".into()
            }
            Problem::DuplicateColumn { .. } => "rename or remove one of the two".into(),
            Problem::UnnamedColumn { .. } => {
                "name it, or remove the column; an extra comma at the end of the header is one".into()
            }
            Problem::MissingTime { hint, .. } | Problem::MappedColumnMissing { hint, .. } => hint.clone(),
            Problem::UnitMissing { .. } => {
                "rename the column if its values are in that unit; otherwise bring the log in with a column map (--columns NAME), which states the unit"
                    .into()
            }
            Problem::RowLength { .. } => {
                "cells are parted by commas, or what the column map's `delimiter` says; a decimal comma or a comma in a text must be quoted there".into()
            }
            Problem::HeaderLonger { .. } => {
                "a name with a delimiter in it must be quoted, one too many taken out; or a column map says which names no row has a cell for: without_cells = [\"NAME\"], above [time]; if only this row is too short, fill it up".into()
            }
            Problem::TimeEmpty { .. } => "fill in the time, or remove the row".into(),
            Problem::TimeNotIncreasing { before, value, .. } if before == value => {
                "where rows come faster than their stamps can tell, as stamps of whole seconds, have the logger write fractions of a second; of rows with one stamp a column map may keep the first: [time] stale_rows = \"drop\"".into()
            }
            Problem::TimeNotIncreasing { .. } => {
                "sort the rows and remove repeated stamps; separate runs belong in separate files; a column map may say [time] stale_rows = \"drop\"".into()
            }
            Problem::NotANumber { text, .. } if has_comma(text) => {
                "a decimal comma is read where the column map says decimal = \",\"; `kort columns LOG` proposes such a map; a mark for thousands is not read: save the file without".into()
            }
            Problem::NotANumber { text, .. } if is_date(text) => {
                "dates are read where the column map says [time] unit = \"date\"; `kort columns LOG` proposes such a map".into()
            }
            Problem::NotANumber { text, .. } if is_time_of_day(text) => {
                "a time of day is read where the column map says [time] unit = \"time of day\", or names it in `time_of_day` beside a column of dates; `kort columns LOG` proposes such a map".into()
            }
            Problem::NotANumber { text, .. } if is_day(text) => {
                "a date is read where the column map says [time] unit = \"date\" and names in `time_of_day` the column with its time of day; `kort columns LOG` proposes such a map".into()
            }
            Problem::NotADate { text, .. } if is_day(text) => {
                "name the column with the time of day in [time] time_of_day; a date alone tells no instant".into()
            }
            Problem::NotADate { text, .. } if is_time_of_day(text) => {
                "a time of day without a date is read where the column map says [time] unit = \"time of day\"".into()
            }
            Problem::NotATimeOfDay { .. } => {
                "write all stamps in one of these forms, or as numbers with their unit; for dates the column map says [time] unit = \"date\"".into()
            }
            Problem::NotADate { .. } => {
                "write all stamps in one of these forms, or as numbers with their unit; the column map may state `order` in [time]: \"year-first\", \"day-first\" or \"month-first\"".into()
            }
            Problem::DateOrder { .. } => {
                "say in the column map [time] order = \"day-first\" or \"month-first\"; `kort columns LOG` proposes it where a later row tells".into()
            }
            Problem::NotANumber { place: Place::Line(2), text, .. } if symbol(text).is_some() => {
                "a row of units below names of our own must repeat the units that they end in; other names come in through a column map: `kort columns LOG` proposes one".into()
            }
            Problem::PointBesideComma { .. } => {
                "write the file without marks for thousands and with one decimal mark throughout, or correct `decimal` in the map".into()
            }
            Problem::NotANumber { .. } => {
                "correct the cell, or take its row out; a column of text is left out where a column map (--columns NAME) does not name it".into()
            }
            Problem::NotFinite { .. } => "leave the cell empty if there was no sample; through a column map (--columns NAME) such a cell is none".into(),
            Problem::TooFewRows { .. } => "was the logger stopped too early?".into(),
            Problem::NothingSelected { .. } => "give the value after the map's name: --columns NAME:VALUE".into(),
            Problem::MapWanted { .. } => {
                "`kort columns LOG` lists what is in it and which map fits; then --columns NAME".into()
            }
            Problem::ClockWanted { .. } => "such a map has [time] clock = \"log\"; `kort columns LOG` proposes one".into(),
            Problem::TableWanted { .. } => {
                "a map for tables names the column of stamps: [time] source and unit; `kort columns LOG` proposes one".into()
            }
            Problem::Broken { format: crate::formats::CANDUMP, .. } => {
                "log frames with their time stamps: `candump -L can0 > FILE`, `candump -l can0`, or `candump -t a can0 > FILE`".into()
            }
            Problem::Broken { .. } => "was the file copied whole? A log that was cut off is read up to where it ends".into(),
            Problem::NoChannel { .. } => "`kort columns LOG` lists what can be read; else export the signals with JSON messages, or as CSV".into(),
            Problem::Mcap { .. } => "a file cut off by a killed process is read up to its last complete chunk; this one has none".into(),
        }
    }
}
