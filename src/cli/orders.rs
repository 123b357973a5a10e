//! `hbot estop`, `disable`, `enable` and `reset`: send one order to a running server. Also the
//! connection of all commands that are clients.

use std::ffi::OsString;
use std::process::ExitCode;
use std::sync::mpsc::RecvTimeoutError;
use std::time::{Duration, Instant};

use anyhow::{Context as _, bail};
use hbot_api::{
    Client, ClientError, ConnectOptions, ErrorCode, Fault, Mode, StateEvent, Token, Trust, client_name,
};

use hbot_host::run_loop::signals;

use super::out::{WrongLine, note, tell};
use super::{Chosen, Cli, Commanding, ServerAddress, habits, show, style};

/// Longest time until controllers which have come back are seen to be there.
const SETTLED: Duration = Duration::from_secs(1);

/// Longest time of a soft start, which lasts half a second of the rig's time.
const RISEN: Duration = Duration::from_secs(20);
/// Longest time until the torque is off, which a `disable` ramps down in less than a tenth of it.
const OFF: Duration = Duration::from_secs(2);
/// A stop that is not confirmed within this time is told, as in the panel.
const ANSWER: Duration = Duration::from_secs(1);

/// Stops the rig, and prints the mode that follows and what comes next. The stop is sent without
/// waiting for an answer of the server. If the server does not confirm it, the error says so before
/// anything else.
///
/// If the file with the token cannot be read, the stop is sent without a token, because the server
/// may need none.
pub(crate) fn estop(address: &ServerAddress) -> anyhow::Result<ExitCode> {
    let (token, unread) = match token(address) {
        Ok(token) => (token, String::new()),
        Err(error) => (None, format!("; {error:#}")),
    };
    // Only a stop that is not confirmed leaves something to do.
    let (confirms, waits) = std::sync::mpsc::channel::<()>();
    let waiting = std::thread::spawn(move || {
        if waits.recv_timeout(ANSWER) == Err(RecvTimeoutError::Timeout) {
            note!("NOT STOPPED yet: no answer within {} s. Cut the motors' power.", ANSWER.as_secs());
        }
    });
    let confirmed = options(address, "hbot", token).and_then(|options| {
        Client::estop_at(&address.server, &options).map_err(|error| match error {
            ClientError::NoServer { .. } => anyhow::anyhow!("no server there: connection refused"),
            other => not_connected(other, &address.server),
        })
    });
    drop(confirms);
    let _ = waiting.join();
    let mode = confirmed.map_err(|error| {
        anyhow::anyhow!(
            "NOT STOPPED: the server at {} has not confirmed the stop ({error:#}{unread}). Cut the motors' power.",
            address.server
        )
    })?;
    print(mode).context("the rig is stopped, but this cannot be told")
}

/// Carries out a stop whose command line clap refuses: sends it to the server that the line names,
/// and says what was not understood.
pub(crate) fn estop_first(answer: &clap::Error, arguments: &[OsString]) -> anyhow::Result<ExitCode> {
    let (line, odd) = habits::stop_line(arguments);
    let Ok(Cli { command: Chosen::Estop(address) }) = Cli::of(&line) else {
        let why = answer.render().to_string();
        let why = why.lines().next().unwrap_or_default().trim_start_matches("error: ").to_owned();
        bail!("NOT STOPPED: {why}. Cut the motors' power");
    };
    let (stopped, odd) = (estop(&address), odd.join(" "));
    match stopped {
        stopped if odd.is_empty() => stopped,
        Ok(_) => bail!(WrongLine(format!(
            "not understood: {odd}. Only the rig of the server at {} is stopped",
            address.server
        ))),
        Err(error) => bail!("{error:#} Not understood: {odd}"),
    }
}

