//! The session thread. It keeps a connection to the server, sends requests in order, and passes
//! events on as they come.

use std::time::{Duration, Instant};

use hbot_api::{
    Client, ClientError, ConnectOptions, Encoding, ErrorCode, Event, HandCommand, HandHold, LeaseEvent,
    LeaseInfo, Requester,
};
use serde_json::Map;

use super::mailbox::{Mailbox, Outgoing};
use super::{ANSWER_TIMEOUT, Intent, Lease, News, PanelOptions};

/// Pause after the first failed attempt to connect. It doubles with each further failure.
const FIRST_PAUSE: Duration = Duration::from_millis(250);
/// Longest pause between two attempts to connect.
const LONGEST_PAUSE: Duration = Duration::from_secs(2);
/// Time between two requests for the statistics of the control loop.
const STATS_EVERY: Duration = Duration::from_secs(1);
/// Time between two requests for what the motor controllers report about themselves.
const CONTROLLERS_EVERY: Duration = Duration::from_secs(1);
/// Time in which the simulated hand follows the pointer, ms. It is some frames of the window, so
/// that the hand moves evenly.
const HAND_MS: u64 = 50;
/// Pause after a request for `info` that failed.
const INFO_AGAIN: Duration = Duration::from_secs(1);
/// Longest time to wait for an event from the server before the next request of the user is sent.
const IDLE: Duration = Duration::from_millis(5);

/// Why a connection to the server has ended.
enum Over {
    /// The window has been closed.
    Window,
    /// The user wants to connect to another server.
    Elsewhere,
    /// The connection broke, or the server stopped or refused it, or no server is running there.
    Lost { why: String, absent: bool },
}

pub(super) fn run(mut options: PanelOptions, outgoing: &Outgoing, mailbox: &Mailbox) {
    let mut pause = FIRST_PAUSE;
    let mut released = None;
    loop {
        mailbox.post(News::Connecting);
        let over = match connect(&options) {
            Ok(client) => {
                pause = FIRST_PAUSE;
                Session::new(client, &mut options, &mut released, outgoing, mailbox).run()
            }
            Err(error) => {
                let absent = matches!(error, ClientError::NoServer { .. });
                Over::Lost { why: advised(&error), absent }
            }
        };
        match over {
            Over::Window => return,
            Over::Elsewhere => pause = FIRST_PAUSE,
            Over::Lost { why, absent } => {
                mailbox.post(News::Offline { why, absent, again_in: pause });
                if !wait(pause, &mut options, outgoing, mailbox) {
                    return;
                }
                pause = (2 * pause).min(LONGEST_PAUSE);
            }
        }
    }
}

pub(super) fn connect(options: &PanelOptions) -> Result<Client, ClientError> {
    let connect = ConnectOptions {
        token: options.token.clone(),
        encoding: Encoding::Msgpack,
        trust: options.trust.clone(),
        timeout: ANSWER_TIMEOUT,
        ..ConnectOptions::new(&options.name)
    };
    Client::connect_with(&options.server, &connect)
}

/// Explains an error to a person. How to start a server is not a part of it: the middle of the
/// window says so, and the explanation also appears where a rig may not have stopped.
pub(super) fn in_words(error: &ClientError) -> String {
    match error {
        ClientError::Tls(_) => format!("{error} (hbot-gui --ca FILE)"),
        ClientError::Timeout { after, .. } => format!("no answer within {} s", after.as_secs_f64()),
        ClientError::Server(body) => body.reason().to_owned(),
        ClientError::NoServer { .. } => "nobody listens there: connection refused".to_owned(),
        _ => error.to_string(),
    }
}

/// Explains an error, and says what to do about a server that does not answer.
fn advised(error: &ClientError) -> String {
    match error {
        ClientError::Timeout { after, .. } => format!(
            "the server has not answered within {} s; look whether it runs, and whether the network reaches it",
            after.as_secs_f64()
        ),
        _ => in_words(error),
    }
}

/// Waits until the next attempt to connect. Returns early if the user wants another server. Returns
/// false if the window has been closed.
fn wait(pause: Duration, options: &mut PanelOptions, outgoing: &Outgoing, mailbox: &Mailbox) -> bool {
    let until = Instant::now() + pause;
    while Instant::now() < until {
        if outgoing.is_closed() {
            return false;
        }
        match outgoing.pop() {
            Some(Intent::Connect(address)) => {
                options.server = address;
                return true;
            }
            Some(Intent::Samples(n)) => options.samples_per_s = n,
            Some(intent) => {
                let result = Err("there is no connection to a server".to_owned());
                mailbox.post(answer(intent, result, &options.server));
            }
            None => std::thread::sleep(Duration::from_millis(20)),
        }
    }
    true
}

/// Returns the news of the result of a request to the server at the address `server`.
fn answer(intent: Intent, result: Result<(), String>, server: &str) -> News {
    match intent {
        Intent::Stop => News::Stop { server: server.to_owned(), result },
        intent => News::Answer { intent, result },
    }
}

