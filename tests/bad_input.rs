//! Recordings that cannot be used, handed to the built program: exit code 2, the place, the value, a hint; and
//! recordings that lost something: exit code 3. The recording comes in as a replay of `kort simulate`.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use kort_recording::{Column, Format, Recording};

/// Replays `column` of `recording` into a simulated run.
fn replay(folder: &Path, recording: &Path, column: &str, columns: Option<&str>) -> Output {
    let scenario = folder.join("replay.toml");
    let map = columns.map_or(String::new(), |c| format!("columns = \"{c}\"\n"));
    let text = format!(
        "command = \"current_cmd_a\"\n[[segments]]\nkind = \"replay\"\nrecording = \"{}\"\ncolumn = \"{column}\"\nduration_s = 0.5\n{map}",
        recording.display()
    );
    std::fs::write(&scenario, text).unwrap();
    Command::new(env!("CARGO_BIN_EXE_kort"))
        .args(["simulate", "--rig", "whitcomb-yoerger-1999", "--scenario"])
        .arg(&scenario)
        .arg("-o")
        .arg(folder.join("out.csv"))
        .output()
        .unwrap()
}

fn file(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    std::fs::File::create(&path).unwrap().write_all(bytes).unwrap();
    path
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn every_kind_of_bad_recording_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let cases: &[(&[u8], &[&str])] = &[
        (b"", &["empty"]),
        (b"time_s,current_a\n", &["0 row(s)", "at least 2"]),
        (b"time_s,current_a\n0,1\n", &["1 row(s)"]),
        (b"time,current_a\n0,1\n1,1\n", &["time_s", "time"]),
        (b"time_s;current_a\n0,5;1\n1;1\n", &["line 2", "time_s", "\"0,5\"", "kort columns"]),
        (b"time_s,current_a,current_a\n0,1,1\n1,1,1\n", &["current_a", "twice", "2 and 3"]),
        (b"time_s,current_a,\n0,1,\n1,1,\n", &["position 3"]),
        (b"time_s,current\n0,1\n1,1\n", &["`current`", "current_a", "column map"]),
        (b"time_s,shaft_speed_rpm\n0,1\n1,1\n", &["shaft_speed_rpm", "shaft_speed_rad_s"]),
        (b"time_s,current_a\n0,1\n0,1\n", &["line 3", "time_s", "= 0", "strictly increasing"]),
        (b"time_s,current_a\n0,1\n1,1\n0.5,1\n", &["line 4", "0.5", "after 1"]),
        (b"time_s,current_a\n0,1\n,1\n", &["line 3", "time_s", "empty"]),
        (b"time_s,current_a\n0,1\n1,one\n", &["line 3", "current_a", "\"one\""]),
        (b"time_s,current_a\n0,1\n1,NaN\n", &["line 3", "current_a", "\"NaN\"", "not finite"]),
        (b"time_s,current_a\n0,1\ninf,1\n", &["line 3", "time_s", "\"inf\""]),
        (b"time_s,current_a\n0,1\n1\n2,1\n", &["line 3", "1 cells", "2"]),
        (b"time_s,current_a\n0,\x81\x8d\n1,1\n", &["line 2", "UTF-8", "Windows-1252"]),
        (b"time_s,current_a\n0,\xff\xfe\n1,1\n", &["line 2", "current_a", "\"\u{ff}\u{fe}\""]),
        (b"Bench 3\nWater 18 C\n\ntime_s,current_a\n0,1\n1,one\n", &["line 6", "current_a", "\"one\""]),
        (b"\x89MCAP0\r\n\x00\x01\x02", &["MCAP"]),
        (b"\x1f\x8b\x08\x00garbage", &["bad.csv"]),
    ];
    for (bytes, words) in cases {
        let path = file(folder.path(), "bad.csv", bytes);
        let output = replay(folder.path(), &path, "current_a", None);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{words:?}: {said}");
        assert!(output.stdout.is_empty() && !folder.path().join("out.csv").exists());
        for word in words.iter().chain(&["bad.csv", "hint:"]) {
            assert!(said.contains(word), "`{word}` is missing in: {said}");
        }
        assert!(!said.contains("panicked"), "{said}");
    }
    let folder_itself = replay(folder.path(), folder.path(), "current_a", None);
    assert_eq!(folder_itself.status.code(), Some(2));
}