/// Takes the torque away, waits until it is zero, and prints the mode that follows. The time of a
/// simulated rig that waits for `advance` stands still.
pub(crate) fn disable(address: &ServerAddress) -> anyhow::Result<ExitCode> {
    let is_on = |mode| matches!(mode, Mode::Enabling | Mode::Active);
    let ordered = || {
        let mut client = connect(address, "hbot")?;
        let mode = client.disable().map_err(remedied)?;
        let until = Instant::now() + OFF;
        let off =
            |state: &StateEvent| !is_on(state.mode) && state.torque == [0.0; 3] || Instant::now() > until;
        match show::state(&mut client, off)? {
            Some(state) => Ok((state.mode, state.torque)),
            None if client.info().map_err(remedied)?.rig.simulated => Ok((mode, [0.0; 3])),
            None => bail!("no state says that the torque is off"),
        }
    };
    let (mode, torque) = ordered().map_err(|error: anyhow::Error| {
        anyhow::anyhow!(
            "NOT DISABLED: the server at {} has not confirmed it ({error:#}). Cut the motors' power.",
            address.server
        )
    })?;
    if is_on(mode) || torque != [0.0; 3] {
        bail!(
            "NOT DISABLED: the torque is on in mode {mode}; another client may have enabled it again. Cut the motors' power."
        );
    }
    print(mode)
}

/// Resets the rig, and prints the mode that follows. In a fault, a cause that has just gone is seen
/// to be gone after a moment, and controllers that have just come back say a little later where
/// they are: waits for both. A stop that somebody presses meanwhile stays.
pub(crate) fn reset(to: &Commanding) -> anyhow::Result<ExitCode> {
    let mut client = connect(&to.address, "hbot")?;
    let incident = client.info().map_err(remedied)?.incident;
    let until = Instant::now() + SETTLED;
    let mode = holding(&mut client, to.steal, |client| {
        loop {
            let refused = match client.reset() {
                Err(error) if error.code() == Some(ErrorCode::Faulted) => error,
                answer => return answer,
            };
            std::thread::sleep(SETTLED / 20);
            if Instant::now() > until || client.info()?.mode != Some(Mode::Fault) {
                return Err(refused);
            }
        }
    });
    let mode = match (mode, incident.as_ref().and_then(|incident| incident.remedy.as_deref())) {
        (Err(error), Some(remedy)) if !is_lost(&error) => bail!("{error:#}. {remedy}"),
        (mode, _) => mode?,
    };
    if incident.is_some_and(|incident| incident.fault == Some(Fault::LinkLost)) {
        note!("while no readings came, the sphere may have turned unseen: its orientation can be wrong");
    }
    let settled = |state: &StateEvent| state.mode != Mode::Unreferenced || Instant::now() > until;
    let state = if mode == Mode::Unreferenced { show::state(&mut client, settled)? } else { None };
    print(state.map_or(mode, |state| state.mode))
}

