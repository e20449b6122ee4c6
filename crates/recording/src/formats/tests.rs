use std::io::Cursor;

use flate2::{Compression, write::GzEncoder};
use proptest::prelude::*;

use super::*;
use crate::{Column, Place};

fn csv(text: &str) -> Result<Recording, Problem> {
    decode("rec.csv", text.as_bytes(), None)
}

fn sample(rows: usize) -> Recording {
    let time_s: Vec<f64> = (0..rows).map(|i| i as f64 * 0.01).collect();
    let some = |i: usize| if i.is_multiple_of(5) { i as f64 * 0.1 } else { f64::NAN };
    Recording {
        name: "rec".into(),
        columns: vec![
            Column::new("current_cmd_a", time_s.iter().map(|t| t.sin()).collect()),
            Column::new("flow_m_s", (0..rows).map(some).collect()),
        ],
        time_s,
        ..Recording::default()
    }
}

fn written(recording: &Recording, format: Format) -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    recording.write(format, &mut out).unwrap();
    out.into_inner()
}

fn same(a: &Recording, b: &Recording) -> bool {
    let bits = |v: &[f64]| v.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    bits(&a.time_s) == bits(&b.time_s)
        && a.columns.len() == b.columns.len()
        && a.columns.iter().all(|c| b.column(&c.name).is_some_and(|other| bits(other) == bits(&c.values)))
}

#[test]
fn every_format_gives_back_the_same_bits() {
    let recording = sample(1000);
    for format in [Format::Csv, Format::CsvGz, Format::Mcap] {
        let bytes = written(&recording, format);
        let back = decode("rec", bytes.as_slice(), None).unwrap();
        assert!(same(&recording, &back), "{format:?}");
        assert!(back.losses.is_empty(), "{format:?}: {:?}", back.losses);
    }
}

#[test]
fn contract_example_reads() {
    let r = csv("time_s,current_cmd_a,flow_m_s,valve_open\n0.00,1.5,,0\n0.01,1.5,0.25,1\n").unwrap();
    assert_eq!(r.time_s, [0.0, 0.01]);
    assert!(r.column("flow_m_s").unwrap()[0].is_nan());
    assert!(r.columns[0].known && !r.columns[2].known);
    let quoted = csv("\u{feff}\"time_s\",\"thrust_n\"\r\n\"0\",\"1e-3\"\r\n 1 , +2 \r\n").unwrap();
    assert_eq!(quoted.column("thrust_n").unwrap(), [1e-3, 2.0]);
}

