//! Several thrusters in one deployment: how late their loops wake, what they weigh, and where it breaks.
//!
//! `cargo bench --bench thrusters [-- SECONDS N…]`
//!
//! For each number of thrusters a deployment of simulated ones is started as it ships (servo 1 kHz, controller 250 Hz), every thruster is
//! armed and pushes; after some seconds:
//!
//! - lateness of all servo loops together, from the service's own histogram (upper bounds of its buckets), and ticks left out;
//! - thrusters that tripped, and by what;
//! - processor time, in cores;
//! - memory: of each process alone (without the program's own pages, which all have in common), and of the shared memory, MB.

#[path = "../tests/common/mod.rs"]
mod common;

use std::collections::BTreeMap;
use std::os::unix::fs::MetadataExt;
use std::time::{Duration, Instant};

use common::{Site, Stack, children};
use serde_json::{Value, json};

/// Thrust that each is asked for, N.
const THRUST_N: f64 = 20.0;
/// Time to arm all of them.
const PATIENCE: Duration = Duration::from_secs(20);
/// Ticks of the kernel's processor times, a second.
const TICKS_HZ: f64 = 100.0;

fn main() {
    let numbers: Vec<u64> = std::env::args().filter_map(|a| a.parse().ok()).collect();
    let (seconds, counts) = match numbers.as_slice() {
        [] => (10, vec![1, 8, 16]),
        [seconds] => (*seconds, vec![1, 8, 16]),
        [seconds, counts @ ..] => (*seconds, counts.to_vec()),
    };
    println!("{seconds} s each\n");
    for count in counts {
        measure(count, seconds);
    }
}

fn measure(count: u64, seconds: u64) {
    let site = Site::new();
    // The first as it ships, and the others like it.
    let text = std::fs::read_to_string(site.config()).expect("a configuration");
    let text = text.replace("servo = { rate_hz = 500 }\n", "").replace("rate_hz = 10, ", "rate_hz = 250, ");
    let (head, first) = text.split_at(text.find("[thrusters.t1]").expect("a thruster"));
    let all: String =
        (1..=count).map(|n| first.replace("thrusters.t1", &format!("thrusters.t{n}"))).collect();
    std::fs::write(site.config(), format!("{head}{all}")).expect("a configuration");
    let mut stack = Stack::start_at(site);
    let ids: Vec<&'static str> = (1..=count).map(|n| &*format!("t{n}").leak()).collect();
    let armed = arm(&mut stack, &ids);
    println!("{count} thrusters, {armed} of them armed");

    let everyone = || -> Vec<(u32, String)> {
        let up = (stack.supervisor.id(), "up".to_owned());
        children(up.0).into_iter().chain([up]).collect()
    };
    let processes = everyone();
    let busy = || -> BTreeMap<u32, f64> { processes.iter().map(|(pid, _)| (*pid, cpu_s(*pid))).collect() };
    let before = (loops(&stack), busy());
    let began = Instant::now();
    std::thread::sleep(Duration::from_secs(seconds));
    let passed_s = began.elapsed().as_secs_f64();
    let now = everyone();
    let after = (loops(&stack), busy());
    let cores = |pid: &u32| (after.1.get(pid).unwrap_or(&0.0) - before.1.get(pid).unwrap_or(&0.0)) / passed_s;

    let mut buckets: Vec<(f64, f64)> = after
        .0
        .buckets
        .iter()
        .map(|(bound, n)| (f64::from_bits(*bound), n - before.0.buckets.get(bound).copied().unwrap_or(0.0)))
        .collect();
    buckets.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total = buckets.last().map_or(0.0, |(_, n)| *n);
    let below = |share: f64| {
        let bound = buckets.iter().find(|(_, n)| *n >= share * total).map_or(f64::NAN, |(bound, _)| *bound);
        if bound.is_finite() { format!("{:.0} us", bound * 1e6) } else { "more than 10 ms".into() }
    };
    println!("  servo late, at most   p50 {}, p99 {}, p99.9 {}", below(0.5), below(0.99), below(0.999));
    println!("  ticks left out        {:.0} of {:.0}", after.0.overruns - before.0.overruns, total);
    let same = |(pid, _): &(u32, String)| now.iter().any(|(other, _)| other == pid);
    if processes.iter().all(same) {
        println!(
            "  processor time        {:.2} cores",
            processes.iter().map(|(pid, _)| cores(pid)).sum::<f64>()
        );
    } else {
        println!("  processes were replaced: this machine does not carry so many");
    }
    println!("  stopped meanwhile     {}", stopped(&stack, &ids));
    let (mut roles, mut shared) = (BTreeMap::<&str, (f64, f64, f64)>::new(), BTreeMap::new());
    for (pid, role) in now.iter().map(|(pid, role)| (*pid, role.as_str())) {
        let sum = roles.entry(role).or_default();
        *sum = (sum.0 + 1.0, sum.1 + own_mb(pid), sum.2 + cores(&pid));
        shared.extend(shared_mb(pid));
    }
    let (own, shm) = (roles.values().map(|role| role.1).sum::<f64>(), shared.values().sum::<f64>());
    let whole = own + shm;
    println!("  memory                {whole:.0} MB: {own:.0} of the processes, {shm:.0} shared");
    for (role, (n, own, cores)) in roles {
        println!("    {role:<18}  {:.1} MB, {:.3} cores each ({n})", own / n, cores / n);
    }
    println!();
}

