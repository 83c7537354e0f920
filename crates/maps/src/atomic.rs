//! Files that are either whole or not there: written under another name, then renamed.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use tempfile::TempPath;

use crate::MapError;

/// Names of files being written, for [`abandon_all`].
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// A file under a temporary name beside its final one; dropped unfinished, it is removed.
#[derive(Debug)]
pub struct AtomicFile {
    file: File,
    /// Until the file has its final name.
    temporary: Option<TempPath>,
    target: PathBuf,
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        if let Some(temporary) = self.temporary.take() {
            forget(&temporary);
        }
    }
}

impl AtomicFile {
    /// Opens a temporary file in the folder of `target`.
    ///
    /// # Errors
    /// [`MapError`] when the folder does not take a file, or `target` is a folder.
    pub fn create(target: &Path) -> Result<Self, MapError> {
        if target.is_dir() {
            return Err(MapError::invalid(target, "is a folder, not a file"));
        }
        let folder = folder_of(target);
        if !folder.is_dir() {
            return Err(MapError::invalid(target, format!("there is no folder {}", folder.display())));
        }
        let mut builder = tempfile::Builder::new();
        // The file is as readable as any new file; the crate's default is for secrets.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o644));
        let made = builder.prefix(".ndfmap-").tempfile_in(folder).map_err(|e| MapError::io(target, e))?;
        let (file, temporary) = made.into_parts();
        unfinished().push(temporary.to_path_buf());
        Ok(Self { file, temporary: Some(temporary), target: target.to_owned() })
    }

    /// Opens a further file in the same folder, without a name, for as long as it stays open.
    ///
    /// # Errors
    /// [`MapError`] when the folder does not take it.
    pub fn scratch(&self) -> Result<File, MapError> {
        tempfile::tempfile_in(folder_of(&self.target)).map_err(|e| MapError::io(&self.target, e))
    }

    /// The file to write to.
    pub fn file(&mut self) -> &mut File {
        &mut self.file
    }

    /// The final name, for messages.
    #[must_use]
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// Gives the file its final name; replaces a file of that name.
    ///
    /// # Errors
    /// [`MapError`] when the rename fails; the temporary file is removed.
    pub fn finish(mut self) -> Result<(), MapError> {
        let Some(temporary) = self.temporary.take() else { return Ok(()) };
        let name = temporary.to_path_buf();
        let renamed = temporary.persist(&self.target).map_err(|e| MapError::io(&self.target, e.error));
        forget(&name);
        renamed
    }
}

fn folder_of(target: &Path) -> &Path {
    target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn forget(name: &Path) {
    unfinished().retain(|unfinished| unfinished != name);
}

/// Writes a whole file at once.
///
/// # Errors
/// [`MapError`] when it cannot be written; then nothing is left behind.
pub fn write(target: &Path, bytes: &[u8]) -> Result<(), MapError> {
    use std::io::Write;
    let mut file = AtomicFile::create(target)?;
    file.file().write_all(bytes).map_err(|e| MapError::io(target, e))?;
    file.finish()
}

/// Removes every file that is still being written. For an interrupt handler, just before the end.
pub fn abandon_all() {
    for path in unfinished().drain(..) {
        // A file finished or dropped meanwhile is not there to remove, and nobody is left to tell.
        let _gone = std::fs::remove_file(path);
    }
}

fn unfinished() -> std::sync::MutexGuard<'static, Vec<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn unfinished_files_leave_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("a.ktx2");
        let mut file = AtomicFile::create(&target).unwrap();
        file.file().write_all(b"half").unwrap();
        drop(file);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        write(&target, b"whole").unwrap();
        assert_eq!(std::fs::read(&target).unwrap(), b"whole");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn folders_and_missing_folders_are_named() {
        let folder = tempfile::tempdir().unwrap();
        assert!(AtomicFile::create(folder.path()).unwrap_err().to_string().contains("is a folder"));
        let error = AtomicFile::create(&folder.path().join("no/such.ktx2")).unwrap_err().to_string();
        assert!(error.contains("such.ktx2"), "{error}");
    }
}
