//! What is said of a file, taken apart for those who show it in parts: `kort check --json`, a problem document.

use serde::Serialize;

/// Something that is wrong.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Complaint {
    /// The key meant, with its table.
    pub key: Option<String>,
    /// What stands there.
    pub found: Option<String>,
    /// Values that are allowed, where that is what is wrong and the words set them apart.
    pub allowed: Option<String>,
    /// What to do.
    pub hint: Option<String>,
    /// All that is said but the hint.
    pub message: String,
}

impl Complaint {
    /// Takes a message apart: `` `key` = value is …\nhint: … ``.
    pub fn of(words: &str) -> Complaint {
        let (what, hint) = match words.split_once("hint:") {
            Some((what, hint)) => (what.trim(), Some(hint.trim().to_owned())),
            None => (words.trim(), None),
        };
        // The TOML reader shows the line, and says behind the hint in which key it lies.
        let (hint, within) = match hint.as_deref().and_then(|hint| hint.rsplit_once("\nin `")) {
            Some((hint, key)) => (Some(hint.trim().to_owned()), key.strip_suffix('`')),
            None => (hint, None),
        };
        let parsing = what.contains("TOML parse error");
        let pointed = if parsing { pointed_at(what) } else { None };
        let named = || what.split('`').nth(1).filter(|_| !parsing || what.contains(" field `"));
        let key = pointed.map(|(key, _)| key).or_else(named).or(within).map(str::to_owned);
        let after = |words: &[&str]| words.iter().find_map(|words| Some(what.split_once(words)?.1));
        // A colon within a value (an address) is followed by no space, a comma within a list by one.
        let ends = [" is ", " does ", " asks ", ": ", ";", ", and ", ", but ", ", which ", "\n"];
        let found = after(&["` = ", "` holds ", "` has "])
            .and_then(|rest| ends.iter().try_fold(rest, |found, end| found.split(end).next()))
            .or(pointed.map(|(_, value)| value))
            .map(|found| found.trim().to_owned());
        let allowed = after(&[
            "is allowed: ",
            " is outside ",
            "allowed is ",
            "allowed are ",
            "known are ",
            "expected one of ",
            "here are ",
        ]);
        // A type; names of ours mean nothing to others.
        let typed = pointed.is_some() || what.contains(": invalid type: ");
        let of_type = || after(&[", expected "]).filter(|kind| typed && !kind.starts_with("struct "));
        let allowed = allowed.or_else(of_type);
        // Where the words only say that it is none of them, the hint counts them up.
        let allowed = allowed.or_else(|| hint.as_deref()?.strip_prefix("known are "));
        let allowed = allowed.map(|allowed| allowed.trim().replace('`', ""));
        Complaint { key, found, allowed, hint, message: what.to_owned() }
    }
}

/// Key and value at which a reader of TOML points, with carets below the line that it shows.
fn pointed_at(what: &str) -> Option<(&str, &str)> {
    let mut lines = what.lines();
    let line = lines.by_ref().find_map(|line| line.trim_start().split_once(" | "))?.1;
    let below = lines.next()?.split_once("| ")?.1;
    let from = below.find('^')?;
    let key = line.get(..from)?.trim_end().strip_suffix('=')?.trim_end();
    let key = key.rsplit([' ', '{', ',']).next()?;
    Some((key, line.get(from..from + below.trim().len())?))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Key, value found and values allowed of a message.
    fn apart(message: &str) -> [Option<String>; 3] {
        let Complaint { key, found, allowed, .. } = Complaint::of(message);
        [key, found, allowed]
    }

    #[test]
    fn a_message_is_taken_apart() {
        for (message, key, value, allowed) in [
            (
                "`thrusters.t1.limits.current_a` = 1000000 is outside 0.001 to 9\nhint: at most 9",
                "thrusters.t1.limits.current_a",
                "1000000",
                "0.001 to 9",
            ),
            (
                "`noise` = \"none\": invalid type: string \"none\", expected a number",
                "noise",
                "\"none\"",
                "a number",
            ),
            (
                "`gateway.hosts` holds \"a:1\"; allowed are names and addresses\nhint: \"a\"",
                "gateway.hosts",
                "\"a:1\"",
                "names and addresses",
            ),
            (
                "`thrusters.t1.servo.cores` holds 9, which this machine does not have; here are 0-3",
                "thrusters.t1.servo.cores",
                "9",
                "0-3",
            ),
            (
                "`amplifier.kind` = curent is outside what is allowed: \"current\" or \"speed\"\nhint: say it",
                "amplifier.kind",
                "curent",
                "\"current\" or \"speed\"",
            ),
            (
                "`thrusters.t1.amplifier` = \"x\" is no drive\nhint: known are \"simulated\", \"vesc\"",
                "thrusters.t1.amplifier",
                "\"x\"",
                "\"simulated\", \"vesc\"",
            ),
            (
                "TOML parse error at line 2, column 12\n  |\n2 | observer = \"x\"\n  |            ^^^\nunknown variant `x`, expected one of `ekf`, `ukf`",
                "observer",
                "\"x\"",
                "ekf, ukf",
            ),
            (
                "TOML parse error at line 9, column 21\n  |\n9 | servo = { rate_hz = \"x\" }\n  |                     ^^^\ninvalid type: string \"x\", expected f64\nhint: a number",
                "rate_hz",
                "\"x\"",
                "f64",
            ),
        ] {
            let [key, value, allowed] = [key, value, allowed].map(|part| Some(part.to_owned()));
            assert_eq!(apart(message), [key, value, allowed], "{message}");
        }
        let [key, found, allowed] =
            apart("section [a]: unknown field `frozn_s`, expected one of `frozen_s`, `spike_rad_s`");
        assert_eq!((key.as_deref(), found), (Some("frozn_s"), None));
        assert_eq!(allowed.as_deref(), Some("frozen_s, spike_rad_s"));
    }

    /// A sentence is no value: where the words say something else than what is allowed, nothing stands there.
    #[test]
    fn what_is_not_set_apart_is_not_called_allowed() {
        for (message, value) in [
            ("`gateway.bind` = [::]:8080 is reached from other machines: no tls", "[::]:8080"),
            ("`thrusters.t1.controller.rate_hz` = 300 does not divide servo.rate_hz = 500", "300"),
        ] {
            let found = Complaint::of(message);
            assert_eq!(
                (found.found.as_deref(), found.allowed, &*found.message),
                (Some(value), None, message)
            );
        }
    }
}
