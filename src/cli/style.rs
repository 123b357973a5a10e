//! Colours. anstream removes them if the output is not a terminal or NO_COLOR is set.

use anstyle::{AnsiColor, Reset, Style};

pub(crate) const GOOD: Style = AnsiColor::Green.on_default().bold();
pub(crate) const WARN: Style = AnsiColor::Yellow.on_default().bold();
pub(crate) const BAD: Style = AnsiColor::Red.on_default().bold();
pub(crate) const NAME: Style = Style::new().bold();
pub(crate) const DIM: Style = Style::new().dimmed();
pub(crate) const OFF: Reset = Reset;

/// Escape sequence that goes to the start of the terminal's line and clears it. The terminal then
/// cuts the following text at its right edge instead of wrapping it. For terminals only. It must be
/// written without anstream, which would remove it together with the colours.
pub(crate) const SAME_LINE: &str = "\r\x1b[2K\x1b[?7l";
/// Escape sequence that ends the effect of [`SAME_LINE`].
pub(crate) const LINE_END: &str = "\x1b[?7h";
/// Escape sequence that clears the terminal's line, so that something else can be written there.
pub(crate) const CLEAR_LINE: &str = "\r\x1b[2K";

/// Returns the colour of a mode, or of the fault that stands in its place.
pub(crate) fn of_mode(mode: &str) -> Style {
    match mode {
        "active" | "enabling" => GOOD,
        "idle" | "unreferenced" => NAME,
        _ => BAD,
    }
}