#[test]
fn bad_input_is_named() {
    let place = Place::Line(3);
    for (text, wanted) in [
        ("", Problem::Empty),
        ("time_s,thrust_n\n", Problem::TooFewRows { found: 0 }),
        ("time_s,thrust_n\n0,1\n", Problem::TooFewRows { found: 1 }),
        (
            "time_s,thrust_n,thrust_n\n0,1,1\n",
            Problem::DuplicateColumn { column: "thrust_n".into(), first: 2, second: 3 },
        ),
        ("time_s,thrust_n,\n0,1,\n", Problem::UnnamedColumn { position: 3 }),
        (
            "time_s,thrust_n\n0,1\n0,2\n",
            Problem::TimeNotIncreasing {
                place,
                column: "time_s".into(),
                before: "0".into(),
                value: "0".into(),
            },
        ),
        (
            "time_s,thrust_n\n1,1\n0.5,2\n",
            Problem::TimeNotIncreasing {
                place,
                column: "time_s".into(),
                before: "1".into(),
                value: "0.5".into(),
            },
        ),
        ("time_s,thrust_n\n1,1\n,2\n", Problem::TimeEmpty { place, column: "time_s".into() }),
        (
            "time_s,thrust_n\n1,1\n2,ten\n",
            Problem::NotANumber { place, column: "thrust_n".into(), text: "ten".into() },
        ),
        (
            "time_s,thrust_n\n1,1\n2,NaN\n",
            Problem::NotFinite { place, column: "thrust_n".into(), text: "NaN".into() },
        ),
        (
            "time_s,thrust_n\n1,1\n2,-inf\n",
            Problem::NotFinite { place, column: "thrust_n".into(), text: "-inf".into() },
        ),
        (
            "time_s,thrust_n\n1,1\n2,1e999\n",
            Problem::NotFinite { place, column: "thrust_n".into(), text: "1e999".into() },
        ),
        ("time_s,thrust_n\n1,1\n2\n3,1\n", Problem::RowLength { place, found: 1, expected: 2 }),
        ("time_s,thrust_n\n1,1\n2,1,1\n", Problem::RowLength { place, found: 3, expected: 2 }),
    ] {
        assert_eq!(csv(text).unwrap_err(), wanted, "{text:?}");
    }
    assert!(matches!(csv("time,thrust_n\n0,1\n").unwrap_err(), Problem::MissingTime { .. }));
    assert!(
        matches!(csv("t;thrust_n\n0;1\n").unwrap_err(), Problem::MissingTime { hint, found, .. } if found == "t, thrust_n" && hint.contains("kort columns"))
    );
    assert!(matches!(csv("time_s,shaft_speed\n0,1\n").unwrap_err(), Problem::UnitMissing { .. }));
    for bytes in [&b"time_s,\x81\n0,1\n"[..], b"time_s,thrust_n\n0,\x81\n", b"time_s,thrust_n\n0,\0\n"] {
        assert!(matches!(decode("rec", bytes, None).unwrap_err(), Problem::NotText { .. }));
    }
    for bytes in [&b"t\0i\0m\0e\0_\0s\0\n\0"[..], b"\0t\0i\0m\0e\0_\0s\0\n"] {
        assert_eq!(decode("rec", bytes, None).unwrap_err(), Problem::Utf16Unmarked);
    }
}

#[test]
fn a_cut_off_csv_keeps_its_whole_rows_and_says_so() {
    let r = csv("time_s,thrust_n,flow_m_s\n0,1,1\n1,2,2\n2,3").unwrap();
    assert_eq!(r.rows(), 2);
    assert_eq!(r.losses.len(), 1);
    let whole = csv("time_s,thrust_n\n0,1\n1,2").unwrap();
    assert!(whole.losses.is_empty());
    let gz = written(&sample(50_000), Format::CsvGz);
    let torn = decode("rec", &gz[..gz.len() / 2], None).unwrap();
    assert!(torn.rows() > 1000 && !torn.losses.is_empty());
}

#[test]
fn a_torn_mcap_opens_up_to_its_last_complete_chunk() {
    let whole = sample(200_000);
    let bytes = written(&whole, Format::Mcap);
    let torn = decode("rec", &bytes[..bytes.len() * 6 / 10], None).unwrap();
    assert!(torn.rows() > 50_000 && torn.rows() < 150_000, "{}", torn.rows());
    assert!(torn.losses[0].contains("cut off"), "{:?}", torn.losses);
    assert!(torn.time_s[..] == whole.time_s[..torn.rows()]);
    let early = decode("rec", &bytes[..bytes.len() / 10], None).unwrap();
    assert!(early.rows() > 10_000, "{}", early.rows());
    // Only the index at the end missing: every message is there, and the file still says so.
    let data_only = decode("rec", &bytes[..bytes.len() - 20], None).unwrap();
    assert_eq!(data_only.rows(), whole.rows());
    assert!(matches!(decode("rec", &bytes[..100], None).unwrap_err(), Problem::Mcap { .. }));
}

