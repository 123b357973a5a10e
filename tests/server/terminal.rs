//! What a terminal of 80 columns and 24 lines shows: no line is wider than it, and no word is
//! broken.

use std::fs::File;
use std::io::Read as _;
use std::os::fd::OwnedFd;
use std::process::{Child, Command};

use rustix::fs::{Mode, OFlags};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{Winsize, tcsetwinsize, ttyname};

use crate::process::*;

const COLUMNS: u16 = 80;

/// A terminal, whose user reads.
struct Terminal {
    near: File,
    far: OwnedFd,
}

impl Terminal {
    fn open() -> Self {
        let near =
            openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).expect("a terminal");
        grantpt(&near).expect("granted");
        unlockpt(&near).expect("unlocked");
        let path = ptsname(&near, Vec::new()).expect("a name");
        let far = rustix::fs::open(path, OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty());
        let far = far.expect("the other end");
        let size = Winsize { ws_row: 24, ws_col: COLUMNS, ws_xpixel: 0, ws_ypixel: 0 };
        tcsetwinsize(&far, size).expect("a size");
        Self { near: near.into(), far }
    }

    fn run(&self, command: &mut Command) -> Child {
        let end = || self.far.try_clone().expect("a descriptor");
        command.stdin(end()).stdout(end()).stderr(end()).spawn().expect("it runs")
    }

    /// Reads what the terminal gets until it contains `words`.
    fn read_until(&mut self, words: &str) -> String {
        let (mut all, mut buffer) = (Vec::new(), [0; 4096]);
        loop {
            let n = self.near.read(&mut buffer).expect("readable");
            all.extend_from_slice(&buffer[..n]);
            let text = String::from_utf8_lossy(&all);
            if text.contains(words) {
                return text.into_owned();
            }
            assert!(all.len() < 1 << 20, "never {words:?}: {text}");
        }
    }
}

/// Returns the lines that have stood on the terminal, also those that others have replaced.
fn lines(text: &str) -> Vec<String> {
    let text = text.replace("\u{1b}[2K", "\n").replace("\u{1b}[?7l", "").replace("\u{1b}[?7h", "");
    let plain = anstream::adapter::strip_str(&text).to_string();
    plain.split(['\n', '\r']).map(str::to_owned).collect()
}

fn assert_fit(text: &str) {
    for line in lines(text) {
        // A path that is longer than a line stays whole.
        let fits = line.chars().count() <= usize::from(COLUMNS) || !line.trim().contains(' ');
        assert!(fits, "too wide: {line:?} in:\n{text}");
    }
}

#[test]
fn the_server_s_banner_and_status_line_end_at_80_columns() {
    let state = tempfile::tempdir().expect("a folder");
    let mut terminal = Terminal::open();
    let mut command = hbot();
    command.args(["server", "--listen", "127.0.0.1:0", "--rig", &patient_rig(state.path())]);
    let _server = Killed(terminal.run(command.env("XDG_STATE_HOME", state.path())));
    let start = terminal.read_until("0 clients");
    assert_fit(&start);
    let shown = lines(&start);
    assert!(shown.iter().any(|line| line.contains("orientation takes")), "{start}");
    let status = shown.iter().find(|line| line.contains(" late ")).expect("a status line");
    assert!(status.ends_with("  0 clients"), "{status:?}");
    let address = shown.iter().find(|line| line.contains("listen")).expect("an address");
    let address = address.split_whitespace().last().expect("an address").to_owned();
    // A holder with a long name is cut at the edge, and the line keeps its beginning.
    let mut client = JsonLines::connect(&address);
    client.ask(&format!(r#"{{"id": 1, "op": "hello", "version": 1, "name": "{}"}}"#, "x".repeat(60)));
    client.ask(r#"{"id": 2, "op": "acquire"}"#);
    let held = terminal.read_until("…");
    assert_fit(&held);
    // How much of the name there is depends on the digits of late and lost ticks.
    assert!(held.contains("1 client, held by x"), "{held}");
}

#[test]
fn watch_shows_the_three_torques_in_80_columns() {
    let server = Process::patient(&[]);
    let mut terminal = Terminal::open();
    let watch = Killed(terminal.run(hbot().args(["watch", "--server", &server.address])));
    let shown = terminal.read_until("active");
    let shown = shown + &terminal.read_until("[?7h");
    assert_fit(&shown);
    let lines = lines(&shown);
    assert!(lines.iter().any(|line| line.contains("torque N m n1 n2 n3")), "{shown}");
    let row = lines.iter().find(|line| line.contains("active")).expect("a row");
    let numbers = row.split_whitespace().filter(|word| word.parse::<f64>().is_ok()).count();
    assert_eq!(numbers, 9, "t, angle, three torques, their length, rate, scale, lateness: {row:?}");
    // Ctrl-C ends it with what README asks for.
    kill_process(Pid::from_child(&watch.0), Signal::INT).expect("it is there");
    let ended = terminal.read_until(" N m\r\n");
    assert!(ended.contains("the largest length in "), "{ended}");
    assert_fit(&ended);
}

#[test]
fn a_turn_of_the_hand_shows_how_far_it_is() {
    let server = Process::patient(&[]);
    let mut terminal = Terminal::open();
    let turn = ["hand", "turn", "n2", "20deg", "--over", "60s", "--server", &server.address];
    let _turn = Killed(terminal.run(hbot().args(turn)));
    assert_fit(&terminal.read_until(" s of 60 s; Ctrl-C ends"));
}

#[test]
fn info_and_the_answer_to_a_stop_break_between_words() {
    let server = Process::patient(&[]);
    for (command, end) in [("estop", "hbot enable`"), ("info", "spring       spring")] {
        let mut terminal = Terminal::open();
        let _run = Killed(terminal.run(hbot().arg(command).env("HBOT_SERVER", &server.address)));
        assert_fit(&terminal.read_until(end));
    }
}

/// Runs a command to its end. Returns what the terminal shows.
fn shown_by(terminal: &mut Terminal, program: &[&str]) -> String {
    let mut shell = Command::new("sh");
    let _ended = Killed(terminal.run(shell.args(["-c", "\"$0\" \"$@\"; echo THE END"]).args(program)));
    terminal.read_until("THE END")
}

/// To change the settings of the terminal in which a command runs would leave the shell unusable,
/// and stop a command that runs in the background.
#[test]
fn a_scan_of_the_terminal_in_which_it_runs_is_refused() {
    let mut terminal = Terminal::open();
    let port = ttyname(&terminal.far, Vec::new()).expect("a name").into_string().expect("UTF-8");
    // Only the terminal of a session is meant, so the command begins one.
    let program = hbot().get_program().to_str().expect("UTF-8").to_owned();
    let scan = ["setsid", "--ctty", "--wait", &program, "rig", "scan", "--port", &port];
    let said = shown_by(&mut terminal, &scan);
    assert!(said.contains("it is the terminal of this command"), "{said}");
}

#[test]
fn lists_end_at_80_columns() {
    let program = hbot().get_program().to_str().expect("UTF-8").to_owned();
    for words in ["scene list", "scene kinds", "scene kinds spring", "rig test --joint 1 --torque auto"] {
        let words: Vec<&str> = [program.as_str()].into_iter().chain(words.split(' ')).collect();
        let said = shown_by(&mut Terminal::open(), &words);
        assert!(said.lines().count() > 5, "{said}");
        assert_fit(&said);
    }
}
