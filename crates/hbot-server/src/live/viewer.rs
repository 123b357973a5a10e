//! One viewer: its subscriptions, and the messages on their way to it.

use std::sync::Arc;
use std::time::Duration;

use futures_util::{SinkExt as _, StreamExt as _};
use hbot_record::Topic;
use tokio::net::TcpStream;
use tokio::sync::broadcast;
use tokio::sync::broadcast::error::RecvError;
use tokio::time::{Instant, interval_at, timeout};
use tokio_tungstenite::WebSocketStream;
use tokio_tungstenite::tungstenite::handshake::server::Request;
use tokio_tungstenite::tungstenite::http::{HeaderValue, StatusCode, header};
use tokio_tungstenite::tungstenite::protocol::frame::coding::CloseCode;
use tokio_tungstenite::tungstenite::protocol::{CloseFrame, Role, WebSocketConfig};
use tokio_tungstenite::tungstenite::{self, Message as Frame};

use super::protocol::{self, Subscription};
use super::{Message, Shared};
use crate::web::allowed::Door;
use crate::web::head::Refusal;
use crate::web::upgrade;

/// Time limit for the handshake.
const HANDSHAKE: Duration = Duration::from_secs(5);
/// A viewer that accepts no bytes for this time is disconnected.
const STALL: Duration = Duration::from_secs(10);
/// Largest size of a message from a viewer, bytes. A subscription takes about 30.
const REQUEST: usize = 16 * 1024;
/// Largest number of subscriptions of a viewer. There are fewer topics.
const SUBSCRIPTIONS: usize = 32;
/// Number of messages after which the viewer's requests are read again.
const BATCH: usize = 256;
/// Number of bytes that are collected before they are passed to the operating system.
const COLLECT: usize = 16 * 1024;

/// The reason why a connection ends.
enum End {
    /// The viewer has gone, or its connection has failed.
    Gone,
    /// The viewer does not read.
    Stalled,
    /// Nothing has come from the viewer for too long, not even an answer to a ping.
    Silent,
    /// The viewer has sent what only a client that commands would send.
    Unwanted,
    /// The run is over.
    Over,
}

impl From<tungstenite::Error> for End {
    fn from(_: tungstenite::Error) -> Self {
        Self::Gone
    }
}

struct Viewer {
    socket: WebSocketStream<TcpStream>,
    shared: Arc<Shared>,
    subscriptions: Vec<Subscription>,
    /// Number of messages that this viewer has lost.
    dropped: u64,
}

/// Serves one viewer until it leaves or the run is over.
pub(super) async fn serve(mut stream: TcpStream, shared: Arc<Shared>) {
    // Without it, some messages would wait for the acknowledgement of those before them.
    let _ = stream.set_nodelay(true);
    let config = WebSocketConfig::default()
        .read_buffer_size(4096)
        .write_buffer_size(COLLECT)
        .max_message_size(Some(REQUEST))
        .max_frame_size(Some(REQUEST));
    let Ok(Ok(Some(rest))) = timeout(HANDSHAKE, shake_hands(&mut stream, &shared)).await else { return };
    let socket = WebSocketStream::from_partially_read(stream, rest, Role::Server, Some(config)).await;
    let Some(mut messages) = shared.messages.upgrade().map(|messages| messages.subscribe()) else { return };
    let mut viewer = Viewer { socket, shared, subscriptions: Vec::new(), dropped: 0 };
    let (code, reason) = match viewer.run(&mut messages).await {
        Ok(()) | Err(End::Gone) => return,
        Err(End::Stalled) => return viewer.shared.counts.drop_for_viewer(messages.len() as u64),
        Err(End::Silent) => (CloseCode::Policy, "no answer to pings"),
        Err(End::Unwanted) => (CloseCode::Unsupported, "this server shows, and takes no commands"),
        Err(End::Over) => (CloseCode::Away, "the run is over"),
    };
    let farewell = viewer.socket.close(Some(CloseFrame { code, reason: reason.into() }));
    // A viewer that does not read is not waited for.
    let _ = timeout(STALL, farewell).await;
}

/// Makes a connection a WebSocket. Returns the bytes that the viewer has sent after its request, or
/// `None` if it was refused.
async fn shake_hands(stream: &mut TcpStream, shared: &Shared) -> std::io::Result<Option<Vec<u8>>> {
    // Viewers that are no browsers send no Origin. They can only watch.
    let door =
        Door { hosts: &shared.hosts, at: stream.local_addr()?, encrypted: false, without_origin: true };
    upgrade(stream, |request| {
        door.check(request)?;
        let name = agree(request)?;
        Ok(Some((header::SEC_WEBSOCKET_PROTOCOL, HeaderValue::from_static(name))))
    })
    .await
}

