//! Questions to a person at the terminal.

use std::io::{BufRead as _, IsTerminal as _, Write as _};

use anyhow::bail;

use super::out::{fitted, note};

/// Returns whether a person at a terminal can be asked.
pub(crate) fn somebody_is_there() -> bool {
    std::io::stdin().is_terminal() && std::io::stderr().is_terminal()
}

/// Says it if nobody is at a terminal, before questions that have options.
pub(crate) fn note_if_nobody_is_there() {
    if !somebody_is_there() {
        note!("there is no terminal, so nothing is asked: what no option gives has its default");
    }
}

/// Asks a person at the terminal. Returns `None` if there is none.
pub(crate) fn at_terminal(prompt: &str) -> anyhow::Result<Option<String>> {
    if !somebody_is_there() {
        return Ok(None);
    }
    let prompt = fitted(format_args!("{prompt}"), std::io::stderr());
    write!(anstream::stderr(), "{prompt}")?;
    std::io::stderr().flush()?;
    let mut line = String::new();
    if std::io::stdin().lock().read_line(&mut line)? == 0 {
        bail!("the input has ended: no file is written");
    }
    Ok(Some(line.trim().to_owned()))
}
