//! Live viewers: the public topics of a recording over WebSocket, for Foxglove, Lichtblick and
//! PlotJuggler.
//!
//! ```text
//! recorder's thread -> Feed -> bounded queue -> viewers' thread -> one task for each viewer
//! ```
//!
//! The first request, the upgrade and the check of Host and Origin are those of the web port.
//! Nothing can be commanded here: viewers choose topics, and everything else that they send is
//! ignored or ends their connection. A viewer that reads too slowly loses messages, which are
//! counted. It delays neither the loop, nor the service, nor other viewers.

mod protocol;
#[cfg(test)]
mod tests;
mod viewer;

use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

use hbot_api::{Event, StateEvent};
use hbot_record::Topic;
use hbot_record::public::Encoder;
use tokio::sync::{broadcast, watch};
use tokio::task::JoinSet;
use tokio::time::{sleep, timeout};

use crate::background;
use crate::not_built::NotBuilt;
use crate::recording::{Counts, SceneNote};
use crate::web::{AllowedHosts, WebOptions};

/// Number of messages that wait for the slowest viewer: four seconds at 1 kHz.
const QUEUE: usize = 16 * 1024;
/// Largest number of simultaneous viewers. Further ones wait in the operating system's queue.
const VIEWERS: usize = 8;
/// Pause before the next attempt after the operating system has failed to accept a connection.
const PAUSE: Duration = Duration::from_millis(200);
/// A viewer from which nothing comes for this time, not even answers to pings, is disconnected.
const SILENCE: Duration = Duration::from_secs(30);
/// Longest time for which the end of a run waits until all viewers have been notified.
const FAREWELL: Duration = Duration::from_millis(500);

/// A message of a public topic.
#[derive(Clone)]
struct Message {
    topic: Topic,
    /// Unix time of the message, ns.
    unix_ns: u64,
    /// The message in the format of protobuf.
    data: Arc<[u8]>,
}

/// What every connection needs.
struct Shared {
    /// The first two texts of the protocol.
    greeting: [String; 2],
    /// Does not keep the queue open, so that viewers notice when the run ends.
    messages: broadcast::WeakSender<Message>,
    /// The scene that is rendered now, which a viewer receives as soon as it subscribes.
    scene: watch::Receiver<Option<Message>>,
    counts: Arc<Counts>,
    /// Which names of this machine a browser may use.
    hosts: Arc<AllowedHosts>,
    /// Time after which a silent viewer is disconnected. It is sent three pings in this time.
    silence: Duration,
}

/// The recorder's half: it passes messages to the viewers and never waits for them. Viewers are
/// disconnected when this is dropped.
pub(crate) struct Feed {
    messages: broadcast::Sender<Message>,
    scene: watch::Sender<Option<Message>>,
    encoder: Encoder,
}

/// Succeeds, because this build has live viewers.
///
/// # Errors
/// Fails in a build without the feature `live`.
pub const fn built() -> Result<(), NotBuilt> {
    Ok(())
}

/// Starts the thread that serves viewers at `port`. `joints` are the names of the joints, in
/// the order steer, drive of each wheel. The thread ends after the feed has been dropped.
///
/// # Errors
/// Fails if the system refuses a thread or its resources.
pub(crate) fn start(
    port: WebOptions,
    rig: &str,
    joints: Vec<String>,
    counts: Arc<Counts>,
) -> std::io::Result<(Feed, JoinHandle<()>)> {
    start_with(port, rig, joints, counts, SILENCE)
}

/// Starts the thread as [`start`] does. A viewer that is silent for `silence` is disconnected.
fn start_with(
    port: WebOptions,
    rig: &str,
    joints: Vec<String>,
    counts: Arc<Counts>,
    silence: Duration,
) -> std::io::Result<(Feed, JoinHandle<()>)> {
    let (messages, _) = broadcast::channel(QUEUE);
    let (scene, present) = watch::channel(None);
    let greeting = [protocol::server_info(rig), protocol::advertise()];
    let WebOptions { listener, hosts } = port;
    let shared = Shared { greeting, messages: messages.downgrade(), scene: present, counts, hosts, silence };
    listener.set_nonblocking(true)?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let thread = std::thread::Builder::new().name("hbot-live".to_owned()).spawn(move || {
        background::give_way();
        runtime.block_on(async {
            match tokio::net::TcpListener::from_std(listener) {
                Ok(listener) => accept(listener, Arc::new(shared)).await,
                Err(error) => tracing::warn!(%error, "no live viewers are served"),
            }
        });
    })?;
    Ok((Feed { messages, scene, encoder: Encoder::new(joints) }, thread))
}

/// Serves viewers until the feed is dropped.
async fn accept(listener: tokio::net::TcpListener, shared: Arc<Shared>) {
    let mut viewers = JoinSet::new();
    let mut scene = shared.scene.clone();
    loop {
        tokio::select! {
            accepted = listener.accept(), if viewers.len() < VIEWERS => match accepted {
                Ok((stream, _)) => drop(viewers.spawn(viewer::serve(stream, Arc::clone(&shared)))),
                Err(_) => sleep(PAUSE).await,
            },
            Some(_) = viewers.join_next() => {}
            changed = scene.changed() => if changed.is_err() { break },
        }
    }
    // A viewer that does not read is not waited for.
    let _ = timeout(FAREWELL, async { while viewers.join_next().await.is_some() {} }).await;
}

impl Feed {
    /// Returns whether messages have a receiver.
    pub(crate) fn is_watched(&self) -> bool {
        self.messages.receiver_count() > 0
    }

    /// Passes on the state of a tick, whose deadline is at `unix_ns`.
    pub(crate) fn state(&mut self, state: &StateEvent, unix_ns: u64) {
        let Self { messages, encoder, .. } = self;
        let _ = encoder.state(state, unix_ns, |topic, data| {
            // Fails only if no viewer is connected.
            messages.send(Message { topic, unix_ns, data: data.into() }).map(drop)
        });
    }

    pub(crate) fn event(&mut self, event: &Event, unix_ns: u64) {
        let data = self.encoder.event(event, unix_ns).into();
        let _ = self.messages.send(Message { topic: Topic::Event, unix_ns, data });
    }

    /// Passes on that a scene is rendered from `tick` on.
    pub(crate) fn scene(&mut self, tick: u64, scene: &SceneNote, unix_ns: u64) {
        let data = self.encoder.scene(tick, &scene.name, &scene.json, unix_ns).into();
        let message = Message { topic: Topic::Scene, unix_ns, data };
        self.scene.send_replace(Some(message.clone()));
        let _ = self.messages.send(message);
    }
}
