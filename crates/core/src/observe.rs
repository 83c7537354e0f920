//! Observers of long work, which are told how far it is and may stop it.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError, TryLockError};

/// Observer of a piece of work. A closure that takes the fraction done is an observer that never stops it.
pub trait Observer: Sync {
    /// Told that another piece of the work begins, in words such as `bake vmf:4`; progress counts from 0
    /// again.
    fn begin(&self, _work: &str) {}

    /// Told news that a person may want to know, in a sentence without a full stop.
    fn note(&self, _note: &str) {}

    /// Told the fraction done, from 0 to 1, by any thread and never less than before.
    fn progress(&self, _fraction: f64) {}

    /// Asked now and then, by any thread; once true, the work ends as soon as it can, with [`Cancelled`].
    fn cancelled(&self) -> bool {
        false
    }

    /// [`Self::cancelled`] as a result, for `?`.
    ///
    /// # Errors
    /// [`Cancelled`], where the observer wants the work to end.
    fn check(&self) -> Result<(), Cancelled> {
        if self.cancelled() { Err(Cancelled) } else { Ok(()) }
    }
}

impl<F: Fn(f64) + Sync> Observer for F {
    fn progress(&self, fraction: f64) {
        self(fraction);
    }
}

/// Observer that ignores everything and never stops the work.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unobserved;

impl Observer for Unobserved {}

/// Error of work that its observer stopped; no result of it is left.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cancelled")]
pub struct Cancelled;

impl dyn Observer + '_ {
    /// Observer of a part of the work, which goes from one fraction of the whole to another.
    pub fn part(&self, from: f64, to: f64) -> Part<'_> {
        Part { whole: self, from, to }
    }
}

/// Observer of a part, made by [`part`](trait.Observer.html#method.part).
#[derive(Clone, Copy)]
pub struct Part<'a> {
    whole: &'a dyn Observer,
    from: f64,
    to: f64,
}

impl Observer for Part<'_> {
    fn begin(&self, work: &str) {
        self.whole.begin(work);
    }

    fn note(&self, note: &str) {
        self.whole.note(note);
    }

    fn progress(&self, fraction: f64) {
        self.whole.progress(self.from + (self.to - self.from) * fraction);
    }

    fn cancelled(&self) -> bool {
        self.whole.cancelled()
    }
}

/// Observer that hands on what threads report, except progress that would run backwards.
pub struct Forward<'a> {
    observer: &'a dyn Observer,
    most: Mutex<f64>,
    stopped: AtomicBool,
}

impl<'a> Forward<'a> {
    /// Nothing done.
    #[must_use]
    pub fn new(observer: &'a dyn Observer) -> Self {
        Self { observer, most: Mutex::new(f64::NEG_INFINITY), stopped: AtomicBool::new(false) }
    }
}

impl Observer for Forward<'_> {
    fn begin(&self, work: &str) {
        *self.most.lock().unwrap_or_else(PoisonError::into_inner) = f64::NEG_INFINITY;
        self.observer.begin(work);
    }

    fn note(&self, note: &str) {
        self.observer.note(note);
    }

    fn progress(&self, fraction: f64) {
        // Held while the observer is told, so that no other thread tells less after it. A thread that finds
        // it held says nothing: it does not wait for a slow observer, nor for itself, where an observer's own
        // parallel work runs a piece of ours.
        let mut most = match self.most.try_lock() {
            Ok(most) => most,
            Err(TryLockError::Poisoned(most)) => most.into_inner(),
            Err(TryLockError::WouldBlock) => return,
        };
        if fraction > *most {
            *most = fraction;
            self.observer.progress(fraction);
        }
    }

    /// True for ever once it was: work that a thread left out is never taken for done.
    fn cancelled(&self) -> bool {
        if self.stopped.load(Ordering::Relaxed) {
            return true;
        }
        let cancelled = self.observer.cancelled();
        if cancelled {
            self.stopped.store(true, Ordering::Relaxed);
        }
        cancelled
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn progress_never_runs_backwards() {
        let told = Mutex::new(Vec::new());
        let observer = |fraction: f64| told.lock().unwrap().push(fraction);
        let forward = Forward::new(&observer);
        [0.1, 0.3, 0.2, 0.3, 0.9].iter().for_each(|fraction| forward.progress(*fraction));
        assert_eq!(*told.lock().unwrap(), [0.1, 0.3, 0.9]);
    }

    #[test]
    fn a_part_is_a_share_of_the_whole_and_ends_with_it() {
        struct Stopped(Mutex<f64>);
        impl Observer for Stopped {
            fn progress(&self, fraction: f64) {
                *self.0.lock().unwrap() = fraction;
            }
            fn cancelled(&self) -> bool {
                true
            }
        }
        let stopped = Stopped(Mutex::new(0.0));
        let whole: &dyn Observer = &stopped;
        let part = whole.part(0.5, 0.75);
        part.progress(0.5);
        assert_eq!(*stopped.0.lock().unwrap(), 0.625);
        assert_eq!(part.check(), Err(Cancelled));
    }

    #[test]
    fn stopped_once_is_stopped_for_good() {
        // An observer whose answer is consumed by the question.
        struct Flicker(AtomicBool);
        impl Observer for Flicker {
            fn cancelled(&self) -> bool {
                self.0.swap(false, Ordering::Relaxed)
            }
        }
        let flicker = Flicker(AtomicBool::new(true));
        let forward = Forward::new(&flicker);
        assert!(forward.cancelled() && forward.cancelled());
        assert_eq!(forward.check(), Err(Cancelled));
    }
}
