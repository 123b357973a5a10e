//! Colours, which anstream takes out where the output is not a terminal or NO_COLOR is set.

use anstyle::{AnsiColor, Reset, Style};

pub(crate) const GOOD: Style = AnsiColor::Green.on_default().bold();
pub(crate) const WARN: Style = AnsiColor::Yellow.on_default().bold();
pub(crate) const BAD: Style = AnsiColor::Red.on_default().bold();
pub(crate) const NAME: Style = Style::new().bold();
pub(crate) const DIM: Style = Style::new().dimmed();
pub(crate) const OFF: Reset = Reset;

/// Goes to the start of the terminal's line, empties it, and has what follows cut at the right edge instead of wrapped. For a
/// terminal only; written past anstream, which would take it out with the colours.
pub(crate) const SAME_LINE: &str = "\r\x1b[2K\x1b[?7l";
/// Ends what [`SAME_LINE`] began.
pub(crate) const LINE_END: &str = "\x1b[?7h";
/// Empties the terminal's line for something else.
pub(crate) const CLEAR_LINE: &str = "\r\x1b[2K";

/// The colour of a mode.
pub(crate) fn of_mode(mode: &str) -> Style {
    match mode {
        "active" | "enabling" => GOOD,
        "fault" | "estop" => BAD,
        _ => WARN,
    }
}
