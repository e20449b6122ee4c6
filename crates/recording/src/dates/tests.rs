use proptest::prelude::*;
use time::{Date, PlainDateTime, Time};

use super::*;

const LINE: Place = Place::Line(7);

/// Seconds of each stamp, or what is wrong with the first that cannot be read.
fn read(stated: Option<Order>, stamps: &[&str]) -> Result<Vec<f64>, Problem> {
    let mut dates = Dates::new(stated);
    stamps.iter().map(|stamp| dates.take(LINE, "Zeit", Stamp::Whole(stamp))).collect()
}

#[test]
fn what_loggers_write_is_read() {
    for [first, second] in [
        ["2024-05-01 12:00:00.250", "2024-05-01 12:00:01"],
        ["2024-05-01 12:00:00:250", "2024-05-01 12:00:01:000"],
        ["01.05.2024 12:00:00:250000", "01.05.2024 12:00:01"],
        ["2024-05-01T12:00:00.25Z", "2024-05-01T12:00:01Z"],
        ["2024-05-01T14:00:00.25+02:00", "2024-05-01T12:00:01 UTC"],
        ["2024-05-01T14:00:00,25+0200", "2024-05-01T08:00:01-04"],
        ["2024/5/1 12:00:00.250000", "2024/5/1 12:00:01.000000"],
        ["01.05.2024 12:00:00,250", "01.05.2024 12:00:01,000"],
        ["1.5.2024, 12:00:00.25", "1.5.2024, 12:00:01"],
        ["01/05/2024 12:00:00.250", "01/05/2024 12:00:01.000"],
        ["05/01/2024 12:00:00.250 PM", "5/1/2024 12:00:01 pm"],
        ["05/01/2024 12:59:59.250 AM", "5/1/2024 1:00:00 AM"],
        ["01-May-2024 12:00:00.25", "1-MAY-2024 12:00:01"],
        [" 2024-05-01 23:59:59.25", "2024-05-02 00:00 "],
    ] {
        assert_eq!(read(None, &[first, second]), Ok(vec![0.0, 0.75]), "{first}");
    }
}

#[test]
fn what_is_no_date_is_refused_with_what_is_allowed() {
    for text in [
        "12:00:00",
        "2024-05-01",
        "2024-13-01 12:00",
        "2024-02-30 12:00",
        "24-05-01 12:00",
        "1714564800",
        "today",
        "2024-05-01 25:00:00",
        "2024-05-01 12:00:00 h",
        "2024-05-01 12:00:00.",
        "2024-05-01 12:00:00:25",
        "2024-05-01 12:00:00:5",
        "05.13.2024 12:00:00",
        "13:00 PM",
    ] {
        assert!(!is_date(text), "{text}");
        let error = read(None, &[text]).unwrap_err().to_string();
        for part in ["line 7, column `Zeit`", text, "allowed: 2024-05-01 12:00:00.250"] {
            assert!(error.contains(part), "{part} in {error}");
        }
    }
    let long = "x".repeat(1000);
    assert!(read(None, &[&long]).unwrap_err().to_string().len() < 400);
    assert!(read(None, &[" "]).unwrap()[0].is_nan(), "an empty cell");
}