#[test]
fn a_damaged_chunk_of_an_mcap_takes_no_more_with_it() {
    let whole = sample(200_000);
    let mut bytes = written(&whole, Format::Mcap);
    let chunks = ::mcap::Summary::read(&bytes).unwrap().unwrap().chunk_indexes;
    let chunk = &chunks[chunks.len() / 2];
    bytes[(chunk.chunk_start_offset + chunk.chunk_length / 2) as usize] ^= 0x55;
    let damaged = decode("rec", bytes.as_slice(), None).unwrap();
    assert!(damaged.rows() > 100_000 && damaged.rows() < 200_000, "{}", damaged.rows());
    assert_eq!(damaged.time_s.last(), whole.time_s.last());
    assert!(damaged.losses.len() == 1 && damaged.losses[0].starts_with("1 of "), "{:?}", damaged.losses);
}

/// As a logger that is stopped at once leaves it: not a file of others.
#[test]
fn a_recording_without_a_row_says_so_in_every_format() {
    for format in [Format::Csv, Format::CsvGz, Format::Mcap] {
        let mut out = Cursor::new(Vec::new());
        Writer::create(format, TOPIC, &["thrust_n"], &mut out).unwrap().finish().unwrap();
        let refused = decode("rec", out.into_inner().as_slice(), None).unwrap_err();
        assert_eq!(refused, Problem::TooFewRows { found: 0 }, "{format:?}");
    }
}

#[test]
fn a_flushed_mcap_keeps_its_rows_without_an_end() {
    let mut out = Cursor::new(Vec::new());
    let mut writer = Writer::create(Format::Mcap, "t1", &["thrust_n"], &mut out).unwrap();
    for i in 0..100 {
        writer.row(f64::from(i), &[1.0]).unwrap();
    }
    writer.flush().unwrap();
    std::mem::forget(writer);
    let bytes = out.into_inner();
    let torn = decode("rec", bytes.as_slice(), None).unwrap();
    assert_eq!(torn.rows(), 100);
    assert_eq!(torn.losses.len(), 1);
    // Who goes by a file's end finds one.
    assert!(::mcap::read::footer(&bytes).is_ok());
    let messages = ::mcap::MessageStream::new(&bytes).unwrap();
    assert_eq!(messages.filter(|message| message.is_ok()).count(), 100);
}

/// What is left of a filtered signal long after its end has three hundred zeros behind the point.
#[test]
fn the_smallest_numbers_are_short_in_csv_too() {
    let mut out = Cursor::new(Vec::new());
    let mut writer = Writer::create(Format::Csv, "t1", &["thrust_n"], &mut out).unwrap();
    let values = [5e-324, -1.5e-310, 2.5e-7, 1e-6, 0.0];
    for (i, value) in values.into_iter().enumerate() {
        writer.row(i as f64, &[value]).unwrap();
    }
    writer.finish().unwrap();
    let bytes = out.into_inner();
    let text = String::from_utf8(bytes.clone()).unwrap();
    assert_eq!(text, "time_s,thrust_n\n0,5e-324\n1,-1.5e-310\n2,2.5e-7\n3,0.000001\n4,0\n");
    assert_eq!(decode("rec", bytes.as_slice(), None).unwrap().column("thrust_n").unwrap(), values);
}

#[test]
fn a_map_takes_over_what_it_names() {
    let map = ColumnMap::from_toml(
        "m",
        "[time]\nsource = \"t_ms\"\nunit = \"ms\"\nstale_rows = \"drop\"\n[select]\nsource = \"run\"\nvalue = \"b\"\n\
         [columns.shaft_speed_rad_s]\nsource = \"n\"\nunit = \"rev/s\"\nsign_of = \"pwm\"\nsign_zero = 1500\n\
         [columns.duty_cmd]\nsource = \"pwm\"\nunit = \"1\"\nscale = 0.0025\noffset = -3.75\n",
    )
    .unwrap();
    let text = "run,t_ms,n,pwm,label\na,0,1,1500,x\nb,5,1,1400,y\nb,5,1,1400,y\nb,10,2,1700,y\n";
    let r = decode("rec", text.as_bytes(), Some(&map)).unwrap();
    assert_eq!(r.time_s, [0.005, 0.01]);
    let tau = std::f64::consts::TAU;
    assert_eq!(r.column("shaft_speed_rad_s").unwrap(), [-tau, 2.0 * tau]);
    assert!((r.column("duty_cmd").unwrap()[1] - 0.5).abs() < 1e-12);
    assert_eq!(r.unused, ["label"]);
    assert_eq!(r.losses.len(), 1, "the stale row is counted");
    let mut other = map.clone();
    other.select.as_mut().unwrap().value = "c".into();
    let error = decode("rec", text.as_bytes(), Some(&other)).unwrap_err();
    assert_eq!(
        error,
        Problem::NothingSelected { column: "run".into(), wanted: "c".into(), found: "a, b".into() }
    );
}

