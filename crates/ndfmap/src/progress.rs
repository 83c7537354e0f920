//! A progress bar on stderr, shown only when that is a terminal.

use indicatif::{ProgressBar, ProgressStyle};
use ndfmap_core::observe::Observer;

/// Steps of a bar: finer than any terminal is wide.
const STEPS: u64 = 1000;

/// A bar for one piece of work.
pub(crate) struct Progress {
    bar: ProgressBar,
}

impl Progress {
    /// A bar with a word before it.
    pub(crate) fn new(what: &str) -> Self {
        let bar = ProgressBar::new(STEPS);
        if let Ok(style) = ProgressStyle::with_template("{msg:24} [{wide_bar}] {percent:>3}% {eta:>4}") {
            bar.set_style(style.progress_chars("=> "));
        }
        bar.set_message(what.to_owned());
        Self { bar }
    }
}

impl Observer for Progress {
    fn progress(&self, fraction: f64) {
        self.bar.set_position((fraction.clamp(0.0, 1.0) * STEPS as f64) as u64);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
