//! Records a server into a file, over a connection of its own.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use anyhow::Context as _;
use hbot_api::{Client, Event};
use hbot_record::ClientRecording;

use super::mailbox::Mailbox;
use super::session::{connect, in_words};
use super::{News, PanelOptions};

/// Longest time for which states wait before they are in the file.
const FLUSH_EVERY: Duration = Duration::from_millis(500);
/// Longest time until the end is noticed if the server sends nothing.
const LISTEN: Duration = Duration::from_millis(100);
/// Time between two reports of the progress.
const TOLD_EVERY: Duration = Duration::from_millis(250);

/// How far a recording is.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Progress {
    pub(crate) path: PathBuf,
    pub(crate) since: Instant,
    pub(crate) states: u64,
    /// Number of states that the server has dropped, because they were not taken fast enough.
    pub(crate) lost: u64,
}

/// A recording of a server in progress. Dropping it ends the recording and completes the file.
#[derive(Debug)]
pub(crate) struct Recorder {
    end: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Recorder {
    /// Begins to record every tick of the server that `options` names into a new file. The mailbox
    /// gets the progress, and a note at the end.
    ///
    /// # Errors
    /// Fails if the operating system refuses a thread.
    pub(crate) fn start(
        options: PanelOptions,
        path: PathBuf,
        mailbox: Arc<Mailbox>,
    ) -> std::io::Result<Self> {
        let end = Arc::new(AtomicBool::new(false));
        let ended = Arc::clone(&end);
        let thread = std::thread::Builder::new().name("hbot-recorder".to_owned()).spawn(move || {
            let told = record(&options, &path, &mailbox, &ended);
            mailbox.post(News::Recording(None));
            mailbox.note(told);
        })?;
        Ok(Self { end, thread: Some(thread) })
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        self.end.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // A panic of that thread has been printed.
            let _ = thread.join();
        }
    }
}

/// Records until `end` is set or the server stops. Returns what to tell the user, an error if the
/// connection broke before. The file is complete in both cases.
fn record(
    options: &PanelOptions,
    path: &Path,
    mailbox: &Mailbox,
    end: &AtomicBool,
) -> anyhow::Result<String> {
    let name = || path.display().to_string();
    let mut client = connect(options).map_err(|error| anyhow::anyhow!(in_words(&error)))?;
    let info = client.info()?;
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).with_context(name)?;
    }
    let file = File::create_new(path).with_context(name)?;
    let mut recording =
        ClientRecording::new(BufWriter::new(file), &info, &client.hello().server).with_context(name)?;
    client.subscribe(1)?;
    let since = Instant::now();
    let progress = |recording: &ClientRecording<_>, client: &Client| Progress {
        path: path.to_owned(),
        since,
        states: recording.states(),
        lost: recording.dropped() + client.events_lost(),
    };
    mailbox.post(News::Recording(Some(progress(&recording, &client))));
    let (mut flushed, mut told, mut broken) = (since, since, None);
    while !end.load(Ordering::Relaxed) {
        match client.next_event(LISTEN) {
            Ok(Some(event)) => {
                recording.take(&event).with_context(name)?;
                if matches!(event, Event::Stopping(_)) {
                    break;
                }
            }
            Ok(None) => {}
            Err(error) => {
                broken = Some(in_words(&error));
                break;
            }
        }
        if flushed.elapsed() >= FLUSH_EVERY {
            recording.flush().with_context(name)?;
            flushed = Instant::now();
        }
        if told.elapsed() >= TOLD_EVERY {
            mailbox.post(News::Recording(Some(progress(&recording, &client))));
            told = Instant::now();
        }
    }
    // What the server has sent until now belongs to the recording too.
    if client.unsubscribe().is_ok() {
        while let Ok(Some(event)) = client.next_event(Duration::ZERO) {
            recording.take(&event).with_context(name)?;
        }
    }
    let Progress { states, lost, .. } = progress(&recording, &client);
    recording.finish().with_context(name)?;
    let told = format!("recorded {states} states, {lost} lost, in {}", path.display());
    match broken {
        None => Ok(told),
        Some(why) => anyhow::bail!("the recording has ended early, {why}: {told}"),
    }
}
