//! Two thrusters in one deployment: what both take is refused, and drives that were swapped are not armed.

use kort_emulators::{Bench as Emulator, Moteus, ODrive, moteus, odrive};
use serde_json::{Value, json};

use crate::common::{KORT, PATIENCE, Site, Stack, in_real_time, run, wait};
use crate::link::rig;

const RIG: &str = "whitcomb-yoerger-1999";

/// A deployment of t1 and t2 on drives of one kind, each with these keys.
fn site(kind: &str, keys: [&str; 2]) -> Site {
    let [first, second] = keys;
    let site = Site::new().with_drive(kind, first);
    let text = std::fs::read_to_string(site.config()).unwrap();
    let t1 = &text[text.find("[thrusters.t1]").unwrap()..];
    let t2 = t1.replace("[thrusters.t1]", "[thrusters.t2]").replace(first, second);
    std::fs::write(site.config(), format!("{text}{t2}")).unwrap();
    site
}

#[test]
fn what_both_take_is_refused_by_check_and_at_the_start() {
    let keys = "port = \"/dev/kort-none\", pole_pairs = 7";
    let site = site("vesc", [keys, &format!("{keys}, reversed = true")]);
    let words = "`thrusters.t2.drive.port` = \"/dev/kort-none\" is `thrusters.t1.drive.port` too; allowed is one device a port";
    let mut check = std::process::Command::new(KORT);
    let checked = run(check.args(["check", "--json"]).arg(site.config()));
    assert_eq!(checked.status.code(), Some(2));
    let report: Value = serde_json::from_slice(&checked.stdout).unwrap();
    let [problem] = report["problems"].as_array().unwrap().as_slice() else { panic!("{report}") };
    assert!(problem["message"].as_str().unwrap().contains(words), "{problem}");
    assert_eq!(problem["key"], "thrusters.t2.drive.port");
    assert_eq!(problem["found"], "\"/dev/kort-none\"");
    assert_eq!(problem["allowed"], "one device a port");
    for role in [&["up"][..], &["servo", "--thruster", "t1"], &["servo", "--thruster", "t2"]] {
        let out = run(site.command(role[0]).args(&role[1..]));
        let error = String::from_utf8_lossy(&out.stderr);
        assert_eq!(out.status.code(), Some(2), "{role:?}: {error}");
        assert!(error.contains(words) && error.matches("hint:").count() == 1, "{role:?}: {error}");
    }
}

fn started(site: Site) -> Stack {
    Stack::of(site.spawn("up"), site)
}

/// Whether the servo of a thruster lets itself be armed; its words if not.
fn armed(stack: &mut Stack, thruster: &'static str) -> Result<(), String> {
    stack.at(thruster);
    let lease = wait("the lease", || {
        let (status, lease) = stack.http("POST", "/lease", Some(json!({"holder": "t", "ttl_ms": 60_000})))?;
        (status == 201).then_some(lease)
    });
    stack.leases.insert(thruster, lease["lease_id"].as_str().unwrap().to_owned());
    let end = std::time::Instant::now() + PATIENCE;
    loop {
        stack.http("POST", "/clear-faults", None);
        let (status, answer) = stack.http("POST", "/arm", None).unwrap_or_default();
        let answer = answer.to_string();
        if status < 300 && status > 0 {
            return Ok(());
        }
        // It is not up yet, or a busy machine held it up.
        if answer.contains("drive_unguarded") || std::time::Instant::now() > end {
            return Err(answer);
        }
    }
}

/// The drives of both thrusters, each on the other one's wire, and then as they are meant.
fn told_apart(kind: &str, emulators: [Emulator; 2], identities: [&str; 2]) {
    let keys = |emulator: &Emulator, identity: &str| {
        format!(
            "port = {:?}, identity = \"{identity}\", reading_life_ms = 300, timeout_ms = 300",
            emulator.port()
        )
    };
    let [first, second] = &emulators;
    let [one, other] = identities;
    let mut stack = started(site(kind, [&keys(second, one), &keys(first, other)]));
    for (thruster, meant, found) in [("t1", one, other), ("t2", other, one)] {
        let refused = armed(&mut stack, thruster).expect_err("the other one's drive was armed");
        assert!(refused.contains("drive_unguarded"), "{refused}");
        let (meant, found) = (meant.to_lowercase(), found.to_lowercase());
        let words = format!("drive of {thruster}: `drive.identity` = {meant}, but {found} answers");
        let log = wait("the reason", || Some(stack.site.log()).filter(|log| log.contains(&words)));
        assert_eq!(log.matches(&words).count(), 1, "it is said once: {log}");
    }
    assert!(emulators.iter().all(|emulator| emulator.driven().is_none()), "one was driven");
    drop(stack);
    let mut stack = started(site(kind, [&keys(first, one), &keys(second, other)]));
    for thruster in ["t1", "t2"] {
        armed(&mut stack, thruster).unwrap();
    }
}

#[test]
fn two_odrives_that_were_swapped_are_not_armed() {
    in_real_time(|| {
        let odrive = |serial_number| {
            let make = odrive::Make { serial_number: Some(serial_number), ..odrive::Make::default() };
            Emulator::start(ODrive::new(make, &rig(RIG))).unwrap()
        };
        // All digits of the second one could be a number's.
        let numbers = ["2084377D3548", "208437753548"];
        told_apart("odrive", numbers.map(odrive), numbers);
    });
}

#[test]
fn two_moteus_that_were_swapped_are_not_armed() {
    in_real_time(|| {
        let moteus = |words| {
            let make = moteus::Make { serial_number: Some(words), ..moteus::Make::default() };
            Emulator::start(Moteus::new(make, &rig(RIG))).unwrap()
        };
        let words = [[0x8034_001c, 0x5350_4b06, 0x2037_3757], [0x0034_001c, 0x5350_4b06, 0x2037_3757]];
        told_apart("moteus", words.map(moteus), ["2037375753504b068034001c", "2037375753504b060034001c"]);
    });
}
