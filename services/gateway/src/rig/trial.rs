//! Is the thrust worse since another revision of the rig description came into force?
//!
//! Driving is looked at second by second: the mean square of thrust error (measured less commanded), where the drive was
//! armed under a thrust command for the whole second and thrust is measured. Seconds are compared with seconds of like
//! command only, so that driving harder than before is not taken for a worse model: of the same level and the same kind,
//! steady or moving. What a sensor's noise adds, it adds to both sides.

mod compared;

use std::collections::VecDeque;

use kort_proto::messages::Telemetry;
use serde::Serialize;
use utoipa::ToSchema;

use compared::Compared;

const SECOND_NS: u64 = 1_000_000_000;
/// Driven seconds that are kept of each side.
const SPAN: usize = 60;
/// Older driving than this is not what the revision found, ns.
const LIFE_NS: u64 = 600 * SECOND_NS;
/// What settles after a revision is nobody's error, ns.
const SETTLE_NS: u64 = 5 * SECOND_NS;
/// Levels of command either way, full thrust the last.
const LEVELS: f64 = 8.0;
/// A command that moves by more than this share of full thrust within a second is no steady one.
const MOVING: f64 = 0.02;
/// Seconds of like commands that are needed for a comparison.
const ENOUGH: usize = 10;

/// One driven second.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Second {
    begun_ns: u64,
    /// Level of the command, and whether it moved.
    like: (i32, bool),
    mean_square_n2: f64,
}

/// The second under way.
#[derive(Clone, Copy, Debug, Default)]
struct Running {
    begun_ns: u64,
    samples: u32,
    /// Of these, with a thrust that was read.
    read: u32,
    sum_square: f64,
    sum_command: f64,
    least: f64,
    most: f64,
    /// Driven under a thrust command all the time.
    whole: bool,
}

/// A revision that came into force.
#[derive(Clone, Debug)]
struct Revised {
    number: u32,
    back_to: Option<u32>,
    /// What was driven before it.
    before: VecDeque<Second>,
    told: bool,
}

/// The seconds of one thruster under the revision in force, and under the one before.
#[derive(Clone, Debug)]
pub struct Trial {
    full_n: f64,
    running: Running,
    last_ns: u64,
    counts_from_ns: u64,
    seconds: VecDeque<Second>,
    revised: Option<Revised>,
    /// As judged with the last second.
    view: Option<TrialView>,
}

/// Thrust error under the revision in force beside the one before, under like commands.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct TrialView {
    /// Number of the revision that came into force last.
    pub revision: u32,
    /// Number of the one before, to which a rollback goes; null where there is none.
    pub before: Option<u32>,
    /// Root mean square of the thrust error before it, N; null until enough was driven under like commands.
    pub before_rms_n: Option<f64>,
    /// The same since then, N.
    pub since_rms_n: Option<f64>,
    /// Seconds of like command that are compared.
    pub compared_s: usize,
    /// Is the error larger than before, beyond its scatter? Null while that is not judged.
    pub larger: Option<bool>,
    /// Why it is not judged; null where it is.
    #[schema(example = "no command since was held like one before it")]
    pub not_judged: Option<String>,
}

impl TrialView {
    /// In words, for the event log.
    pub fn words(&self) -> String {
        let n = |value: Option<f64>| value.map_or("unknown".into(), |value| format!("{value:.2} N rms"));
        let back = self
            .before
            .map_or(String::new(), |number| format!("; POST …/rig/rollback goes back to revision {number}"));
        format!(
            "the thrust error is larger since revision {} of the rig: {}, before {}, over {} s of like commands{back}",
            self.revision,
            n(self.since_rms_n),
            n(self.before_rms_n),
            self.compared_s
        )
    }
}

impl Trial {
    /// Nothing driven yet; `full_n` is full thrust, N.
    pub fn new(full_n: f64) -> Trial {
        Trial {
            full_n,
            running: Running::default(),
            last_ns: 0,
            counts_from_ns: 0,
            seconds: VecDeque::with_capacity(SPAN),
            revised: None,
            view: None,
        }
    }

    /// Another revision is in force from now on; `back_to` is the number of the one before.
    pub fn revised(&mut self, number: u32, back_to: Option<u32>) {
        let oldest_ns = self.last_ns.saturating_sub(LIFE_NS);
        let before = self.seconds.drain(..).filter(|second| second.begun_ns >= oldest_ns).collect();
        self.revised = Some(Revised { number, back_to, before, told: false });
        self.counts_from_ns = self.last_ns + SETTLE_NS;
        self.running = Running::default();
        self.view = self.judge();
    }

