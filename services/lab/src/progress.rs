//! Progress on stderr: a bar on a terminal; elsewhere, where a bar would be noise, a plain line now
//! and then, so that a log shows whether long work still moves.

use std::ops::Deref;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use indicatif::{
    FormattedDuration, HumanBytes, HumanDuration, ProgressBar, ProgressDrawTarget, ProgressStyle,
};

/// Between two lines where there is no terminal.
const LINE_EVERY: Duration = Duration::from_secs(30);

/// A bar, or the lines in its place; both end when it goes.
pub struct Progress {
    bar: ProgressBar,
    lines: Option<(Sender<()>, JoinHandle<()>)>,
}

impl Progress {
    fn new(bar: ProgressBar, line: fn(&ProgressBar) -> String) -> Self {
        let lines = bar.is_hidden().then(|| {
            let bar = bar.clone();
            lines(LINE_EVERY, move || eprintln!("{}", line(&bar)))
        });
        Self { bar, lines }
    }

    /// A line of its own, above the bar where there is one.
    pub fn say(&self, text: &str) {
        self.bar.suspend(|| eprintln!("{text}"));
    }
}

impl Deref for Progress {
    type Target = ProgressBar;

    fn deref(&self) -> &ProgressBar {
        &self.bar
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
        if let Some((running, thread)) = self.lines.take() {
            drop(running);
            let _ = thread.join();
        }
    }
}

/// Calls `line` at this interval, on a thread of its own, until the sender is dropped.
fn lines(every: Duration, line: impl Fn() + Send + 'static) -> (Sender<()>, JoinHandle<()>) {
    let (running, ended) = channel();
    let thread = std::thread::spawn(move || {
        while ended.recv_timeout(every) == Err(RecvTimeoutError::Timeout) {
            line();
        }
    });
    (running, thread)
}

/// Progress over `steps` equal steps of work.
pub fn bar(steps: u64, what: &'static str) -> Progress {
    let bar = ProgressBar::with_draw_target(Some(steps), ProgressDrawTarget::stderr());
    bar.set_style(style("{msg} [{bar:40}] {pos}/{len} {eta}"));
    Progress::new(bar.with_message(what), |bar| counted(bar, |n| n.to_string()))
}

/// Progress over bytes read.
pub fn bytes(total: u64, what: String) -> Progress {
    let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::stderr());
    bar.set_style(style("{msg} [{bar:40}] {bytes}/{total_bytes} {eta}"));
    Progress::new(bar.with_message(what), |bar| counted(bar, |n| HumanBytes(n).to_string()))
}

/// Progress of work of unknown length: its message and the time gone.
pub fn spinner() -> Progress {
    let spinner = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
    spinner.set_style(style("{spinner} {elapsed} {msg}"));
    spinner.enable_steady_tick(Duration::from_millis(120));
    Progress::new(spinner, |bar| format!("{}, {} so far", bar.message(), FormattedDuration(bar.elapsed())))
}

/// Steps of a command of unknown length: on a spinner, or, for the service that it is a job of, each on a line of its own.
pub struct Steps(Option<Progress>);

impl Steps {
    /// Before the first one; `job` is the service's process id.
    pub fn new(job: Option<u32>) -> Self {
        Self(job.is_none().then(spinner))
    }

    /// It is at this now.
    pub fn tell(&self, step: &str) {
        match &self.0 {
            Some(spinner) => spinner.set_message(step.to_string()),
            None => eprintln!("step: {step}"),
        }
    }
}

fn style(template: &str) -> ProgressStyle {
    // The templates above are fixed; should one be wrong, the default bar still shows progress.
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}

/// What is done of how much, how long it took, and how long the rest takes at the same pace.
fn counted(bar: &ProgressBar, unit: fn(u64) -> String) -> String {
    let (done, all, gone) = (bar.position(), bar.length().unwrap_or(0), bar.elapsed());
    let mut line =
        format!("{}: {} of {} after {}", bar.message(), unit(done), unit(all), FormattedDuration(gone));
    if (1..all).contains(&done) {
        let left = gone.mul_f64((all - done) as f64 / done as f64);
        line += &format!(", about {} to go", HumanDuration(left));
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_says_what_is_done_of_how_much_and_what_is_left() {
        let at = |done: u64| {
            let bar = ProgressBar::hidden().with_elapsed(Duration::from_secs(100));
            bar.set_length(340);
            bar.set_position(done);
            counted(&bar.with_message("cases diagnosed"), |n| n.to_string())
        };
        assert_eq!(at(0), "cases diagnosed: 0 of 340 after 00:01:40");
        assert_eq!(at(20), "cases diagnosed: 20 of 340 after 00:01:40, about 27 minutes to go");
        assert_eq!(at(340), "cases diagnosed: 340 of 340 after 00:01:40");
    }

    #[test]
    fn lines_come_until_the_work_ends_and_not_after() {
        let (told, heard) = channel();
        let (running, thread) = lines(Duration::from_millis(1), move || {
            let _ = told.send(());
        });
        let patience = Duration::from_secs(60);
        assert!((0..3).all(|_| heard.recv_timeout(patience).is_ok()), "three lines");
        drop(running);
        thread.join().expect("the lines end with the work");
        while heard.recv_timeout(patience) == Ok(()) {}
        assert_eq!(heard.try_recv(), Err(std::sync::mpsc::TryRecvError::Disconnected));
    }
}
