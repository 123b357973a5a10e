//! The stop line: a thread with a separate connection that is used only to stop the rig.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

use hbot_api::{Client, ClientError};

use super::mailbox::{Mailbox, Outgoing};
use super::session::{connect, in_words};
use super::{Intent, News, PanelOptions};

/// While no stop is requested, the stop line discards events and restores a lost connection at this
/// period.
const IDLE: Duration = Duration::from_millis(200);
/// Longest time to wait for the answer to a stop. A stop without an answer is reported as not
/// confirmed.
const TIMEOUT: Duration = Duration::from_secs(1);

pub(super) enum Order {
    Stop,
    Connect(String),
}

/// Starts the thread of the stop line. It lives as long as the sender that is returned.
pub(super) fn start(
    options: PanelOptions,
    mailbox: Arc<Mailbox>,
    outgoing: Arc<Outgoing>,
) -> std::io::Result<Sender<Order>> {
    let (orders, inbox) = channel();
    let name = "hbot-stop".to_owned();
    std::thread::Builder::new().name(name).spawn(move || run(options, &inbox, &mailbox, &outgoing))?;
    Ok(orders)
}

fn run(mut options: PanelOptions, inbox: &Receiver<Order>, mailbox: &Mailbox, outgoing: &Outgoing) {
    let mut client = None;
    let mut waiting = VecDeque::new();
    loop {
        match waiting.pop_front().map_or_else(|| inbox.recv_timeout(IDLE), Ok) {
            Ok(Order::Stop) => {
                // A key that is held down asks many times. One stop answers all of these requests,
                // up to a change of the server.
                waiting.extend(inbox.try_iter());
                while matches!(waiting.front(), Some(Order::Stop)) {
                    waiting.pop_front();
                }
                let result = estop(&mut client, &options, mailbox);
                if let Err(error) = &result {
                    client = None;
                    // The user may have chosen another server meanwhile, which must not be stopped.
                    waiting.extend(inbox.try_iter());
                    let elsewhere = waiting.iter().any(|order| matches!(order, Order::Connect(_)));
                    if !matches!(error, ClientError::NoServer { .. }) && !elsewhere {
                        // Also try the session's connection, as soon as it gets through.
                        outgoing.push_first(Intent::Stop);
                    }
                }
                let result = result.map_err(|error| {
                    let why = in_words(&error);
                    format!("the server has not confirmed the stop ({why})")
                });
                mailbox.post(News::Stop { server: options.server.clone(), result });
            }
            Ok(Order::Connect(address)) => {
                options.server = address;
                client = None;
            }
            Err(RecvTimeoutError::Timeout) => {
                if client.as_mut().is_none_or(|client| !drain(client)) {
                    client = open(&options, mailbox).ok();
                }
            }
            Err(RecvTimeoutError::Disconnected) => return,
        }
    }
}

/// Opens a connection for stops, and reports its number to the window.
fn open(options: &PanelOptions, mailbox: &Mailbox) -> Result<Client, ClientError> {
    let mut client = connect(options)?;
    client.set_timeout(TIMEOUT);
    mailbox.post(News::StopLine(client.hello().session));
    Ok(client)
}

/// Sends an emergency stop to the server over `client`, or over a new connection if that is broken.
fn estop(client: &mut Option<Client>, options: &PanelOptions, mailbox: &Mailbox) -> Result<(), ClientError> {
    if let Some(client) = client.as_mut() {
        match client.estop() {
            Err(ClientError::Closed | ClientError::Io(_)) => {}
            result => return result.map(drop),
        }
    }
    client.insert(open(options, mailbox)?).estop().map(drop)
}

/// Discards the events that have arrived. Returns false if the connection has ended.
fn drain(client: &mut Client) -> bool {
    loop {
        match client.next_event(Duration::ZERO) {
            Ok(Some(_)) => {}
            Ok(None) | Err(ClientError::Server(_)) => return true,
            Err(_) => return false,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::net::TcpListener;
    use std::time::Instant;

    use super::*;

    #[test]
    fn a_stop_that_waits_goes_to_the_server_for_which_it_was_asked() {
        let first = TcpListener::bind(("127.0.0.1", 0)).expect("a port");
        let second = TcpListener::bind(("127.0.0.1", 0)).expect("a port");
        let address = |listener: &TcpListener| listener.local_addr().expect("an address").to_string();
        let options = PanelOptions::new(&address(&first));
        let (orders, inbox) = channel();
        // Both orders wait when the thread looks for the first.
        orders.send(Order::Stop).expect("a thread to come");
        orders.send(Order::Connect(address(&second))).expect("a thread to come");
        let (mailbox, outgoing) = (Mailbox::new(Arc::new(|| {})), Outgoing::default());
        let line = std::thread::spawn(move || run(options, &inbox, &mailbox, &outgoing));
        first.set_nonblocking(true).expect("a socket");
        let until = Instant::now() + Duration::from_secs(60);
        let asked = loop {
            match first.accept() {
                Ok((stream, _)) => break stream,
                Err(error) => assert!(Instant::now() < until, "the first server was not asked: {error}"),
            }
            std::thread::sleep(Duration::from_millis(5));
        };
        drop(asked);
        second.accept().expect("the line to the second server");
        drop((orders, first, second));
        line.join().expect("an end");
    }
}
