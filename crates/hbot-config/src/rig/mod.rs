//! The rig file: it describes the machine, its connection and its limits.

mod compensation;
mod compile;
mod file;
mod methods;
mod settings;
mod wheel;

use std::fmt;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use hbot_core::design::rig::Rig;
use hbot_core::inputs::OnClientLost;
use serde::Deserialize as _;
use serde_json::Value;

pub use self::settings::Protocol;
use crate::advice::RatePick;
use crate::angle::to_radians;
use crate::decode::decode;
use crate::diagnostic::{Diagnostics, LoadError};
use crate::document::{Document, Report};
use crate::schema;
use crate::text::read_text;
use crate::validate::validate;

/// Text of the prototype's rig file, compiled into the program.
const PROTOTYPE: &str = include_str!("../../../../rigs/prototype.toml");

static SCHEMA: LazyLock<Value> = LazyLock::new(schema::of::<file::RigFile>);

/// Time constant with which the torque of a joint follows a command if the rig file does not say
/// it and its protocol is hbot's own, s. Also that of the simulated rig's motors, if a scene
/// switches their phenomenon on and gives no time. It is usual for motors of this size
/// (docs/internals/physics.md, section 8).
pub const USUAL_LAG_S: f64 = 5.0e-4;

/// A rig file that has been checked and is ready for use. Every number is in range, and the
/// geometry has been checked for all postures.
#[derive(Debug, Clone, PartialEq)]
pub struct RigConfig {
    /// Name of the rig, shown to people.
    pub name: String,
    /// Name of the certificate of the rig, if it has one.
    pub certificate: Option<String>,
    /// The data about the rig that the control law needs.
    pub rig: Rig,
    /// Names of the wheels, shown to people, in the order of the file.
    pub wheels: Vec<String>,
    /// Index of each joint's serial line. Each wheel has two joints in this list: steer, then
    /// drive.
    pub ports: Vec<usize>,
    /// The motor controller of each joint on its serial line; no two joints of a line have the
    /// same. With hbot's own protocol these are the positions of the joints on the line, from 0.
    /// With other protocols they are ids on the bus.
    pub controllers: Vec<usize>,
    /// Angle of each joint when its encoder reads zero, rad.
    pub zero_offsets: Vec<f64>,
    /// Largest time constant with which the torque of a joint follows a command, s, of all joints
    /// with a motor.
    pub torque_lag: f64,
    /// Largest delay of a reported joint rate behind the true rate, s, of all joints. It is 2/w of
    /// a motor controller whose encoder filter has the natural frequency w, rad/s: the position
    /// that such a controller reports is (2 w s + w²)/(s + w)² of the true one, and the rate
    /// w²/(s + w)² of the true rate. A rate that is not filtered has the delay 0.
    pub rate_lag: f64,
    /// What `rate_estimate = "auto"` has picked. `None` if the rig file names the estimate, or if
    /// its inertias contradict each other. Then the rates are those of the motor controllers.
    pub rate_pick: Option<RatePick>,
    /// Rate of the control loop in ticks per second, 50 to 20000.
    pub rate_hz: u32,
    /// Largest lead, which is the time from the loop's wake-up to the deadline of a tick, ns. If 0,
    /// the loop sleeps until the deadline.
    pub early_ns: u64,
    /// Longest time that a processor can take to wake from sleep while the loop runs, us. `None` if
    /// the operating system decides.
    pub wake_us: Option<u32>,
    /// Index of the processor on which the loop's thread runs. `None` if the operating system
    /// chooses one.
    pub cpu: Option<u32>,
    /// Whether the torque is lowered if the sphere shakes by itself (see
    /// [`hbot_core::safety::shaking`]).
    pub shaking_guard: bool,
    /// Name of the preset of numerical methods: `fast`, `balanced` or `exact`. It is `custom` if
    /// the rig file names each method.
    pub accuracy: &'static str,
    /// Settings of the serial line to the motor controllers.
    pub link: LineConfig,
    /// Settings of the TCP service to which clients connect.
    pub api: ApiConfig,
}

