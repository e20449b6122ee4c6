//! The section as it is read, and each key that is wrong.

use super::*;
use crate::drives::{Chosen, choose};

const CURRENT: &str = "current = { adc = \"/sys/b/in_voltage0\", gain_a_per_v = -2.0 }\n";
const COUNTER: &str = "counter = { count = \"/sys/c/count0/count\", counts_per_turn = -4096 }\n";
const WATCHDOG: &str = "watchdog = \"/sys/w\"\nenabled = \"/sys/e\"\n";

/// What comes of these keys of `drive`.
fn chosen(keys: &str) -> Result<Iio, String> {
    let rig = include_str!("../../../../../../config/thrusters/whitcomb-yoerger-1999.toml");
    let text = format!("[thrusters.t1]\nrig = \"r\"\namplifier = \"iio\"\n[thrusters.t1.drive]\n{keys}\n");
    let config = Config::parse(&text, None).unwrap();
    let thruster = config.thruster("t1").unwrap();
    match choose(&config, "t1", thruster, &Rig::from_toml(rig).unwrap()) {
        Ok(Chosen::Iio(iio)) => Ok(*iio),
        Ok(_) => panic!("another drive"),
        Err(error) => Err(error.to_string()),
    }
}

fn with(dac: &str, rest: &str) -> String {
    format!("dac = \"{dac}\"\n{CURRENT}{COUNTER}{rest}")
}

#[test]
fn an_amplifier_is_read_with_what_it_leaves_out() {
    let keys = with("/sys/a/out_voltage1_raw", &format!("gain_a_per_v = 2.0\nlimit_v = 10.0\n{WATCHDOG}"));
    let iio = chosen(&keys).unwrap();
    assert_eq!((iio.dac.folder.to_str(), iio.dac.channel.as_str()), (Some("/sys/a"), "out_voltage1"));
    assert_eq!((iio.rate_hz, iio.timeout_s, iio.sign), (200.0, 0.1, 1.0));
    assert_eq!(iio.counter.unwrap().folder, Path::new("/sys/c/count0"), "with its file or without");
    assert!(iio.watchdog.is_some());
    let watching = with("/sys/a/out_voltage1", "gain_a_per_v = 2.0\nlimit_v = 10.0\nwatchdog = \"none\"");
    assert_eq!(chosen(&watching).unwrap().watchdog, None);
}

#[test]
fn each_bad_key_is_named_with_a_hint() {
    let dac = "/sys/a/out_voltage0";
    let sound = format!("gain_a_per_v = 2.0\nlimit_v = 10.0\n{WATCHDOG}");
    let beside = |more: &str| with(dac, &format!("{sound}{more}"));
    let gains = |gains: &str| with(dac, &format!("{gains}\n{WATCHDOG}"));
    for (keys, words) in [
        (format!("{CURRENT}{COUNTER}{sound}"), "dac` is missing"),
        (with("out_voltage0", &sound), "dac` = \"out_voltage0\" is no whole path"),
        (
            with("/sys/a/in_voltage0", &sound),
            "dac` = \"/sys/a/in_voltage0\" is no channel of volts: out_voltage",
        ),
        (gains("limit_v = 10.0"), "gain_a_per_v` is missing; it is never guessed"),
        (gains("gain_v_per_v = 2.0\nlimit_v = 10.0"), "gain_v_per_v` = 2, but the rig's amplifier"),
        (gains("gain_a_per_v = -2.0\nlimit_v = 10.0"), "gain_a_per_v` = -2 is outside"),
        (gains("gain_a_per_v = nan\nlimit_v = 10.0"), "gain_a_per_v` = NaN is outside"),
        (gains("gain_a_per_v = 2.0"), "limit_v` is missing; it is never guessed"),
        (gains("gain_a_per_v = 2.0\nlimit_v = inf"), "limit_v` = inf is outside"),
        (
            gains("gain_a_per_v = 2.0\nlimit_v = 4.0"),
            "limit_v` = 4, but the largest command, 9 A, is 4.500 V",
        ),
        (beside("scale_mv = 0"), "scale_mv` = 0 is outside"),
        (
            with(dac, "gain_a_per_v = 2.0\nlimit_v = 10.0"),
            "watchdog` is missing: an analogue amplifier keeps",
        ),
        (
            with(dac, "gain_a_per_v = 2.0\nlimit_v = 10.0\nwatchdog = \"/sys/w\""),
            "enabled` is missing: without it nothing shows",
        ),
        (
            with(dac, "gain_a_per_v = 2.0\nlimit_v = 10.0\nwatchdog = \"/sys/w\"\nenabled = \"/sys/w\""),
            "enabled` = \"/sys/w\" is `watchdog` too",
        ),
        (
            with(dac, "gain_a_per_v = 2.0\nlimit_v = 10.0\nwatchdog = \"none\"\nenabled = \"/sys/e\""),
            "enabled` = \"/sys/e\", but `watchdog` is \"none\"",
        ),
        (format!("dac = \"{dac}\"\n{sound}{CURRENT}"), "counter` is missing, and no sensor gives"),
        (format!("dac = \"{dac}\"\n{sound}{COUNTER}"), "current` is missing, and no sensor gives"),
        (beside("rate_hz = 5"), "rate_hz` = 5 is outside 10 to"),
        (beside("timeout_ms = 2000"), "timeout_ms` = 2000 is outside 20 to 1000"),
        (beside("rate_hz = 20"), "timeout_ms` = 100 is less than three exchanges"),
        (beside("port = \"/dev/p\""), "unknown field"),
        (beside("").replace("/sys/w", "w"), "watchdog` = \"w\" is no whole path"),
        (beside("").replace("/sys/e", "e"), "enabled` = \"e\" is no whole path"),
        (beside("").replace("-4096", "0"), "counter.counts_per_turn` = 0; allowed is"),
        (
            beside("").replace("-4096", "-4096, ceiling = 4095"),
            "counter.ceiling` = 4095 is less than two turns",
        ),
        (beside("").replace("-2.0", "0.0"), "current.gain_a_per_v` = 0; allowed is"),
        (beside("").replace("-2.0", "2.0, zero_v = nan"), "current.zero_v` = NaN is outside"),
    ] {
        let error = chosen(&keys).unwrap_err();
        assert!(error.contains(words), "{words}\n{error}");
        assert!(error.contains("\nhint: ") && error.contains("thrusters.t1.drive"), "{error}");
    }
}
