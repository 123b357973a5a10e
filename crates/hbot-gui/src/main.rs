//! `hbot-gui`: the panel in a window.

use std::io::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use anyhow::{Context as _, anyhow, bail};
use clap::builder::{PathBufValueParser, TypedValueParser as _};
use clap::{CommandFactory as _, Parser, ValueEnum};
use eframe::egui;
use hbot_api::Trust;
use hbot_gui::{DEFAULT_SAMPLES_PER_S, Folders, Panel, PanelOptions, Picture};

/// The address of the server if none is given.
const SERVER: &str = "127.0.0.1:4268";

/// Returns the address that a text names. An empty variable is as if it was not set.
fn server_or_default(text: &str) -> Result<String, std::convert::Infallible> {
    Ok(if text.is_empty() { SERVER } else { text }.to_owned())
}

/// The panel of an Hbot: shows the sphere, sets its stiffness, stops it
#[derive(Debug, Parser)]
#[command(name = "hbot-gui", version)]
struct Args {
    /// Address of the server
    #[arg(long, value_name = "HOST[:PORT]", env = "HBOT_SERVER", default_value = SERVER, value_parser = server_or_default)]
    server: String,
    /// File with the token that the server requires
    #[arg(long, value_name = "FILE", env = "HBOT_TOKEN_FILE")]
    token_file: Option<PathBuf>,
    /// File with the certificate of an encrypting server, or of the authority that signed it (PEM)
    #[arg(long, value_name = "FILE")]
    ca: Option<PathBuf>,
    /// Only watch: do not take command automatically
    #[arg(long)]
    observe: bool,
    /// Folder with your scene files, which are listed after the ready-made ones
    #[arg(long, value_name = "DIR", default_value = "scenes")]
    scenes: PathBuf,
    /// Folder for exported samples
    #[arg(long, value_name = "DIR", default_value = ".")]
    out: PathBuf,
    /// States per second to request, 1 to 100000
    #[arg(long, value_name = "N", default_value_t = DEFAULT_SAMPLES_PER_S, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    samples: u32,
    /// Colours of the window
    #[arg(long, value_enum, default_value_t = Theme::System)]
    theme: Theme,
    /// Size of the window, points, 900x600 to 10000x10000
    #[arg(long, value_name = "WIDTHxHEIGHT", default_value = "1280x760", value_parser = size)]
    size: [f32; 2],
    /// Save a picture of the window as a PNG file, then exit
    #[arg(long, value_name = "FILE", value_parser = PathBufValueParser::new().try_map(png))]
    picture: Option<PathBuf>,
    /// Time from the first frame until the picture is taken, 0 to 3600 s
    #[arg(long, value_name = "SECONDS", default_value_t = 5, requires = "picture", value_parser = clap::value_parser!(u64).range(0..=3600))]
    picture_after: u64,
    /// Print a script that completes options in a shell
    #[arg(long, value_name = "SHELL", hide = true)]
    completions: Option<clap_complete::Shell>,
    /// Print the man page
    #[arg(long, hide = true, conflicts_with = "completions")]
    man: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Theme {
    /// The setting of the desktop
    System,
    /// Dark background
    Dark,
    /// Light background
    Light,
}

/// The smallest window size for which the panel is designed, points.
const LEAST: [f32; 2] = [900.0, 600.0];

fn size(text: &str) -> Result<[f32; 2], String> {
    let parts = text.split_once('x').and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    parts
        .filter(|[w, h]: &[f32; 2]| (LEAST[0]..=10_000.0).contains(w) && (LEAST[1]..=10_000.0).contains(h))
        .ok_or_else(|| "WIDTHxHEIGHT from 900x600 to 10000x10000".to_owned())
}

fn png(path: PathBuf) -> Result<PathBuf, String> {
    if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("png")) {
        Ok(path)
    } else {
        Err("the picture is a PNG file, so its name must end in .png".to_owned())
    }
}

/// What helps if there is no display on which the window can open.
const WITHOUT_DISPLAY: &str = "Start the panel on a desktop. Over ssh, use `ssh -X`, or start the panel on the computer where you \
     sit, with --server. Without a window, `hbot watch` shows the state in a terminal";

/// Returns the display on which the window opens, as the environment variable that names it.
/// Wayland comes first, as in the library that opens the window.
fn display() -> Option<String> {
    ["WAYLAND_DISPLAY", "WAYLAND_SOCKET", "DISPLAY"].into_iter().find_map(|name| {
        let value = std::env::var_os(name).filter(|value| !value.is_empty())?;
        Some(format!("{name}={}", value.to_string_lossy()))
    })
}

fn no_window(error: &eframe::Error) -> anyhow::Error {
    let text = match error {
        eframe::Error::WinitEventLoop(error) => error.to_string(),
        _ => String::new(),
    };
    // An error of the system begins with a line of the library's own source text.
    let why = text.strip_prefix("os error at ").and_then(|rest| rest.split_once(": "));
    match (why, display()) {
        (Some((_, why)), Some(display)) => {
            anyhow!("cannot open a window on {display}: {why}. {WITHOUT_DISPLAY}")
        }
        _ => anyhow!("no window: {error}"),
    }
}

