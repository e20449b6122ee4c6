//! What a process takes of the machine, as `/proc` tells it.

/// Processor time and memory of one process.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Usage {
    /// Processor time since its start, user and system, s.
    pub cpu_s: f64,
    /// Memory in use, bytes.
    pub resident_bytes: f64,
}

impl Usage {
    /// Of a process; none if it is gone.
    pub fn of(pid: u32) -> Option<Usage> {
        let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
        parse(&stat, rustix::param::clock_ticks_per_second() as f64, rustix::param::page_size() as f64)
    }
}

/// proc(5): utime, stime and rss are fields 14, 15 and 24; the name in brackets may hold anything.
fn parse(stat: &str, ticks_per_s: f64, page_bytes: f64) -> Option<Usage> {
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let number = |field: usize| fields.get(field - 3)?.parse::<f64>().ok();
    Some(Usage { cpu_s: (number(14)? + number(15)?) / ticks_per_s, resident_bytes: number(24)? * page_bytes })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_process_takes_time_and_memory() {
        let usage = Usage::of(std::process::id()).unwrap();
        assert!(usage.resident_bytes > 1e5 && usage.cpu_s >= 0.0, "{usage:?}");
        assert_eq!(Usage::of(u32::MAX), None);
    }

    #[test]
    fn a_name_with_brackets_and_blanks_is_no_trap() {
        let stat =
            "7 (a b) c) S 1 1 1 0 -1 4194560 1 2 3 4 250 50 0 0 20 0 3 0 99 1000000 25 18446744073709551615";
        assert_eq!(parse(stat, 100.0, 4096.0), Some(Usage { cpu_s: 3.0, resident_bytes: 102_400.0 }));
    }
}
