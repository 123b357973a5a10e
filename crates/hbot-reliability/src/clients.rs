//! Test clients and an echo server, each run as a separate process.

use std::time::{Duration, Instant};

use hbot_api::{Client, Event, TorqueCommand};
use serde_json::json;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};

use crate::Outcome;
use crate::timing::quantile;

/// Time for which each torque message of a client is valid, ms.
pub(crate) const VALID_MS: u64 = 100;

/// Runs a client that commands a torque of 0.3 N m a hundred times a second, without end.
pub(crate) fn push(address: &str) -> Outcome<()> {
    let mut client = Client::connect(address, "pusher")?;
    client.acquire(true)?;
    println!("pushing");
    for seq in 0.. {
        let torque = [0.0, 0.3, 0.0];
        client.torque(TorqueCommand { torque, valid_ms: VALID_MS, tick: None, seq: Some(seq) })?;
        std::thread::sleep(Duration::from_millis(10));
    }
    Ok(())
}

/// Runs a client that renders a spring itself: it receives a state and sends a torque in every
/// tick. Prints the age of its torques in ticks.
pub(crate) fn render(address: &str, seconds: u64) -> Outcome<()> {
    let mut client = Client::connect(address, "renderer")?;
    client.acquire(true)?;
    client.subscribe(1)?;
    let (start, mut ages) = (Instant::now(), Vec::new());
    while start.elapsed() < Duration::from_secs(seconds) {
        let Some(Event::State(state)) = client.next_event(Duration::from_secs(5))? else { continue };
        ages.extend(state.client.map(|client| client.age_ticks as f64));
        let [w, x, y, z] = state.q;
        // For a small turn, twice the vector part is the turn. The sign of w selects the shorter
        // way.
        let torque = [x, y, z].map(|part| -0.2 * w.signum() * part);
        client.torque(TorqueCommand {
            torque,
            valid_ms: VALID_MS,
            tick: Some(state.tick),
            seq: Some(state.tick),
        })?;
    }
    let n = ages.len();
    let (median, far) = (quantile(&mut ages, 0.5), quantile(&mut ages, 0.99));
    println!("{}", json!({"p50": median, "p99": far, "count": n}));
    Ok(())
}

/// Runs a server that sends back every byte it receives, on the kind of runtime that the hbot
/// server uses.
pub(crate) fn echo() -> Outcome<()> {
    tokio::runtime::Builder::new_current_thread().enable_all().build()?.block_on(async {
        let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await?;
        println!("{}", listener.local_addr()?);
        let (mut stream, _) = listener.accept().await?;
        stream.set_nodelay(true)?;
        let mut piece = [0; 4096];
        loop {
            let n = stream.read(&mut piece).await?;
            if n == 0 {
                return Ok(());
            }
            stream.write_all(&piece[..n]).await?;
        }
    })
}
