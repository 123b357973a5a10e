//! Error types: what is wrong with a file, at which place, and what would be legal.

use std::fmt;
use std::path::PathBuf;

/// One mistake in a rig file, a scene file or a JSON value. It is displayed on one line, such as
/// `rigs/x.toml:12:9: wheel[1].steer.gear: 0 is out of range; legal: > 0`. Unknown parts are left
/// out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Diagnostic {
    /// Path of the file that contains the mistake, as the caller gave it, or the command line
    /// option that set the value. `None` for a JSON value.
    pub file: Option<String>,
    /// Line of the mistake in the file, counted from 1. `None` if the value did not come from a
    /// text, or if the mistake has no place in the text.
    pub line: Option<usize>,
    /// Column of the mistake in its line, in characters, counted from 1. `None` if and only if
    /// `line` is `None`.
    pub column: Option<usize>,
    /// Path of the wrong value in the file, such as `wheel[1].steer.gear`. Wheels are counted from
    /// 0. Empty if the mistake concerns the whole file.
    pub path: String,
    /// A description of the mistake, including the value that was found.
    pub message: String,
    /// A description of the legal values. `None` if the message already contains it.
    pub legal: Option<String>,
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(file) = &self.file {
            f.write_str(file)?;
            if let (Some(line), Some(column)) = (self.line, self.column) {
                write!(f, ":{line}:{column}")?;
            }
            f.write_str(": ")?;
        }
        if !self.path.is_empty() {
            write!(f, "{}: ", self.path)?;
        }
        f.write_str(&self.message)?;
        match &self.legal {
            Some(legal) => write!(f, "; legal: {legal}"),
            None => Ok(()),
        }
    }
}

/// All mistakes found in a file or JSON value, in the order of the file. There is at least one.
/// They are displayed one per line.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}", .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))]
pub struct Diagnostics(Vec<Diagnostic>);

impl Diagnostics {
    /// Creates the error from at least one mistake, and sorts the mistakes by line and column.
    pub(crate) fn new(mut all: Vec<Diagnostic>) -> Self {
        all.sort_by_key(|d| (d.line, d.column));
        Self(all)
    }

    /// Creates the error like [`new`](Self::new), and adds a last line which says that more
    /// mistakes were found.
    pub(crate) fn cut_short(all: Vec<Diagnostic>) -> Self {
        let Self(mut all) = Self::new(all);
        let file = all.first().and_then(|first| first.file.clone());
        let message = "... and more".to_owned();
        all.push(Diagnostic { file, line: None, column: None, path: String::new(), message, legal: None });
        Self(all)
    }
}

impl std::ops::Deref for Diagnostics {
    type Target = [Diagnostic];

    fn deref(&self) -> &[Diagnostic] {
        &self.0
    }
}

/// The error returned when a rig or scene file cannot be loaded.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// The file could not be read from disk.
    #[error("{}: cannot be read", path.display())]
    Read {
        /// Path of the file that could not be read.
        path: PathBuf,
        /// The error from the operating system.
        source: std::io::Error,
    },
    /// The file was read, but it contains mistakes.
    #[error(transparent)]
    Invalid(#[from] Diagnostics),
}
