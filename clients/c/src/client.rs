//! Connecting and closing, and the client behind its handle.

use std::collections::VecDeque;
use std::ffi::{CString, c_char};
use std::path::Path;
use std::sync::{Mutex, TryLockError};
use std::time::Duration;

use hbot_api::{Client, ConnectOptions, Encoding, Event, StateEvent, Trust};

use crate::boundary::{Out, guarded, input, optional_text, text};
use crate::status::{Failure, HbotStatus};

/// A connection to a server.
///
/// Opaque: a program only has a pointer to it.
pub struct HbotClient {
    inner: Mutex<Inner>,
}

/// What belongs to one connection.
pub(crate) struct Inner {
    pub(crate) client: Client,
    /// States that arrived while the program waited for another event.
    pub(crate) states: VecDeque<StateEvent>,
    /// Events other than states that arrived while the program waited for a state.
    pub(crate) notices: VecDeque<Event>,
    /// Events that were dropped because one of the queues was full.
    pub(crate) lost: u64,
    /// The last text that was given to the program. It lives until the next one.
    pub(crate) text: CString,
}

/// The encoding of messages.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub enum HbotEncoding {
    /// Lines of JSON.
    Json = 0,
    /// MessagePack: shorter, and quicker to read.
    Msgpack = 1,
}

/// Options of hbot_connect(). A field that is 0 or NULL has its default.
#[repr(C)]
#[derive(Debug)]
pub struct HbotOptions {
    /// Name of the client, shown to people. Default: "c".
    pub name: *const c_char,
    /// The server's token. Default: none.
    pub token: *const c_char,
    /// PEM file with the server's certificate, or with that of its authority. With a file the
    /// connection is encrypted; without one, connecting to a server that encrypts fails.
    pub ca_file: *const c_char,
    /// One of hbot_encoding. Default: JSON.
    pub encoding: u32,
    /// Longest time for connecting, and later for each answer, ms. Default: 5000.
    pub timeout_ms: u32,
}

/// Connects to the server at `address`: HOST or HOST:PORT, as "127.0.0.1:4268". `options` can be
/// NULL. On success `*client` is the new client, which hbot_close() ends.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_connect(
    address: *const c_char,
    options: *const HbotOptions,
    client: *mut *mut HbotClient,
) -> HbotStatus {
    guarded(|| {
        // SAFETY: the contract of all functions, stated at the crate.
        let (address, out) = unsafe { (text(address, "address")?, Out::new(client, "client")?) };
        // SAFETY: as above.
        let options = unsafe { read(options) }?;
        let client = Client::connect_with(address, &options)?;
        let inner = Inner {
            client,
            states: VecDeque::new(),
            notices: VecDeque::new(),
            lost: 0,
            text: CString::default(),
        };
        out.write(Box::into_raw(Box::new(HbotClient { inner: Mutex::new(inner) })));
        Ok(HbotStatus::Ok)
    })
}

/// Converts the options of a program.
///
/// # Safety
/// `options` is null or obeys the contract of the crate, and so do the texts in it.
unsafe fn read(options: *const HbotOptions) -> Result<ConnectOptions, Failure> {
    if options.is_null() {
        return Ok(ConnectOptions::new("c"));
    }
    // SAFETY: the caller promises that it points to options.
    let given = unsafe { input(options, "options") }?;
    // SAFETY: the caller promises that they are texts or null.
    let [name, token, ca_file] = unsafe {
        [
            optional_text(given.name, "name")?,
            optional_text(given.token, "token")?,
            optional_text(given.ca_file, "ca_file")?,
        ]
    };
    let mut options = ConnectOptions::new(name.unwrap_or("c"));
    options.token = token.map(|token| token.to_owned().into());
    options.trust = ca_file.map(|file| Trust::from_file(Path::new(file))).transpose()?;
    options.encoding = match given.encoding {
        0 => Encoding::Json,
        1 => Encoding::Msgpack,
        other => return Err(Failure::argument(format!("encoding is {other}; legal: 0 and 1"))),
    };
    if given.timeout_ms > 0 {
        options.timeout = Duration::from_millis(given.timeout_ms.into());
    }
    Ok(options)
}

/// Ends a connection and frees the client. The lease is given back, and a stream goes to zero. NULL
/// is ignored. Fails with HBOT_STATUS_IN_USE, and closes nothing, during another call with it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_close(client: *mut HbotClient) -> HbotStatus {
    if client.is_null() {
        return HbotStatus::Ok;
    }
    // SAFETY: the contract of all functions. The closure does nothing but see that no call runs; a
    // client that has failed by a defect can be closed.
    let idle = unsafe { with(client, |_| Ok(HbotStatus::Ok)) };
    if idle == HbotStatus::InUse {
        return idle;
    }
    guarded(|| {
        // SAFETY: it came from `Box::into_raw` in hbot_connect, and the program promises that this
        // is the last call with it.
        drop(unsafe { Box::from_raw(client) });
        Ok(HbotStatus::Ok)
    })
}

/// Sets the longest time that a call waits for its answer, ms, at least 1.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_set_timeout(client: *mut HbotClient, timeout_ms: u32) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe {
        with(client, |inner| {
            if timeout_ms == 0 {
                return Err(Failure::argument("timeout_ms is 0; legal: from 1"));
            }
            inner.client.set_timeout(Duration::from_millis(timeout_ms.into()));
            Ok(HbotStatus::Ok)
        })
    }
}

/// Runs the body of a function that uses a client.
///
/// # Safety
/// `client` is null or came from hbot_connect and was not closed.
pub(crate) unsafe fn with(
    client: *mut HbotClient,
    body: impl FnOnce(&mut Inner) -> Result<HbotStatus, Failure>,
) -> HbotStatus {
    guarded(|| {
        // SAFETY: the caller promises a client that lives during the call.
        let client = unsafe { input(client, "client") }?;
        match client.inner.try_lock() {
            Ok(mut inner) => body(&mut inner),
            Err(TryLockError::WouldBlock) => Err(Failure::new(
                HbotStatus::InUse,
                "another call with this client is running: use one client for each thread, and none in its own callback",
            )),
            Err(TryLockError::Poisoned(_)) => Err(Failure::new(
                HbotStatus::Panic,
                "an earlier call with this client met a defect of the library: close it",
            )),
        }
    })
}
