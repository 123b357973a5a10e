//! Tests of connections over pipes in memory, with a hub and no loop.

use hbot_api::{Encoding, Request};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _, DuplexStream, duplex};
use tokio::task::yield_now;
use tokio::time::{sleep, timeout};

use super::super::connection::converse;
use super::super::hub::First;
use super::super::hub::Hub;
use super::super::outbox::outbox;
use super::super::peer::Peer;
use super::super::shared_hub::SharedHub;
use super::*;
use hbot_host::run_loop::bridge::LoopEnd;
use hbot_host::run_loop::clock::Origin;

/// Capacity of the pipe between a client and the service, bytes.
const PIPE: usize = 128 * 1024;

pub(super) fn still() -> (LoopEnd, SharedHub) {
    let (loop_end, end) = bridge().unwrap();
    let mut scene = RunningScene::new();
    let _ = scene.load(SceneFile::default_scene());
    let setup = ServiceSetup {
        rig: RigConfig::prototype(),
        scene,
        phenomena: None,
        token: None,
        encryption: None,
        flight_dir: None,
        controllers: Default::default(),
        accuracy: "test".to_owned(),
        origin: Origin::at(0),
        time_waits: false,
        notes: crate::recording::Notes::default(),
        web: None,
        hand: None,
    };
    let bounds = Bounds { stuck: Duration::from_millis(50), ..Bounds::default() };
    (loop_end, SharedHub::new(Hub::new(bounds, end, setup, watch::channel(Status::default()).0)))
}

/// Connects a client that uses MessagePack. Returns the client's end of the pipe, after the hello,
/// and its session number.
async fn greeted(hub: &SharedHub) -> (DuplexStream, u64) {
    let (client, session) = connected(hub, PIPE, b", \"encoding\": \"msgpack\"").await;
    (client, session)
}

/// Connects a client that uses JSON, over a pipe of `pipe` bytes. Returns the client's end of the
/// pipe, after the hello.
pub(super) async fn greeted_in_json(hub: &SharedHub, pipe: usize) -> DuplexStream {
    connected(hub, pipe, b"").await.0
}

async fn connected(hub: &SharedHub, pipe: usize, fields: &[u8]) -> (DuplexStream, u64) {
    let (mut client, server) = duplex(pipe);
    let (session, inbox, bounds) = {
        let mut hub = hub.lock();
        let session = hub.next_session();
        let (out, inbox) = outbox(8192);
        hub.admit(
            session,
            Peer::new(out, tokio::spawn(async {}).abort_handle(), std::net::Ipv4Addr::LOCALHOST.into()),
        );
        (session, inbox, *hub.bounds())
    };
    let deadline = tokio::time::Instant::now() + PATIENCE;
    tokio::spawn(converse(server, deadline, session, hub.clone(), inbox, bounds));
    let hello = [b"{\"op\": \"hello\", \"version\": 1, \"name\": \"x\"", fields, b"}\n"].concat();
    client.write_all(&hello).await.unwrap();
    // The answer to a hello is always JSON.
    while client.read_u8().await.unwrap() != b'\n' {}
    (client, session)
}

/// Returns a request that takes 200 times its own size in memory when it is parsed.
fn swelling() -> Vec<u8> {
    let mut map = b"\x82\xa2op\xa4ping\xa4data\xdc\x50\x00".to_vec();
    map.extend(b"\x81\xa0\x00".repeat(0x5000));
    let mut frame = u32::try_from(map.len()).unwrap().to_be_bytes().to_vec();
    frame.extend(map);
    frame
}

/// Checks that requests that would take much memory are refused without being parsed, because they
/// are longer than a ping can be.
#[test]
fn requests_that_swell_are_read_one_after_the_other() {
    const CLIENTS: usize = 24;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    let swollen = allocation_counter::measure(|| {
        let frame = swelling();
        assert!(hbot_api::Request::read(hbot_api::Encoding::Msgpack, &frame[4..]).is_ok());
    });
    let used = allocation_counter::measure(|| {
        runtime.block_on(async {
            let (_loop_end, hub) = still();
            let mut clients = Vec::new();
            for _ in 0..CLIENTS {
                clients.push(greeted(&hub).await.0);
            }
            for client in &mut clients {
                client.write_all(&swelling()).await.unwrap();
            }
            for client in &mut clients {
                let length = client.read_u32().await.unwrap();
                let mut answer = vec![0; length as usize];
                client.read_exact(&mut answer).await.unwrap();
                assert!(String::from_utf8_lossy(&answer).contains("too_large"));
            }
        });
    });
    // The limit allows pipes and buffers for every client. This is less than one such request takes
    // when parsed.
    let most = (CLIENTS * (2 * PIPE + 128 * 1024)) as u64;
    assert!(swollen.bytes_max > most, "{} bytes", swollen.bytes_max);
    assert!(used.bytes_max < most, "{} KiB of {}", used.bytes_max >> 10, most >> 10);
}

