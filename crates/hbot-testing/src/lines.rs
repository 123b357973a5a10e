//! A client that sends JSON by hand, line by line.

use std::io::{BufRead as _, BufReader, ErrorKind, Read as _, Write as _};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Instant;

use serde_json::Value;

use crate::patience::PATIENCE;

/// A connection over which bytes are sent as they stand.
pub struct JsonLines {
    /// The socket.
    pub stream: TcpStream,
    /// What comes over it.
    pub reader: BufReader<TcpStream>,
}

impl JsonLines {
    /// Connects, and says nothing yet.
    ///
    /// # Panics
    /// If nobody listens there.
    #[must_use]
    pub fn connect(address: impl ToSocketAddrs) -> Self {
        let stream = TcpStream::connect(address).expect("the server listens");
        stream.set_read_timeout(Some(PATIENCE)).expect("a socket");
        stream.set_nodelay(true).expect("a socket");
        let reader = BufReader::new(stream.try_clone().expect("a socket"));
        Self { stream, reader }
    }

    /// Connects and says hello.
    ///
    /// # Panics
    /// If the answer is not that of an hbot server.
    #[must_use]
    pub fn greeted(address: impl ToSocketAddrs) -> Self {
        let mut lines = Self::connect(address);
        let hello = lines.ask(r#"{"id": 0, "op": "hello", "version": 1, "name": "a test"}"#);
        assert!(hello["ok"]["server"].as_str().is_some_and(|s| s.starts_with("hbot")), "{hello}");
        lines
    }

    /// Sends bytes.
    ///
    /// # Panics
    /// If the connection is closed.
    pub fn bytes(&mut self, bytes: &[u8]) {
        self.stream.write_all(bytes).expect("sent");
    }

    /// Sends a line.
    ///
    /// # Panics
    /// If the connection is closed.
    pub fn send(&mut self, line: &str) {
        self.bytes(format!("{line}\n").as_bytes());
    }

    /// The next line, `None` if the server has closed the connection.
    ///
    /// # Panics
    /// If no line comes within [`PATIENCE`], or one that is not JSON.
    pub fn next_line(&mut self) -> Option<Value> {
        let mut line = String::new();
        match self.reader.read_line(&mut line) {
            Ok(0) => None,
            Ok(_) => Some(serde_json::from_str(&line).unwrap_or_else(|error| panic!("{line:?}: {error}"))),
            Err(error) if error.kind() == ErrorKind::ConnectionReset => None,
            Err(error) => panic!("no line within {PATIENCE:?}: {error}"),
        }
    }

    /// The next line.
    ///
    /// # Panics
    /// If the server has closed the connection.
    pub fn line(&mut self) -> Value {
        self.next_line().expect("the connection stays")
    }

    /// The next line that `found` accepts; those before it are dropped.
    ///
    /// # Panics
    /// If none comes within [`PATIENCE`].
    pub fn until(&mut self, mut found: impl FnMut(&Value) -> bool) -> Value {
        let start = Instant::now();
        let mut last = Value::Null;
        while start.elapsed() < PATIENCE {
            last = self.line();
            if found(&last) {
                return last;
            }
        }
        panic!("it did not come within {PATIENCE:?}; the last that came: {last}");
    }

    /// The next answer; events before it are dropped.
    pub fn answer(&mut self) -> Value {
        self.until(|value| value.get("event").is_none())
    }

    /// Sends a request and waits for its answer.
    pub fn ask(&mut self, line: &str) -> Value {
        self.send(line);
        self.answer()
    }

    /// The next state event for which `ready` holds.
    pub fn state(&mut self, mut ready: impl FnMut(&Value) -> bool) -> Value {
        self.until(|value| value["event"] == "state" && ready(value))
    }

    /// Everything until the server closes.
    ///
    /// # Panics
    /// If that is not UTF-8.
    pub fn rest(&mut self) -> String {
        let mut rest = Vec::new();
        // A reset is an end as well.
        let _ = self.reader.read_to_end(&mut rest);
        String::from_utf8(rest).expect("UTF-8")
    }
}

/// Three numbers of a state.
///
/// # Panics
/// If they are none.
#[must_use]
pub fn vector(value: &Value) -> [f64; 3] {
    std::array::from_fn(|i| value[i].as_f64().expect("a number"))
}

/// The length of three numbers of a state.
#[must_use]
pub fn norm(value: &Value) -> f64 {
    vector(value).iter().map(|x| x * x).sum::<f64>().sqrt()
}
