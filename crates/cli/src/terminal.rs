//! The terminal as an observer: a progress bar on stderr, shown only when stderr is a terminal, with notes
//! above it.

use std::sync::{Mutex, PoisonError};

use indicatif::{ProgressBar, ProgressStyle};
use ndfmap::core::observe::Observer;

/// Steps of a bar: finer than any terminal is wide.
const STEPS: u64 = 1000;

/// Observer that shows people the progress of the work.
#[derive(Default)]
pub(crate) struct Terminal {
    bar: Mutex<Option<ProgressBar>>,
}

impl Terminal {
    fn change(&self, change: impl FnOnce(&mut Option<ProgressBar>)) {
        change(&mut self.bar.lock().unwrap_or_else(PoisonError::into_inner));
    }
}

/// Takes a bar away.
fn clear(bar: &mut Option<ProgressBar>) {
    if let Some(bar) = bar.take() {
        bar.finish_and_clear();
    }
}

impl Observer for Terminal {
    fn begin(&self, work: &str) {
        let bar = ProgressBar::new(STEPS);
        if let Ok(style) = ProgressStyle::with_template("{msg:24} [{wide_bar}] {percent:>3}% {eta:>4}") {
            bar.set_style(style.progress_chars("=> "));
        }
        bar.set_message(work.to_owned());
        self.change(|last| {
            clear(last);
            *last = Some(bar);
        });
    }

    fn note(&self, note: &str) {
        self.change(|bar| {
            let say = || eprintln!("ndfmap: {note}");
            match bar {
                Some(bar) => bar.suspend(say),
                None => say(),
            }
        });
    }

    fn progress(&self, fraction: f64) {
        self.change(|bar| match bar {
            Some(_) if fraction >= 1.0 => clear(bar),
            Some(bar) => bar.set_position((fraction.clamp(0.0, 1.0) * STEPS as f64) as u64),
            None => {}
        });
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        self.change(clear);
    }
}
