//! Tests of what the program says if it cannot open its window.

use std::process::Command;

#[test]
fn without_a_display_the_panel_says_so_in_one_line_and_how_to_go_on() {
    // No X server has so high a number.
    for (display, said) in [
        (":6400", "error: cannot open a window on DISPLAY=:6400: "),
        ("", "error: no display: neither DISPLAY nor WAYLAND_DISPLAY is set. "),
    ] {
        let mut panel = Command::new(env!("CARGO_BIN_EXE_hbot-gui"));
        panel.env("DISPLAY", display).env_remove("WAYLAND_DISPLAY").env_remove("WAYLAND_SOCKET");
        let done = panel.output().expect("the panel runs");
        let text = String::from_utf8_lossy(&done.stderr);
        assert_eq!(done.status.code(), Some(1), "{text}");
        assert!(text.starts_with(said) && text.lines().count() == 1, "{text}");
        assert!(text.contains("`ssh -X`") && text.contains("--server") && !text.contains(".rs"), "{text}");
    }
}
