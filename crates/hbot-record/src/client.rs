//! The recording of a client: what a server sends to it, without what a replay needs.

use std::collections::BTreeMap;
use std::io::{Seek, Write};
use std::time::{SystemTime, UNIX_EPOCH};

use hbot_api::{Event, InfoOk};
use mcap::McapError;

use crate::writer::{About, Writer};

/// A recording in progress of the events that a client receives.
pub struct ClientRecording<W: Write + Seek> {
    writer: Writer<W>,
    /// Unix time of tick 0, ns.
    unix_ns: u64,
    /// Unix time of the newest state, ns.
    newest: u64,
    /// Name and JSON of the scene that the server rendered at the start. It is written with the
    /// first state, because only that tells which tick and time it is.
    scene: Option<(String, String)>,
    states: u64,
    dropped: u64,
}

impl<W: Write + Seek> ClientRecording<W> {
    /// Begins a recording of the rig that `info` describes. `server` is the name and version of the
    /// server, from its answer to the hello.
    ///
    /// # Errors
    /// Fails if `into` cannot be written.
    pub fn new(into: W, info: &InfoOk, server: &str) -> Result<Self, McapError> {
        let unix_ns = info.clock.map_or_else(now, |clock| clock.unix_ns);
        let title = info.scene.get("name").and_then(|name| name.as_str()).unwrap_or_default();
        Ok(Self {
            writer: Writer::new(into, &about(info, server))?,
            unix_ns,
            newest: now().max(unix_ns),
            scene: Some((title.to_owned(), info.scene.to_string())),
            states: 0,
            dropped: 0,
        })
    }

    /// Writes an event.
    ///
    /// # Errors
    /// Fails if the recording cannot be written. It is unusable then.
    pub fn take(&mut self, event: &Event) -> Result<(), McapError> {
        match event {
            Event::State(state) => {
                self.newest = self.unix_ns + (state.t * 1.0e9).round() as u64;
                if let Some((name, json)) = self.scene.take() {
                    self.writer.scene(state.tick, &name, &json, self.newest)?;
                }
                self.states += 1;
                self.writer.state(state, self.newest)
            }
            other => {
                if let Event::Dropped(dropped) = other {
                    self.dropped += dropped.count;
                }
                if let Event::Scene(scene) = other {
                    // No state was rendered with the first scene.
                    self.scene = None;
                    self.writer.scene(scene.tick, &scene.name, "", self.newest)?;
                }
                self.writer.event(other, self.newest)
            }
        }
    }

    /// Returns the number of states that have been written.
    #[must_use]
    pub fn states(&self) -> u64 {
        self.states
    }

    /// Returns the number of states that the server has dropped, because it sent them faster than
    /// they were taken.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    /// Writes everything up to here, so that it is readable even if the program dies immediately
    /// afterwards.
    ///
    /// # Errors
    /// Fails if the recording cannot be written. It is unusable then.
    pub fn flush(&mut self) -> Result<(), McapError> {
        self.writer.flush()
    }

    /// Ends the recording.
    ///
    /// # Errors
    /// Fails if the recording cannot be written.
    pub fn finish(self) -> Result<(), McapError> {
        self.writer.finish().map(drop)
    }
}

fn now() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since.as_nanos()).unwrap_or(u64::MAX)
}

fn about(info: &InfoOk, server: &str) -> About {
    let wheels =
        info.rig.wheels.iter().enumerate().map(|(k, wheel)| {
            wheel.name.clone().unwrap_or_else(|| format!("wheel {}", k + 1)).replace(' ', "_")
        });
    let joints = wheels.flat_map(|wheel| ["steer", "drive"].map(|joint| format!("{wheel}.{joint}")));
    let mut entries = BTreeMap::new();
    let mut put = |key: &str, value: String| entries.insert(key.to_owned(), value);
    put("rig_name", info.rig.name.clone());
    put("rate_hz", info.rig.rate_hz.to_string());
    put("accuracy", info.accuracy.clone());
    put("scene", info.scene.to_string());
    put("server", server.to_owned());
    // What a viewer needs to draw the rig. A client does not have the rig file.
    put("rig", serde_json::json!({"rig": info.rig, "limits": info.limits}).to_string());
    About { joints: joints.collect(), entries }
}
