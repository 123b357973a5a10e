//! Tests of live viewers with a real WebSocket client.

use std::net::{SocketAddr, TcpListener as Listener};
use std::time::Instant;

use hbot_testing::patience::PATIENCE;
use serde_json::{Value, json};
use tokio::net::TcpStream;
use tokio_tungstenite::WebSocketStream;
use tokio_tungstenite::tungstenite::client::IntoClientRequest as _;
use tokio_tungstenite::tungstenite::protocol::frame::coding::CloseCode;
use tokio_tungstenite::tungstenite::{Error, Message as Frame};

use super::*;
use futures_util::{SinkExt as _, StreamExt as _};
use hbot_config::SceneFile;

struct Served {
    feed: Option<Feed>,
    thread: Option<JoinHandle<()>>,
    counts: Arc<Counts>,
    address: SocketAddr,
}

fn served() -> Served {
    served_with(SILENCE)
}

fn served_with(silence: Duration) -> Served {
    let listener = Listener::bind(("127.0.0.1", 0)).unwrap();
    let address = listener.local_addr().unwrap();
    let counts = Arc::new(Counts::default());
    let names = ["steer", "drive"].map(str::to_owned).to_vec();
    let (feed, thread) = start_with(
        WebOptions { listener, hosts: Arc::default() },
        "a rig",
        names,
        Arc::clone(&counts),
        silence,
    )
    .unwrap();
    Served { feed: Some(feed), thread: Some(thread), counts, address }
}

impl Served {
    fn feed(&mut self) -> &mut Feed {
        self.feed.as_mut().unwrap()
    }

    async fn watched_by(&mut self, count: usize) {
        let begun = Instant::now();
        while self.feed().messages.receiver_count() < count {
            assert!(begun.elapsed() < PATIENCE, "{count} viewers");
            sleep(Duration::from_millis(1)).await;
        }
    }
}

struct Client(WebSocketStream<TcpStream>);

impl Client {
    async fn asking_for(at: SocketAddr, protocol: &str) -> Result<Self, Error> {
        let mut request = format!("ws://{at}").into_client_request().unwrap();
        request.headers_mut().insert("sec-websocket-protocol", protocol.parse().unwrap());
        let stream = TcpStream::connect(at).await.unwrap();
        let (socket, answer) = tokio_tungstenite::client_async(request, stream).await?;
        let chosen = answer.headers().get("sec-websocket-protocol").unwrap().to_str().unwrap();
        assert!(protocol.split(", ").any(|offered| offered == chosen), "{chosen}");
        Ok(Self(socket))
    }

    /// Connects, reads the greeting and subscribes to all topics, each under the number of its
    /// channel plus 100.
    async fn subscribed(at: SocketAddr) -> Self {
        let mut client = Self::asking_for(at, "foxglove.websocket.v1").await.unwrap();
        assert_eq!(client.text().await["op"], "serverInfo");
        let channels = client.text().await["channels"].as_array().unwrap().clone();
        let ids = channels.iter().map(|channel| channel["id"].as_u64().unwrap());
        let all: Vec<Value> = ids.map(|id| json!({"id": id + 100, "channelId": id})).collect();
        client.say(json!({"op": "subscribe", "subscriptions": all})).await;
        client
    }

    async fn say(&mut self, text: Value) {
        self.0.send(Frame::text(text.to_string())).await.unwrap();
    }

    async fn next(&mut self) -> Option<Frame> {
        let next = timeout(PATIENCE, self.0.next()).await.expect("something within the patience");
        next.and_then(Result::ok)
    }

    async fn text(&mut self) -> Value {
        let frame = self.next().await.expect("a text");
        serde_json::from_str(frame.to_text().unwrap()).unwrap()
    }

    /// Returns the subscription, the Unix time and the contents of the next message.
    async fn message(&mut self) -> (u32, u64, Vec<u8>) {
        let Some(Frame::Binary(bytes)) = self.next().await else { panic!("a message of a topic") };
        assert_eq!(bytes[0], 1, "the code of a message");
        let subscription = u32::from_le_bytes(bytes[1..5].try_into().unwrap());
        (subscription, u64::from_le_bytes(bytes[5..13].try_into().unwrap()), bytes[13..].to_vec())
    }

    /// Reads everything that waits. Returns whether a warning is in it.
    async fn is_warned(&mut self) -> bool {
        let mut warned = false;
        while let Ok(Some(Ok(frame))) = timeout(Duration::from_millis(500), self.0.next()).await {
            warned |= frame.is_text() && frame.to_text().unwrap().contains("were dropped");
        }
        warned
    }

