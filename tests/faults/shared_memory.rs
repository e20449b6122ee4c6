//! A full `/dev/shm`, in a mount of its own so that no other program is touched.

use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::{Site, Stack, kill, run, wait};
use crate::table::Table;

/// Becomes `kort` with a `/dev/shm` of this size.
fn own_shm(size: &str) -> [String; 5] {
    let script = format!(r#"mount -t tmpfs -o {size} kort-test /dev/shm && exec "$0" "$@""#);
    ["unshare", "--mount", "sh", "-c", &script].map(str::to_owned)
}

/// May this user mount?
fn may_mount() -> bool {
    let [program, rest @ ..] = own_shm("size=1m");
    Command::new(program)
        .args(rest)
        .arg("true")
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|done| done.success())
}

/// Too little room at the start: refused, and the words say what is short.
pub fn full_at_the_start(table: &mut Table) {
    if !may_mount() {
        println!("not run: a /dev/shm that is full at the start (mounting is not permitted)");
        return;
    }
    let site = Site::new();
    let surroundings = own_shm("size=2m");
    let began = Instant::now();
    let kort = site.command("up");
    let out = run(Command::new(&surroundings[0])
        .args(&surroundings[1..])
        .arg(kort.get_program())
        .args(kort.get_args())
        .current_dir(site.folder.path()));
    let words = String::from_utf8_lossy(&out.stderr);
    assert_eq!(out.status.code(), Some(1), "{words}");
    assert!(words.contains("/dev/shm") && words.contains("hint:"), "{words}");
    table.row(
        "/dev/shm full at the start",
        "refused, with what is short",
        Duration::from_secs(15),
        &[began.elapsed()],
    );
}

/// It fills up under way: what the service needs it has, so the thrust goes on; a process that is killed then ends at
/// zero as ever.
pub fn full_under_way(table: &mut Table) {
    if !may_mount() {
        println!("not run: /dev/shm that fills up under way (mounting is not permitted)");
        return;
    }
    let surroundings = own_shm("size=64m");
    let surroundings: Vec<&str> = surroundings.iter().map(String::as_str).collect();
    let mut stack = Stack::start_in(&surroundings, Site::new());
    let inside = ["--mount", "--target", &stack.supervisor.id().to_string(), "sh", "-c"].map(str::to_owned);
    let shell = |script: &str| {
        let done = Command::new("nsenter").args(&inside).arg(script).stderr(Stdio::null()).output();
        String::from_utf8_lossy(&done.expect("nsenter").stdout).into_owned()
    };
    // Before the rings were gone through once: every page is taken at the start, not when it is first written.
    // What a starting process gives back in the meantime is filled too.
    wait("a full /dev/shm", || {
        shell("dd if=/dev/zero bs=4k >> /dev/shm/fill; df /dev/shm | tail -1").contains("100%").then_some(())
    });
    // Arming and thrust need no more of it, however long it lasts; a machine that holds the controller up trips.
    stack.thrust_by_state(30.0, 60_000);
    let undisturbed = (0..5).any(|again| {
        if again > 0 {
            stack.thrust_by_state(30.0, 60_000);
        }
        let end = Instant::now() + Duration::from_secs(3);
        let mut state = wait("a state", || stack.state());
        while Instant::now() < end && state["armed"] == true {
            assert!(state["measured"]["thrust_n"].as_f64().is_some_and(|n| n > 20.0), "{state}");
            std::thread::sleep(Duration::from_millis(50));
            state = wait("a state", || stack.state());
        }
        state["armed"] == true && state["faults"] == serde_json::json!([])
    });
    assert!(undisturbed, "thrust with a full /dev/shm");
    // A process that dies now ends at zero all the same, and says so.
    let victim = stack.process_of("controller");
    let killed = Instant::now();
    kill(victim, "KILL");
    wait("zero", || (stack.state()?["armed"] == false).then_some(()));
    table.row(
        "/dev/shm full under way, controller killed",
        "thrust untouched before, zero after",
        Duration::from_millis(500),
        &[killed.elapsed()],
    );
    wait("the fault to be shown", || {
        let faults = stack.state()?["faults"].as_array()?.len();
        (faults > 0).then_some(())
    });
    // Its successor needs room of its own: without it says so, and with it runs.
    shell("rm /dev/shm/fill");
    stack.wait_until_up();
    stack.thrust_by_state(30.0, 60_000);
    assert!(!stack.site.log().contains("SIGBUS"), "no process wrote where there was no page");
}
