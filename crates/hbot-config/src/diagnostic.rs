//! What is wrong with a file, where, and what would be right.

use std::fmt;
use std::path::PathBuf;

/// One mistake. Displayed as `rigs/x.toml:12:9: wheel[1].steer.gear: 0 is out of range; legal: > 0`, without the parts that
/// are not known.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Diagnostic {
    /// The file as it was named, or the option of the command line that gave the value; `None` for a JSON value.
    pub file: Option<String>,
    /// Line, from 1. `None` where there is no text, or nothing in it to point at.
    pub line: Option<usize>,
    /// Column in characters, from 1; known where the line is.
    pub column: Option<usize>,
    /// Which value, such as `wheel[1].steer.gear` (wheels counted from 0); empty for the whole.
    pub path: String,
    /// What was wrong, with the value found.
    pub message: String,
    /// What would be right, where the message does not say it.
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

/// All mistakes that were found, at least one, in the order of the file. Displayed one a line.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}", .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))]
pub struct Diagnostics(Vec<Diagnostic>);

impl Diagnostics {
    /// Of at least one diagnostic; sorted by place.
    pub(crate) fn new(mut all: Vec<Diagnostic>) -> Self {
        debug_assert!(!all.is_empty(), "an error needs a reason");
        all.sort_by_key(|d| (d.line, d.column));
        Self(all)
    }

    /// The same where there were more than are told.
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

/// Why a file could not be loaded.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// The file could not be read.
    #[error("{}: cannot be read", path.display())]
    Read {
        /// Which file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// It was read and is not legal.
    #[error(transparent)]
    Invalid(#[from] Diagnostics),
}
