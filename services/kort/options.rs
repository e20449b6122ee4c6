//! What is said of options that cannot be taken, beside what the reader of the command line says itself.

use clap::Command;
use clap::error::{ContextKind, ContextValue, Error, ErrorKind};

/// Has `--seed -1` reach the check of what is allowed, instead of being taken for an option `-1`.
pub fn with_negative_numbers(command: Command) -> Command {
    let with = |command: Command| {
        command.mut_args(|arg| {
            let takes = arg.get_action().takes_values() && !arg.is_positional();
            if takes { arg.allow_negative_numbers(true) } else { arg }
        })
    };
    with(command).mut_subcommands(with_negative_numbers)
}

/// Ends what was said of a value with what to do.
pub fn hint(error: &Error) {
    if error.kind() == ErrorKind::ValueValidation
        && let Some(ContextValue::String(option)) = error.get(ContextKind::InvalidArg)
    {
        let words = format!("hint: {}\n", allowed(option, &error.to_string()));
        let _ = std::io::Write::write_all(&mut std::io::stderr(), words.as_bytes());
    }
}

/// What an option may be, from what was said of it.
fn allowed(option: &str, said: &str) -> String {
    let option = option.split(' ').next().unwrap_or(option);
    let range = said.split_once(" is not in ").and_then(|(_, range)| range.lines().next());
    match range.and_then(|range| range.split_once("..=")) {
        Some((low, high)) => format!("{option} takes a whole number from {low} to {high}"),
        None if said.contains("invalid float") || said.contains("parse float") => {
            format!("{option} takes a number: 0.5")
        }
        None if said.contains("invalid digit")
            || said.contains("number too")
            || said.contains("empty string") =>
        {
            format!("{option} takes a whole number, 0 or above")
        }
        None => format!("--help says what {option} takes"),
    }
}

#[cfg(test)]
mod tests {
    use super::allowed;

    #[test]
    fn what_an_option_takes_is_said() {
        for (said, words) in [
            ("error: invalid value '0' for '--jobs <N>': 0 is not in 1..=1024\n\nFor more", "from 1 to 1024"),
            ("error: invalid value '-1' for '--jobs <N>': invalid digit found in string\n", "0 or above"),
            ("error: invalid value 'x' for '--jobs <N>': invalid float literal\n", "a number: 0.5"),
            (
                "error: invalid value '' for '--jobs <N>': cannot parse float from empty string\n",
                "a number: 0.5",
            ),
            (
                "error: invalid value '' for '--jobs <N>': cannot parse integer from empty string\n",
                "0 or above",
            ),
        ] {
            assert!(
                allowed("--jobs <N>", said).ends_with(words) || allowed("--jobs <N>", said).contains(words)
            );
        }
    }
}