#[test]
fn a_settled_table_shows_its_response_at_the_end_of_each_hold() {
    let map = ColumnMap::from_toml(
        "m",
        "[time]\nsettle_s = 2.0\n[columns.duty_cmd]\nsource = \"u\"\nunit = \"%\"\n[columns.thrust_n]\nsource = \"f\"\nunit = \"gf\"\n",
    )
    .unwrap();
    let r = decode("rec", "u,f\n10,1000\n20,2000\n".as_bytes(), Some(&map)).unwrap();
    assert_eq!(r.time_s, [0.0, 1.9, 2.0, 3.9]);
    assert_eq!(r.column("duty_cmd").unwrap(), [0.1, 0.1, 0.2, 0.2]);
    let thrust = r.column("thrust_n").unwrap();
    assert!(thrust[0].is_nan() && (thrust[1] - 9.80665).abs() < 1e-9 && thrust[2].is_nan());
}

#[test]
fn a_foreign_mcap_of_several_channels_is_joined_on_log_time() {
    let mut out = Cursor::new(Vec::new());
    let mut writer = ::mcap::Writer::new(&mut out).unwrap();
    let mut channel =
        |topic: &str, encoding: &str| writer.add_channel(0, topic, encoding, &Default::default()).unwrap();
    let (a, b, c) = (channel("/motor", "json"), channel("/water", "json"), channel("/video", "cdr"));
    for i in 0..10_u64 {
        let mut put = |channel_id, data: String| {
            let header = ::mcap::records::MessageHeader {
                channel_id,
                sequence: 0,
                log_time: 5_000_000_000 + i * 10_000_000,
                publish_time: 0,
            };
            writer.write_to_known_channel(&header, data.as_bytes()).unwrap();
        };
        put(a, format!("{{\"current_a\":{i},\"ok\":true,\"note\":\"x\"}}"));
        put(b, format!("{{\"flow_m_s\":{i},\"box\":{{\"temperature_c\":20}}}}"));
        put(c, "?".into());
    }
    writer.finish().unwrap();
    drop(writer);
    let r = decode("rec", out.into_inner().as_slice(), None).unwrap();
    assert_eq!(r.rows(), 10);
    assert!((r.time_s[9] - 0.09).abs() < 1e-12);
    assert_eq!(r.column("flow_m_s").unwrap()[9], 9.0);
    assert!(r.column("box.temperature_c").is_some() && r.column("ok").is_some());
    assert!(r.notes[0].contains("/video"));
}

#[test]
fn gaps_are_noted() {
    let mut text = String::from("time_s,thrust_n\n");
    for i in 0..50 {
        text += &format!("{},1\n", if i < 25 { f64::from(i) * 0.01 } else { 3.0 + f64::from(i) * 0.01 });
    }
    assert!(csv(&text).unwrap().notes[0].contains("1 gap(s)"));
}

/// A disk that grows to so many bytes and no more.
struct Small(Cursor<Vec<u8>>, usize);

