//! The words of bash, which breaks a line at `=` and `:` as well as at spaces: `--scene=hinge` and
//! `127.0.0.1:4268` come in three words. clap_complete takes them for three arguments.

use std::ffi::OsString;
use std::io::{Result, Write};
use std::path::Path;

use clap::Command;
use clap_complete::engine::complete;
use clap_complete::env::{self, EnvCompleter};

/// clap_complete's bash, with whole words.
pub(super) struct Bash;

impl EnvCompleter for Bash {
    fn name(&self) -> &'static str {
        env::Bash.name()
    }

    fn is(&self, name: &str) -> bool {
        env::Bash.is(name)
    }

    fn write_registration(
        &self,
        variable: &str,
        name: &str,
        program: &str,
        completer: &str,
        out: &mut dyn Write,
    ) -> Result<()> {
        let mut script = Vec::new();
        env::Bash.write_registration(variable, name, program, completer, &mut script)?;
        // A break at the end of the line is a word that must stay.
        let last = "words[COMP_CWORD]=\"$2\"";
        let kept = format!("[[ ${{words[COMP_CWORD]}} == [=:] ]] || {last}");
        out.write_all(String::from_utf8_lossy(&script).replace(last, &kept).as_bytes())
    }

    fn write_complete(
        &self,
        command: &mut Command,
        words: Vec<OsString>,
        folder: Option<&Path>,
        out: &mut dyn Write,
    ) -> Result<()> {
        let variable = |name| std::env::var(name).unwrap_or_default();
        let at: usize = variable("_CLAP_COMPLETE_INDEX").parse().unwrap_or_default();
        let words = whole(words.into_iter().take(at + 1));
        let typed = words.last().map(|word| word.to_string_lossy().into_owned()).unwrap_or_default();
        // bash puts what it is told in place of what follows the last break.
        let kept = &typed[..typed.rfind(['=', ':']).map_or(0, |at| at + 1)];
        let last = words.len().saturating_sub(1);
        let offered: Vec<String> = complete(command, words, last, folder)?
            .iter()
            .map(|it| it.get_value().to_string_lossy().into_owned())
            .map(|value| value.strip_prefix(kept).map(str::to_owned).unwrap_or(value))
            .collect();
        write!(out, "{}", offered.join(&variable("_CLAP_IFS")))
    }
}

/// Returns the words of a line with those put together that bash has broken.
pub(super) fn whole(broken: impl Iterator<Item = OsString>) -> Vec<OsString> {
    let mut words: Vec<OsString> = Vec::new();
    let mut goes_on = false;
    for word in broken {
        let breaks = word == "=" || word == ":";
        match words.last_mut() {
            Some(last) if goes_on || breaks => last.push(&word),
            _ => words.push(word),
        }
        goes_on = breaks;
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_that_bash_has_broken_are_whole_again() {
        let whole = |line: &str| {
            let words = whole(line.split(' ').map(OsString::from));
            words.iter().map(|word| word.to_string_lossy().into_owned()).collect::<Vec<_>>().join(" ")
        };
        for (broken, line) in [
            ("hbot server --scene = hin", "hbot server --scene=hin"),
            ("hbot set --server 127.0.0.1 : 4268 spr", "hbot set --server 127.0.0.1:4268 spr"),
            ("hbot set spring stiffness = 2 da", "hbot set spring stiffness=2 da"),
            ("hbot replay ", "hbot replay "),
        ] {
            assert_eq!(whole(broken), line);
        }
    }
}
