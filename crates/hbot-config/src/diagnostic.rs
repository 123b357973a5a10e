//! Error types: what is wrong with a file, at which place, and what would be legal.

use std::fmt;
use std::path::PathBuf;

/// One mistake in a file or JSON value. Displayed as `rigs/x.toml:12:9: wheel[1].steer.gear: 0 is
/// out of range; legal: > 0`; parts that are not known are left out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Diagnostic {
    /// Path of the file as the caller gave it, or the command line option that set the value.
    /// `None` for a JSON value.
    pub file: Option<String>,
    /// Line in the file, counted from 1. `None` if there is no text, or no place in it to point at.
    pub line: Option<usize>,
    /// Column in the line, in characters, counted from 1. Known if and only if the line is known.
    pub column: Option<usize>,
    /// Path of the wrong value, such as `wheel[1].steer.gear`. Wheels are counted from 0. Empty if
    /// the mistake concerns the whole file.
    pub path: String,
    /// What is wrong, including the value that was found.
    pub message: String,
    /// The legal values. `None` if the message already says it.
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

/// All mistakes found in a file or JSON value: at least one, in the order of the file. Displayed
/// with one mistake per line.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}", .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))]
pub struct Diagnostics(Vec<Diagnostic>);

impl Diagnostics {
    /// Wraps at least one diagnostic and sorts them by line and column.
    pub(crate) fn new(mut all: Vec<Diagnostic>) -> Self {
        debug_assert!(!all.is_empty(), "an error needs a reason");
        all.sort_by_key(|d| (d.line, d.column));
        Self(all)
    }

    /// Like [`new`](Self::new), and adds a last line that says that more mistakes were found.
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
    /// The file could not be read.
    #[error("{}: cannot be read", path.display())]
    Read {
        /// Path of the file.
        path: PathBuf,
        /// The error reported by the operating system.
        source: std::io::Error,
    },
    /// The file was read, but its content is not legal.
    #[error(transparent)]
    Invalid(#[from] Diagnostics),
}
