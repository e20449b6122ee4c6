//! Ports in one process: new samples pass, the owner is alone, and leftovers do not matter.
#![cfg(feature = "transport")]

use std::time::Duration;

use kort_proto::messages::{Command, Reply, Request, Setpoint, Telemetry};
use kort_proto::transport::{ControllerPorts, Deployment, GatewayPorts, ServoPorts, TransportError};

#[test]
fn samples_travel_from_gateway_to_servo_and_back() {
    // The longest root that is allowed: the sockets' paths under it must have room.
    let dir = tempfile::Builder::new().prefix("k").rand_bytes(8).tempdir_in("/tmp").unwrap();
    let root = dir.path().join("r".repeat(35 - 1 - dir.path().as_os_str().len()));
    let deployment = Deployment::new(Some(&root));
    assert!(matches!(GatewayPorts::open(&deployment, "t1"), Err(TransportError::NoGeneration { .. })));
    let mut owner = deployment.own().unwrap();
    owner.create(&["t1", "t2"]).unwrap();

    let mut servo = ServoPorts::open(&deployment, "t1").unwrap();
    let mut controller = ControllerPorts::open(&deployment, "t1").unwrap();
    let mut gateway = GatewayPorts::open(&deployment, "t1").unwrap();
    let other = ControllerPorts::open(&deployment, "t2").unwrap();

    for generation in 1..4 {
        gateway.setpoint.send(Setpoint { generation, value: 25.0, ..Default::default() }).unwrap();
    }
    let got = controller.setpoint.latest().unwrap();
    assert_eq!((got.generation, got.header.sequence, got.value), (3, 3, 25.0));
    assert!(controller.setpoint.latest().is_none(), "the same sample twice");
    assert!(other.setpoint.latest().is_none(), "another thruster's sample");

    controller.command.send(Command { drive: 1.5, ..Default::default() }).unwrap();
    assert_eq!(servo.command.latest().unwrap().drive, 1.5);

    for i in 0..500 {
        servo.telemetry.send(Telemetry { faults: i, ..Default::default() }).unwrap();
    }
    servo.waker.wake();
    assert!(controller.ticks.wait(Duration::from_secs(5)));
    assert!(!controller.ticks.wait(Duration::from_millis(1)));
    let recorded: Vec<_> = std::iter::from_fn(|| gateway.telemetry.next()).map(|t| t.faults).collect();
    assert_eq!(recorded, (0..500).collect::<Vec<_>>(), "a recording gets every sample");
    assert_eq!(controller.telemetry.latest().unwrap().faults, 499, "a controller gets the latest");
}

#[test]
fn requests_and_answers_pass_through_ports_opened_anew() {
    let dir = tempfile::tempdir().unwrap();
    let deployment = Deployment::new(Some(&dir.path().join("root")));
    let mut owner = deployment.own().unwrap();
    owner.create(&["t1"]).unwrap();
    let mut servo = ServoPorts::open(&deployment, "t1").unwrap();
    let controller = ControllerPorts::open(&deployment, "t1").unwrap();
    let mut gateway = GatewayPorts::open(&deployment, "t1").unwrap();
    gateway.request.send(Request { id: 1, ..Default::default() }).unwrap();
    let before = servo.request.next().expect("a request").header;
    for id in 2..5 {
        gateway.reconnect_requests(&deployment, "t1").unwrap();
        gateway.request.send(Request { id, ..Default::default() }).unwrap();
        let request = servo.request.next().expect("a request through ports opened anew");
        assert_eq!((request.id, request.header.session), (id, before.session), "the same asker goes on");
        assert_eq!(request.header.sequence, id, "and counts on");
        assert_eq!(std::iter::from_fn(|| controller.request.next()).last().map(|r| r.id), Some(id));
        servo.reply.send(Reply { id, ..Default::default() }).unwrap();
        assert_eq!(gateway.reply.next().map(|reply| reply.id), Some(id), "its answer");
    }
}

#[test]
fn a_second_owner_is_told_who_holds_the_root() {
    let dir = tempfile::tempdir().unwrap();
    let deployment = Deployment::new(Some(&dir.path().join("root")));
    let owner = deployment.own().unwrap();
    let Err(error) = deployment.own() else { panic!("two owners") };
    assert!(error.to_string().contains(&std::process::id().to_string()), "{error}");
    drop(owner);
    deployment.own().unwrap();
}

#[test]
fn leftovers_of_a_killed_owner_are_cleared() {
    let dir = tempfile::tempdir().unwrap();
    let deployment = Deployment::new(Some(&dir.path().join("root")));
    let mut owner = deployment.own().unwrap();
    let first = owner.create(&["t1"]).unwrap();
    let left = ServoPorts::open(&deployment, "t1").unwrap();
    drop(owner);
    assert_eq!(deployment.generation(), None);
    let mut owner = deployment.own().unwrap();
    let second = owner.create(&["t1"]).unwrap();
    assert!(second > first);
    ServoPorts::open(&deployment, "t1").unwrap();
    drop(left);
    ServoPorts::open(&deployment, "t1").unwrap();
}

/// iceoryx2 would wait for such an object's length for ever, and the supervisor with it.
#[test]
fn who_opens_what_its_maker_was_killed_over_is_not_kept_waiting() {
    let dir = tempfile::tempdir().unwrap();
    let deployment = Deployment::new(Some(&dir.path().join("root")));
    let mut owner = deployment.own().unwrap();
    let generation = owner.create(&["t1"]).unwrap();
    let prefix = deployment.config(generation).unwrap().global.prefix.to_string();
    let objects = std::fs::read_dir("/dev/shm").unwrap().flatten().map(|entry| entry.path());
    let services: Vec<_> = objects
        .filter(|path| path.file_name().unwrap().to_string_lossy().starts_with(&prefix))
        .filter(|path| path.extension().is_some_and(|extension| extension == "dynamic"))
        .collect();
    assert!(services.len() > 4, "{services:?}");
    for service in services {
        std::fs::remove_file(&service).unwrap();
        std::fs::write(&service, "").unwrap();
    }
    let (told, answer) = std::sync::mpsc::channel();
    std::thread::spawn(move || told.send(ServoPorts::open(&deployment, "t1").map(|_| ())));
    let answer = answer.recv_timeout(Duration::from_secs(20)).expect("an answer");
    assert!(matches!(answer, Err(TransportError::Iceoryx { .. })), "{answer:?}");
}
