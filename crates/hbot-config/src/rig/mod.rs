//! The rig file: what the device is, how it is reached, and what it must not do.

mod compile;
mod file;
mod methods;
mod settings;

use std::fmt;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use hbot_core::inputs::OnClientLost;
use hbot_core::rig::Rig;
use serde::Deserialize as _;
use serde_json::Value;

pub use self::settings::Protocol;
use crate::decode::decode;
use crate::diagnostic::{Diagnostics, LoadError};
use crate::document::Document;
use crate::schema;
use crate::text::read_text;
use crate::validate::validate;

/// The rig file that is built in.
const PROTOTYPE: &str = include_str!("../../../../rigs/prototype.toml");

static SCHEMA: LazyLock<Value> = LazyLock::new(schema::of::<file::RigFile>);

/// A legal rig: its geometry has been checked over all steering angles, every figure is in range.
#[derive(Debug, Clone, PartialEq)]
pub struct RigConfig {
    /// What people call the rig.
    pub name: String,
    /// What the controller needs to know.
    pub rig: Rig,
    /// What people call the wheels, in their order.
    pub wheels: Vec<String>,
    /// For each joint (steer, drive of each wheel) the serial line that carries it.
    pub ports: Vec<usize>,
    /// For each joint its controller on that line: those of one line differ. With hbot's own protocol positions, a permutation of
    /// 0..n of the joints there; with the others ids on the bus.
    pub controllers: Vec<usize>,
    /// For each joint its angle where its encoder says zero, rad.
    pub zero_offsets: Vec<f64>,
    /// Ticks a second, 50 to 20000.
    pub rate_hz: u32,
    /// How long before a tick's deadline the loop wakes at most, ns; 0: it sleeps until the deadline.
    pub early_ns: u64,
    /// How long a processor may take to wake while the loop runs, us; `None` where that is left to the system.
    pub wake_us: Option<u32>,
    /// The processor that the loop's thread stays on; `None` where the system chooses.
    pub cpu: Option<u32>,
    /// The preset of methods: `fast`, `balanced`, `exact`, or `custom` where the file names each.
    pub accuracy: &'static str,
    /// The serial line.
    pub link: LinkConfig,
    /// The TCP service.
    pub api: ApiConfig,
}

/// The serial line to the motor controllers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LinkConfig {
    /// Where the controllers are.
    pub port: Port,
    /// What they speak.
    pub protocol: Protocol,
    /// Bits a second on the line, of which a byte takes ten.
    pub baud: u32,
    /// How long a controller holds a command that no other follows, ms; at least two loop periods.
    pub watchdog_ms: u16,
    /// Ticks without feedback until the fault link_lost.
    pub timeout_ticks: u32,
}

impl LinkConfig {
    /// The share of the line, in one direction, that a frame of `frame_bytes` each tick takes; above 1 it does not fit.
    #[must_use]
    pub fn load(&self, frame_bytes: usize, rate_hz: u32) -> f64 {
        /// Start bit, eight bits, stop bit.
        const BITS_A_BYTE: f64 = 10.0;
        frame_bytes as f64 * BITS_A_BYTE * f64::from(rate_hz) / f64::from(self.baud)
    }
}

/// Where the controllers are.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum Port {
    /// The simulated rig.
    Sim,
    /// Serial devices, such as `/dev/ttyACM0`; at least one.
    Devices(Vec<String>),
}

impl From<&str> for Port {
    fn from(name: &str) -> Self {
        if name == "sim" { Self::Sim } else { Self::Devices(vec![name.to_owned()]) }
    }
}

impl fmt::Display for Port {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Sim => f.write_str("sim"),
            Self::Devices(paths) => f.write_str(&paths.join(", ")),
        }
    }
}

/// The TCP service.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ApiConfig {
    /// Where to listen.
    pub listen: SocketAddr,
    /// The file that holds the token, where one is asked for.
    pub token_file: Option<PathBuf>,
    /// What the service shows of itself where it is encrypted; `None` for plain TCP.
    pub tls: Option<TlsFiles>,
    /// What happens to the holder's commands when its connection ends without a release.
    pub on_client_lost: OnClientLost,
}

/// The files of an encrypted service, in PEM.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TlsFiles {
    /// The server's certificate, then those between it and an authority.
    pub certificate: PathBuf,
    /// Its private key.
    pub key: PathBuf,
}

impl ApiConfig {
    /// Whether others than programs on this machine can reach the service, so that it needs a token.
    #[must_use]
    pub fn needs_token(&self) -> bool {
        !self.listen.ip().is_loopback()
    }
}

/// A value that the command line puts in place of the file's.
#[derive(Debug, Clone, PartialEq)]
pub struct Override {
    /// Which key, such as `loop.rate_hz`.
    pub path: &'static str,
    /// Its value, as the file would have it.
    pub value: Value,
    /// What to name in messages, such as `--rate`.
    pub from: &'static str,
}

impl RigConfig {
    /// The prototype of the paper, behind the simulated port; the same as `rigs/prototype.toml`.
    #[must_use]
    pub fn prototype() -> Self {
        Self::from_toml(PROTOTYPE, "rigs/prototype.toml")
            .unwrap_or_else(|mistakes| panic!("the rig file that is built in is legal, by test:\n{mistakes}"))
    }

    /// A rig from the text of its file; `file` is its name in messages.
    ///
    /// # Errors
    /// Everything that is wrong with it.
    pub fn from_toml(text: &str, file: &str) -> Result<Self, Diagnostics> {
        Self::from_toml_with(text, file, &[])
    }

    /// A rig from its file. Relative paths in `[api]` are taken from the folder of the rig file.
    ///
    /// # Errors
    /// The file cannot be read, or everything that is wrong with it.
    pub fn from_path(path: &Path) -> Result<Self, LoadError> {
        Self::load(Some(path), &[])
    }

    /// The rig of a file, or the prototype without one, with some values replaced. What depends on them (the default watchdog
    /// of a port, say) follows.
    ///
    /// # Errors
    /// As [`from_path`](Self::from_path); a replaced value that is not legal is reported under its option's name.
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

    /// A rig from the text of its file with some values replaced.
    ///
    /// # Errors
    /// Everything that is wrong with it.
    pub fn from_toml_with(text: &str, file: &str, overrides: &[Override]) -> Result<Self, Diagnostics> {
        let mut document = Document::from_toml(text, file)?;
        for o in overrides {
            document.replace(o.path, o.value.clone(), o.from);
        }
        let Document { tree, mut report } = document;
        validate(&SCHEMA, &tree, "", &mut report);
        // Each wheel is checked even where other parts are not legal, so that all its mistakes are told at once.
        let protocol = Protocol::deserialize(&tree["link"]["protocol"]).unwrap_or(Protocol::Hbot);
        for (i, wheel) in tree["wheel"].as_array().into_iter().flatten().enumerate() {
            let path = format!("wheel[{i}]");
            if report.clean_under(&path)
                && let Some(wheel) = decode(wheel, &path, &mut report)
            {
                compile::check_wheel(&wheel, protocol, &path, &mut report);
            }
        }
        let mut config = None;
        if report.clean_under("")
            && let Some(file) = decode(&tree, "", &mut report)
        {
            config = compile::compile(file, &mut report);
        }
        report.finish(config)
    }

    /// The JSON schema of rig files, for editors. Besides standard keywords: `unit`.
    #[must_use]
    pub fn schema() -> Value {
        SCHEMA.clone()
    }
}
