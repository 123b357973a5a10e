//! The connection to the server: threads that can wait, so that the window never does.
//!
//! ```text
//! window -- Intent ---------> Outgoing (bounded) --> session thread --> server
//! window <-- News, samples -- Mailbox (bounded) <--- session thread <-- server
//! window -- stop -----------> stop line (separate thread and connection) --> server
//! ```
//!
//! `Outgoing` keeps only the newest value of each parameter. The stop has a second connection, so
//! that it does not queue behind a scene that is being compiled. No side can block another: the
//! session thread drops samples that the window does not take, and the server drops states that the
//! panel does not read.

mod mailbox;
mod session;
mod stop_line;

use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use hbot_api::{DroppedEvent, FaultEvent, HelloOk, InfoOk, LeaseCause, SceneEvent, StatsOk, Token, Trust};
use serde_json::Value;

use mailbox::Outgoing;
pub(crate) use mailbox::{Delivery, Mailbox};

/// Default number of states per second to request. This is twice the rate of a screen, and little
/// work for the server and the panel.
pub const DEFAULT_SAMPLES_PER_S: u32 = 120;

/// Time limit for an answer. The server compiles a scene in far less time.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(2);

/// The address of the server and the settings of the connection.
#[derive(Clone, Debug)]
pub struct PanelOptions {
    /// Address of the server, as `HOST:PORT` or `HOST`.
    pub server: String,
    /// The token that the server requires, if any.
    pub token: Option<Token>,
    /// The certificate to trust if the server encrypts. With `None` connections are plain TCP. It
    /// applies to all connections, whichever server they go to.
    pub trust: Option<Trust>,
    /// Whether the panel only watches and never takes the lease automatically.
    pub observe: bool,
    /// Number of states to request per second of the loop's time.
    pub samples_per_s: u32,
}

impl PanelOptions {
    /// Returns options for the server at `server`, without a token or encryption. The panel takes
    /// the lease if it is free.
    #[must_use]
    pub fn new(server: &str) -> Self {
        Self {
            server: server.to_owned(),
            token: None,
            trust: None,
            observe: false,
            samples_per_s: DEFAULT_SAMPLES_PER_S,
        }
    }
}

/// A request of the user to the server.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Intent {
    /// Zero torque at once. This goes over the stop line.
    Stop,
    Enable,
    Disable,
    Reset,
    Acquire {
        steal: bool,
    },
    Release,
    /// Changes one parameter of an effect.
    Set {
        effect: String,
        key: String,
        value: Value,
    },
    Load {
        scene: Value,
    },
    /// Connects to another server.
    Connect(String),
    /// Number of states to request per second of the loop's time.
    Samples(u32),
}

impl Intent {
    /// Returns the name of the intent in messages to the user.
    pub(crate) fn name(&self) -> String {
        match self {
            Self::Stop => "Stop".to_owned(),
            Self::Enable => "Enable".to_owned(),
            Self::Disable => "Disable".to_owned(),
            Self::Reset => "Reset".to_owned(),
            Self::Acquire { steal: false } => "Take command".to_owned(),
            Self::Acquire { steal: true } => "Take over".to_owned(),
            Self::Release => "Release".to_owned(),
            Self::Set { effect, key, .. } => format!("{effect}: {key}"),
            Self::Load { .. } => "Load scene".to_owned(),
            Self::Connect(address) => format!("Connect to {address}"),
            Self::Samples(n) => format!("{n} samples/s"),
        }
    }
}

/// Who holds the lease, as seen by the panel.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) enum Lease {
    /// The server has not reported it yet.
    #[default]
    Unknown,
    Free,
    Mine,
    /// Another client, with its name.
    Other(String),
}

/// A report from the network threads to the window.
#[derive(Clone, Debug)]
pub(crate) enum News {
    Connecting,
    Connected(HelloOk),
    Offline {
        why: String,
        /// The address refuses connections, so no server is running there.
        absent: bool,
        again_in: Duration,
    },
    Info(Box<InfoOk>),
    Stats(Box<StatsOk>),
    Lease {
        lease: Lease,
        cause: Option<LeaseCause>,
    },
    Fault(FaultEvent),
    Scene(SceneEvent),
    Dropped(DroppedEvent),
    Stopping(String),
    /// An intent that was carried out, or the reason why it was not.
    Answer {
        intent: Intent,
        result: Result<(), String>,
    },
    /// The result of work on this machine: a written file, or the reason why it was not written.
    Note(Result<String, String>),
}

/// Wakes the window. The network threads call it.
pub(crate) type Wake = Arc<dyn Fn() + Send + Sync>;

/// Time that closing the window waits for the lease to be released. A rig file can make the loss of
/// the lease holder a fault, but closing the window must not cause one.
const FAREWELL: Duration = Duration::from_millis(500);

/// The window's end of the network. Dropping it ends the threads.
pub(crate) struct Network {
    outgoing: Arc<Outgoing>,
    pub(crate) mailbox: Arc<Mailbox>,
    stop: stop_line::StopLine,
    /// Disconnected when the session thread has ended.
    ended: Receiver<()>,
}

impl Network {
    /// Starts the network threads.
    ///
    /// # Errors
    /// Fails if the operating system refuses a thread.
    pub(crate) fn start(options: PanelOptions, wake: Wake) -> std::io::Result<Self> {
        let mailbox = Arc::new(Mailbox::new(wake));
        let outgoing = Arc::new(Outgoing::default());
        let stop = stop_line::StopLine::start(&options, Arc::clone(&mailbox), Arc::clone(&outgoing))?;
        let (inside, post) = (Arc::clone(&outgoing), Arc::clone(&mailbox));
        let (running, ended) = channel();
        std::thread::Builder::new().name("hbot-session".to_owned()).spawn(move || {
            session::run(options, &inside, &post);
            drop(running);
        })?;
        Ok(Self { outgoing, mailbox, stop, ended })
    }

    /// Queues an intent without waiting. A stop goes over the stop line.
    pub(crate) fn send(&self, intent: Intent) {
        match intent {
            Intent::Stop => self.stop.request(),
            Intent::Connect(address) => {
                self.stop.connect(&address);
                self.outgoing.push(Intent::Connect(address));
            }
            intent => {
                if let Some(given_up) = self.outgoing.push(intent) {
                    let why = "given up: the server has not answered what was asked before".to_owned();
                    self.mailbox.post(News::Answer { intent: given_up, result: Err(why) });
                }
            }
        }
    }
}

impl Drop for Network {
    fn drop(&mut self) {
        self.outgoing.close();
        // A server that hangs must not keep the window open.
        let _ = self.ended.recv_timeout(FAREWELL);
    }
}
