//! Whether the external watchdog is one: pure, fed with what `enabled` shows and when.
//!
//! Tried at rest, at zero volts: pulse until the amplifier is enabled, then no pulse, and the enable must fall in time. A
//! disarming is the second half of the same trial. A trial that the machine's own lateness spoils is neither passed
//! nor failed: it is done again.

/// How long an enable may take to come, ns: a safety relay takes some tens of milliseconds.
const COMES_WITHIN_NS: u64 = 250_000_000;
/// Rest after a trial that was failed, ns.
const AGAIN_NS: u64 = 1_000_000_000;

/// Where the trial stands; instants are of CLOCK_MONOTONIC, ns.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    /// No pulse: it must be off, or fall, since then.
    Still(u64),
    /// Pulses at zero volts: it must come, since then.
    Comes(u64),
    /// No pulse any more: it must fall.
    Falls,
    /// It fell in time: there is a watchdog.
    Ready,
    /// Armed, pulses, zero volts until it comes, since then.
    Enabling(u64),
    /// The amplifier is enabled, since then.
    Driving(u64),
    /// The trial was failed: no pulse until then.
    Rests(u64),
}

/// What `enabled` showed.
#[derive(Clone, Copy, Debug)]
pub struct Look {
    /// Before it was read, on CLOCK_MONOTONIC, ns.
    pub from_ns: u64,
    /// After it was read.
    pub to_ns: u64,
    /// It was 1.
    pub enabled: bool,
    /// Somebody is armed.
    pub wanted: bool,
}

/// What was found out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Found {
    /// The enable falls so long after the last pulse, ns.
    Guards(u64),
    /// It stays 1 without a pulse.
    StaysOn,
    /// It stays 0 under the pulse.
    StaysOff,
    /// It came by itself.
    Comes,
    /// It did not come when somebody armed.
    NotEnabled,
    /// It fell under the pulse.
    Fell,
}

/// The trial.
#[derive(Clone, Copy, Debug)]
pub struct Interlock {
    timeout_ns: u64,
    rise_ns: u64,
    stage: Stage,
    /// Before and after the last pulse was given.
    pulsed_ns: (u64, u64),
}

impl Interlock {
    /// Before the first trial. The enable must fall within `timeout_ns`; once it came, the command comes in over `rise_ns`.
    pub fn new(timeout_ns: u64, rise_ns: u64) -> Self {
        Self { timeout_ns, rise_ns, stage: Stage::Still(0), pulsed_ns: (0, 0) }
    }

    /// Everything anew: the files were gone.
    pub fn begin(&mut self, now_ns: u64) {
        self.stage = Stage::Still(now_ns);
    }

    /// Is a pulse to be given? One for somebody who is armed only when a tick asks for it.
    pub fn pulses(&self, ticked: bool) -> bool {
        match self.stage {
            Stage::Comes(_) => true,
            Stage::Enabling(_) | Stage::Driving(_) => ticked,
            Stage::Still(_) | Stage::Falls | Stage::Ready | Stage::Rests(_) => false,
        }
    }

    /// Is somebody driving, so that only ticks may go on?
    pub fn drives(&self) -> bool {
        matches!(self.stage, Stage::Enabling(_) | Stage::Driving(_))
    }

    /// Share of the command that may go out now.
    pub fn share(&self, now_ns: u64) -> f64 {
        match self.stage {
            Stage::Driving(since) => {
                (now_ns.saturating_sub(since) as f64 / self.rise_ns.max(1) as f64).min(1.0)
            }
            _ => 0.0,
        }
    }

    /// A pulse was given between these instants.
    pub fn pulsed(&mut self, from_ns: u64, to_ns: u64) {
        self.pulsed_ns = (from_ns, to_ns);
    }