    /// Returns why the server closed the connection, after all messages before.
    async fn closed(&mut self) -> Option<CloseCode> {
        while let Some(frame) = self.next().await {
            if let Frame::Close(why) = frame {
                return why.map(|why| why.code);
            }
        }
        None
    }
}

fn state(tick: u64) -> StateEvent {
    let joints = vec![hbot_api::JointState::default(); 8];
    StateEvent { tick, torque: [0.1, 0.2, 0.3], joints, ..StateEvent::default() }
}

fn scene() -> SceneNote {
    let file = SceneFile::default_scene();
    let mut running = hbot_config::RunningScene::new();
    SceneNote::new(&running.load(file.clone()), &file)
}

#[tokio::test]
async fn a_viewer_gets_every_topic_and_the_scene_at_once() {
    let mut served = served();
    served.feed().scene(0, &scene(), 5);
    let mut client = Client::subscribed(served.address).await;
    // The scene comes when the last topic is subscribed to: all topics are subscribed to now.
    let (subscription, at, data) = client.message().await;
    let mut encoder = Encoder::new(["steer", "drive"].map(str::to_owned).to_vec());
    let file = SceneFile::default_scene();
    assert_eq!((subscription, at), (100 + Topic::Scene as u32 + 1, 5));
    assert_eq!(data, encoder.scene(0, file.name(), &file.to_json().to_string(), 5));

    for tick in 1..4 {
        served.feed().state(&state(tick), 1000 * tick);
        let mut sent = Vec::new();
        let _ = encoder.state(&state(tick), 1000 * tick, |topic, data| {
            sent.push((100 + topic as u32 + 1, 1000 * tick, data.to_vec()));
            Ok::<_, ()>(())
        });
        assert_eq!(sent.len(), 4);
        for message in sent {
            assert_eq!(client.message().await, message);
        }
    }
    client.say(json!({"op": "unsubscribe", "subscriptionIds": [101, 102, 103]})).await;
    // Answers come in order, so a second subscription is obeyed after the request before it.
    client.say(json!({"op": "subscribe", "subscriptions": [{"id": 7, "channelId": 7}]})).await;
    assert_eq!(client.message().await.0, 7);
    served.feed().state(&state(4), 4000);
    assert_eq!(client.message().await.0, 100 + Topic::Torque as u32 + 1);
}

#[tokio::test]
async fn nothing_can_be_commanded() {
    let mut served = served();
    let mut client = Client::asking_for(served.address, "foxglove.websocket.v1").await.unwrap();
    let info = client.text().await;
    assert_eq!(info["capabilities"], json!([]));
    client.text().await;
    let channel = json!({"id": 1, "topic": "/t", "encoding": "json", "schemaName": "x"});
    for text in [
        json!({"op": "advertise", "channels": [channel]}),
        json!({"op": "setParameters", "parameters": [{"name": "a", "value": 1}]}),
        json!({"op": "getParameters", "parameterNames": []}),
        json!({"op": "estop"}),
        json!({"op": "subscribe", "subscriptions": [{"id": -1, "channelId": "x"}]}),
        json!({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 8}]}),
        json!("garbage"),
    ] {
        client.say(text).await;
    }
    client.0.send(Frame::text("{")).await.unwrap();
    // None of them has an answer or ends the connection.
    client.say(json!({"op": "subscribe", "subscriptions": [{"id": 9, "channelId": 1}]})).await;
    let begun = Instant::now();
    let first = loop {
        // The subscription may take effect after this state.
        served.feed().state(&state(1), 1);
        if let Ok(message) = timeout(Duration::from_millis(10), client.message()).await {
            break message;
        }
        assert!(begun.elapsed() < PATIENCE, "a message");
    };
    assert_eq!(first.0, 9, "the private topic and unknown channels are not served");
    // A client that publishes, or calls a service.
    client.0.send(Frame::binary(vec![1, 1, 0, 0, 0, 1])).await.unwrap();
    assert_eq!(client.closed().await, Some(CloseCode::Unsupported));
}

#[tokio::test]
async fn a_message_that_is_too_large_ends_the_connection() {
    let served = served();
    let mut client = Client::subscribed(served.address).await;
    let _ = client.0.send(Frame::text("x".repeat(100_000))).await;
    assert_eq!(client.closed().await, None, "it is not closed politely");
}

#[tokio::test]
async fn either_name_of_the_protocol_is_agreed_to_and_no_other() {
    let served = served();
    for name in ["foxglove.sdk.v1", "foxglove.websocket.v1", "other, foxglove.sdk.v1"] {
        Client::asking_for(served.address, name).await.unwrap();
    }
    match Client::asking_for(served.address, "chat").await {
        Err(Error::Http(answer)) => assert_eq!(answer.status(), 400),
        other => panic!("{:?}", other.map(|_| "agreed")),
    }
}

