//! Ctrl-C: unfinished files are removed, then the program ends.

/// Installs the handler. It exits with status 130, as shells expect of an interrupted program.
pub(crate) fn clean_up_when_interrupted() {
    let handler = || {
        ndfmap::maps::atomic::abandon_all();
        std::process::exit(130);
    };
    if let Err(error) = ctrlc::set_handler(handler) {
        eprintln!("ndfmap: warning: an interrupt may leave a temporary file behind: {error}");
    }
}
