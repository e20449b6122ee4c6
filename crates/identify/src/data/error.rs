//! Why a recording cannot be compared with a model.

/// A number as people write it; with an exponent only where it would be nothing but zeros.
fn plain(value: f64) -> String {
    if value == 0.0 || (1e-4..1e9).contains(&value.abs()) { value.to_string() } else { format!("{value:e}") }
}

/// Why a recording cannot be compared with a model.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DataError {
    /// No column to drive the model.
    #[error(
        "{recording}: no driving column\nhint: one of current_cmd_a, voltage_cmd_v, duty_cmd, speed_cmd_rad_s, or a measured current_a or shaft_speed_rad_s must be there and vary"
    )]
    NoDriving {
        /// The recording.
        recording: String,
    },
    /// A drive of another kind is commanded than the rig has.
    #[error(
        "{recording}: {column} is commanded, which a drive of amplifier.kind = \"{kind}\" does not take\nhint: a rig whose drive takes {column} says so in amplifier.kind (shipped with \"speed\": speed-drive)"
    )]
    OtherDrive {
        /// The recording.
        recording: String,
        /// The command that is recorded.
        column: &'static str,
        /// The drive that the rig states.
        kind: &'static str,
    },
    /// Nothing to compare with.
    #[error(
        "{recording}: driven by {driving}, but no measured response beside it: {found}\nhint: record shaft_speed_rad_s, thrust_n, torque_n_m or flow_m_s as well; one that is there under another name comes in through a column map (`kort columns FILE` proposes it); a log of commands alone can be replayed (kort simulate, a segment of kind \"replay\"), not diagnosed"
    )]
    NoResponse {
        /// The recording.
        recording: String,
        /// The driving column.
        driving: &'static str,
        /// What there is instead.
        found: String,
    },
    /// Too short.
    #[error(
        "{recording}: {rows} rows are too few to compare with a model; at least {least} are needed\nhint: record at least a few seconds with changes of the command"
    )]
    TooShort {
        /// The recording.
        recording: String,
        /// Rows found.
        rows: usize,
        /// Rows needed.
        least: usize,
    },
    /// A value that no thruster gives.
    #[error(
        "{recording}: {column} = {} at {time_s} s is outside what is allowed: -{} to {}\nhint: is the unit right (a column map reads scale * source + offset)? a value not measured is an empty cell",
        plain(*value), plain(*most), plain(*most)
    )]
    Implausible {
        /// The recording.
        recording: String,
        /// The column.
        column: String,
        /// When.
        time_s: f64,
        /// The value found.
        value: f64,
        /// Largest size allowed.
        most: f64,
    },
    /// Rows closer together than any log writes them.
    #[error(
        "{recording}: rows are usually {} s apart; at least {} s are needed\nhint: is time_s in seconds?",
        plain(*interval_s), plain(*least_s)
    )]
    TooFast {
        /// The recording.
        recording: String,
        /// Median time between rows, s.
        interval_s: f64,
        /// Shortest allowed, s.
        least_s: f64,
    },
    /// The model cannot be simulated.
    #[error(
        "{recording}: the simulation of the stated rig breaks down (a response is not a number or runs away)\nhint: check the rig's inertia, duct length, resistance and gains for their units; kort simulate shows what the model does"
    )]
    BrokeDown {
        /// The recording.
        recording: String,
    },
    /// More control ticks than can be simulated.
    #[error(
        "{recording}: time_s spans {seconds} s; at most {most_s:.0} s can be compared at this control rate (the longest gap is from {} to {} s)\nhint: is time_s in seconds? cut the recording at its gaps, or take a part of it", .gap_s[0], .gap_s[1]
    )]
    TooLong {
        /// The recording.
        recording: String,
        /// Span found, s.
        seconds: f64,
        /// Longest allowed, s.
        most_s: f64,
        /// The longest gap, from and to, s.
        gap_s: [f64; 2],
    },
}

#[cfg(test)]
mod tests {
    use super::DataError;

    #[test]
    fn numbers_stand_as_people_write_them() {
        let said = |value: f64, most: f64| {
            let (recording, column) = ("r".into(), "duty_cmd".into());
            DataError::Implausible { recording, column, time_s: 2.0, value, most }.to_string()
        };
        assert!(said(-3.75, 2.0).contains("duty_cmd = -3.75 at 2 s is outside what is allowed: -2 to 2\n"));
        assert!(
            said(3e300, 1e12).contains("duty_cmd = 3e300 at 2 s is outside what is allowed: -1e12 to 1e12")
        );
    }
}