#[test]
fn maps_that_do_not_fit_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let log = file(folder.path(), "log.csv", b"t_ms,i,run\n0,1,a\n10,2,a\n20,3,b\n30,3,b\n");
    let time = "[time]\nsource = \"t_ms\"\nunit = \"ms\"\n";
    for (map, words) in [
        (format!("{time}[columns.current_a]\nsource = \"i\"\n"), "unit"),
        (format!("{time}[columns.current_a]\nsource = \"i\"\nunit = \"V\"\n"), "\"mA\""),
        (format!("{time}[columns.current_a]\nsource = \"I_motor\"\nunit = \"A\"\n"), "I_motor"),
        (format!("{time}[columns.current]\nsource = \"i\"\nunit = \"A\"\n"), "current_a"),
        ("[columns.current_a]\nsource = \"i\"\nunit = \"A\"\n".into(), "time"),
        (
            format!(
                "{time}[select]\nsource = \"run\"\nvalue = \"c\"\n[columns.current_a]\nsource = \"i\"\nunit = \"A\"\n"
            ),
            "a, b",
        ),
    ] {
        let path = file(folder.path(), "map.toml", map.as_bytes());
        let output = replay(folder.path(), &log, "current_a", Some(path.to_str().unwrap()));
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{map}: {said}");
        assert!(said.contains(words) && said.contains("hint:"), "`{words}` is missing in: {said}");
    }
    let output = replay(folder.path(), &log, "current_a", Some("vortex"));
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("vortex-auv-pool"), "{}", stderr(&output));
}

#[test]
fn what_was_lost_is_said_and_ends_in_exit_code_3() {
    let folder = tempfile::tempdir().unwrap();
    let time_s: Vec<f64> = (0..100_000).map(|i| f64::from(i) * 0.01).collect();
    let column = Column::new("current_a", time_s.iter().map(|t| t.sin()).collect());
    let whole = Recording { time_s, columns: vec![column], ..Recording::default() };
    for (name, format) in
        [("torn.mcap", Format::Mcap), ("torn.csv.gz", Format::CsvGz), ("torn.csv", Format::Csv)]
    {
        let mut bytes = std::io::Cursor::new(Vec::new());
        whole.write(format, &mut bytes).unwrap();
        let mut bytes = bytes.into_inner();
        bytes.truncate(bytes.len() / 2);
        while format == Format::Csv && bytes.last() != Some(&b'\n') {
            bytes.pop();
        }
        if format == Format::Csv {
            bytes.extend_from_slice(b"5000");
        }
        let path = file(folder.path(), name, &bytes);
        let output = replay(folder.path(), &path, "current_a", None);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(3), "{name}: {said}");
        assert!(said.contains(name) && said.contains("lost:"), "{name}: {said}");
        assert!(folder.path().join("out.csv").exists());
    }
}

#[test]
fn a_large_recording_needs_little_more_memory_than_its_columns() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("large.csv");
    let mut out = std::io::BufWriter::new(std::fs::File::create(&path).unwrap());
    writeln!(out, "time_s,current_a,thrust_n").unwrap();
    let rows = 2_000_000;
    for i in 0..rows {
        writeln!(out, "{:.4},{:.12},{:.12}", f64::from(i) * 1e-4, f64::from(i % 7), 123.456_789_012_345)
            .unwrap();
    }
    out.flush().unwrap();
    drop(out);
    let scenario = folder.path().join("s.toml");
    let text = "command = \"current_cmd_a\"\n[[segments]]\nkind = \"replay\"\nrecording = \"large.csv\"\ncolumn = \"current_a\"\nduration_s = 0.5\n";
    std::fs::write(&scenario, text).unwrap();
    // 48 MB of columns, 32 MB of replayed pairs, as much again while vectors grow; the file itself is 80 MB.
    let limit_kb = 200 * 1024;
    let script = format!(
        "ulimit -v {limit_kb}; exec \"$0\" simulate --rig whitcomb-yoerger-1999 --scenario \"$1\" -o \"$2\""
    );
    let output = Command::new("sh")
        .args(["-c", &script, env!("CARGO_BIN_EXE_kort")])
        .arg(&scenario)
        .arg(folder.path().join("out.csv"))
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
}

