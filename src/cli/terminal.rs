//! The width of a terminal, and text that fits it.

use std::os::fd::AsFd;

use super::style;

/// Returns the width of the terminal that `output` writes to, columns. Returns `None` if it is no
/// terminal, or if the terminal does not tell its width.
pub(crate) fn columns(output: impl AsFd) -> Option<usize> {
    let size = rustix::termios::tcgetwinsize(output).ok()?;
    (size.ws_col > 0).then(|| usize::from(size.ws_col))
}

/// One piece of a text with colours.
enum Piece<'a> {
    /// A character that takes a column.
    Seen(char),
    /// An escape sequence, such as one that sets a colour.
    Code(&'a str),
}

/// Splits a text into visible characters and escape sequences of the form `ESC [ ... letter`.
fn pieces(text: &str) -> impl Iterator<Item = Piece<'_>> {
    let mut rest = text;
    std::iter::from_fn(move || {
        let first = rest.chars().next()?;
        let code = rest.strip_prefix("\x1b[").and_then(|tail| tail.find(|c: char| c.is_ascii_alphabetic()));
        let length = code.map_or(first.len_utf8(), |at| at + 3);
        let (piece, tail) = rest.split_at(length);
        rest = tail;
        Some(if code.is_some() { Piece::Code(piece) } else { Piece::Seen(first) })
    })
}

/// Returns how many columns a text takes. Every character counts as one column.
fn width(text: &str) -> usize {
    pieces(text).filter(|piece| matches!(piece, Piece::Seen(_))).count()
}

/// Cuts a line with colours so that it takes at most `columns` columns. A line that was cut ends in
/// an ellipsis.
pub(crate) fn cut(line: &str, columns: usize) -> String {
    if width(line) <= columns {
        return line.to_owned();
    }
    let mut kept = String::new();
    let mut left = columns.saturating_sub(1);
    for piece in pieces(line) {
        match piece {
            Piece::Code(code) => kept.push_str(code),
            Piece::Seen(_) if left == 0 => break,
            Piece::Seen(c) => {
                kept.push(c);
                left -= 1;
            }
        }
    }
    format!("{kept}{}…", style::OFF)
}

/// Breaks the lines of a text at spaces, so that each takes at most `columns` columns. A word that
/// is longer than a line stays whole. The continuation of a line such as `  label    words` stands
/// under its words, that of any other line is indented by two columns.
pub(crate) fn wrapped(text: &str, columns: usize) -> String {
    text.split('\n').map(|line| wrapped_line(line, columns)).collect::<Vec<_>>().join("\n")
}

fn wrapped_line(line: &str, columns: usize) -> String {
    if width(line) <= columns {
        return line.to_owned();
    }
    let hang = hang(line, columns);
    // The indentation and the label are not broken.
    let mut wrapped = String::new();
    let mut used = 0;
    for (i, word) in line.split(' ').enumerate() {
        let length = width(word);
        if i > 0 && used >= hang && used + 1 + length > columns && length > 0 {
            wrapped.truncate(wrapped.trim_end_matches(' ').len());
            wrapped.push('\n');
            wrapped.extend(std::iter::repeat_n(' ', hang));
            used = hang;
        } else if i > 0 {
            wrapped.push(' ');
            used += 1;
        }
        wrapped.push_str(word);
        used += length;
    }
    wrapped
}

/// Returns the column under which the continuation of a line stands.
fn hang(line: &str, columns: usize) -> usize {
    let seen: String =
        pieces(line).filter_map(|piece| if let Piece::Seen(c) = piece { Some(c) } else { None }).collect();
    let indent = seen.chars().take_while(|c| *c == ' ').count();
    let body: Vec<char> = seen.chars().skip(indent).collect();
    let gap = body.windows(2).position(|pair| pair == [' ', ' ']).filter(|_| indent > 0);
    let label = gap.map(|gap| gap + body[gap..].iter().take_while(|c| **c == ' ').count());
    // A deeply indented line continues a label above it.
    let hang = indent + label.unwrap_or(if indent > 4 { 0 } else { 2 });
    if hang > columns / 3 { indent + 2 } else { hang }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cut_line_fits_and_says_that_it_was_cut() {
        let line = format!("{}active{} and more", style::GOOD, style::OFF);
        assert_eq!(cut(&line, 15), line);
        let cut = cut(&line, 8);
        assert_eq!((width(&cut), anstream::adapter::strip_str(&cut).to_string().as_str()), (8, "active …"));
        assert!(cut.ends_with(&format!("{}…", style::OFF)), "the colour ends: {cut:?}");
    }

    #[test]
    fn a_long_line_breaks_between_words_under_its_words() {
        let line = format!("  {}note{}     the simulated rig has no motors", style::WARN, style::OFF);
        let lines = wrapped(&line, 33);
        let plain = anstream::adapter::strip_str(&lines).to_string();
        assert_eq!(plain, "  note     the simulated rig has\n           no motors");
        assert_eq!(wrapped("one two three", 8), "one two\n  three");
        assert_eq!(wrapped("  a_word_longer_than_the_line x", 10), "  a_word_longer_than_the_line\n    x");
        assert_eq!(wrapped("short\n  lines", 20), "short\n  lines");
    }
}
