//! A client that sends and receives JSON line by line, without the client library.

use std::io::{BufRead as _, BufReader, ErrorKind, Read as _, Write as _};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Instant;

use serde_json::Value;

use crate::patience::PATIENCE;

/// A TCP connection to an hbot server over which a test sends JSON text line by line, without the
/// client library. A test can also send invalid bytes.
pub struct JsonLines {
    /// Socket over which the test sends.
    pub stream: TcpStream,
    /// Buffered reader of the bytes that the server sends.
    pub reader: BufReader<TcpStream>,
}

impl JsonLines {
    /// Connects to the server at `address` and sends nothing yet.
    pub fn connect(address: impl ToSocketAddrs) -> Self {
        let stream = TcpStream::connect(address).expect("the server listens");
        stream.set_read_timeout(Some(PATIENCE)).expect("a socket");
        stream.set_nodelay(true).expect("a socket");
        let reader = BufReader::new(stream.try_clone().expect("a socket"));
        Self { stream, reader }
    }

    /// Connects to the server at `address`, sends the `hello` request and checks the answer.
    pub fn greeted(address: impl ToSocketAddrs) -> Self {
        let mut lines = Self::connect(address);
        let hello = lines.ask(r#"{"id": 0, "op": "hello", "version": 1, "name": "a test"}"#);
        assert!(hello["ok"]["server"].as_str().is_some_and(|s| s.starts_with("hbot")), "{hello}");
        lines
    }

    /// Sends `bytes` unchanged, without a line break.
    pub fn bytes(&mut self, bytes: &[u8]) {
        self.stream.write_all(bytes).expect("sent");
    }

    /// Sends `line`, followed by a line break.
    pub fn send(&mut self, line: &str) {
        self.bytes(format!("{line}\n").as_bytes());
    }

    /// Waits for the next line from the server and returns it as JSON. Returns `None` if the server
    /// has closed the connection.
    pub fn next_line(&mut self) -> Option<Value> {
        let mut line = String::new();
        match self.reader.read_line(&mut line) {
            Ok(0) => None,
            Ok(_) => Some(serde_json::from_str(&line).unwrap_or_else(|error| panic!("{line:?}: {error}"))),
            Err(error) if error.kind() == ErrorKind::ConnectionReset => None,
            Err(error) => panic!("no line within {PATIENCE:?}: {error}"),
        }
    }

    /// Waits for the next line from the server and returns it as JSON.
    pub fn line(&mut self) -> Value {
        self.next_line().expect("the connection stays")
    }

    /// Reads lines from the server until `found` accepts one, and returns that line. Drops the
    /// lines before it.
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

    /// Returns the server's next answer to a request. Drops the events that arrive before it.
    pub fn answer(&mut self) -> Value {
        self.until(|value| value.get("event").is_none())
    }

    /// Sends the request `line` and returns the server's answer. Drops the events that arrive
    /// before it.
    pub fn ask(&mut self, line: &str) -> Value {
        self.send(line);
        self.answer()
    }

    /// Returns the next state event that `ready` accepts. Drops all lines before it.
    pub fn state(&mut self, mut ready: impl FnMut(&Value) -> bool) -> Value {
        self.until(|value| value["event"] == "state" && ready(value))
    }

    /// Returns all text that the server sends until it closes the connection.
    pub fn rest(&mut self) -> String {
        let mut rest = Vec::new();
        // An error, such as a reset of the connection, also ends the text.
        let _ = self.reader.read_to_end(&mut rest);
        String::from_utf8(rest).expect("UTF-8")
    }
}

/// Converts a JSON array from a state, such as the torque, to a vector of three numbers.
pub fn vector(value: &Value) -> [f64; 3] {
    std::array::from_fn(|i| value[i].as_f64().expect("a number"))
}

/// Returns the length of a vector that a state holds as a JSON array of three numbers.
pub fn norm(value: &Value) -> f64 {
    vector(value).iter().map(|x| x * x).sum::<f64>().sqrt()
}