struct Session<'a> {
    client: Client,
    options: &'a mut PanelOptions,
    /// Address of the server at which the user has released the lease. A new connection there does
    /// not take it again.
    released: &'a mut Option<String>,
    outgoing: &'a Outgoing,
    mailbox: &'a Mailbox,
    lease: Lease,
    stats_due: Instant,
    /// When to ask for `info`. `None` while the panel knows the rig and the running scene.
    info_due: Option<Instant>,
    /// `None` if the server does not know the request, because it is older than this panel.
    controllers_due: Option<Instant>,
}

impl<'a> Session<'a> {
    fn new(
        client: Client,
        options: &'a mut PanelOptions,
        released: &'a mut Option<String>,
        outgoing: &'a Outgoing,
        mailbox: &'a Mailbox,
    ) -> Self {
        let now = Instant::now();
        mailbox.post(News::Connected(client.hello().clone()));
        Self {
            client,
            options,
            released,
            outgoing,
            mailbox,
            lease: Lease::Unknown,
            stats_due: now,
            info_due: Some(now),
            controllers_due: Some(now),
        }
    }

    fn run(mut self) -> Over {
        let over = self.begin().and_then(|()| self.serve());
        over.unwrap_or_else(|error| Over::Lost { why: advised(&error), absent: false })
    }

    fn begin(&mut self) -> Result<(), ClientError> {
        self.poll()?;
        if !self.options.observe && self.released.as_ref() != Some(&self.options.server) {
            self.acquire(false).or_else(survivable)?;
        }
        self.subscribe().or_else(survivable)
    }

    fn serve(&mut self) -> Result<Over, ClientError> {
        loop {
            if self.outgoing.is_closed() {
                if self.lease == Lease::Mine {
                    self.client.release()?;
                }
                return Ok(Over::Window);
            }
            while let Some(intent) = self.outgoing.pop() {
                if let Intent::Connect(address) = intent {
                    self.options.server = address;
                    return Ok(Over::Elsewhere);
                }
                self.carry_out(intent)?;
            }
            self.poll()?;
            if let Some(event) = self.client.next_event(IDLE)? {
                if let Event::Stopping(stopping) = event {
                    return Ok(Over::Lost { why: stopping.message, absent: false });
                }
                self.event(event);
            }
        }
    }

    /// Carries out a request of the user and reports the result to the window. Returns an error
    /// only if the connection is no longer usable.
    fn carry_out(&mut self, intent: Intent) -> Result<(), ClientError> {
        let result = self.ask(&intent);
        let told = result.as_ref().copied().map_err(|error| match error {
            ClientError::Server(_) => error.to_string(),
            _ => advised(error),
        });
        self.mailbox.post(answer(intent, told, &self.options.server));
        result.or_else(survivable)
    }

    fn ask(&mut self, intent: &Intent) -> Result<(), ClientError> {
        let commands = matches!(
            intent,
            Intent::Enable
                | Intent::Reset
                | Intent::Recover
                | Intent::Set { .. }
                | Intent::Load { .. }
                | Intent::Hand(Some(_))
        );
        // A request that needs the lease takes it if it may be free. If another client holds it,
        // the server refuses with that reason. A panel that only watches never takes it like this.
        if commands && !self.options.observe && matches!(self.lease, Lease::Free | Lease::Unknown) {
            self.acquire(false)?;
            let text = format!("you command now, because of {:?}", intent.name());
            self.mailbox.post(News::Note(Ok(text)));
        }
        match intent {
            Intent::Stop => self.client.estop().map(drop),
            Intent::Enable => self.client.enable().map(drop),
            Intent::Disable => self.client.disable().map(drop),
            Intent::Reset => self.client.reset().map(drop),
            // A stop between the two makes the server refuse the second.
            Intent::Recover => self.client.reset().and_then(|_| self.client.enable()).map(drop),
            Intent::Acquire { steal } => self.acquire(*steal),
            Intent::Release => {
                self.client.release()?;
                *self.released = Some(self.options.server.clone());
                self.tell_lease(Lease::Free);
                Ok(())
            }
            Intent::Set { effect, key, value } => {
                self.client.set(effect, Map::from_iter([(key.clone(), value.clone())])).map(drop)
            }
            Intent::Load { scene } => self.client.load_scene(scene.clone()).map(drop),
            Intent::Hand(to) => self.client.hand(hand(*to)),
            Intent::Samples(n) => {
                self.options.samples_per_s = *n;
                self.subscribe()
            }
            // Handled before this function is called.
            Intent::Connect(_) => Ok(()),
        }
    }

    fn acquire(&mut self, steal: bool) -> Result<(), ClientError> {
        let result = self.client.acquire(steal);
        match &result {
            Ok(()) => {
                *self.released = None;
                self.tell_lease(Lease::Mine);
            }
            Err(ClientError::Server(error)) if error.code == ErrorCode::Busy => {
                // What is known of the holder has its number, which the error lacks.
                if !matches!(self.lease, Lease::Other(_)) {
                    let name = error.holder.clone().unwrap_or_else(|| "another client".to_owned());
                    self.tell_lease(Lease::Other(Requester { name, session: None }));
                }
            }
            Err(_) => {}
        }
        result
    }