/// Settings of the serial line to the motor controllers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LineConfig {
    /// Where the motor controllers are connected: in the simulated rig, or at serial devices.
    pub port: Port,
    /// Protocol that the motor controllers use.
    pub protocol: Protocol,
    /// Bits per second on the line. Each byte takes ten bits.
    pub baud: u32,
    /// Watchdog time of the motor controllers, ms. A motor controller switches its motors off if no
    /// command arrives for this time. At least two loop periods.
    pub watchdog_ms: u16,
    /// Largest legal age of the newest reading from the motor controllers, in ticks. An older one
    /// causes the fault `link_lost`.
    pub timeout_ticks: u32,
}

impl LineConfig {
    /// Returns the share of the line's capacity that is used in one direction if each tick sends a
    /// frame of `frame_bytes` bytes. A value above 1 means that the frames do not fit.
    #[must_use]
    pub fn load(&self, frame_bytes: usize, rate_hz: u32) -> f64 {
        /// Bits on the line for one byte: one start bit, eight data bits and one stop bit.
        const BITS_A_BYTE: f64 = 10.0;
        frame_bytes as f64 * BITS_A_BYTE * f64::from(rate_hz) / f64::from(self.baud)
    }
}

/// Where the motor controllers are connected: in the simulated rig, or at serial devices.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum Port {
    /// In the simulated rig, which shares its time with the control loop.
    Sim,
    /// In the simulated rig behind a pseudo-terminal, which runs in wall-clock time like a real
    /// one.
    SimPty,
    /// Paths of the serial devices, such as `/dev/ttyACM0`. There is at least one.
    Devices(Vec<String>),
}

impl Port {
    /// Returns whether the motor controllers are simulated.
    #[must_use]
    pub fn is_simulated(&self) -> bool {
        matches!(self, Self::Sim | Self::SimPty)
    }
}

impl From<&str> for Port {
    fn from(name: &str) -> Self {
        match name {
            "sim" => Self::Sim,
            "sim:pty" => Self::SimPty,
            _ => Self::Devices(vec![name.to_owned()]),
        }
    }
}

impl fmt::Display for Port {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Sim => f.write_str("sim"),
            Self::SimPty => f.write_str("sim:pty"),
            Self::Devices(paths) => f.write_str(&paths.join(", ")),
        }
    }
}

/// Settings of the TCP service to which clients connect.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ApiConfig {
    /// Address and port at which clients connect to the service.
    pub listen: SocketAddr,
    /// File with the token that clients must present. `None` if no token is needed.
    pub token_file: Option<PathBuf>,
    /// Certificate and key for encryption. `None` for TCP without encryption.
    pub tls: Option<TlsFiles>,
    /// What happens to the commands of the lease holder (the client that can command) if its
    /// connection ends without a release.
    pub on_client_lost: OnClientLost,
}

/// Paths of the certificate and key that encrypt the service. Both files are in PEM format.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TlsFiles {
    /// File with the server's certificate, followed by any intermediate certificates.
    pub certificate: PathBuf,
    /// File with the private key of the server's certificate.
    pub key: PathBuf,
}

impl ApiConfig {
    /// Returns whether clients need a token: they do if other machines can reach the service's
    /// address.
    #[must_use]
    pub fn needs_token(&self) -> bool {
        !self.listen.ip().is_loopback()
    }
}

/// A command line option that replaces one value of the rig file.
#[derive(Debug, Clone, PartialEq)]
pub struct Override {
    /// Path of the key that is replaced, such as `loop.rate_hz`.
    pub path: &'static str,
    /// The new value, in the form in which the rig file would contain it.
    pub value: Value,
    /// Name of the option in error messages, such as `--rate`.
    pub from: &'static str,
}

impl RigConfig {
    /// Returns the rig of the paper's prototype, with simulated motors, as in
    /// `rigs/prototype.toml`.
    #[must_use]
    pub fn prototype() -> Self {
        // Tests ask for it some hundred thousand times.
        static READ: LazyLock<RigConfig> = LazyLock::new(|| {
            RigConfig::from_toml(PROTOTYPE, "rigs/prototype.toml").unwrap_or_else(|mistakes| {
                panic!("the rig file that is built in is legal, by test:\n{mistakes}")
            })
        });
        READ.clone()
    }

    /// Reads a rig from the text of a rig file. `file` is the name of the file in messages.
    ///
    /// # Errors
    /// Fails if the text is not a legal rig file. The error lists every mistake.
    pub fn from_toml(text: &str, file: &str) -> Result<Self, Diagnostics> {
        Self::from_toml_with(text, file, &[])
    }

