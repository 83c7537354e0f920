//! Common parts of the targets.

use std::panic::{set_hook, take_hook};
use std::path::Path;

/// Lets readers catch the panics of decoders, some of whose checks of a hostile file are assertions.
/// libFuzzer ends at every panic, caught or not; from here on it ends at those of our own code, and at those
/// that nobody catches.
pub fn forgive_decoders() {
    drop(take_hook());
    let report = take_hook();
    let project = Path::new(env!("CARGO_MANIFEST_DIR")).parent();
    set_hook(Box::new(move |info| {
        report(info);
        // A target's own file has a relative name, all others have absolute ones.
        let ours = |file: &Path| file.is_relative() || project.is_some_and(|p| file.starts_with(p));
        if info.location().is_none_or(|place| ours(Path::new(place.file()))) {
            std::process::abort();
        }
    }));
}
