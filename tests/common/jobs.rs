//! Processes that the gateway starts for work of its own, and how one is caught at it.

use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use super::{Stack, alive, children, wait};

/// The process of the job that runs: `diagnose` or `fit`.
pub fn job(stack: &Stack, command: &str) -> Option<u32> {
    children(stack.process("gateway")?).into_iter().find(|(_, role)| role == command).map(|(pid, _)| pid)
}

/// Begins a job and holds its process where it is until it gets CONT: what is looked at meanwhile does not depend on how fast
/// the machine is. One that was over before it was caught is begun again.
pub fn held(stack: &Stack, command: &str, mut begin: impl FnMut()) -> u32 {
    wait("a job to be caught at work", || {
        begin();
        let end = Instant::now() + Duration::from_secs(5);
        while Instant::now() < end {
            if let Some(pid) = job(stack, command) {
                let stop =
                    Command::new("kill").args(["-STOP", &pid.to_string()]).stderr(Stdio::null()).status();
                return (stop.unwrap().success() && alive(pid)).then_some(pid);
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        None
    })
}

/// The stand's rig description that says of these values alone how well they are known: a fit moves these and no other.
pub fn stand_with_tolerances(tolerances: &[(&str, f64)]) -> String {
    let rig = include_str!("../../config/thrusters/whitcomb-yoerger-1999.toml");
    let of = |line: &str| {
        let stated = line.split_once(" = { value = ");
        let stated = stated.and_then(|(name, rest)| Some((name, rest.split_once(", tol = ")?.0)));
        let Some((name, value)) = stated else { return line.to_owned() };
        match tolerances.iter().find(|(known, _)| *known == name) {
            Some((_, tol)) => format!("{name} = {{ value = {value}, tol = {tol} }}"),
            None => format!("{name} = {value}"),
        }
    };
    rig.lines().map(of).collect::<Vec<_>>().join("\n")
}
