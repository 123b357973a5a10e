//! A virtual display (Xvfb) on which tests open the panel's window, and the pictures that the
//! window takes of itself. The pictures stay in the build folder, so that people can look at them.

use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use hbot_testing::patience::until;

/// A virtual screen on which tests open the panel's window, provided by the program Xvfb.
pub(crate) struct Display {
    name: String,
    _server: Running,
}

impl Display {
    /// Presses the mouse button at a place of the screen. Windows stand in its upper left corner.
    pub(crate) fn click(&self, [x, y]: [u32; 2]) {
        // A window that has opened below a pointer at rest does not know where the pointer is.
        let (x, y, above) = (x.to_string(), y.to_string(), (y - 1).to_string());
        let pressed = self.xdotool(&["mousemove", &x, &above, "mousemove", &x, &y, "click", "1"]);
        assert!(pressed, "xdotool cannot press the mouse button");
    }

    pub(crate) fn has_window(&self, title: &str) -> bool {
        self.xdotool(&["search", "--name", &format!("^{title}")])
    }

    fn xdotool(&self, args: &[&str]) -> bool {
        let mut xdotool = Command::new("xdotool");
        let status = xdotool.args(args).env("DISPLAY", &self.name).stdout(Stdio::null()).status();
        status.expect("xdotool is needed for these tests (apt-get install xdotool)").success()
    }
}

/// A child process that is killed when this value is dropped, so that no process outlives its test.
struct Running(Child);

impl Display {
    /// Starts Xvfb, which provides a virtual screen. Returns `None` on a computer without Xvfb. In
    /// CI its absence is an error.
    pub(crate) fn start() -> Option<Self> {
        let mut command = Command::new("Xvfb");
        command.args(["-displayfd", "1", "-screen", "0", "1400x900x24", "-nolisten", "tcp"]);
        let mut server = match command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn() {
            Ok(server) => server,
            Err(error) => {
                assert!(
                    std::env::var_os("CI").is_none(),
                    "Xvfb is needed here (apt-get install xvfb): {error}"
                );
                println!("no Xvfb on this machine ({error}): the real window is not tested here");
                return None;
            }
        };
        let mut number = String::new();
        let out = server.stdout.take().expect("piped");
        BufReader::new(out).read_line(&mut number).expect("Xvfb names its display");
        Some(Self { name: format!(":{}", number.trim()), _server: Running(server) })
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // Xvfb may have ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A window of the panel that will take a picture of itself.
pub(crate) struct Shot {
    name: String,
    size: [u32; 2],
    path: PathBuf,
    panel: Running,
}

impl Shot {
    /// Starts the panel with the given arguments. It will take its picture after `seconds`.
    pub(crate) fn start(display: &Display, name: &str, args: &[&str], size: [u32; 2], seconds: u32) -> Self {
        let path = folder().join(format!("{name}.png"));
        // Remove the picture of an earlier run, so that it is not mistaken for this one.
        let _ = std::fs::remove_file(&path);
        let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
        let panel = Command::new(env!("CARGO_BIN_EXE_hbot-gui"))
            .args(args)
            .arg(format!("--picture-after={seconds}"))
            .arg(format!("--size={}x{}", size[0], size[1]))
            .arg("--picture")
            .arg(&path)
            .arg("--scenes")
            .arg(scenes)
            .env("DISPLAY", &display.name)
            .env("LIBGL_ALWAYS_SOFTWARE", "1")
            .env_remove("WAYLAND_DISPLAY")
            .spawn();
        Self { name: name.to_owned(), size, path, panel: Running(panel.expect("the panel runs")) }
    }

    pub(crate) fn pixels(mut self, mut meanwhile: impl FnMut()) -> Vec<u8> {
        let Self { name, size, path, panel } = &mut self;
        let mut called = Instant::now();
        let status = until(&format!("the picture {name}"), || {
            if called.elapsed() > Duration::from_millis(200) {
                meanwhile();
                called = Instant::now();
            }
            panel.0.try_wait().expect("a child")
        });
        assert!(status.success(), "{name}: {status}");
        println!("{}", path.display());
        let decoder = png::Decoder::new(BufReader::new(std::fs::File::open(&*path).expect("a picture")));
        let mut reader = decoder.read_info().expect("PNG");
        let mut pixels = vec![0; reader.output_buffer_size().expect("a size")];
        let info = reader.next_frame(&mut pixels).expect("PNG");
        assert_eq!([info.width, info.height], *size, "{name}");
        assert!(
            std::fs::metadata(&*path).expect("a file").len() < 300_000,
            "{name} is too large for a README"
        );
        pixels
    }
}

pub(crate) fn folder() -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("panel");
    std::fs::create_dir_all(&folder).expect("a folder");
    folder
}
