//! Tests of the metrics page with scrapes that are unauthorized, wrong, or incomplete.

use hbot_api::ErrorCode;

use super::*;

fn served(bench: &TestService, token: &str) -> SocketAddr {
    let (control, token) = (bench.control.clone(), token.to_owned());
    let (ready, started) = blocking::channel();
    // The thread ends with the test process.
    std::thread::spawn(move || {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        runtime.block_on(async move {
            let listener = TcpListener::bind(("127.0.0.1", 0)).await.unwrap();
            ready.send(listener.local_addr().unwrap()).unwrap();
            crate::metrics::serve(listener, control, Some(token)).await;
        });
    });
    started.recv().unwrap()
}

#[test]
fn what_the_page_of_metrics_refuses_is_counted_in_stats() {
    let bench = bench();
    let address = served(&bench, "open sesame");
    let ask = |request: &str| {
        let mut raw = JsonLines::connect(address);
        raw.bytes(request.as_bytes());
        raw.rest()
    };
    let get = |token: &str| format!("GET /metrics HTTP/1.1\r\nAuthorization: Bearer {token}\r\n\r\n");
    assert!(ask(&get("open sesame")).starts_with("HTTP/1.1 200 OK"));
    let mut client = bench.client("c");
    let refused = |client: &mut Client| client.stats().unwrap().refused;
    assert_eq!(refused(&mut client).of(ErrorCode::Unauthorized), 0);
    // More requests, one after another, than can be served at the same time.
    for _ in 0..20 {
        assert!(ask(&get("open says me")).starts_with("HTTP/1.1 401"));
    }
    assert!(ask("POST /metrics HTTP/1.1\r\n\r\n").starts_with("HTTP/1.1 405"));
    ask(&format!("GET /metrics HTTP/1.1\r\nX: {}", "x".repeat(9000)));
    let counts = refused(&mut client);
    assert_eq!(
        [ErrorCode::Unauthorized, ErrorCode::BadRequest, ErrorCode::TooLarge].map(|code| counts.of(code)),
        [20, 1, 1]
    );
    // A client that begins a request and does not finish it.
    let mut slow = JsonLines::connect(address);
    slow.bytes(b"GET /met");
    assert_eq!(slow.rest(), "");
    eventually("one more", || refused(&mut bench.client("d")).of(ErrorCode::BadRequest) == 2);
    assert!(ask(&get("open sesame")).contains("hbot_refused_total{code=\"unauthorized\"} 20\n"));
}