/// The window with the panel, as an application of the library eframe.
struct App {
    panel: Panel,
    picture: Option<Picture>,
    /// Receives the error if the picture of the window could not be saved.
    failed: std::sync::mpsc::Sender<anyhow::Error>,
}

impl eframe::App for App {
    fn logic(&mut self, _: &egui::Context, _: &mut eframe::Frame) {
        self.panel.catch_up();
    }

    fn ui(&mut self, ui: &mut egui::Ui, _: &mut eframe::Frame) {
        limit_zoom(ui.ctx());
        self.panel.ui(ui);
        if let Some(done) = self.picture.as_mut().and_then(|picture| picture.frame(ui.ctx())) {
            self.picture = None;
            if let Err(error) = done {
                // The receiver lives until the window is closed, so this does not fail.
                let _ = self.failed.send(error);
            }
            ui.ctx().send_viewport_cmd(egui::ViewportCommand::Close);
        }
    }
}

/// Keeps the zoom (Ctrl and +) so small that all of the panel has room in the window.
fn limit_zoom(ctx: &egui::Context) {
    let zoom = ctx.zoom_factor();
    let size = ctx.content_rect().size() * zoom;
    let most = (size.x / LEAST[0]).min(size.y / LEAST[1]).max(1.0);
    if zoom > most + 0.01 {
        ctx.set_zoom_factor(most);
    }
}

fn main() -> ExitCode {
    let args = Args::parse();
    let done = match args.completions {
        Some(shell) => print_completions(shell),
        None if args.man => print_man_page(),
        None => run(args),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn print_completions(shell: clap_complete::Shell) -> anyhow::Result<()> {
    // It is written to memory first, because `generate` panics if it cannot write.
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Args::command(), "hbot-gui", &mut script);
    Ok(std::io::stdout().write_all(&script)?)
}

fn print_man_page() -> anyhow::Result<()> {
    Ok(clap_mangen::Man::new(Args::command()).render(&mut std::io::stdout())?)
}

fn run(args: Args) -> anyhow::Result<()> {
    let trust = args.ca.as_deref().map(Trust::from_file).transpose().context("--ca")?;
    if cfg!(target_os = "linux") && display().is_none() {
        bail!("no display: neither DISPLAY nor WAYLAND_DISPLAY is set. {WITHOUT_DISPLAY}");
    }
    let token = match &args.token_file {
        Some(file) => {
            let text =
                std::fs::read_to_string(file).with_context(|| format!("token file {}", file.display()))?;
            Some(text.trim().to_owned().into())
        }
        None => None,
    };
    let options = PanelOptions {
        token,
        trust,
        observe: args.observe,
        samples_per_s: args.samples,
        ..PanelOptions::new(&args.server)
    };
    let folders = Folders { scenes: args.scenes, out: args.out };
    let picture = args.picture.map(|path| Picture::new(path, Duration::from_secs(args.picture_after)));
    let viewport = egui::ViewportBuilder::default()
        .with_title("hbot panel")
        .with_app_id("hbot-gui")
        .with_inner_size(args.size)
        .with_min_inner_size(LEAST);
    let native = eframe::NativeOptions { viewport, ..Default::default() };
    let (failed, why) = std::sync::mpsc::channel();
    eframe::run_native(
        "hbot-gui",
        native,
        Box::new(move |context| {
            context.egui_ctx.set_theme(match args.theme {
                Theme::System => egui::ThemePreference::System,
                Theme::Dark => egui::ThemePreference::Dark,
                Theme::Light => egui::ThemePreference::Light,
            });
            let panel = Panel::new(&context.egui_ctx, options, folders)?;
            Ok(Box::new(App { panel, picture, failed }))
        }),
    )
    .map_err(|error| no_window(&error))?;
    why.try_recv().map_or(Ok(()), Err)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_is_a_png_file() {
        let parsed = |name| Args::try_parse_from(["hbot-gui", "--picture", name]);
        for name in ["x.png", "folder/X.PNG"] {
            assert_eq!(parsed(name).expect(name).picture, Some(PathBuf::from(name)));
        }
        for name in ["x.jpg", "x", ".png"] {
            let error = parsed(name).expect_err(name).to_string();
            assert!(error.contains("the picture is a PNG file, so its name must end in .png"), "{error}");
        }
    }

    #[test]
    fn server_and_token_come_from_the_variables_that_commands_read() {
        let command = Args::command();
        for (option, variable) in [("server", "HBOT_SERVER"), ("token_file", "HBOT_TOKEN_FILE")] {
            let argument = command.get_arguments().find(|argument| argument.get_id() == option);
            assert_eq!(argument.expect(option).get_env(), Some(variable.as_ref()), "{option}");
        }
        // As for commands, an empty variable counts as none.
        assert_eq!(Args::try_parse_from(["hbot-gui", "--server", ""]).unwrap().server, SERVER);
    }
}