    /// Goes on by what `enabled` shows.
    pub fn look(&mut self, look: Look) -> Option<Found> {
        let Look { from_ns, to_ns, enabled, wanted } = look;
        let rests = Stage::Rests(to_ns.saturating_add(AGAIN_NS));
        let beyond = |since: u64, most_ns: u64| from_ns.saturating_sub(since) > most_ns;
        let (stage, found) = match self.stage {
            Stage::Still(_) if !enabled => (Stage::Comes(to_ns), None),
            Stage::Still(since) if beyond(since, self.timeout_ns) => (rests, Some(Found::StaysOn)),
            Stage::Comes(_) if enabled => (Stage::Falls, None),
            Stage::Comes(since) if beyond(since, COMES_WITHIN_NS) => (rests, Some(Found::StaysOff)),
            Stage::Falls if enabled && beyond(self.pulsed_ns.1, self.timeout_ns) => {
                (rests, Some(Found::StaysOn))
            }
            Stage::Falls if !enabled => {
                // At the latest now, since the beginning of the pulse.
                let after_ns = to_ns.saturating_sub(self.pulsed_ns.0);
                if after_ns <= self.timeout_ns {
                    (Stage::Ready, Some(Found::Guards(after_ns)))
                } else {
                    (Stage::Still(to_ns), None)
                }
            }
            Stage::Ready if enabled => (Stage::Still(to_ns), Some(Found::Comes)),
            Stage::Ready if wanted => (Stage::Enabling(to_ns), None),
            Stage::Enabling(_) if !wanted => (Stage::Still(to_ns), None),
            Stage::Enabling(_) if enabled => (Stage::Driving(to_ns), None),
            Stage::Enabling(since) if beyond(since, COMES_WITHIN_NS) => (rests, Some(Found::NotEnabled)),
            Stage::Driving(_) if !enabled => (rests, Some(Found::Fell)),
            Stage::Driving(_) if !wanted => (Stage::Falls, None),
            Stage::Rests(until) if to_ns >= until => (Stage::Still(to_ns), None),
            same => (same, None),
        };
        self.stage = stage;
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    /// A watchdog circuit that lets the enable fall so long after the last pulse, looked at every 5 ms; what was found, and
    /// the largest share while somebody wanted to drive.
    fn tried(circuit: impl Fn(u64, u64) -> bool, wanted: impl Fn(u64) -> bool) -> (Vec<(u64, Found)>, f64) {
        let mut interlock = Interlock::new(100 * MS, 20 * MS);
        interlock.begin(0);
        let (mut pulsed, mut found, mut share) = (None, Vec::new(), 0.0f64);
        for at in (0..4000).step_by(5) {
            let enabled = circuit(at, pulsed.map_or(u64::MAX, |pulsed: u64| at - pulsed));
            let look = Look { from_ns: at * MS, to_ns: at * MS + MS / 10, enabled, wanted: wanted(at) };
            found.extend(interlock.look(look).map(|found| (at, found)));
            if interlock.pulses(true) {
                pulsed = Some(at);
                interlock.pulsed(at * MS, at * MS + MS / 10);
            }
            let now = interlock.share(look.to_ns);
            assert!(now == 0.0 || (enabled && wanted(at)), "{at}: torque without the amplifier's enable");
            share = share.max(now);
        }
        (found, share)
    }

    #[test]
    fn a_watchdog_is_confirmed_and_then_drives_and_is_confirmed_at_each_disarming() {
        let (found, share) = tried(|_, since| since < 60, |at| (1000..2000).contains(&at) || at > 3000);
        assert!(
            matches!(found[..], [(60, Found::Guards(first)), (2055, Found::Guards(_))] if first <= 61 * MS),
            "{found:?}"
        );
        assert_eq!(share, 1.0);
    }

    #[test]
    fn an_input_that_lies_or_a_watchdog_that_is_too_slow_never_drives() {
        for (circuit, wrong) in [
            (Box::new(|_, _| true) as Box<dyn Fn(u64, u64) -> bool>, Found::StaysOn),
            (Box::new(|_, _| false), Found::StaysOff),
            (Box::new(|_, since| since < 150), Found::StaysOn),
        ] {
            let (found, share) = tried(circuit, |_| true);
            assert_eq!(share, 0.0, "{wrong:?}");
            assert!(found.iter().all(|(_, found)| *found == wrong) && found.len() > 1, "{found:?}");
        }
    }

    #[test]
    fn an_enable_that_falls_or_comes_by_itself_is_told_and_tried_anew() {
        let fell = |at, since| since < 60 && !(1500..1700).contains(&at);
        let (found, _) = tried(fell, |at| (1000..1500).contains(&at) || at == 1500);
        assert_eq!(found[1].1, Found::Fell, "{found:?}");
        assert!(matches!(found[2].1, Found::Guards(_)), "{found:?}");
        let by_itself = |at: u64, since| since < 60 || (1000..1020).contains(&at);
        let (found, _) = tried(by_itself, |_| false);
        assert!(
            matches!(found[..], [(_, Found::Guards(_)), (1000, Found::Comes), (_, Found::Guards(_))]),
            "{found:?}"
        );
        let never_again = |at: u64, since| since < 60 && at < 500;
        let (found, share) = tried(never_again, |at| (1000..1300).contains(&at));
        assert_eq!((found[1].1, share), (Found::NotEnabled, 0.0), "{found:?}");
    }

    /// A look that came late proves nothing either way.
    #[test]
    fn a_machine_that_stood_still_fails_no_watchdog_and_passes_none() {
        let mut interlock = Interlock::new(100 * MS, 20 * MS);
        let look = |at: u64, enabled| Look { from_ns: at * MS, to_ns: at * MS, enabled, wanted: false };
        assert_eq!(interlock.look(look(1000, false)), None);
        interlock.pulsed(1000 * MS, 1001 * MS);
        assert_eq!(interlock.look(look(1005, true)), None);
        assert_eq!(interlock.look(look(1400, false)), None, "it fell, but who knows when");
        assert_eq!(interlock.look(look(1405, false)), None);
        assert!(interlock.pulses(false), "it is tried again");
    }
}