#[test]
fn day_and_month_are_told_apart_or_asked_for() {
    let day_s = 86_400.0;
    // Within a day both orders give the same times, and over midnight a number above 12 tells which it is.
    assert_eq!(read(None, &["05/06/2024 10:00", "05/06/2024 10:01"]), Ok(vec![0.0, 60.0]));
    assert_eq!(read(None, &["12/06/2024 10:00", "13/06/2024 10:00"]), Ok(vec![0.0, day_s]));
    assert_eq!(read(None, &["06/12/2024 10:00", "06/13/2024 10:00"]), Ok(vec![0.0, day_s]));
    assert_eq!(read(None, &["05.06.2024 10:00", "06.06.2024 10:00"]), Ok(vec![0.0, day_s]), "dots");
    let over = ["05/06/2024 23:59", "06/06/2024 00:00"];
    let error = read(None, &over).unwrap_err();
    for part in ["line 7", "`Zeit`", "06/06/2024 00:00", "day-first or month-first", "order = "] {
        assert!(format!("{error} {}", error.hint()).contains(part), "{part} in {error}");
    }
    assert_eq!(read(Some(Order::DayFirst), &over), Ok(vec![0.0, 60.0]));
    assert_eq!(read(Some(Order::MonthFirst), &over), Ok(vec![0.0, 31.0 * day_s - 86_340.0]));
    // What stands is held to.
    let error = read(Some(Order::MonthFirst), &["13/06/2024 10:00"]).unwrap_err().to_string();
    assert!(error.contains("month-first"), "{error}");
    let error = read(None, &["13/06/2024 10:00", "06/13/2024 10:00"]).unwrap_err().to_string();
    assert!(error.contains("day-first"), "{error}");
    assert!(read(None, &["2024-06-13 10:00", "13.06.2024 10:00"]).is_err());
}

#[test]
fn a_time_of_day_passes_midnight_where_no_date_tells() {
    let read = |stamps: &[Stamp]| -> Result<Vec<f64>, Problem> {
        let mut dates = match stamps[0] {
            Stamp::OfDay(_) => Dates::of_day(),
            _ => Dates::new(None),
        };
        let read: Result<Vec<f64>, Problem> = stamps.iter().map(|s| dates.take(LINE, "Zeit", *s)).collect();
        assert_eq!(dates.midnights().is_some(), stamps.len() == 3, "{stamps:?}");
        read
    };
    for [first, second] in
        [["23:59:59.250", "0:00:00.000"], ["23:59:59,25", "00:00"], ["11:59:59:250 PM", "12:00:00:000 am"]]
    {
        let later = [Stamp::OfDay(first), Stamp::OfDay(second), Stamp::OfDay("00:00:10")];
        assert_eq!(read(&later), Ok(vec![0.0, 0.75, 10.75]), "{first}");
        // Beside a date that stands still it is the same, beside one that goes on nothing is added.
        let still = [first, second, "00:00:10"].map(|of_day| Stamp::InTwo("30.04.2024", of_day));
        assert_eq!(read(&still), Ok(vec![0.0, 0.75, 10.75]), "{first}");
        let dated = [Stamp::InTwo(" 30.04.2024", first), Stamp::InTwo("01.05.2024 ", second)];
        assert_eq!(read(&dated), Ok(vec![0.0, 0.75]), "{first}");
    }
    assert_eq!(
        read(&[Stamp::OfDay("12:00:01"), Stamp::OfDay("11:00:01")]),
        Ok(vec![0.0, -3600.0]),
        "set back"
    );
    for text in ["2024-05-01 12:00:00", "2024-05-01", "12", "12:60", "12:00:00:5", "noon"] {
        assert!(!is_time_of_day(text), "{text}");
        let error = Dates::of_day().take(LINE, "Zeit", Stamp::OfDay(text)).unwrap_err().to_string();
        for part in ["line 7, column `Zeit`", text, "allowed: 12:00:00.250"] {
            assert!(error.contains(part), "{part} in {error}");
        }
    }
    assert!(is_day("2024-05-01") && is_day("31/05/2024") && is_day("31-May-2024"));
    assert!(!is_day("2024-05-01 12:00") && !is_day("12:00") && !is_day("1.5") && !is_day(""));
}

