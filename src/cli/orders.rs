//! `hbot estop`, `disable`, `enable` and `reset`: send one order to a running server.

use std::process::ExitCode;

use anyhow::Context as _;
use hbot_api::{Client, ClientError, ConnectOptions, Trust};

use super::ServerAddress;
use super::out::say;

/// The order to send.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Order {
    Estop,
    Disable,
    Enable,
    Reset,
}

pub(crate) fn run(address: &ServerAddress, order: Order) -> anyhow::Result<ExitCode> {
    let mut client = connect(address, "hbot command line")?;
    let mode = match order {
        Order::Estop => client.estop(),
        Order::Disable => client.disable(),
        Order::Enable => holding(&mut client, Client::enable),
        Order::Reset => holding(&mut client, Client::reset),
    }?;
    say!("{}{mode}{}", super::style::of_mode(mode.as_str()), super::style::OFF)?;
    Ok(ExitCode::SUCCESS)
}

/// Connects to the server, with a token if one is given.
pub(crate) fn connect(address: &ServerAddress, name: &str) -> anyhow::Result<Client> {
    let mut options = ConnectOptions::new(name);
    if let Some(file) = &address.token_file {
        let token = hbot_config::read_text(file).with_context(|| format!("token file {}", file.display()))?;
        options.token = Some(token.trim().to_owned().into());
    }
    options.trust = address.ca.as_deref().map(Trust::from_file).transpose().context("--ca")?;
    Client::connect_with(&address.server, &options).map_err(|error| match error {
        ClientError::Tls(_) => anyhow::Error::from(error).context("--ca FILE names whom to trust"),
        other => other.into(),
    })
}

/// Acquires the lease, runs `what`, and releases the lease.
pub(crate) fn holding<T>(
    client: &mut Client,
    what: impl FnOnce(&mut Client) -> Result<T, hbot_api::ClientError>,
) -> Result<T, hbot_api::ClientError> {
    client.acquire(false)?;
    let result = what(client);
    // A server that stops meanwhile has already taken the lease back.
    let released = client.release();
    let value = result?;
    released?;
    Ok(value)
}
