//! Messages that libraries of the system write on stderr while a GPU is looked for, without those that are no
//! news: Vulkan's device selection complains where no desktop runs, on servers and in containers, each time.

/// Beginning of a message that says no more than that no desktop runs.
#[cfg(unix)]
const NO_DESKTOP: &str = "error: XDG_RUNTIME_DIR";

/// Runs some work, and hands on what it writes on stderr meanwhile, but for what is no news.
#[cfg(unix)]
pub(crate) fn hushed<T>(work: impl FnOnce() -> T) -> T {
    use std::io::{Read, Seek, Write};
    let redirected = || -> std::io::Result<_> {
        let kept = rustix::io::dup(std::io::stderr())?;
        let file = tempfile::tempfile()?;
        rustix::stdio::dup2_stderr(&file)?;
        Ok((kept, file))
    };
    let Ok((kept, mut file)) = redirected() else { return work() };
    let done = work();
    let mut said = Vec::new();
    // Without its stderr back the program could say nothing more, and has nobody to tell.
    let _back = rustix::stdio::dup2_stderr(kept);
    if file.rewind().and_then(|()| file.read_to_end(&mut said)).is_ok() {
        for line in String::from_utf8_lossy(&said).lines().filter(|line| !line.starts_with(NO_DESKTOP)) {
            let _told = writeln!(std::io::stderr(), "{line}");
        }
    }
    done
}

/// Runs some work: other systems write nothing.
#[cfg(not(unix))]
pub(crate) fn hushed<T>(work: impl FnOnce() -> T) -> T {
    work()
}