#[test]
fn a_survey_takes_the_nearest_time_and_proposes_the_order_that_the_whole_column_tells() {
    let through = |stamps: &[&str]| {
        let mut dates = Dates::new(None);
        let mut now_s = 0.0;
        stamps.iter().for_each(|stamp| now_s = dates.nearest_s(Stamp::Whole(stamp)));
        (now_s, dates.proposed())
    };
    let (days_s, asked) = through(&["05/06/2024 10:00", "06/06/2024 10:00"]);
    assert_eq!(days_s, 86_400.0);
    assert!(asked.starts_with("# order = "), "{asked}");
    let later: Vec<String> = (5..20).map(|day| format!("{day:02}/06/2024 10:00")).collect();
    let later: Vec<&str> = later.iter().map(String::as_str).collect();
    assert_eq!(through(&later), (14.0 * 86_400.0, "order = \"day-first\"\n".into()));
    assert_eq!(through(&["05/06/2024 10:00", "05/06/2024 10:01"]).1, "", "both give the same");
    assert_eq!(through(&["2024-05-01 10:00"]).1, "");
}

fn instant() -> impl Strategy<Value = PlainDateTime> {
    (1970..2100_i32, 1..=365_u16, 0..24_u8, 0..60_u8, 0..60_u8, 0..1_000_000_000_u32).prop_map(
        |(year, day, hour, minute, second, ns)| {
            let date = Date::from_ordinal_date(year, day).unwrap();
            PlainDateTime::new(date, Time::from_hms_nano(hour, minute, second, ns).unwrap())
        },
    )
}

/// An instant as people write it in each order.
fn written(order: Order, at: PlainDateTime, mark: char) -> String {
    let (year, month, day) = (at.year(), u8::from(at.month()), at.day());
    let date = match order {
        Order::YearFirst => format!("{year}-{month:02}-{day:02}"),
        Order::DayFirst => format!("{day:02}.{month:02}.{year}"),
        Order::MonthFirst => format!("{month}/{day}/{year}"),
    };
    let (minute, second, ns) = (at.minute(), at.second(), at.nanosecond());
    match order {
        Order::MonthFirst => {
            let (hour, half) = ((at.hour() + 11) % 12 + 1, if at.hour() < 12 { "AM" } else { "PM" });
            format!("{date} {hour}:{minute:02}:{second:02}{mark}{ns:09} {half}")
        }
        _ => format!("{date} {:02}:{minute:02}:{second:02}{mark}{ns:09}", at.hour()),
    }
}

proptest! {
    /// Whatever the instants and the form: the seconds between them.
    #[test]
    fn an_instant_in_any_form_is_the_same_time(
        first in instant(),
        second in instant(),
        order in prop::sample::select(Order::ALL.to_vec()),
        comma: bool,
        zone_minutes in -840..=840_i64,
    ) {
        let ns = |at: PlainDateTime| at.assume_utc().unix_timestamp_nanos();
        let wanted_s = (ns(second) - ns(first)) as f64 / 1e9;
        let mark = if comma { ',' } else { '.' };
        let stamps = [first, second].map(|at| written(order, at, mark));
        let stamps = stamps.each_ref().map(String::as_str);
        prop_assert_eq!(read(Some(order), &stamps), Ok(vec![0.0, wanted_s]));
        // Alone, whenever it is read at all.
        if let Ok(read) = read(None, &stamps) {
            prop_assert_eq!(read[1], wanted_s);
        }
        let sign = if zone_minutes < 0 { '-' } else { '+' };
        let (hours, minutes) = (zone_minutes.abs() / 60, zone_minutes.abs() % 60);
        let zoned = format!("{}{sign}{hours:02}:{minutes:02}", written(Order::YearFirst, first, mark));
        let plain = format!("{}Z", written(Order::YearFirst, first, mark));
        prop_assert_eq!(read(None, &[&zoned, &plain]).unwrap()[1], 60.0 * zone_minutes as f64);
    }

    #[test]
    fn any_text_is_read_or_refused(stamps in prop::collection::vec("[0-9/.:, TZ+-]{0,30}|\\PC{0,30}", 1..5)) {
        let stamps: Vec<&str> = stamps.iter().map(String::as_str).collect();
        if let Err(error) = read(None, &stamps) {
            prop_assert!(error.to_string().contains("line 7") && !error.hint().is_empty());
        }
    }
}
