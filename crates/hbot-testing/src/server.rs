//! An hbot server that runs in the process of the test.

use std::future::Future;
use std::net::SocketAddr;
use std::sync::mpsc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use hbot_core::{CompiledScene, Inputs, Outputs};
use hbot_host::run_loop::engine::Recorder;
use hbot_server::server::{Finished, Server, ServerOptions};
use hbot_server::service::Status;
use tokio::net::TcpListener;
use tokio::runtime::{Builder, Runtime};
use tokio::sync::{mpsc as async_mpsc, oneshot, watch};

fn runtime() -> Runtime {
    Builder::new_current_thread().enable_all().build().expect("a runtime")
}

/// Runs a server on the current thread. `over` receives the server's address and returns a future.
/// The server ends when this future completes, or after the duration in `options`.
pub fn serve<F: Future<Output = ()> + Send + 'static>(
    options: ServerOptions,
    listen: SocketAddr,
    over: impl FnOnce(SocketAddr) -> F,
) -> Finished {
    runtime().block_on(async {
        let listener = TcpListener::bind(listen).await.expect("a free port");
        let address = listener.local_addr().expect("an address");
        let server = Server::start(options).expect("it starts");
        let (_control, controlled) = async_mpsc::channel(1);
        let (status, _status) = watch::channel(Status::default());
        let over = tokio::spawn(over(address));
        let done = async { over.await.expect("what ends the server does not panic") };
        server.serve(listener, controlled, status, done).await
    })
}

/// Returns a recorder that stores nothing, but sleeps in each tick. It slows a loop in virtual time
/// to `rate_hz` ticks per second of real time.
pub fn paced(rate_hz: u32) -> Recorder {
    let (begin, mut ticks) = (Instant::now(), 0);
    let period = Duration::from_secs(1) / rate_hz;
    Box::new(move |_| {
        ticks += 1;
        // Sleeps until the deadline of the next tick. There is no other condition to wait for.
        std::thread::sleep((begin + ticks * period).saturating_duration_since(Instant::now()));
    })
}

/// Runs a server as [`serve`] does and calls `note` in each tick of its loop. Returns the values
/// that `note` returned, one per tick.
pub fn recorded<T: Send + 'static, F: Future<Output = ()> + Send + 'static>(
    options: ServerOptions,
    note: impl Fn(&CompiledScene, &Inputs, &Outputs) -> T + Send + 'static,
    over: impl FnOnce(SocketAddr) -> F,
) -> Vec<T> {
    let (into, ticks) = mpsc::channel();
    let recorder: Recorder = Box::new(move |ticked| {
        into.send(note(ticked.scene, ticked.inputs, ticked.outputs)).expect("somebody listens");
    });
    serve(ServerOptions { recorder: Some(recorder), ..options }, any_port(), over);
    ticks.iter().collect()
}

/// Returns the address 127.0.0.1 with port 0, for which the operating system chooses a free port.
pub fn any_port() -> SocketAddr {
    ([127, 0, 0, 1], 0).into()
}

/// A server that runs on its own thread. It stops when this value is dropped.
pub struct TestServer {
    /// Address at which the server listens.
    pub address: SocketAddr,
    shutdown: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<Finished>>,
}

impl TestServer {
    /// Starts a server on a new thread and waits until it listens at the address `listen`.
    pub fn start(options: ServerOptions, listen: SocketAddr) -> Self {
        let (shutdown, stopped) = oneshot::channel();
        let (ready, started) = mpsc::channel();
        let thread = std::thread::spawn(move || {
            serve(options, listen, move |address| {
                ready.send(address).expect("the test waits");
                async {
                    // Completes when the sender is dropped or sends, and so stops the server.
                    let _ = stopped.await;
                }
            })
        });
        let address = started.recv().expect("the server starts");
        Self { address, shutdown: Some(shutdown), thread: Some(thread) }
    }

    /// Stops the server and returns its result.
    pub fn stop(mut self) -> Finished {
        self.end().expect("it runs until here").expect("the server has not panicked")
    }

    fn end(&mut self) -> Option<std::thread::Result<Finished>> {
        drop(self.shutdown.take());
        self.thread.take().map(JoinHandle::join)
    }
}

impl Drop for TestServer {
    fn drop(&mut self) {
        if let Some(ended) = self.end() {
            assert!(ended.is_ok() || std::thread::panicking(), "the server has panicked");
        }
    }
}
