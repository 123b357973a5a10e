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
mod recorder;
mod session;
mod stop_line;

use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

use hbot_api::{
    ControllerInfo, DroppedEvent, FaultEvent, HelloOk, InfoOk, LeaseCause, Requester, SceneEvent, SetEvent,
    ShakingEvent, StatsOk, Token, Trust, client_name,
};
use serde_json::Value;

use mailbox::Outgoing;
pub(crate) use mailbox::{Delivery, Mailbox};
pub(crate) use recorder::{Progress, Recorder};
use stop_line::Order;

/// Default number of state messages per second that the panel requests. This is twice the rate of a
/// screen, and causes little work for the server and the panel.
pub const DEFAULT_SAMPLES_PER_S: u32 = 120;

/// Longest time that the panel waits for an answer. The server needs far less time, even to compile
/// a scene.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(2);

/// The address of the server and the settings of the connection.
#[derive(Clone, Debug)]
pub struct PanelOptions {
    /// Address of the server, in the form `HOST:PORT` or `HOST`.
    pub server: String,
    /// The token that the server requires, if any.
    pub token: Option<Token>,
    /// The certificate to trust if the server encrypts. `None` for TCP without encryption. It is
    /// used for every server to which the panel connects.
    pub trust: Option<Trust>,
    /// Whether the panel only watches. It then never takes the lease (the right to command)
    /// automatically.
    pub observe: bool,
    /// Number of state messages that the panel requests per second of the control loop's time.
    pub samples_per_s: u32,
    /// Name under which other clients see the panel.
    pub name: String,
}

impl PanelOptions {
    /// Creates options for the server at the address `server`, without a token or encryption. With
    /// these options the panel takes the lease (the right to command) if it is free. Its name is
    /// `panel USER@HOST`.
    #[must_use]
    pub fn new(server: &str) -> Self {
        Self {
            server: server.to_owned(),
            token: None,
            trust: None,
            observe: false,
            samples_per_s: DEFAULT_SAMPLES_PER_S,
            name: client_name("panel"),
        }
    }
}

/// A request of the user, usually to be sent to the server.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Intent {
    /// Sets the torque to zero at once. It is sent over a separate connection, the stop line.
    Stop,
    Enable,
    Disable,
    Reset,
    /// Leaves a fault or a stop, and begins to render.
    Recover,
    Acquire {
        steal: bool,
    },
    Release,
    /// Changes the value of one parameter of an effect.
    Set {
        effect: String,
        key: String,
        value: Value,
    },
    Load {
        scene: Value,
    },
    /// Moves the hand of the simulated rig to an orientation `[w, x, y, z]`. `None`: it lets go.
    Hand(Option<[f64; 4]>),
    /// Connects to the server at another address.
    Connect(String),
    /// Changes how many state messages the panel requests per second of the control loop's time.
    Samples(u32),
}

impl Intent {
    /// Returns a short name of the request for messages to the user.
    pub(crate) fn name(&self) -> String {
        match self {
            Self::Stop => "Stop".to_owned(),
            Self::Enable => "Enable".to_owned(),
            Self::Disable => "Disable".to_owned(),
            Self::Reset => "Reset".to_owned(),
            Self::Recover => "Recover".to_owned(),
            Self::Acquire { steal: false } => "Take command".to_owned(),
            Self::Acquire { steal: true } => "Take over".to_owned(),
            Self::Release => "Release".to_owned(),
            Self::Set { effect, key, .. } => format!("{effect}: {key}"),
            Self::Load { .. } => "Load scene".to_owned(),
            Self::Hand(_) => "Hand".to_owned(),
            Self::Connect(address) => format!("Connect to {address}"),
            Self::Samples(n) => format!("{n} samples/s"),
        }
    }
}

/// Which client holds the lease, which is the right to command.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) enum Lease {
    /// The server has not reported the holder yet.
    #[default]
    Unknown,
    Free,
    Mine,
    /// Another client holds the lease. Its number is not known from a refused request.
    Other(Requester),
}

/// A report from the network threads to the window, such as a lost connection.
#[derive(Clone, Debug)]
pub(crate) enum News {
    Connecting,
    Connected(HelloOk),
    /// The connection for stops was made. This is its number.
    StopLine(u64),
    Offline {
        why: String,
        /// Whether the address refuses connections, which means that no server is running there.
        absent: bool,
        again_in: Duration,
    },
    Info(Box<InfoOk>),
    Stats(Box<StatsOk>),
    /// What the motor controllers report about themselves, in the order of the joints.
    Controllers(Vec<ControllerInfo>),
    /// The server does not know the request for the motor controllers, because it is older than
    /// this panel.
    NoControllers,
    Lease {
        lease: Lease,
        cause: Option<LeaseCause>,
    },
    Fault(FaultEvent),
    /// The sphere shakes by itself, or has its full torque again.
    Shaking(ShakingEvent),
    Scene(SceneEvent),
    Set(SetEvent),
    Dropped(DroppedEvent),
    /// The result of a stop of the rig at the address `server`.
    Stop {
        server: String,
        result: Result<(), String>,
    },
    /// The result of another request of the user: success, or the reason why it failed.
    Answer {
        intent: Intent,
        result: Result<(), String>,
    },
    /// How far the recording is that the panel makes. `None`: it has ended.
    Recording(Option<Progress>),
    /// The result of work on this computer: the written file, or the reason why it was not written.
    Note(Result<String, String>),
}

/// A function that wakes the window. The network threads call it when something has arrived.
pub(crate) type Wake = Arc<dyn Fn() + Send + Sync>;

/// Longest time that closing the window waits until the lease is released. A rig file can make the
/// loss of the lease holder a fault, but closing the window must not cause one.
const FAREWELL: Duration = Duration::from_millis(500);

/// The connection of the window to the network threads. Dropping it ends the threads.
pub(crate) struct Network {
    outgoing: Arc<Outgoing>,
    pub(crate) mailbox: Arc<Mailbox>,
    /// The stop line. Its thread lives as long as this sender, so sending does not fail.
    stop: Sender<Order>,
    /// This channel is disconnected when the session thread has ended.
    ended: Receiver<()>,
}

impl Network {
    /// Starts the threads that exchange messages with the server.
    ///
    /// # Errors
    /// Fails if the operating system refuses a thread.
    pub(crate) fn start(options: PanelOptions, wake: Wake) -> std::io::Result<Self> {
        let mailbox = Arc::new(Mailbox::new(wake));
        let outgoing = Arc::new(Outgoing::default());
        let stop = stop_line::start(options.clone(), Arc::clone(&mailbox), Arc::clone(&outgoing))?;
        let (inside, post) = (Arc::clone(&outgoing), Arc::clone(&mailbox));
        let (running, ended) = channel();
        std::thread::Builder::new().name("hbot-session".to_owned()).spawn(move || {
            session::run(options, &inside, &post);
            drop(running);
        })?;
        Ok(Self { outgoing, mailbox, stop, ended })
    }

    /// Queues a request of the user without waiting. A stop is sent over the stop line, a separate
    /// connection.
    pub(crate) fn send(&self, intent: Intent) {
        match intent {
            Intent::Stop => {
                self.outgoing.make_way_for(&intent);
                let _ = self.stop.send(Order::Stop);
            }
            Intent::Connect(address) => {
                let _ = self.stop.send(Order::Connect(address.clone()));
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