impl Write for Small {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        match self.1.saturating_sub(self.0.position() as usize).min(bytes.len()) {
            0 => Err(std::io::ErrorKind::StorageFull.into()),
            fits => self.0.write(&bytes[..fits]),
        }
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl std::io::Seek for Small {
    fn seek(&mut self, to: std::io::SeekFrom) -> std::io::Result<u64> {
        self.0.seek(to)
    }
}

#[test]
fn a_full_disk_is_called_that_and_what_it_holds_reads() {
    for bytes in [20_000, 20_001, 33_333, 60_000] {
        let mut disk = Small(Cursor::new(Vec::new()), bytes);
        let mut rows = LiveMcap::live("t1", &["thrust_n"], Default::default(), 0, &mut disk).unwrap();
        let refused = (0..200_000).find_map(|i| {
            let row = rows.row(f64::from(i) * 1e-3, &[f64::from(i).sin()]);
            row.and_then(|()| if i % 100 == 0 { rows.flush() } else { Ok(()) }).err()
        });
        assert_eq!(refused.expect("it is full").kind(), std::io::ErrorKind::StorageFull);
        assert_eq!(rows.finish().expect_err("it stays so").kind(), std::io::ErrorKind::StorageFull);
        let written = disk.0.into_inner();
        assert_eq!(written.len(), bytes);
        let read = decode("rec", written.as_slice(), None).unwrap();
        assert!(read.rows() > 100 && read.losses.len() == 1, "{bytes}: {} {:?}", read.rows(), read.losses);
        assert!(::mcap::read::footer(&written).is_ok(), "{bytes}: it ends like any file");
    }
}

/// What the crate beneath believes: the length of a text, 4 GiB of it, and that an attachment has its end.
#[test]
fn an_mcap_whose_records_are_shorter_than_they_say_is_refused() {
    let mut bytes = written(&sample(3), Format::Mcap);
    let library = 8 + 9 + 4;
    bytes[library..library + 4].fill(0xff);
    let refused = decode("rec", bytes.as_slice(), None).unwrap_err().to_string();
    assert!(refused.contains("longer than its record"), "{refused}");
    let mut attached = ::mcap::MAGIC.to_vec();
    attached.push(::mcap::records::op::ATTACHMENT);
    attached.extend(32_u64.to_le_bytes());
    attached.extend([0; 32]);
    assert!(decode("rec", attached.as_slice(), None).is_err());
}

proptest! {
    #[test]
    fn no_bytes_make_it_panic(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        let _ = decode("rec", bytes.as_slice(), None);
        let mut mcap = ::mcap::MAGIC.to_vec();
        mcap.extend_from_slice(&bytes);
        let _ = decode("rec", mcap.as_slice(), None);
        let mut zipped = GzEncoder::new(Vec::new(), Compression::fast());
        zipped.write_all(&bytes).unwrap();
        let _ = decode("rec", zipped.finish().unwrap().as_slice(), None);
    }

    #[test]
    fn a_damaged_mcap_never_panics(at in 8_usize..2000, byte in any::<u8>(), cut in 0_usize..4000) {
        let mut bytes = written(&sample(300), Format::Mcap);
        let n = bytes.len();
        bytes[at % n] = byte;
        bytes.truncate(n - cut % n);
        let _ = decode("rec", bytes.as_slice(), None);
    }

    #[test]
    fn csv_like_text_never_panics(text in "time_s,[a-z_]{0,12}\n([-0-9.eNa,\"]{0,14}\n){0,8}") {
        let _ = csv(&text);
    }

    #[test]
    fn any_recording_survives_any_format(
        steps in proptest::collection::vec((1e-6..10.0_f64, proptest::option::of(-1e12..1e12_f64)), 2..60),
        start in -100.0..100.0_f64,
    ) {
        let mut now = start;
        let time_s: Vec<f64> = steps.iter().map(|(dt, _)| { now += dt; now }).collect();
        let values = steps.iter().map(|(_, v)| v.unwrap_or(f64::NAN)).collect();
        let recording = Recording { time_s, columns: vec![Column::new("thrust_n", values)], ..Recording::default() };
        prop_assume!(recording.columns[0].samples() > 0);
        for format in [Format::Csv, Format::CsvGz, Format::Mcap] {
            let back = decode("rec", written(&recording, format).as_slice(), None).unwrap();
            prop_assert!(same(&recording, &back), "{:?}", format);
        }
    }
}
