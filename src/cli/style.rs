//! Colours, which anstream takes out where the output is not a terminal or NO_COLOR is set.

use anstyle::{AnsiColor, Reset, Style};

pub(crate) const GOOD: Style = AnsiColor::Green.on_default().bold();
pub(crate) const WARN: Style = AnsiColor::Yellow.on_default().bold();
pub(crate) const BAD: Style = AnsiColor::Red.on_default().bold();
pub(crate) const NAME: Style = Style::new().bold();
pub(crate) const DIM: Style = Style::new().dimmed();
pub(crate) const OFF: Reset = Reset;

/// The colour of a mode.
pub(crate) fn of_mode(mode: &str) -> Style {
    match mode {
        "active" | "enabling" => GOOD,
        "fault" | "estop" => BAD,
        _ => WARN,
    }
}
