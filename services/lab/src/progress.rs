//! Progress on stderr, on a terminal only.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// A bar over `steps` equal steps of work; silent when stderr is no terminal.
pub fn bar(steps: u64, what: &'static str) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(steps), ProgressDrawTarget::stderr());
    bar.set_style(style("{msg} [{bar:40}] {pos}/{len} {eta}"));
    bar.with_message(what)
}

/// A bar over bytes read; silent when stderr is no terminal.
pub fn bytes(total: u64, what: String) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::stderr());
    bar.set_style(style("{msg} [{bar:40}] {bytes}/{total_bytes} {eta}"));
    bar.with_message(what)
}

fn style(template: &str) -> ProgressStyle {
    // The templates above are fixed; should one be wrong, the default bar still shows progress.
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}

/// A spinner for work of unknown length; silent when stderr is no terminal.
pub fn spinner() -> ProgressBar {
    let spinner = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
    spinner.set_style(style("{spinner} {elapsed} {msg}"));
    spinner.enable_steady_tick(std::time::Duration::from_millis(120));
    spinner
}