/// Chooses the name of the protocol. Refuses a connection that offers none that is known.
fn agree(request: &Request) -> Result<&'static str, Refusal> {
    let offers = request.headers().get_all(header::SEC_WEBSOCKET_PROTOCOL).iter();
    let offered: Vec<&str> = offers
        .filter_map(|value| value.to_str().ok())
        .flat_map(|value| value.split(',').map(str::trim))
        .collect();
    protocol::NAMES.into_iter().find(|name| offered.contains(name)).ok_or_else(|| {
        let what = format!("the WebSocket subprotocol must be {}", protocol::NAMES.join(" or "));
        Refusal::new(StatusCode::BAD_REQUEST, what)
    })
}

impl Viewer {
    async fn run(&mut self, messages: &mut broadcast::Receiver<Message>) -> Result<(), End> {
        for text in self.shared.greeting.clone() {
            self.send(text.into()).await?;
        }
        let mut heard_at = Instant::now();
        let pause = self.shared.silence / 3;
        let mut pings = interval_at(heard_at + pause, pause);
        loop {
            tokio::select! {
                _ = pings.tick() => {
                    if heard_at.elapsed() >= self.shared.silence {
                        return Err(End::Silent);
                    }
                    self.send(Frame::Ping(Default::default())).await?;
                }
                next = messages.recv() => self.pass(next, messages).await?,
                heard = self.socket.next() => match heard {
                    Some(frame) => {
                        heard_at = Instant::now();
                        self.hear(frame?).await?;
                    }
                    None => return Ok(()),
                },
            }
        }
    }

    /// Sends the next message and those that wait behind it, up to [`BATCH`].
    async fn pass(
        &mut self,
        mut next: Result<Message, RecvError>,
        messages: &mut broadcast::Receiver<Message>,
    ) -> Result<(), End> {
        for left in (0..BATCH).rev() {
            match next {
                Ok(message) => self.feed(&message).await?,
                Err(RecvError::Lagged(lost)) => {
                    self.dropped += lost;
                    self.shared.counts.drop_for_viewer(lost);
                    self.send(protocol::dropped(self.dropped).into()).await?;
                }
                Err(RecvError::Closed) => return Err(End::Over),
            }
            // The next one must not be taken if it is not sent here.
            if left == 0 || messages.is_empty() {
                break;
            }
            next = messages.recv().await;
        }
        in_time(self.socket.flush()).await
    }

    /// Collects a message for each subscription to its topic.
    async fn feed(&mut self, message: &Message) -> Result<(), End> {
        for k in 0..self.subscriptions.len() {
            let Subscription { id, channel_id } = self.subscriptions[k];
            if protocol::topic(channel_id) == Some(message.topic) {
                let bytes = protocol::message_data(id, message.unix_ns, &message.data);
                in_time(self.socket.feed(Frame::Binary(bytes.into()))).await?;
            }
        }
        Ok(())
    }

    async fn send(&mut self, frame: Frame) -> Result<(), End> {
        in_time(self.socket.send(frame)).await
    }

    /// Obeys a subscription. Ignores all other texts. Binary messages are those of clients that
    /// publish or call services, and end the connection.
    async fn hear(&mut self, frame: Frame) -> Result<(), End> {
        let text = match frame {
            Frame::Text(text) => text,
            Frame::Binary(_) => return Err(End::Unwanted),
            // Pings are answered with the next message.
            Frame::Ping(_) | Frame::Pong(_) | Frame::Close(_) | Frame::Frame(_) => return Ok(()),
        };
        match serde_json::from_str(&text) {
            Ok(protocol::Request::Subscribe { subscriptions }) => self.subscribe(subscriptions).await,
            Ok(protocol::Request::Unsubscribe { subscription_ids }) => {
                self.subscriptions.retain(|subscribed| !subscription_ids.contains(&subscribed.id));
                Ok(())
            }
            Ok(protocol::Request::Other) | Err(_) => Ok(()),
        }
    }

    async fn subscribe(&mut self, wanted: Vec<Subscription>) -> Result<(), End> {
        for subscription in wanted {
            self.subscriptions.retain(|subscribed| subscribed.id != subscription.id);
            let Some(topic) = protocol::topic(subscription.channel_id) else { continue };
            if self.subscriptions.len() >= SUBSCRIPTIONS {
                continue;
            }
            self.subscriptions.push(subscription);
            let scene = self.shared.scene.borrow().clone();
            if let (Topic::Scene, Some(scene)) = (topic, scene) {
                let bytes = protocol::message_data(subscription.id, scene.unix_ns, &scene.data);
                self.send(Frame::Binary(bytes.into())).await?;
            }
        }
        Ok(())
    }
}

/// Waits until the connection has accepted what is sent, but at most [`STALL`].
async fn in_time(sent: impl Future<Output = Result<(), tungstenite::Error>>) -> Result<(), End> {
    match timeout(STALL, sent).await {
        Ok(sent) => Ok(sent?),
        Err(_) => Err(End::Stalled),
    }
}