    /// One more sample of the servo. What it says is news: the thrust is worse, told once a revision.
    pub fn take(&mut self, telemetry: &Telemetry) -> Option<TrialView> {
        let now_ns = telemetry.time_ns;
        if now_ns < self.last_ns {
            // A servo on another clock: nothing of before has its place beside it.
            (self.counts_from_ns, self.running) = (0, Running::default());
            self.seconds.clear();
        }
        self.last_ns = now_ns;
        if now_ns < self.counts_from_ns {
            return None;
        }
        let mut news = None;
        if self.running.samples > 0 && now_ns >= self.running.begun_ns + SECOND_NS {
            let running = std::mem::take(&mut self.running);
            // A gap is no driving.
            if running.whole && now_ns < running.begun_ns + 2 * SECOND_NS {
                self.keep(&running);
                news = self.news();
                self.view = self.judge();
            }
        }
        self.add(telemetry);
        news
    }

    fn add(&mut self, telemetry: &Telemetry) {
        let (command, thrust) = (telemetry.signals.thrust_cmd_n, telemetry.signals.thrust_n);
        let running = &mut self.running;
        if running.samples == 0 {
            *running = Running {
                begun_ns: telemetry.time_ns,
                least: f64::INFINITY,
                most: f64::NEG_INFINITY,
                whole: true,
                ..Running::default()
            };
        }
        running.samples += 1;
        running.whole &= telemetry.armed != 0 && command.is_finite();
        // A slow sensor shows a value on some samples only.
        if command.is_finite() && thrust.is_finite() {
            running.sum_square += (thrust - command).powi(2);
            running.sum_command += command;
            running.least = running.least.min(command);
            running.most = running.most.max(command);
            running.read += 1;
        }
    }

    fn keep(&mut self, running: &Running) {
        if running.read == 0 {
            return;
        }
        let read = f64::from(running.read);
        let level = (running.sum_command / read / self.full_n * LEVELS).round();
        let moving = running.most - running.least > MOVING * self.full_n;
        if self.seconds.len() == SPAN {
            self.seconds.pop_front();
        }
        self.seconds.push_back(Second {
            begun_ns: running.begun_ns,
            like: (level as i32, moving),
            mean_square_n2: running.sum_square / read,
        });
    }

    fn news(&mut self) -> Option<TrialView> {
        if self.revised.as_ref().is_none_or(|revised| revised.told) {
            return None;
        }
        let view = self.judge().filter(|view| view.larger == Some(true))?;
        self.revised.as_mut()?.told = true;
        Some(view)
    }

    /// How it stands; `None` while no revision came into force.
    pub fn view(&self) -> Option<TrialView> {
        self.view.clone()
    }

    fn judge(&self) -> Option<TrialView> {
        let revised = self.revised.as_ref()?;
        let compared = Compared::of(&revised.before, &self.seconds);
        let too_little = self.too_little(revised, compared.seconds);
        let enough = too_little.is_none();
        let rms = |mean_square: f64| enough.then(|| mean_square.sqrt());
        Some(TrialView {
            revision: revised.number,
            before: revised.back_to,
            before_rms_n: rms(compared.before_n2),
            since_rms_n: rms(compared.since_n2),
            compared_s: compared.seconds,
            // Once told it stands, until another revision comes.
            larger: if revised.told { Some(true) } else { enough.then(|| compared.is_larger()) },
            not_judged: too_little.filter(|_| !revised.told),
        })
    }

