//! The window's content: model, views and network put together.

use std::path::PathBuf;
use std::sync::Arc;

use eframe::egui::{self, Event, Key, Ui};

use crate::files;
use crate::model::Model;
use crate::net::{Delivery, Intent, Network, News, PanelOptions};
use crate::view::{self, Act, Desk, theme};

/// The longest pause between two frames: clocks and countdowns are never more than this behind.
const FRAME_AT_LEAST_EVERY: std::time::Duration = std::time::Duration::from_millis(250);

/// Everything that is drawn into a window, and what keeps it up to date.
///
/// It never waits: threads of its own talk to the server, and files are written by others.
pub struct Panel {
    model: Model,
    desk: Desk,
    network: Network,
    /// Reused from frame to frame.
    delivery: Delivery,
    /// Where exported samples go.
    out: PathBuf,
}

/// Where the panel finds and puts files.
#[derive(Clone, Debug)]
pub struct Folders {
    /// Scene files to choose from; saved ones go there too.
    pub scenes: PathBuf,
    /// Exported samples.
    pub out: PathBuf,
}

impl Panel {
    /// A panel for the window of `ctx`. It connects as soon as there is a server.
    ///
    /// # Errors
    /// The system gives no threads.
    pub fn new(ctx: &egui::Context, options: PanelOptions, folders: Folders) -> std::io::Result<Self> {
        theme::install(ctx);
        let model = Model::new(&options.server, options.samples_per_s);
        let desk = Desk::new(folders.scenes, &options.server);
        let waker = ctx.clone();
        let network = Network::start(options, Arc::new(move || waker.request_repaint()))?;
        Ok(Self { model, desk, network, delivery: Delivery::default(), out: folders.out })
    }

    /// Whether there is a server and it has sent a state.
    #[must_use]
    pub fn has_state(&self) -> bool {
        self.model.state.is_some()
    }

    /// Takes in what has come, without drawing: for a window that is hidden.
    pub fn catch_up(&mut self) {
        self.network.mailbox.take(&mut self.delivery);
        self.model.take(&mut self.delivery);
    }

    /// Draws a frame and obeys.
    pub fn ui(&mut self, ui: &mut Ui) {
        self.catch_up();
        let mut acts = Vec::new();
        if stop_keys(ui) {
            acts.push(Act::Ask(Intent::Stop));
        }
        view::show(ui, &self.model, &mut self.desk, &mut acts);
        for act in acts {
            self.obey(act);
        }
        ui.ctx().request_repaint_after(FRAME_AT_LEAST_EVERY);
    }

    fn obey(&mut self, act: Act) {
        match act {
            Act::Ask(intent) => self.ask(intent),
            Act::LoadFile(path) => match files::load(&path) {
                Ok(scene) => self.ask(Intent::Load { scene }),
                Err(error) => self.network.mailbox.post(News::Note(Err(format!("{error:#}")))),
            },
            Act::SaveScene(path) => {
                let saved = files::save(&path, &self.model.scene.to_json());
                let told = saved.map(|()| format!("saved as {}", path.display()));
                self.network.mailbox.post(News::Note(told.map_err(|error| format!("{error:#}"))));
            }
            Act::Export(samples) => {
                // Megabytes: not in the window's thread.
                let (mailbox, out) = (Arc::clone(&self.network.mailbox), self.out.clone());
                let export = move || {
                    let told = files::export(&out, &samples)
                        .map(|path| format!("{} samples in {}", samples.len(), path.display()));
                    mailbox.post(News::Note(told.map_err(|error| format!("{error:#}"))));
                };
                if let Err(error) = std::thread::Builder::new().name("hbot-export".to_owned()).spawn(export) {
                    self.network.mailbox.post(News::Note(Err(error.to_string())));
                }
            }
        }
    }

    fn ask(&mut self, intent: Intent) {
        self.model.asked(&intent);
        self.network.send(intent);
    }
}

/// Whether a key asks for a stop, anywhere in the window, whatever has the focus.
///
/// Space is taken away from the widgets: it must neither press the button that has the focus (Enter does) nor write a blank
/// in place of stopping. Esc is left to them, to close what is open.
fn stop_keys(ui: &Ui) -> bool {
    ui.input_mut(|input| {
        let pressed = |event: &Event, keys: &[Key]| {
            matches!(event, Event::Key { key, pressed: true, .. } if keys.contains(key))
        };
        let stop = input.events.iter().any(|event| pressed(event, &[Key::Escape, Key::Space]));
        input.events.retain(|event| {
            !matches!(event, Event::Key { key: Key::Space, .. }) && !matches!(event, Event::Text(text) if text == " ")
        });
        stop
    })
}
