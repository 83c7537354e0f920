//! Files that are either whole or not there: written without a name, or under another, then renamed.

mod unnamed;

use std::fs::File;
use std::io::{self, Seek};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use tempfile::TempPath;

use crate::MapError;

/// Temporary names of files being written, for [`abandon_all`].
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Mode of a file on Unix, less what the process masks: all may read it.
const MODE: u32 = 0o644;

/// A file in the folder of its final name; dropped unfinished, it is removed.
///
/// Where the system can, it has no name until it is finished, so that even a killed process leaves nothing;
/// elsewhere it has a temporary one.
#[derive(Debug)]
pub struct AtomicFile {
    file: File,
    /// Temporary name, if it has one, until the file has its final name.
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
        let (file, temporary) = match unnamed::open(folder, MODE) {
            Some(file) => (file, None),
            None => {
                let (file, name) = named(folder).map_err(|e| MapError::io(target, e))?;
                (file, Some(name))
            }
        };
        Ok(Self { file, temporary, target: target.to_owned() })
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
        let temporary = match self.temporary.take() {
            Some(temporary) => temporary,
            None => self.name().map_err(|e| MapError::io(&self.target, e))?,
        };
        let name = temporary.to_path_buf();
        let renamed = temporary.persist(&self.target).map_err(|e| MapError::io(&self.target, e.error));
        forget(&name);
        renamed
    }

    /// Temporary name for a file without any: only a rename replaces another file.
    fn name(&mut self) -> io::Result<TempPath> {
        let folder = folder_of(&self.target);
        let linked = builder().make_in(folder, |name| unnamed::link(&self.file, name));
        if let Ok(linked) = linked {
            return Ok(remember(linked.into_temp_path()));
        }
        // A rule of the system, as AppArmor's, may forbid the link: then the bytes move.
        self.file.rewind()?;
        let (mut file, name) = named(folder)?;
        io::copy(&mut self.file, &mut file).inspect_err(|_| forget(&name))?;
        Ok(name)
    }
}

fn folder_of(target: &Path) -> &Path {
    target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn builder() -> tempfile::Builder<'static, 'static> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".ndfmap-");
    // The crate's default is for secrets.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(MODE));
    builder
}

/// Opens a file under a temporary name.
fn named(folder: &Path) -> io::Result<(File, TempPath)> {
    let (file, name) = builder().tempfile_in(folder)?.into_parts();
    Ok((file, remember(name)))
}

fn remember(name: TempPath) -> TempPath {
    unfinished().push(name.to_path_buf());
    name
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

    /// Keeps other tests' files from being abandoned.
    fn alone() -> std::sync::MutexGuard<'static, ()> {
        static ALONE: Mutex<()> = Mutex::new(());
        ALONE.lock().unwrap_or_else(PoisonError::into_inner)
    }

    #[test]
    fn unfinished_files_leave_nothing() {
        let _alone = alone();
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

    /// Mode of a file that any program makes with [`MODE`].
    #[cfg(unix)]
    fn mode_of_a_new_file(folder: &Path) -> u32 {
        use std::os::unix::fs::{OpenOptionsExt, PermissionsExt};
        let path = folder.join("new");
        let file = File::options().write(true).create_new(true).mode(MODE).open(&path).unwrap();
        std::fs::remove_file(path).unwrap();
        file.metadata().unwrap().permissions().mode()
    }

    #[cfg(unix)]
    #[test]
    fn every_way_to_a_name_gives_the_same_file() {
        use std::os::unix::fs::PermissionsExt;
        let _alone = alone();
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("a.ktx2");
        let mode = mode_of_a_new_file(folder.path());
        let with = |file, temporary| AtomicFile { file, temporary, target: target.clone() };
        let (file, name) = named(folder.path()).unwrap();
        let with_a_name = with(file, Some(name));
        let (file, name) = named(folder.path()).unwrap();
        forget(&name);
        // Without a name, but not of the kind that may be given one.
        name.close().unwrap();
        let unlinkable = with(file, None);
        let files = [AtomicFile::create(&target).unwrap(), with_a_name, unlinkable];
        for (i, mut file) in files.into_iter().enumerate() {
            file.file().write_all(&[i as u8; 99]).unwrap();
            file.finish().unwrap();
            assert_eq!(std::fs::read(&target).unwrap(), [i as u8; 99]);
            assert_eq!(std::fs::metadata(&target).unwrap().permissions().mode(), mode);
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        assert!(unfinished().is_empty());
    }

    #[test]
    fn abandoned_files_lose_their_temporary_names() {
        let _alone = alone();
        let folder = tempfile::tempdir().unwrap();
        let (file, name) = named(folder.path()).unwrap();
        let file = AtomicFile { file, temporary: Some(name), target: folder.path().join("a.ktx2") };
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        abandon_all();
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        assert!(file.finish().is_err());
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn unfinished_files_have_no_name() {
        let _alone = alone();
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("a.ktx2");
        let mut file = AtomicFile::create(&target).unwrap();
        let mut scratch = file.scratch().unwrap();
        scratch.write_all(b"scratch").unwrap();
        file.file().write_all(b"half").unwrap();
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        file.finish().unwrap();
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn a_link_is_replaced_and_not_followed() {
        let _alone = alone();
        let folder = tempfile::tempdir().unwrap();
        let [own, other] = ["a.ktx2", "b.ktx2"].map(|name| folder.path().join(name));
        std::fs::write(&other, b"other").unwrap();
        std::os::unix::fs::symlink(&other, &own).unwrap();
        write(&own, b"own").unwrap();
        assert!(!own.is_symlink());
        assert_eq!(std::fs::read(&other).unwrap(), b"other");
    }

    #[test]
    fn folders_and_missing_folders_are_named() {
        let folder = tempfile::tempdir().unwrap();
        assert!(AtomicFile::create(folder.path()).unwrap_err().to_string().contains("is a folder"));
        let error = AtomicFile::create(&folder.path().join("no/such.ktx2")).unwrap_err().to_string();
        assert!(error.contains("such.ktx2"), "{error}");
    }
}
