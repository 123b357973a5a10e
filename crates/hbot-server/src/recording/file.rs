//! The files of a recording: their names, and when a new one begins.

use std::fs::{self, File};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::SystemTime;

use super::limit::Limit;
use crate::flight::utc;

/// The extension of recordings.
const EXTENSION: &str = "mcap";

/// Where the files of a recording go.
pub(super) struct Files {
    path: Option<PathBuf>,
    limit: Option<Limit>,
    /// Path of the first file, until it is begun.
    first: Option<PathBuf>,
    /// Number of files begun.
    begun: u64,
}

/// Where a recording is written: a file that counts its bytes.
pub(super) struct Counting {
    file: BufWriter<File>,
    bytes: Arc<AtomicU64>,
}

/// What to write to, and the count of its bytes.
pub(super) type Opened = (Counting, Arc<AtomicU64>);

impl Files {
    pub(super) fn new(path: Option<PathBuf>, limit: Option<Limit>) -> Self {
        let first = path.as_deref().map(|path| named(path, 1));
        Self { path, limit, first, begun: 0 }
    }

    /// Returns the path of the first file. Returns `None` after it was begun, or if only flight
    /// logs are to be recorded.
    pub(super) fn first(&self) -> Option<&Path> {
        self.first.as_deref()
    }

    /// Returns whether anything but flight logs is to be recorded.
    pub(super) fn are_wanted(&self) -> bool {
        self.path.is_some()
    }

    /// Creates the next file. Returns its path and what [`open`] returned. Returns `None` if no
    /// further file is wanted.
    pub(super) fn create(&mut self) -> Option<(PathBuf, io::Result<Opened>)> {
        let path = self.path.as_ref()?;
        let path = match self.first.take() {
            Some(first) => first,
            None if is_file(path) => return None,
            None => named(path, self.begun + 1),
        };
        self.begun += 1;
        let opened = open(&path);
        Some((path, opened))
    }

    /// Returns whether a file of `bytes` bytes that covers `span_ns` of the run is long enough.
    pub(super) fn is_full(&self, bytes: u64, span_ns: u64) -> bool {
        match self.limit {
            None => false,
            Some(Limit::Size(limit)) => bytes >= limit,
            Some(Limit::Time(limit)) => u128::from(span_ns) >= limit.as_nanos(),
        }
    }

    /// Returns whether another file can be created after the present one.
    pub(super) fn has_more(&self) -> bool {
        self.path.as_deref().is_some_and(|path| !is_file(path) || self.begun == 0)
    }
}

/// Returns the path of file `number`, counted from 1, of a recording to `path`: that file, or one
/// in that folder, which is named after the present time.
fn named(path: &Path, number: u64) -> PathBuf {
    if is_file(path) {
        return path.to_owned();
    }
    let (now, process) = (utc(SystemTime::now()), std::process::id());
    path.join(format!("hbot-{now}-{process}-{number:03}.{EXTENSION}"))
}

/// Returns whether a recording goes into the file `path`, and not into a folder of this name.
pub fn is_file(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == EXTENSION) && !is_folder(path)
}

/// Returns whether `path` is a folder whatever its ending: it has `/` at its end, or the folder
/// exists.
pub fn is_folder(path: &Path) -> bool {
    path.as_os_str().as_encoded_bytes().ends_with(b"/") || path.is_dir()
}

/// Returns why nothing can be recorded to `path`, which is the name of a file or of a folder.
/// Returns `None` if nothing is known against it.
///
/// A device, a pipe or a socket is neither, and neither is a symbolic link to nothing.
#[must_use]
pub fn unsuitable(path: &Path) -> Option<&'static str> {
    let link = fs::symlink_metadata(path).ok()?;
    match fs::metadata(path) {
        Err(_) if link.is_symlink() => Some("it is a symbolic link to something that does not exist"),
        Ok(target) if !target.is_dir() && !target.is_file() => {
            Some("it is a device, a pipe or a socket, neither a file nor a folder")
        }
        Ok(target) if target.is_file() && !is_file(path) => {
            Some("a file of this name exists, and the name is that of a folder")
        }
        _ => None,
    }
}

/// Creates the folder of a recording to `path`, unless it exists, and tries whether a file can be
/// made there. So a server refuses at its start what its recorder could only report later. A trial
/// file that a killed server has left there is taken over.
///
/// # Errors
/// Fails if the folder or a file in it cannot be made.
pub fn try_to_make(path: &Path) -> io::Result<()> {
    let folder = if is_file(path) { path.parent().unwrap_or(path) } else { path };
    fs::create_dir_all(folder)?;
    let trial = folder.join(format!(".hbot-{}", std::process::id()));
    File::create(&trial)?;
    // Where files may be made but not removed, a recording is possible.
    let _ = fs::remove_file(trial);
    Ok(())
}

/// Creates the file `path`, which must not exist yet.
pub(super) fn open(path: &Path) -> io::Result<Opened> {
    if let Some(dir) = path.parent() {
        fs::create_dir_all(dir)?;
    }
    let bytes = Arc::new(AtomicU64::new(0));
    let file = BufWriter::new(File::create_new(path)?);
    Ok((Counting { file, bytes: Arc::clone(&bytes) }, bytes))
}

impl Write for Counting {
    fn write(&mut self, data: &[u8]) -> io::Result<usize> {
        let written = self.file.write(data)?;
        self.bytes.fetch_add(written as u64, Ordering::Relaxed);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Seek for Counting {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}