    /// Reads a rig from a rig file. Relative paths in its table `[api]` are relative to the folder
    /// of the rig file.
    ///
    /// # Errors
    /// Fails if the file cannot be read or is not legal. The error then lists every mistake.
    pub fn from_path(path: &Path) -> Result<Self, LoadError> {
        Self::load(Some(path), &[])
    }

    /// Reads a rig from a rig file, or the built-in prototype if `path` is `None`, and replaces
    /// some of its values. Defaults that depend on a replaced value change with it, such as the
    /// watchdog time, which depends on the port.
    ///
    /// # Errors
    /// Fails like [`from_path`](Self::from_path). The message about a replaced value that is not
    /// legal names its command line option.
    pub fn load(path: Option<&Path>, overrides: &[Override]) -> Result<Self, LoadError> {
        let Some(path) = path else {
            return Ok(Self::from_toml_with(PROTOTYPE, "rigs/prototype.toml", overrides)?);
        };
        let text = read_text(path).map_err(|source| LoadError::Read { path: path.to_owned(), source })?;
        let mut config = Self::from_toml_with(&text, &path.display().to_string(), overrides)?;
        let Some(folder) = path.parent() else { return Ok(config) };
        if let Some(token) = &mut config.api.token_file
            && !overrides.iter().any(|o| o.path == "api.token_file")
        {
            *token = folder.join(&*token);
        }
        if let Some(tls) = &mut config.api.tls {
            tls.certificate = folder.join(&tls.certificate);
            tls.key = folder.join(&tls.key);
        }
        Ok(config)
    }

    /// Reads a rig from the text of a rig file, and replaces some of its values. `file` is the name
    /// of the file in messages.
    ///
    /// # Errors
    /// Fails if the text or a replaced value is not legal. The error lists every mistake.
    pub fn from_toml_with(text: &str, file: &str, overrides: &[Override]) -> Result<Self, Diagnostics> {
        let mut document = Document::from_toml(text, file)?;
        for o in overrides {
            document.replace(o.path, o.value.clone(), o.from);
        }
        let Document { mut tree, mut report } = document;
        if refuse_scene(&tree, &mut report) {
            return report.finish(None);
        }
        to_radians(&SCHEMA, &mut tree, "", &mut report);
        validate(&SCHEMA, &mut tree, "", &mut report);
        // Each wheel is checked even if other parts of the file are not legal, so that all mistakes
        // are reported at once. If the protocol is not legal, nobody knows which keys a joint
        // needs, and only the protocol is reported.
        let protocol = match &tree["link"]["protocol"] {
            Value::Null => Some(Protocol::Hbot),
            name => Protocol::deserialize(name).ok(),
        };
        let is_formed = report.clean_under("");
        for (i, wheel) in tree["wheel"].as_array().into_iter().flatten().enumerate() {
            let path = format!("wheel[{i}]");
            if report.clean_under(&path)
                && let Some(wheel) = decode(wheel, &path, &mut report)
            {
                wheel::check_wheel(&wheel, protocol, &path, &mut report);
            }
        }
        let mut config = None;
        if is_formed && let Some(file) = decode(&tree, "", &mut report) {
            config = compile::compile(file, &mut report);
        }
        report.finish(config)
    }

    /// Returns the JSON schema of rig files, which editors can use. In addition to standard
    /// keywords it contains `unit`.
    #[must_use]
    pub fn schema() -> Value {
        SCHEMA.clone()
    }
}

/// Returns whether the file is a scene file, which a command line can confuse with a rig file. Then
/// adds a mistake to the report. The other mistakes of such a file would only hide this one.
fn refuse_scene(tree: &Value, report: &mut Report) -> bool {
    let has = |key: &str| tree.get(key).is_some();
    let Some(key) = ["effect", "simulate"].into_iter().find(|key| has(key)) else { return false };
    if has("sphere") || has("wheel") {
        return false;
    }
    let file = report.file().unwrap_or("FILE");
    let message = format!(
        "this is a scene file, not a rig file. `hbot server --scene {file}` starts with it, and `hbot scene load {file}` \
         loads it into a running server"
    );
    report.push_key(key, message, "a file with [sphere] and [[wheel]]".to_owned());
    true
}
