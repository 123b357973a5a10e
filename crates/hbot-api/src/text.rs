//! Text of strangers in logs and terminals.

use std::fmt;

/// Whether a character shows as what it is: no control character, no escape, none that turns the direction of the text around it,
/// is invisible, or ends a line. Names of clients consist of such characters.
///
/// The standard library decides, by the Unicode categories that `{:?}` escapes. Marks that combine with the letter before them
/// are plain, since some scripts need them, and so are the two spaces of fixed width that people type.
#[must_use]
pub fn is_plain(c: char) -> bool {
    if matches!(c, '"' | '\'' | '\\' | '\u{a0}' | '\u{3000}') {
        return true;
    }
    // Behind a letter, so that a mark which combines is not taken for one that stands alone.
    let mut bytes = [b'a'; 5];
    let end = 1 + c.encode_utf8(&mut bytes[1..]).len();
    std::str::from_utf8(&bytes[..end]).is_ok_and(|text| text.escape_debug().nth(1) == Some(c))
}

/// Shows text of a stranger: characters that are not [plain](is_plain) as `\u{202e}` or `\n`.
///
/// ```
/// assert_eq!(hbot_api::Plain("a\u{1b}[2J\u{202e}b\n").to_string(), "a\\u{1b}[2J\\u{202e}b\\n");
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Plain<'a>(pub &'a str);

impl fmt::Display for Plain<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for c in self.0.chars() {
            if is_plain(c) {
                fmt::Write::write_char(f, c)?;
            } else {
                write!(f, "{}", c.escape_debug())?;
            }
        }
        Ok(())
    }
}
