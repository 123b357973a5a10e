//! Statistics of a server for Prometheus: `GET /metrics` over HTTP, read only.
//!
//! A task on the service's runtime asks the hub for the statistics, as a client does with `stats`,
//! so a scrape costs the loop nothing. Connections are few at a time, short, and bounded in size.
//! If the address can be reached from other machines, a scrape must show a token as `Authorization:
//! Bearer TOKEN`. Use a separate token for this page, because it crosses the network unencrypted.

mod figures;
mod format;

use std::sync::Arc;
use std::time::Duration;

use hbot_api::ErrorCode;
use subtle::ConstantTimeEq as _;
use tokio::io::AsyncWriteExt as _;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{Semaphore, mpsc, oneshot};
use tokio::time::timeout;

use self::format::Format;
use crate::not_built::NotBuilt;
use crate::service::{Control, Summary};
use crate::web::head;

/// Largest number of simultaneous connections to the metrics page. Further ones wait in the
/// operating system's queue.
const CONNECTIONS: usize = 4;
/// Time limit for reading and answering one request for the metrics page.
const PATIENCE: Duration = Duration::from_secs(2);
/// Pause before the next attempt after the operating system has failed to accept a connection.
const PAUSE: Duration = Duration::from_millis(200);

/// Succeeds, because this build has the metrics page.
///
/// # Errors
/// Fails in a build without the feature `metrics`.
pub const fn built() -> Result<(), NotBuilt> {
    Ok(())
}

/// Answers requests for the metrics page on `listener`, for as long as the future is polled. Gets
/// the statistics from the service through `control`. If `token` is given, every request must
/// contain it.
pub async fn serve(listener: TcpListener, control: mpsc::Sender<Control>, token: Option<String>) {
    let places = Arc::new(Semaphore::new(CONNECTIONS));
    let token = Arc::new(token);
    loop {
        // Unreachable: the semaphore is never closed.
        let Ok(place) = Arc::clone(&places).acquire_owned().await else { return };
        match listener.accept().await {
            Ok((stream, _)) => {
                let (control, token) = (control.clone(), Arc::clone(&token));
                tokio::spawn(async move {
                    // A connection that exceeds its time gets no answer. It keeps its place until
                    // its refusal is counted, so the number of messages that wait for the hub stays
                    // bounded.
                    if timeout(PATIENCE, answer(stream, &control, token.as_deref())).await.is_err() {
                        let _ = control.send(Control::Refused(ErrorCode::BadRequest)).await;
                    }
                    drop(place);
                });
            }
            Err(_) => tokio::time::sleep(PAUSE).await,
        }
    }
}

async fn answer(
    mut stream: TcpStream,
    control: &mpsc::Sender<Control>,
    token: Option<&str>,
) -> std::io::Result<()> {
    let head = head::bytes(&mut stream).await?;
    let request = String::from_utf8_lossy(head.as_deref().unwrap_or_default());
    let judged = match &head {
        Ok(_) => judge(&request, token),
        Err(_) => Err("431 Request Header Fields Too Large"),
    };
    if let Err(status) = judged {
        // If the service has ended, nobody counts refusals any more.
        let _ = control.send(Control::Refused(code(status))).await;
    }
    let (status, kind, body) = match judged {
        Ok(()) => match summary(control).await {
            Some(summary) => {
                let accept = Vec::from_iter(values(&request, "accept")).join(",");
                let format = Format::preferred(&accept);
                ("200 OK", format.content_type(), figures::text(summary, format))
            }
            None => ("503 Service Unavailable", "text/plain", "the server stops\n".to_owned()),
        },
        Err(status) => (status, "text/plain", format!("{status}\n")),
    };
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {}\r\nConnection: close\r\n\r\n",
        body.len()
    );
    stream.write_all(head.as_bytes()).await?;
    stream.write_all(body.as_bytes()).await?;
    stream.shutdown().await
}

/// Checks that an HTTP request is an authorized `GET /metrics`. Otherwise returns the HTTP status
/// of the refusal.
fn judge(request: &str, token: Option<&str>) -> Result<(), &'static str> {
    let mut words = request.split("\r\n").next().unwrap_or_default().split(' ');
    if words.next() != Some("GET") {
        return Err("405 Method Not Allowed");
    }
    if words.next().map(|path| path.split('?').next().unwrap_or_default()) != Some("/metrics") {
        return Err("404 Not Found");
    }
    let Some(token) = token else { return Ok(()) };
    let shown = values(request, "authorization").find_map(|value| value.strip_prefix("Bearer "));
    let same = shown.is_some_and(|shown| bool::from(shown.as_bytes().ct_eq(token.as_bytes())));
    if same { Ok(()) } else { Err("401 Unauthorized") }
}

/// Returns the values of all headers with this name in an HTTP request.
fn values<'a>(request: &'a str, header: &'a str) -> impl Iterator<Item = &'a str> {
    let headers = request.split("\r\n").skip(1).filter_map(|line| line.split_once(':'));
    headers.filter(move |(name, _)| name.eq_ignore_ascii_case(header)).map(|(_, value)| value.trim())
}

/// Returns the API error code under which a refusal with this HTTP status is counted.
fn code(status: &str) -> ErrorCode {
    match status.get(..3) {
        Some("401") => ErrorCode::Unauthorized,
        Some("431") => ErrorCode::TooLarge,
        _ => ErrorCode::BadRequest,
    }
}

async fn summary(control: &mpsc::Sender<Control>) -> Option<Box<Summary>> {
    let (wanted, told) = oneshot::channel();
    control.send(Control::Summarize(wanted)).await.ok()?;
    told.await.ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_get_of_metrics_by_somebody_who_may_is_answered() {
        let get = "GET /metrics HTTP/1.1\r\nHost: x\r\n\r\n";
        assert_eq!(judge(get, None), Ok(()));
        assert_eq!(judge("GET /metrics?x=1 HTTP/1.1\r\n\r\n", None), Ok(()));
        assert_eq!(judge("POST /metrics HTTP/1.1\r\n\r\n", None), Err("405 Method Not Allowed"));
        assert_eq!(judge("GET / HTTP/1.1\r\n\r\n", None), Err("404 Not Found"));
        assert_eq!(judge("\r\n\r\n", None), Err("405 Method Not Allowed"));
        assert_eq!(judge(get, Some("secret")), Err("401 Unauthorized"));
        let with = |shown: &str| format!("GET /metrics HTTP/1.1\r\nauthorization: {shown}\r\n\r\n");
        assert_eq!(judge(&with("Bearer secret"), Some("secret")), Ok(()));
        for wrong in ["Bearer secre", "Bearer secret2", "secret", ""] {
            assert_eq!(judge(&with(wrong), Some("secret")), Err("401 Unauthorized"), "{wrong}");
        }
    }
}