    fn lease_of(&self, holder: Option<String>, session: Option<u64>) -> Lease {
        match (holder, session) {
            (_, Some(session)) if session == self.client.hello().session => Lease::Mine,
            (Some(name), session) => Lease::Other(Requester { name, session }),
            (None, _) => Lease::Free,
        }
    }

    fn tell_lease(&mut self, lease: Lease) {
        self.lease = lease.clone();
        self.mailbox.post(News::Lease { lease, cause: None });
    }

    fn subscribe(&mut self) -> Result<(), ClientError> {
        let every = self.client.hello().rate_hz / f64::from(self.options.samples_per_s.max(1));
        let every = (every.round() as u64).clamp(1, hbot_api::MAX_EVERY);
        self.client.subscribe(every).map(drop)
    }

    /// Asks the server for `info`, for the statistics and for the motor controllers when their time
    /// has come.
    fn poll(&mut self) -> Result<(), ClientError> {
        if self.info_due.is_some_and(|due| Instant::now() >= due) {
            match self.client.info() {
                Ok(info) => {
                    self.info_due = None;
                    // Events report only changes of the lease, so a panel that only watches learns
                    // the present holder here.
                    if self.lease == Lease::Unknown
                        && let Some(LeaseInfo { holder, session }) = info.lease.clone()
                    {
                        self.tell_lease(self.lease_of(holder, session));
                    }
                    self.mailbox.post(News::Info(Box::new(info)));
                }
                Err(error) => {
                    self.info_due = Some(Instant::now() + INFO_AGAIN);
                    survivable(error)?;
                }
            }
        }
        if Instant::now() >= self.stats_due {
            let stats = self.client.stats();
            self.stats_due = Instant::now() + STATS_EVERY;
            match stats {
                Ok(stats) => self.mailbox.post(News::Stats(Box::new(stats))),
                Err(error) => survivable(error)?,
            }
        }
        if self.controllers_due.is_some_and(|due| Instant::now() >= due) {
            let controllers = self.client.controllers();
            self.controllers_due = Some(Instant::now() + CONTROLLERS_EVERY);
            match controllers {
                Ok(controllers) => self.mailbox.post(News::Controllers(controllers)),
                Err(ClientError::Server(error)) if error.code == ErrorCode::BadRequest => {
                    self.controllers_due = None;
                    self.mailbox.post(News::NoControllers);
                }
                Err(error) => survivable(error)?,
            }
        }
        Ok(())
    }

    fn event(&mut self, event: Event) {
        match event {
            Event::State(state) => self.mailbox.sample(state),
            Event::Fault(fault) => self.mailbox.post(News::Fault(fault)),
            Event::Scene(scene) => {
                self.info_due = Some(Instant::now());
                self.mailbox.post(News::Scene(scene));
            }
            Event::Set(set) => self.mailbox.post(News::Set(set)),
            Event::Lease(LeaseEvent { holder, session, cause, .. }) => {
                self.lease = self.lease_of(holder, session);
                self.mailbox.post(News::Lease { lease: self.lease.clone(), cause: Some(cause) });
            }
            Event::Dropped(dropped) => self.mailbox.post(News::Dropped(dropped)),
            Event::Shaking(shaking) => self.mailbox.post(News::Shaking(shaking)),
            // The only stream that the panel sends moves the simulated hand.
            Event::Refused(refused) => self.mailbox.post(News::Note(Err(refused.message))),
            // Events that only a later server knows are ignored.
            Event::Stopping(_) | Event::Unknown => {}
        }
    }
}

/// Returns the order to the simulated hand: to turn to an orientation, or to let go.
fn hand(to: Option<[f64; 4]>) -> HandCommand {
    let hold = |q| HandHold { q, over_ms: HAND_MS, stiffness: None, damping: None, inertia: None };
    to.map_or(HandCommand::RELEASE, |q| HandCommand::Hold(hold(q)))
}

/// Returns `Ok` if the connection is still usable after this error, otherwise the error.
fn survivable(error: ClientError) -> Result<(), ClientError> {
    match error {
        ClientError::Server(_) | ClientError::Timeout { .. } | ClientError::Encode(_) => Ok(()),
        error => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_absent_server_is_told_without_advice_that_is_out_of_place_at_a_rig_that_may_push() {
        let error = ClientError::NoServer { address: "rig:4268".to_owned() };
        assert_eq!(in_words(&error), "nobody listens there: connection refused");
    }

    #[test]
    fn a_server_that_does_not_answer_is_told_without_the_names_of_messages() {
        let error = ClientError::Timeout { what: "hello", after: ANSWER_TIMEOUT };
        assert_eq!(in_words(&error), "no answer within 2 s");
        let advice = "the server has not answered within 2 s; look whether it runs, and whether the network reaches it";
        assert_eq!(advised(&error), advice);
    }
}
