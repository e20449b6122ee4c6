//! Which cores a deployment names, and which this machine has.

use crate::config::{Config, ConfigError};

/// Cores of this machine that run, as the kernel lists them: "0-3,8".
const ONLINE: &str = "/sys/devices/system/cpu/online";

/// Settings of cores that this machine does not have. No mistake of the deployment, which may be meant for another machine,
/// and a loop runs without them; each names file, key, value and what there is.
pub fn absent(config: &Config) -> Vec<ConfigError> {
    // Where the kernel does not say, nothing is absent.
    let text = std::fs::read_to_string(ONLINE).unwrap_or_default();
    let online = text.trim();
    let Some(ranges) = ranges(online) else { return Vec::new() };
    let mut missing = Vec::new();
    for (id, thruster) in &config.thrusters {
        for (key, cores) in [("servo", &thruster.servo.cores), ("controller", &thruster.controller.cores)] {
            let here = |core: &usize| ranges.iter().any(|(first, last)| (first..=last).contains(&core));
            for core in cores.iter().filter(|core| !here(core)) {
                missing.push(config.error(format!(
                    "`thrusters.{id}.{key}.cores` holds {core}, which this machine does not have; here are {online}\nhint: cores are counted from 0; the loop runs on the others, or wherever the system likes"
                )));
            }
        }
    }
    missing
}

/// The ranges of a list of cores, both ends in; none where it is no list.
fn ranges(list: &str) -> Option<Vec<(usize, usize)>> {
    let range = |part: &str| {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        Some((first.parse().ok()?, last.parse().ok()?))
    };
    list.split(',').map(range).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_of_the_kernel_is_read() {
        assert_eq!(ranges("0"), Some(vec![(0, 0)]));
        assert_eq!(ranges("0-3,8,10-11"), Some(vec![(0, 3), (8, 8), (10, 11)]));
        assert_eq!(ranges(""), None);
    }

    #[test]
    fn a_core_that_is_not_there_is_told_by_its_key() {
        let text = "[thrusters.t1]\nrig = \"r\"\namplifier = \"simulated\"\nservo = { cores = [0] }\ncontroller = { cores = [0, 1023] }\n";
        let config = Config::parse(text, None).unwrap();
        let words: Vec<String> = absent(&config).iter().map(ToString::to_string).collect();
        assert_eq!(words.len(), 1, "{words:?}");
        assert!(words[0].contains("`thrusters.t1.controller.cores` holds 1023, "), "{words:?}");
        assert!(words[0].contains("; here are 0") && words[0].contains("\nhint: "), "{words:?}");
    }
}
