//! The terminal as an observer: a progress bar on stderr with notes above it; without a terminal, a line for
//! each piece of work that takes long.

use std::io::IsTerminal;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressState, ProgressStyle};
use ndfmap::core::observe::Observer;

use crate::voice::{Verbosity, say, wants};

/// Steps of a bar: finer than any terminal is wide.
const STEPS: u64 = 1000;

/// Time after which work is told of where there is no terminal for a bar.
const LONG: Duration = Duration::from_secs(2);

/// Interval at which the bar's clock ticks, whether or not there is progress.
const TICK: Duration = Duration::from_millis(250);

/// Observer that shows people the progress of the work.
#[derive(Default)]
pub(crate) struct Terminal {
    work: Mutex<Option<Work>>,
}

/// Piece of work that has begun.
struct Work {
    name: String,
    since: Instant,
    /// Most of it that was ever told done.
    done: f64,
    /// Bar, where there is a terminal.
    bar: Option<ProgressBar>,
    /// True once a line has told of it.
    told: bool,
}

impl Work {
    fn new(name: &str) -> Self {
        let bar = (std::io::stderr().is_terminal() && wants(Verbosity::Usual)).then(|| bar(name));
        Self { name: name.to_owned(), since: Instant::now(), done: 0.0, bar, told: false }
    }

    fn progress(&mut self, fraction: f64) {
        self.done = self.done.max(fraction.clamp(0.0, 1.0));
        match &self.bar {
            Some(bar) => bar.set_position((self.done * STEPS as f64) as u64),
            None if !self.told && self.since.elapsed() > LONG && self.done < 1.0 => {
                self.told = true;
                say(format_args!("{} ... {:.0} %", self.name, 100.0 * self.done));
            }
            None => {}
        }
    }

    /// Takes the bar away; a line that was begun gets its end.
    fn end(self) {
        if let Some(bar) = self.bar {
            bar.finish_and_clear();
        }
        if self.told {
            say(format_args!("{} took {:.1} s", self.name, self.since.elapsed().as_secs_f64()));
        }
    }
}

fn bar(name: &str) -> ProgressBar {
    let bar = ProgressBar::new(STEPS);
    // Time that remains, were the rest as fast as the part that is done: it counts down with the clock, not
    // with progress.
    let remaining = |state: &ProgressState, out: &mut dyn std::fmt::Write| {
        let done = state.pos() as f64 / STEPS as f64;
        let _shown = match (state.elapsed().as_secs_f64(), done) {
            (elapsed, done) if elapsed > 1.0 && done >= 0.02 => {
                write!(out, "{:.0} s left", elapsed * (1.0 - done) / done)
            }
            _ => Ok(()),
        };
    };
    if let Ok(style) = ProgressStyle::with_template(
        "{spinner} {msg:24} [{wide_bar}] {percent:>3} % {elapsed:>4} {remaining:>10}",
    ) {
        bar.set_style(style.progress_chars("=> ").with_key("remaining", remaining));
    }
    bar.set_message(name.to_owned());
    bar.enable_steady_tick(TICK);
    bar
}

impl Terminal {
    fn change(&self, change: impl FnOnce(&mut Option<Work>)) {
        change(&mut self.work.lock().unwrap_or_else(PoisonError::into_inner));
    }
}

impl Observer for Terminal {
    fn begin(&self, work: &str) {
        self.change(|last| {
            last.take().into_iter().for_each(Work::end);
            *last = Some(Work::new(work));
        });
    }

    fn note(&self, note: &str) {
        self.change(|work| match work.as_ref().and_then(|work| work.bar.as_ref()) {
            Some(bar) => bar.suspend(|| say(note)),
            None => say(note),
        });
    }

    fn progress(&self, fraction: f64) {
        self.change(|work| {
            work.iter_mut().for_each(|work| work.progress(fraction));
        });
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        self.change(|work| work.take().into_iter().for_each(Work::end));
    }
}
