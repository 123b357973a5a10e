//! Safe display of text from unknown clients in logs and terminals.

use std::fmt;

/// Returns whether a character is displayed as it is. False for control characters, escapes,
/// characters that change the direction of the text, invisible characters and ends of lines. The
/// names of clients consist of such plain characters.
///
/// The rules are those of the standard library, by the Unicode categories that `{:?}` escapes.
/// Combining marks are plain, because some scripts need them. Two fixed-width spaces that people
/// type are plain too.
#[must_use]
pub fn is_plain(c: char) -> bool {
    if matches!(c, '"' | '\'' | '\\' | '\u{a0}' | '\u{3000}') {
        return true;
    }
    // `escape_debug` escapes a combining mark only at the start of a string, so a letter precedes
    // `c`.
    let mut bytes = [b'a'; 5];
    let end = 1 + c.encode_utf8(&mut bytes[1..]).len();
    std::str::from_utf8(&bytes[..end]).is_ok_and(|text| text.escape_debug().nth(1) == Some(c))
}

/// Displays text from an unknown client safely. Characters that are not [plain](is_plain) are
/// escaped, such as `\u{202e}` or `\n`.
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