/// Every web page could connect here. The page says from where it is, and by which name it came.
#[tokio::test]
async fn a_page_from_elsewhere_sees_nothing() {
    let served = served();
    let asked = async |host: &str, origin: Option<&str>| {
        let mut request = format!("ws://{}", served.address).into_client_request().unwrap();
        let headers = request.headers_mut();
        headers.insert("sec-websocket-protocol", "foxglove.sdk.v1".parse().unwrap());
        headers.insert("host", host.parse().unwrap());
        origin.map(|origin| headers.insert("origin", origin.parse().unwrap()));
        let stream = TcpStream::connect(served.address).await.unwrap();
        match tokio_tungstenite::client_async(request, stream).await {
            Ok(_) => 101,
            Err(Error::Http(answer)) => answer.status().as_u16(),
            Err(other) => panic!("{other}"),
        }
    };
    let own = served.address.to_string();
    assert_eq!(asked(&own, None).await, 101, "a viewer that is no browser");
    assert_eq!(asked(&own, Some(&format!("http://{own}"))).await, 101);
    assert_eq!(asked(&own, Some("https://evil.example")).await, 403);
    assert_eq!(asked(&own, Some("null")).await, 403);
    let rebound = format!("evil.example:{}", served.address.port());
    assert_eq!(asked(&rebound, Some(&format!("http://{rebound}"))).await, 403);
    assert_eq!(asked(&rebound, None).await, 403);
}

#[tokio::test]
async fn a_slow_viewer_loses_messages_which_are_counted_and_delays_no_other() {
    let mut served = served();
    let mut slow = Client::subscribed(served.address).await;
    let mut fast = Client::subscribed(served.address).await;
    served.watched_by(2).await;
    // The scene shows that the subscription is in force. It may come twice.
    served.feed().scene(0, &scene(), 0);
    assert_eq!(fast.message().await.0, 107);
    let (mut tick, mut warned) = (0, false);
    while served.counts.dropped_for_viewers() == 0 {
        // Far fewer messages than the queue has room for.
        for _ in 0..100 {
            tick += 1;
            served.feed().state(&state(tick), tick);
        }
        let mut left = 400;
        while left > 0 {
            let (_, at, _) = fast.message().await;
            assert!(at == 0 || (tick - 99..=tick).contains(&at), "nothing is missing: {at} of {tick}");
            left -= u32::from(at > 0);
        }
        assert!(tick < 400_000, "the slow viewer loses nothing");
        // The system buffers about 10 MB for the slow one. 40,000 ticks are more than 20 MB.
        if tick % 40_000 == 0 {
            warned |= slow.is_warned().await;
        }
    }
    // On a machine that stands still for 10 s, it is disconnected instead.
    assert!(warned || slow.closed().await.is_none(), "the slow viewer is told what it has lost");
}

#[tokio::test]
async fn the_end_of_a_run_ends_the_connections_and_the_thread() {
    let mut served = served();
    let mut client = Client::subscribed(served.address).await;
    served.watched_by(1).await;
    served.feed().state(&state(1), 1);
    served.feed = None;
    assert_eq!(client.closed().await, Some(CloseCode::Away));
    served.thread.take().unwrap().join().unwrap();
    assert!(TcpStream::connect(served.address).await.is_err(), "nobody listens");
}

/// Viewers that are silent and do not answer pings give their places to others. A viewer that
/// answers stays.
#[tokio::test]
async fn silent_viewers_give_their_places_to_others() {
    let silence = Duration::from_millis(600);
    let mut served = served_with(silence);
    let mut silent = Vec::new();
    for _ in 0..VIEWERS {
        // It does not read, so it does not answer pings.
        silent.push(Client::asking_for(served.address, "foxglove.sdk.v1").await.unwrap());
    }
    served.watched_by(VIEWERS).await;
    let mut client = timeout(PATIENCE, Client::subscribed(served.address)).await.expect("a free place");
    // An answer to a ping that comes after the end can hide the reason of the end.
    while let Some(frame) = silent[0].next().await {
        assert!(frame.is_text() || frame.is_ping() || frame.is_close(), "{frame:?}");
    }
    // Reading answers pings.
    let begun = Instant::now();
    while begun.elapsed() < 3 * silence {
        match timeout(silence, client.0.next()).await {
            Ok(Some(Ok(frame))) => assert!(frame.is_ping() || frame.is_text(), "{frame:?}"),
            other => panic!("{other:?}"),
        }
    }
}
