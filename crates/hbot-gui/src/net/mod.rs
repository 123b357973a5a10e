//! The way to the server: threads that may wait, so that the window never does.
//!
//! ```text
//! window -- Intent --> Outgoing (bounded, newest value of a parameter) --> session thread -- requests --> server
//! window <-- News, samples -- Mailbox (bounded) <-- session thread <-- answers, events -- server
//! window -- stop --> stop line, a thread and a connection of its own -- estop --> server
//! ```
//!
//! A stop must not queue behind a scene that is being compiled, hence the second connection. Neither thread holds up the
//! other end: the session's drops samples that nobody takes, and the server drops those that nobody reads.

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

/// States a second that are asked for where nobody says otherwise: twice what a screen shows, and little work for both ends.
pub const DEFAULT_SAMPLES_PER_S: u32 = 120;

/// How long an answer may take. The server compiles a scene in far less.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(2);

/// Where the server is and how the panel meets it.
#[derive(Clone, Debug)]
pub struct PanelOptions {
    /// `HOST:PORT` or `HOST`.
    pub server: String,
    /// What the server asks for, where it does.
    pub token: Option<Token>,
    /// Whom to believe, where the server encrypts; `None` for plain TCP. It holds for every connection, to whichever server.
    pub trust: Option<Trust>,
    /// Never take the lease unasked.
    pub observe: bool,
    /// States of a second of the loop's time.
    pub samples_per_s: u32,
}

impl PanelOptions {
    /// A server at `server` without a token or encryption; the lease is taken where it is free.
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

/// What the person at the panel wants of the server.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Intent {
    /// Zero torque at once. Takes the stop line.
    Stop,
    Enable,
    Disable,
    Reset,
    Acquire {
        steal: bool,
    },
    Release,
    /// One parameter of an effect.
    Set {
        effect: String,
        key: String,
        value: Value,
    },
    Load {
        scene: Value,
    },
    /// Another server.
    Connect(String),
    /// States of a second of the loop's time.
    Samples(u32),
}

impl Intent {
    /// What it is called in messages.
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

/// Who commands.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) enum Lease {
    /// Nobody has said yet.
    #[default]
    Unknown,
    Free,
    Mine,
    /// Another client, by its name.
    Other(String),
}

/// What the threads have to tell.
#[derive(Clone, Debug)]
pub(crate) enum News {
    Connecting,
    Connected(HelloOk),
    Offline {
        why: String,
        /// Nobody listens at the address.
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
    /// An intent carried out, or why not.
    Answer {
        intent: Intent,
        result: Result<(), String>,
    },
    /// Something done on this machine: a file written, or why not.
    Note(Result<String, String>),
}

/// Wakes the window; called from the threads.
pub(crate) type Wake = Arc<dyn Fn() + Send + Sync>;

/// How long the window's end waits for the lease to be given back. A rig may be told to take the loss of its commander for a
/// fault; a window that is closed is none.
const FAREWELL: Duration = Duration::from_millis(500);

/// The window's end. Dropping it ends the threads.
pub(crate) struct Network {
    outgoing: Arc<Outgoing>,
    pub(crate) mailbox: Arc<Mailbox>,
    stop: stop_line::StopLine,
    /// Closed where the session has ended.
    ended: Receiver<()>,
}

impl Network {
    /// Starts the threads.
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

    /// Never waits.
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
        // A server that hangs does not keep the window open.
        let _ = self.ended.recv_timeout(FAREWELL);
    }
}
