//! Shows how a client connects to a running server and reads its states. It takes no lease, so it
//! does not disturb other clients.
//!
//! ```text
//! cargo run server                                         # in one terminal: a simulated rig
//! cargo run --example watch_states -- [ADDRESS] [STATES]   # in another terminal
//! ```
//!
//! The defaults are 127.0.0.1:4268 and 20 states.

use std::error::Error;
use std::time::Duration;

use hbot_api::{Client, Event};

/// Number of ticks from one state to the next. At 1 kHz, 100 gives ten states per second.
const EVERY: u64 = 100;

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let address = args.next().unwrap_or_else(|| "127.0.0.1:4268".to_owned());
    let states: u32 = args.next().map_or(Ok(20), |count| count.parse())?;

    let mut client = Client::connect(&address, "watch_states")?;
    client.subscribe(EVERY)?;
    let mut seen = 0;
    while seen < states {
        let Some(event) = client.next_event(Duration::from_secs(5))? else {
            return Err("no state for 5 s: does the server's loop run?".into());
        };
        // Other events report faults, modes and leases. This program shows states only.
        let Event::State(state) = event else { continue };
        let [w, x, y, z] = state.q;
        let torque = state.torque.iter().map(|t| t * t).sum::<f64>().sqrt();
        println!(
            "{:8.3} s  {:12}  q = [{w:6.3}, {x:6.3}, {y:6.3}, {z:6.3}]  torque {torque:.3} N m",
            state.t,
            state.mode.as_str()
        );
        seen += 1;
    }
    Ok(())
}