/// What is read is not written over, and what cannot be written is said before anything is done.
#[test]
fn outputs_are_looked_at_first() {
    let folder = tempfile::tempdir().unwrap();
    let recording = file(folder.path(), "run.csv", b"time_s,current_cmd_a,shaft_speed_rad_s\n0,1,0\n1,1,1\n");
    let rig = folder.path().join("rig.toml");
    std::fs::copy(concat!(env!("CARGO_MANIFEST_DIR"), "/config/thrusters/t200.toml"), &rig).unwrap();
    let bench = b"[thrusters.t1]\nrig = \"rig.toml\"\namplifier = \"simulated\"\n";
    let bench = file(folder.path(), "kort.toml", bench);
    let kept = [&recording, &rig].map(|path| std::fs::read(path).unwrap());
    let (run, rig_file) = (recording.to_str().unwrap(), rig.to_str().unwrap());
    let (bench, new) = (bench.to_str().unwrap(), folder.path().join("new.toml"));
    for (args, words) in [
        (vec!["diagnose", run, "--rig", rig_file, "--html", run], "recording that is read"),
        (vec!["diagnose", run, "--rig", rig_file, "-o", rig_file], "rig description that is read"),
        (vec!["fit", run, "--rig", rig_file, "-o", rig_file], "rig description that is read"),
        (vec!["fit", run, "--rig", rig_file, "-o", "fitted.json"], "must end in .toml"),
        (vec!["fit", run, "--rig", rig_file, "-o", "/no/such/fitted.toml"], "cannot be written"),
        (vec!["convert", run, "-o", run], "recording that is read"),
        (vec!["columns", run, "-o", "map.csv"], "must end in .toml"),
        (
            vec!["simulate", "--rig", rig_file, "--scenario", "chirp", "-o", "/no/such/a.csv"],
            "cannot be written",
        ),
        // A rig that only the deployment names is read too; and no session is lost for its recording's name.
        (vec!["calibrate", "--config", bench, "--yes", "-o", rig_file], "rig description that is read"),
        (
            vec![
                "calibrate",
                "--config",
                bench,
                "--yes",
                "-o",
                new.to_str().unwrap(),
                "--recording",
                "a.txt",
            ],
            "\".txt\"",
        ),
        (vec!["reproduce", "--html", "/proc"], "it is a folder"),
        (vec!["soak", "soak-towed", "--html", "/no/such/page.html"], "cannot be written"),
    ] {
        let output = Command::new(env!("CARGO_BIN_EXE_kort")).args(&args).output().unwrap();
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{args:?}: {said}");
        assert!(
            said.contains(words) && said.contains("hint:") && output.stdout.is_empty(),
            "{args:?}: {said}"
        );
    }
    assert_eq!(kept, [&recording, &rig].map(|path| std::fs::read(path).unwrap()));
}

/// Nor is a recording that a scenario replays.
#[test]
fn what_is_replayed_is_not_written_over() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = b"time_s,current_cmd_a\n0,1\n1,1\n";
    let kept = file(folder.path(), "out.csv", bytes);
    let output = replay(folder.path(), &kept, "current_cmd_a", None);
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    assert!(stderr(&output).contains("replayed recording that is read"), "{}", stderr(&output));
    assert_eq!(std::fs::read(kept).unwrap(), bytes);
}

/// A result that nobody gets is a failure, and is said.
#[test]
fn what_cannot_be_printed_is_a_failure() {
    let folder = tempfile::tempdir().unwrap();
    let tokens = folder.path().join("tokens.toml");
    let config = folder.path().join("kort.toml");
    let text = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/config/kort.toml")).unwrap();
    std::fs::write(
        &config,
        text.replace("tokens = \"kort-state/tokens.toml\"", &format!("tokens = {tokens:?}")),
    )
    .unwrap();
    let rig = concat!(env!("CARGO_MANIFEST_DIR"), "/config/thrusters/t200.toml");
    for args in [
        &["explain"][..],
        &["explain", "--json"],
        &["check", rig],
        &["token", "new", "bridge", "--role", "viewer", "--config", config.to_str().unwrap()],
        &["--version"],
    ] {
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_kort"));
        let output = command.args(args).stdout(full).output().unwrap();
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{args:?}: {said}");
        assert!(said.contains("cannot be printed") && said.contains("hint:"), "{args:?}: {said}");
        assert!(!said.contains("panicked"), "{args:?}: {said}");
    }
}

/// What is shipped is built in, whatever folder it is used in; what is no address, no scenario of this command, or named twice is
/// refused for that.
#[test]
fn shipped_scenarios_run_anywhere_and_wrong_usage_is_named() {
    let folder = tempfile::tempdir().unwrap();
    for (args, code, words) in [
        (&["soak-recovery-lift", "soak-aged", "--live", "http://127.0.0.1:1"][..], 1, "http://127.0.0.1:1"),
        (&["soak-towed", "--live", "notaurl"], 2, "--live notaurl"),
        (&["chirp"], 2, "hint: kort simulate"),
        (&["soak-towed", "soak-towed"], 2, "scenario soak-towed is given twice"),
        (&["soak-towed", "--controllers", "default, default"], 2, "--controllers default is given twice"),
    ] {
        let run = Command::new(env!("CARGO_BIN_EXE_kort"))
            .arg("soak")
            .args(args)
            .current_dir(folder.path())
            .output()
            .unwrap();
        let said = stderr(&run);
        assert_eq!(run.status.code(), Some(code), "{args:?}: {said}");
        assert!(said.contains(words) && said.contains("hint:"), "{args:?}: {said}");
    }
}