    /// What is missing for a comparison.
    fn too_little(&self, revised: &Revised, compared: usize) -> Option<String> {
        const DRIVEN: &str = "was driven under a thrust command, with the thrust measured,";
        match compared {
            _ if revised.before.is_empty() => Some(format!("nothing {DRIVEN} shortly before it")),
            _ if self.seconds.is_empty() => Some(format!("nothing {DRIVEN} since")),
            0 => Some("no command since was held like one before it".into()),
            few if few < ENOUGH => {
                Some(format!("{few} s under like commands before and since are too few: {ENOUGH} are needed"))
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use kort_proto::signals::Signals;

    /// Drives for so many seconds at 50 Hz: the error is a wave around `bias_n`.
    fn drive(
        trial: &mut Trial,
        from_s: &mut f64,
        seconds: f64,
        command_n: f64,
        bias_n: f64,
    ) -> Vec<TrialView> {
        let end_s = *from_s + seconds;
        let mut news = Vec::new();
        while *from_s < end_s {
            let wave = (*from_s * 7.3).sin();
            let signals =
                Signals { thrust_cmd_n: command_n, thrust_n: command_n + bias_n + wave, ..Signals::UNKNOWN };
            let time_ns = (*from_s * 1e9) as u64;
            news.extend(trial.take(&Telemetry { time_ns, armed: 1, signals, ..Telemetry::default() }));
            *from_s += 0.02;
        }
        news
    }

    #[test]
    fn a_larger_error_under_like_commands_is_told_once_with_the_way_back() {
        let (mut trial, mut at_s) = (Trial::new(100.0), 1.0);
        assert_eq!(trial.view(), None);
        drive(&mut trial, &mut at_s, 40.0, 30.0, 1.0);
        trial.revised(3, Some(2));
        let view = trial.view().unwrap();
        assert_eq!((view.before_rms_n, view.larger), (None, None));
        assert!(view.not_judged.as_ref().is_some_and(|why| why.ends_with("measured, since")), "{view:?}");
        let news = drive(&mut trial, &mut at_s, 40.0, 30.0, 4.0);
        let [news] = news.as_slice() else { panic!("{news:?}") };
        assert_eq!((news.revision, news.before, news.larger), (3, Some(2), Some(true)));
        // A constant and a sine: mean square b^2 + 1/2.
        assert!((news.before_rms_n.unwrap() - 1.5_f64.sqrt()).abs() < 0.05, "{news:?}");
        assert!((news.since_rms_n.unwrap() - 16.5_f64.sqrt()).abs() < 0.1, "{news:?}");
        assert!(news.words().contains("rollback goes back to revision 2"), "{}", news.words());
        // Back again: the trial is of the way back, which makes it better.
        trial.revised(2, Some(1));
        assert!(drive(&mut trial, &mut at_s, 40.0, 30.0, 1.0).is_empty());
        let view = trial.view().unwrap();
        assert!(view.larger == Some(false) && view.since_rms_n < view.before_rms_n, "{view:?}");
    }

    #[test]
    fn other_commands_and_what_settles_are_not_compared() {
        let (mut trial, mut at_s) = (Trial::new(100.0), 1.0);
        drive(&mut trial, &mut at_s, 40.0, 30.0, 1.0);
        trial.revised(2, Some(1));
        assert!(drive(&mut trial, &mut at_s, 4.5, 30.0, 50.0).is_empty(), "it settles");
        assert!(drive(&mut trial, &mut at_s, 40.0, 80.0, 9.0).is_empty(), "driven harder");
        assert!(drive(&mut trial, &mut at_s, 40.0, f64::NAN, 9.0).is_empty(), "not driven");
        let view = trial.view().unwrap();
        assert_eq!((view.compared_s, view.larger), (0, None));
        assert!(view.not_judged.is_some_and(|why| why.contains("like one before")));
        drive(&mut trial, &mut at_s, 5.0, 30.0, 1.0);
        let view = trial.view().unwrap();
        assert!(view.larger.is_none() && view.not_judged.unwrap().contains("too few: 10 are needed"));
        assert!(drive(&mut trial, &mut at_s, 30.0, 30.0, 1.0).is_empty(), "as before");
        let view = trial.view().unwrap();
        assert!(view.compared_s >= ENOUGH && view.larger == Some(false), "{view:?}");
        assert_eq!(view.not_judged, None);
    }

    #[test]
    fn where_nothing_was_driven_before_nothing_is_judged() {
        let (mut trial, mut at_s) = (Trial::new(100.0), 1.0);
        drive(&mut trial, &mut at_s, 40.0, f64::NAN, 1.0);
        trial.revised(2, Some(1));
        drive(&mut trial, &mut at_s, 40.0, 30.0, 9.0);
        let view = trial.view().unwrap();
        assert_eq!(view.larger, None);
        assert!(view.not_judged.as_ref().is_some_and(|why| why.ends_with("before it")), "{view:?}");
    }

    #[test]
    fn what_is_kept_is_bounded_and_another_clock_begins_anew() {
        let (mut trial, mut at_s) = (Trial::new(100.0), 1000.0);
        drive(&mut trial, &mut at_s, 200.0, 30.0, 1.0);
        assert_eq!(trial.seconds.len(), SPAN);
        at_s = 1.0;
        drive(&mut trial, &mut at_s, 3.0, 30.0, 1.0);
        assert!(trial.seconds.len() <= 3);
    }
}