/// Enables the rig, waits for the end of the soft start, and prints the mode that follows. Fails if
/// a fault, a stop or a `disable` has ended it, or if it lasts too long. The time of a rig that
/// waits for `advance` stands still. Ctrl-C meanwhile takes the torque away again.
pub(crate) fn enable(to: &Commanding) -> anyhow::Result<ExitCode> {
    let stop = signals::stop_flag()?;
    let mut client = connect(&to.address, "hbot")?;
    let until = Instant::now() + RISEN;
    let risen = holding(&mut client, to.steal, |client| {
        // A signal that came earlier asks for no torque.
        if stop.is_set() { Ok(None) } else { client.enable().map(Some) }
    });
    let risen = risen.and_then(|mode| {
        let rises =
            |state: &StateEvent| state.mode == Mode::Enabling && Instant::now() < until && !stop.is_set();
        Ok((mode, show::state(&mut client, |state| !rises(state))?))
    });
    if stop.is_set() {
        note!("enable was broken off by a signal, so the torque is taken away:");
        disable(&to.address)?;
        signals::end_as_interrupted()?;
    }
    let (mode, risen) = risen?;
    let stands = risen.is_none();
    let mode = risen.map(|state| state.mode).or(mode).context("no mode")?;
    print(mode)?;
    let is_up = mode == Mode::Active || stands && mode == Mode::Enabling;
    Ok(if is_up { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn print(mode: Mode) -> anyhow::Result<ExitCode> {
    tell!("{}{mode}{}{}", style::of_mode(mode.as_str()), style::OFF, show::next(mode))?;
    Ok(ExitCode::SUCCESS)
}

/// Connects to the server, with a token if one is given. `program` begins the name of the client;
/// the user and the machine follow.
pub(crate) fn connect(address: &ServerAddress, program: &str) -> anyhow::Result<Client> {
    let options = options(address, program, token(address)?)?;
    Client::connect_with(&address.server, &options).map_err(|error| not_connected(error, &address.server))
}

/// Like [`connect`], for a program that waits no longer than `timeout` for each answer.
pub(crate) fn connect_within(
    address: &ServerAddress,
    program: &str,
    timeout: Duration,
) -> anyhow::Result<Client> {
    let options = ConnectOptions { timeout, ..options(address, program, token(address)?)? };
    Ok(Client::connect_with(&address.server, &options)?)
}

/// Like [`connect`], for a command that does not read the variable HBOT_SERVER.
pub(crate) fn connect_by_option(address: &ServerAddress, program: &str) -> anyhow::Result<Client> {
    let options = options(address, program, token(address)?)?;
    Client::connect_with(&address.server, &options).map_err(|error| match error {
        ClientError::NoServer { .. } => anyhow::anyhow!("{error}: by `--server ADDR`"),
        error => not_connected(error, &address.server),
    })
}

/// Returns the token in the file that `address` names, if it names one.
fn token(address: &ServerAddress) -> anyhow::Result<Option<Token>> {
    let Some(file) = address.token_file() else { return Ok(None) };
    let text = hbot_config::read_text(file).with_context(|| format!("token file {}", file.display()))?;
    Ok(Some(text.trim().to_owned().into()))
}

/// Returns the options for connecting to the server. Reads the certificates that `address` names.
fn options(address: &ServerAddress, program: &str, token: Option<Token>) -> anyhow::Result<ConnectOptions> {
    let trust = address.ca.as_deref().map(Trust::from_file).transpose().context("--ca")?;
    Ok(ConnectOptions { token, trust, ..ConnectOptions::new(&client_name(program)) })
}

/// Adds to the error of a connection that failed what the command line can do about it.
fn not_connected(error: ClientError, address: &str) -> anyhow::Error {
    match error {
        ClientError::Tls(_) => anyhow::Error::from(error).context("--ca FILE names whom to trust"),
        ClientError::Address { .. } => WrongLine(error.to_string()).into(),
        ClientError::Protocol(why) => anyhow::anyhow!(
            "what answers at {address} is no hbot server, or one of another version (its answer cannot be read: {why})"
        ),
        other => remedied(other),
    }
}

/// Acquires the lease, runs `what`, and releases the lease. If `steal` is true, takes the lease
/// even if another client holds it.
pub(crate) fn holding<T>(
    client: &mut Client,
    steal: bool,
    what: impl FnOnce(&mut Client) -> Result<T, ClientError>,
) -> anyhow::Result<T> {
    client.acquire(steal).map_err(remedied)?;
    let result = what(client);
    // A server that stops meanwhile has already taken the lease back.
    let released = client.release();
    let value = result.map_err(remedied)?;
    released?;
    Ok(value)
}

/// Adds to an error from the server what the command line can do about it.
pub(crate) fn remedied(error: ClientError) -> anyhow::Error {
    let said = match &error {
        // The op and the code are for programs.
        ClientError::Server(body) => body.reason().to_owned(),
        other => other.to_string(),
    };
    let remedy = match error.code() {
        Some(ErrorCode::Busy) => {
            let Some(name) = holder(&error) else { return error.into() };
            let at_panel = if name.starts_with(PANEL) {
                "press `Release` in that panel, or start it as an observer by `hbot-gui --observe`. Or "
            } else {
                ""
            };
            return anyhow::anyhow!(
                "{name:?} holds the lease: {at_panel}add `--steal` to take the lease from that client"
            );
        }
        Some(ErrorCode::Faulted) => {
            return anyhow::anyhow!(
                "{said}. `hbot info` shows the cause; when it is gone, run `hbot reset`, then `hbot enable`"
            );
        }
        Some(ErrorCode::Unauthorized) => {
            "name the file with the server's token by `--token-file FILE` or the variable HBOT_TOKEN_FILE"
        }
        Some(ErrorCode::NotHolder) if holder(&error).is_some() => {
            "that client has taken the lease from this command meanwhile. Ask its user, or repeat the command with `--steal`"
        }
        Some(ErrorCode::UnknownEffect) => SHOW_SCENE,
        _ => match error {
            ClientError::NoServer { .. } => "by `--server ADDR` or the variable HBOT_SERVER",
            // Its text has that of its source.
            ClientError::Connect { .. } | ClientError::Server(_) => return anyhow::anyhow!("{said}"),
            ClientError::Timeout { what: "hello", .. } => {
                return anyhow::Error::from(error)
                    .context("the server is there but does not answer (it may be suspended or overloaded)");
            }
            _ => return error.into(),
        },
    };
    anyhow::anyhow!("{said}: {remedy}")
}

/// Says what to do about motors whose server does not answer any more, if that is the `error`.
pub(crate) fn warn_of_torque(error: &anyhow::Error) {
    if is_lost(error) {
        note!("If the sphere still pushes, cut the motors' power.");
    }
}

/// Returns whether a server is gone or silent that has answered before, or is there and is silent.
fn is_lost(error: &anyhow::Error) -> bool {
    let is_lost = |error: &ClientError| {
        use ClientError::{Closed, Io, NoState, Timeout};
        matches!(error, Closed | Io(_) | NoState { .. } | Timeout { .. })
    };
    error.chain().filter_map(|source| source.downcast_ref()).any(is_lost)
}

/// Where the ids of the effects are found.
pub(crate) const SHOW_SCENE: &str = "`hbot scene show` prints the running scene";
/// Beginning of the name that a panel gives to the server.
const PANEL: &str = "panel ";

/// Returns the name of the client that holds the lease, if the error names it.
fn holder(error: &ClientError) -> Option<&str> {
    match error {
        ClientError::Server(body) => body.holder.as_deref(),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use hbot_api::ErrorBody;

    use super::*;

    #[test]
    fn errors_name_what_the_command_line_can_do() {
        let told = |body: ErrorBody| format!("{:#}", remedied(ClientError::Server(body)));
        let busy = ErrorBody::new(ErrorCode::Busy, "\"ann\" holds the lease");
        assert!(!told(busy.clone()).contains("--steal"), "the loop is busy, and nobody can be robbed");
        let held = |name: &str| told(ErrorBody { holder: Some(name.to_owned()), ..busy.clone() });
        assert!(held("ann").contains("--steal") && !held("ann").contains("panel"), "{}", held("ann"));
        for words in ["`Release`", "`hbot-gui --observe`", "`--steal`"] {
            assert!(held("panel ann@lab2").contains(words), "{}", held("panel ann@lab2"));
        }
        let robbed = ErrorBody::new(ErrorCode::NotHolder, "op set needs the lease, which \"bob\" holds");
        let robbed = told(ErrorBody { holder: Some("bob".to_owned()), ..robbed });
        assert!(robbed.contains("\"bob\" holds") && robbed.contains("has taken the lease from this command"));
        assert!(told(ErrorBody::new(ErrorCode::Faulted, "x")).contains("`hbot reset`, then `hbot enable`"));
        assert!(told(ErrorBody::new(ErrorCode::Unauthorized, "x")).contains("HBOT_TOKEN_FILE"));
        assert_eq!(told(ErrorBody::new(ErrorCode::OutOfRange, "x")), "x");
        assert_eq!(told(ErrorBody::new(ErrorCode::OutOfRange, "op set: x: y")), "x: y");
    }
}
