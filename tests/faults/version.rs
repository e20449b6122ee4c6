//! Peers that speak another version, and a rival of the same: refused in words, whoever was there first, and what runs
//! goes on.

use std::time::{Duration, Instant};

use iceoryx2::prelude::*;
use iceoryx2::service::builder::publish_subscribe::PublishSubscribeOpenError;
use kort_proto::names::{MESSAGES_VERSION, Stream};
use kort_proto::transport::Deployment;

use crate::common::{Site, Stack, run};
use crate::table::Table;

/// A process that cannot start says so within this time, on a busy machine too.
const REFUSED: Duration = Duration::from_secs(15);

/// A command as another version lays it out: of the same name, with a field more.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, ZeroCopySend)]
#[type_name("kort.Command")]
struct OtherCommand {
    header: [u64; 3],
    telemetry_stamp_ns: u64,
    drive: f64,
    thrust_cmd_n: f64,
    speed_cmd_rad_s: f64,
    torque_cmd_n_m: f64,
    kind: u32,
    stop: u32,
}

/// A participant that opens services without our ports.
fn stranger(deployment: &Deployment, generation: u64) -> Node<ipc::Service> {
    set_log_level(LogLevel::Fatal);
    NodeBuilder::new()
        .name(&NodeName::new("stranger").expect("a name"))
        .config(&deployment.config(generation).expect("a configuration"))
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<ipc::Service>()
        .expect("a node")
}

/// A stranger that would send commands of another layout, or under another version's name, gets no way in.
pub fn foreign_peer(table: &mut Table) {
    let mut stack = Stack::start();
    stack.thrust(30.0, 60_000);
    let before = stack.watch().next();
    let deployment = stack.site.deployment();
    let generation = deployment.generation().expect("a generation");
    let began = Instant::now();
    let node = stranger(&deployment, generation);
    let ours = Stream::Command.service("t1", generation);
    let version = format!("kort/{MESSAGES_VERSION}/");
    for (name, refusal) in [
        (ours.clone(), PublishSubscribeOpenError::IncompatibleTypes),
        (ours.replace(&version, "kort/1/"), PublishSubscribeOpenError::DoesNotExist),
    ] {
        let opened = node
            .service_builder(&ServiceName::new(&name).expect("a name"))
            .publish_subscribe::<OtherCommand>()
            .open();
        assert_eq!(opened.err(), Some(refusal), "{name}");
    }
    let took = began.elapsed();
    let mut watch = stack.watch();
    let after = watch
        .until("another command of the controller", |t| t.command_sequence > before.command_sequence + 2);
    assert!(after.armed == 1 && after.faults == 0, "{after:?}");
    assert_eq!(after.commands_invalid, before.commands_invalid);
    table.row("a peer of another message layout or version", "finds no way in", REFUSED, &[took]);
}

/// The built program on shared memory whose owner is of another version, by number or by layout alone.
pub fn foreign_owner(table: &mut Table) {
    let mut measured = Vec::new();
    let mut refused = |site: &Site, role: &str, words: &[&str]| {
        let began = Instant::now();
        let mut command = site.command(role);
        if role == "servo" {
            command.arg("--join");
        }
        let out = run(&mut command);
        measured.push(began.elapsed());
        let said = String::from_utf8_lossy(&out.stderr);
        assert_eq!(out.status.code(), Some(1), "{role}: {said}");
        for word in words.iter().chain(&["one build", "hint:"]) {
            assert!(said.contains(word), "{role}: `{word}` is missing in: {said}");
        }
    };
    let site = Site::new();
    let mut owner = site.deployment().own().expect("the lock");
    let generation = owner.create(&["t1"]).expect("services");
    let written = site.root().with_extension("generation");
    let ours = format!("this kort those of version {MESSAGES_VERSION}");
    std::fs::write(&written, format!("{generation} 1")).expect("written");
    for role in ["controller", "servo"] {
        refused(&site, role, &["messages of version 1,", &ours]);
    }
    // Before the number was written down.
    std::fs::write(&written, generation.to_string()).expect("written");
    refused(&site, "controller", &["version 4 or older", &ours]);
    // The same number, and yet another layout: a build between two releases.
    let generation = owner.create(&[]).expect("no services");
    let node = stranger(owner.deployment(), generation);
    let name = Stream::Setpoint.service("t1", generation);
    let _theirs = node
        .service_builder(&ServiceName::new(&name).expect("a name"))
        .publish_subscribe::<OtherCommand>()
        .create()
        .expect("their service");
    refused(&site, "controller", &[&name, "laid out otherwise"]);
    table.row("shared memory of another message version", "refused, said why", REFUSED, &measured);
}

/// A second deployment at the same root: the lock is held.
pub fn rival(table: &mut Table) {
    let mut stack = Stack::start();
    stack.thrust(30.0, 60_000);
    let began = Instant::now();
    let second = run(&mut stack.site.command("servo"));
    let took = began.elapsed();
    assert_eq!(second.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&second.stderr).contains("already runs here"), "{second:?}");
    let t = stack.watch().next();
    assert!(t.armed == 1 && t.faults == 0, "{t:?}");
    table.row("a rival servo", "refused", REFUSED, &[took]);
}