/// Arms every thruster and asks for thrust; how many obeyed.
fn arm(stack: &mut Stack, ids: &[&'static str]) -> usize {
    let mut waiting = ids.to_vec();
    let end = Instant::now() + PATIENCE;
    while !waiting.is_empty() && Instant::now() < end {
        waiting.retain(|id| {
            let ask = |stack: &mut Stack, method: &str, path: &str, body: Option<Value>| {
                stack
                    .at(id)
                    .http(method, path, body)
                    .filter(|(status, _)| *status < 300)
                    .map(|(_, body)| body)
            };
            let done = (|| {
                if !stack.leases.contains_key(id) {
                    let lease =
                        ask(stack, "POST", "/lease", Some(json!({"holder": "bench", "ttl_ms": 60_000})))?;
                    stack.leases.insert(id, lease["lease_id"].as_str()?.to_owned());
                }
                ask(stack, "POST", "/clear-faults", None)?;
                ask(stack, "POST", "/arm", None)?;
                ask(stack, "PUT", "/setpoint", Some(json!({"thrust_n": THRUST_N})))
            })();
            done.is_none()
        });
    }
    ids.len() - waiting.len()
}

/// Thrusters that are armed no more, and why.
fn stopped(stack: &Stack, ids: &[&'static str]) -> String {
    let all = stack.get("/v1/thrusters").unwrap_or_default();
    let list = all.as_array().or_else(|| all["thrusters"].as_array()).cloned().unwrap_or_default();
    let off: Vec<&Value> = list.iter().filter(|state| state["armed"] != json!(true)).collect();
    let mut why: BTreeMap<String, usize> = BTreeMap::new();
    for fault in off.iter().flat_map(|state| state["faults"].as_array().into_iter().flatten()) {
        *why.entry(fault["name"].as_str().unwrap_or("?").to_owned()).or_default() += 1;
    }
    format!("{} of {} {why:?}", off.len() + ids.len().saturating_sub(list.len()), ids.len())
}

/// What all servo loops counted so far.
struct Loops {
    /// Wake-ups that were not later than this, s, by the bits of that bound.
    buckets: BTreeMap<u64, f64>,
    overruns: f64,
}

fn loops(stack: &Stack) -> Loops {
    let text = stack.text("/metrics").unwrap_or_default();
    let mut all = Loops { buckets: BTreeMap::new(), overruns: 0.0 };
    for line in text.lines().filter(|line| line.contains("process=\"servo\"")) {
        let Some(value) = line.rsplit(' ').next().and_then(|word| word.parse::<f64>().ok()) else { continue };
        if line.starts_with("kort_loop_overruns_total") {
            all.overruns += value;
        } else if line.starts_with("kort_loop_lateness_seconds_bucket") {
            let bound = line.split("le=\"").nth(1).and_then(|rest| rest.split('"').next()).unwrap_or("+Inf");
            let bound = bound.parse::<f64>().unwrap_or(f64::INFINITY);
            *all.buckets.entry(bound.to_bits()).or_default() += value;
        }
    }
    all
}

/// Processor time of a process so far, s.
fn cpu_s(pid: u32) -> f64 {
    let line = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    let fields: Vec<&str> = line.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
    let ticks = |at: usize| fields.get(at).and_then(|word| word.parse::<f64>().ok()).unwrap_or(0.0);
    (ticks(11) + ticks(12)) / TICKS_HZ
}

/// Memory of a process that no other one has, MB; the program itself, which all have in common, is not in it.
fn own_mb(pid: u32) -> f64 {
    let text = std::fs::read_to_string(format!("/proc/{pid}/smaps_rollup")).unwrap_or_default();
    let line = text.lines().find_map(|line| line.strip_prefix("Anonymous:")).unwrap_or_default();
    line.split_whitespace().next().and_then(|word| word.parse::<f64>().ok()).unwrap_or(f64::NAN) / 1024.0
}

/// The pieces of shared memory that a process has, with what each takes, MB.
fn shared_mb(pid: u32) -> BTreeMap<String, f64> {
    let text = std::fs::read_to_string(format!("/proc/{pid}/maps")).unwrap_or_default();
    let names = text.lines().filter_map(|line| line.find("/dev/shm/").map(|at| line[at..].to_owned()));
    let taken =
        |name: &str| std::fs::metadata(name).map_or(0.0, |m| m.blocks() as f64 * 512.0 / 1024.0 / 1024.0);
    names.map(|name| (name.clone(), taken(&name))).collect()
}
