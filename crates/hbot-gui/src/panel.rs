//! The content of the window: combines model, views and network.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};

use eframe::egui::{self, Event, Key, Ui};

use crate::files;
use crate::model::{Film, Judged, Model};
use crate::net::{Delivery, Intent, Network, News, PanelOptions, Recorder};
use crate::recorded::Recorded;
use crate::view::{self, Act, Desk, theme};

/// Longest time between two frames of the window. Clocks and countdowns in the window are late by
/// at most this time.
const FRAME_AT_LEAST_EVERY: std::time::Duration = std::time::Duration::from_millis(100);

/// The contents of a window, together with the threads that keep them up to date.
///
/// Drawing never waits for the server. Separate threads talk to the server and export samples.
pub struct Panel {
    model: Model,
    desk: Desk,
    network: Network,
    /// Buffer for everything that arrives from the server. It is reused from frame to frame.
    delivery: Delivery,
    /// Folder in which exported samples are saved.
    out: PathBuf,
    /// The settings of the connection, for a recording.
    options: PanelOptions,
    recorder: Option<Recorder>,
    /// Recordings that a thread has read, to be shown.
    opened: (Sender<Recorded>, Receiver<Recorded>),
    title: String,
}

/// The folders in which the panel reads and writes files.
#[derive(Clone, Debug)]
pub struct Folders {
    /// Folder with the scene files from which the user can choose. Saved scenes are written to it
    /// too.
    pub scenes: PathBuf,
    /// Folder in which exported samples are saved.
    pub out: PathBuf,
}

impl Panel {
    /// Creates a panel for the window of `ctx`. It connects as soon as the server is available.
    ///
    /// # Errors
    /// Fails if the operating system refuses a thread.
    pub fn new(ctx: &egui::Context, options: PanelOptions, folders: Folders) -> std::io::Result<Self> {
        theme::install(ctx);
        let mut model = Model::new(&options.server, &options.name, options.samples_per_s);
        model.observes = options.observe;
        let waker = ctx.clone();
        let judged = Judged::apart(move || waker.request_repaint());
        let out = folders.out.clone();
        let desk = Desk::new(folders, &options.server, judged);
        let waker = ctx.clone();
        let network = Network::start(options.clone(), Arc::new(move || waker.request_repaint()))?;
        Ok(Self {
            model,
            desk,
            network,
            delivery: Delivery::default(),
            out,
            options,
            recorder: None,
            opened: channel(),
            title: String::new(),
        })
    }

    /// Updates the panel with everything that has arrived from the server, without drawing. Use it
    /// while the window is hidden.
    pub fn catch_up(&mut self) {
        self.network.mailbox.take(&mut self.delivery);
        self.model.take(&mut self.delivery);
        if let Ok(recorded) = self.opened.1.try_recv() {
            self.desk.open(Film::new(Arc::new(recorded)));
        }
    }

    /// Draws one frame, and carries out what the user has asked for in it.
    pub fn ui(&mut self, ui: &mut Ui) {
        self.catch_up();
        let mut acts = Vec::new();
        if stop_keys(ui) {
            acts.push(Act::Ask(Intent::Stop));
        }
        self.retitle(ui.ctx());
        view::show(ui, &self.model, &mut self.desk, &mut acts);
        for act in acts {
            self.obey(act);
        }
        ui.ctx().request_repaint_after(FRAME_AT_LEAST_EVERY);
    }

    /// Sets the title of the window, if it has changed.
    fn retitle(&mut self, ctx: &egui::Context) {
        let title = match self.desk.film() {
            Some(film) => format!("RECORDING: {} - hbot panel", film.name()),
            None => self.model.title(),
        };
        if title != self.title {
            ctx.send_viewport_cmd(egui::ViewportCommand::Title(title.clone()));
            self.title = title;
        }
    }

    fn obey(&mut self, act: Act) {
        match act {
            Act::Ask(intent) => self.ask(intent),
            Act::LoadScene(source) => match files::load(&source) {
                Ok(scene) => self.ask(Intent::Load { scene }),
                Err(error) => self.network.mailbox.note(Err(error)),
            },
            Act::SaveScene(path) => {
                let saved = files::save(&path, &self.model.scene.to_json());
                self.network.mailbox.note(saved.map(|()| format!("saved as {}", path.display())));
            }
            Act::Export(samples) => {
                // An export writes megabytes, so it does not run in the window's thread.
                let (mailbox, out) = (Arc::clone(&self.network.mailbox), self.out.clone());
                self.apart("hbot-export", move || {
                    let told = |path: PathBuf| format!("{} samples in {}", samples.len(), path.display());
                    mailbox.note(files::export(&out, &samples).map(told));
                });
            }
            Act::Record(path) => {
                let options = PanelOptions { server: self.model.server.clone(), ..self.options.clone() };
                match Recorder::start(options, path, Arc::clone(&self.network.mailbox)) {
                    Ok(recorder) => self.recorder = Some(recorder),
                    Err(error) => self.network.mailbox.note(Err(error.into())),
                }
            }
            Act::Refuse(why) => self.network.mailbox.post(News::Note(Err(why))),
            Act::EndRecording => {
                // The end waits for the disk, so it does not run in the window's thread.
                let recorder = self.recorder.take();
                self.apart("hbot-recorder-end", move || drop(recorder));
            }
            Act::Open(path) => {
                let (mailbox, opened) = (Arc::clone(&self.network.mailbox), self.opened.0.clone());
                self.apart("hbot-open", move || match Recorded::read(&path) {
                    Ok(recorded) => {
                        // The window may have gone.
                        let _ = opened.send(recorded);
                        mailbox.note(Ok(format!("opened {}", path.display())));
                    }
                    Err(error) => mailbox.note(Err(error)),
                });
            }
        }
    }

    /// Runs `work` in a separate thread, because it can take long.
    fn apart(&self, name: &str, work: impl FnOnce() + Send + 'static) {
        if let Err(error) = std::thread::Builder::new().name(name.to_owned()).spawn(work) {
            self.network.mailbox.note(Err(error.into()));
        }
    }

    fn ask(&mut self, intent: Intent) {
        self.model.asked(&intent);
        self.network.send(intent);
    }
}

/// Returns whether the user has pressed a key that stops the rig. The keys work anywhere in the
/// window, whichever control has the focus.
///
/// Controls do not receive the space key, because it would press a focused button or type a blank.
/// They still receive Esc, with which they close menus.
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