/// Checks that a request allocates memory only for its answer: with room for the answers, pings
/// allocate none.
#[tokio::test]
async fn a_ping_is_answered_without_an_allocation() {
    const PINGS: usize = 100;
    let (_loop_end, hub) = still();
    let (out, mut inbox) = outbox(8192);
    let session = hub.lock().next_session();
    let task = tokio::spawn(async {}).abort_handle();
    hub.lock().admit(session, Peer::new(out, task, std::net::Ipv4Addr::LOCALHOST.into()));
    let hello = br#"{"op": "hello", "version": 1, "name": "x", "encoding": "msgpack"}"#;
    assert_eq!(hub.first(session, Request::read_first(hello)), First::Greeted(Encoding::Msgpack));
    let context = std::task::Context::from_waker(std::task::Waker::noop());
    // Room for the answers, allocated before the measurement.
    let mut bytes = Vec::with_capacity(64 * 1024);
    assert!(inbox.poll_take(&context, &mut bytes).is_ready());
    let mut pings: Vec<_> =
        (0..PINGS).map(|_| Ok(Request { id: None, op: Op::Ping { data: Value::Null } })).collect();
    let used = allocation_counter::measure(|| {
        for ping in pings.drain(..) {
            assert!(hub.message(session, ping));
        }
    });
    assert_eq!(used.count_total, 0);
    assert!(inbox.poll_take(&context, &mut bytes).is_ready());
    assert!(bytes.len() > 20 * PINGS, "{} bytes of answers", bytes.len());
}

#[tokio::test]
async fn one_that_says_no_more_and_reads_no_more_is_counted_as_cut() {
    let (_loop_end, hub) = still();
    let (mut client, session) = greeted(&hub).await;
    // The answers are larger than the capacity of the pipe.
    let ping = Request { id: None, op: Op::Ping { data: json!("x".repeat(1900)) } };
    let mut pings = Vec::new();
    while pings.len() < 4 * PIPE {
        Encoding::Msgpack.encode(&ping, &mut pings).unwrap();
    }
    client.write_all(&pings).await.unwrap();
    client.shutdown().await.unwrap();
    // Other tasks of this thread have their turn in between, and the time that the service waits
    // for passes.
    timeout(PATIENCE, async {
        while hub.lock().summary().connections_cut == 0 {
            sleep(LOOK).await;
        }
    })
    .await
    .unwrap();
    assert!(!hub.message(session, Ok(ping)), "it is no client any more");
}

#[tokio::test]
async fn one_that_asks_without_end_leaves_the_others_their_turn() {
    const PINGS: usize = 5000;
    let (_loop_end, hub) = still();
    let (busy, _) = greeted(&hub).await;
    let (mut from, mut to) = tokio::io::split(busy);
    let ping = b"\0\0\0\x09\x81\xa2op\xa4ping";
    to.write_all(&ping.repeat(PINGS)).await.unwrap();
    let reading = tokio::spawn(async move {
        for _ in 0..PINGS {
            let length = from.read_u32().await.unwrap();
            from.read_exact(&mut vec![0; length as usize]).await.unwrap();
        }
    });
    let done = || hub.lock().summary().requests;
    let (mut most, mut before) = (0, done());
    while !reading.is_finished() {
        // Every other task gets a turn meanwhile.
        yield_now().await;
        let now = done();
        most = most.max(now - before);
        before = now;
    }
    reading.await.unwrap();
    assert_eq!(done(), PINGS as u64 + 1, "the hello and all that it asked");
    assert!((1..=32).contains(&most), "{most} requests in a row");
}
