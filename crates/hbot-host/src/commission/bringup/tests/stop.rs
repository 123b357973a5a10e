//! Tests that the motors are off after a test that was stopped or that panicked.

use std::sync::{Arc, Mutex};

use super::*;

/// A line to simulated motor controllers that records all commands, and sets the flag `stop` after
/// `after` commands with torque.
struct Recorded {
    line: Memory,
    decoder: hbot_link::Decoder<ToController>,
    heard: Arc<Mutex<Vec<hbot_link::Command>>>,
    stop: StopFlag,
    after: usize,
}

impl Line for Recorded {
    fn read(&mut self, now_ns: u64, buffer: &mut [u8]) -> std::io::Result<usize> {
        self.line.read(now_ns, buffer)
    }

    fn write(&mut self, now_ns: u64, bytes: &[u8]) -> std::io::Result<usize> {
        let heard = &mut *self.heard.lock().unwrap();
        self.decoder.feed(bytes, |message| {
            if let Ok(ToController::Command(command)) = message {
                heard.push(command);
            }
        });
        if heard.iter().filter(|command| command.enable).count() == self.after {
            self.stop.stop();
        }
        self.line.write(now_ns, bytes)
    }
}

/// Returns a bench whose stop flag is set at its 50th command with torque, and a record of the
/// commands that its motor controllers receive.
fn recorded() -> (Bench, Arc<Mutex<Vec<hbot_link::Command>>>) {
    let (heard, stop) = (Arc::default(), StopFlag::default());
    let line = Recorded {
        line: Memory::new(simulated(), mpsc::channel().1),
        decoder: hbot_link::Decoder::new(),
        heard: Arc::clone(&heard),
        stop: stop.clone(),
        after: 50,
    };
    let mut bench = on(line);
    bench.stop = stop;
    (bench, heard)
}

/// Returns how many of the recorded commands switched the motors on. Checks that the last three
/// switched them off.
fn pushes(heard: &Mutex<Vec<hbot_link::Command>>) -> usize {
    let heard = heard.lock().unwrap();
    for last in &heard[heard.len() - 3..] {
        assert!(!last.enable && last.torque.iter().all(|torque| *torque == 0.0), "{last:?}");
    }
    heard.iter().filter(|command| command.enable).count()
}

#[test]
fn a_push_that_is_stopped_goes_no_further_and_ends_with_motors_off() {
    for push in [test, ramp] {
        let (mut bench, heard) = recorded();
        assert_eq!(push(&mut bench, 1, 0.001, 50.0), Err(Interrupted::Stopped));
        assert_eq!(pushes(&heard), 50, "the flag is looked at before each command");
        drop(bench);
        assert_eq!(pushes(&heard), 50);
    }
}

#[test]
fn a_panic_in_a_push_ends_with_motors_off() {
    let (bench, heard) = recorded();
    let panics = std::panic::AssertUnwindSafe(move || {
        let mut bench = bench;
        bench.exchange(Some(&[0.001; MAX_JOINTS])).unwrap();
        panic!("as a test asks: with torque on the line");
    });
    assert!(std::panic::catch_unwind(panics).is_err());
    assert_eq!(pushes(&heard), 1);
}
