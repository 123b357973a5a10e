//! Shows how a client renders an effect itself: it reads each state and streams back the torque of
//! a spring, which the server adds to its scene. The spring pulls towards the orientation that the
//! sphere had when the program started.
//!
//! ```text
//! cargo run server               # in one terminal: a simulated rig
//!                                # in another terminal:
//! cargo run --example stream_torque -- [ADDRESS] [SECONDS] [ENCODING]
//! ```
//!
//! The defaults are 127.0.0.1:4268, 5 s and `json`. The other encoding is `msgpack`.
//!
//! A torque that a client computes is some milliseconds old when it acts. Such a spring must
//! therefore be softer than one of a scene, which the loop renders itself. Each message states how
//! long it is valid: if the program ends or hangs, its torque goes to zero.

use std::error::Error;
use std::time::{Duration, Instant};

use hbot_api::{Client, ConnectOptions, Encoding, Event, TorqueCommand};
use hbot_core::{Vec3, rotation};

/// Stiffness of the spring, N m/rad.
const STIFFNESS: f64 = 0.3;
/// Damping of the spring, N m s/rad.
const DAMPING: f64 = 0.005;
/// Time after which a torque expires if no new one arrives, ms.
const VALID_MS: u64 = 50;

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let address = args.next().unwrap_or_else(|| "127.0.0.1:4268".to_owned());
    let seconds: f64 = args.next().map_or(Ok(5.0), |seconds| seconds.parse())?;
    let encoding = match args.next() {
        None => Encoding::Json,
        Some(name) => name.parse().map_err(|()| "the encodings are json and msgpack")?,
    };

    let options = ConnectOptions { encoding, ..ConnectOptions::new("stream_torque") };
    let mut client = Client::connect_with(&address, &options)?;
    // Only the holder of the lease can stream. The lease is given back when the connection ends.
    client.acquire(false)?;
    client.enable()?;
    client.subscribe(1)?;

    let (start, mut reference, mut largest, mut oldest) = (Instant::now(), None, 0.0_f64, 0);
    while start.elapsed().as_secs_f64() < seconds {
        let Some(event) = client.next_event(Duration::from_secs(5))? else {
            return Err("no state for 5 s: does the server's loop run?".into());
        };
        let state = match event {
            Event::State(state) => state,
            // A stream gets no answers: if the server refuses a message, it reports this as an
            // event.
            Event::Refused(refused) => return Err(format!("{refused:?}").into()),
            _ => continue,
        };
        let q = rotation::from_wxyz(state.q).ok_or("an orientation that is none")?;
        let reference = *reference.get_or_insert(q);
        // The turn in frame N that would bring the sphere back, rad.
        let back = rotation::difference(reference, q);
        let torque = back * STIFFNESS - Vec3::from_array(state.omega) * DAMPING;
        client.torque(TorqueCommand {
            torque: torque.to_array(),
            valid_ms: VALID_MS,
            // The tick of the state from which the torque was computed. The server can refuse a
            // torque that is too old.
            tick: Some(state.tick),
            seq: Some(state.tick),
        })?;
        largest = largest.max(torque.length());
        oldest = oldest.max(state.client.map_or(0, |client| client.age_ticks));
    }
    println!(
        "streamed for {seconds} s: at most {largest:.3} N m, in use up to {oldest} ticks after their state"
    );
    client.disable()?;
    Ok(())
}
