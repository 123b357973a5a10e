//! The impaired line: it delays, loses and damages frames, and never reorders them.

use hbot_link::{Decoder, FrameError};
use hbot_sim::phenomena::Link;

use crate::prelude::*;

/// Parameters of a link that delivers every frame at once and unchanged.
const PERFECT: Link =
    Link { latency_s: 0.0, command_latency_s: 0.0, jitter_s: 0.0, loss: 0.0, corrupt: 0.0, seed: 1 };

/// Returns a rig that has sent its description, and whose line has been impaired since then.
fn with(link: Link) -> SimulatedRig {
    let mut rig = SimulatedRig::new(&SimulatedConfig::new(&rig())).unwrap();
    rig.receive(0, &frame(&ToController::Describe), &mut Vec::new());
    rig.set_link(Some(link));
    rig
}

fn bytes(sequence: u32) -> Vec<u8> {
    frame(&ToController::Command(command(sequence, true, &[0.01, 0.002, 0.0, -0.003])))
}

/// Decodes `bytes`. Returns the sequence numbers of the answers in them, and the number of refused
/// frames.
fn heard(decoder: &mut Decoder<FromController>, bytes: &[u8]) -> (Vec<u32>, u32) {
    let (mut sequences, mut refused) = (Vec::new(), 0);
    decoder.feed(bytes, |result| match result {
        Ok(FromController::Feedback(feedback)) => sequences.push(feedback.sequence),
        Ok(FromController::Description(_)) => {}
        Err(FrameError::Body) => panic!("accepted by its check"),
        Err(_) => refused += 1,
    });
    (sequences, refused)
}

/// With a given latency, `receive` returns an answer at the first tick at or after its arrival.
/// `deliver`, which reads before writing, returns it at the first tick after its arrival.
#[test]
fn latency_is_exact_in_ticks() {
    for (latency_ms, received, read) in [(0.0, 0, 1), (0.4, 1, 1), (1.0, 1, 2), (3.0, 3, 4), (3.4, 4, 4)] {
        let link = Link { latency_s: latency_ms * 1e-3, ..PERFECT };
        let (mut looking, mut reading) = (with(link), with(link));
        let mut decoders = [Decoder::new(), Decoder::new()];
        let mut inbox = Vec::new();
        for k in 0..20u32 {
            let now = u64::from(k) * MS;
            let mut reply = Vec::new();
            looking.receive(now, &bytes(k), &mut reply);
            let wanted: Vec<u32> = k.checked_sub(received).into_iter().collect();
            assert_eq!(heard(&mut decoders[0], &reply), (wanted, 0), "{latency_ms} ms, tick {k}");

            reading.deliver(now, &mut inbox);
            let wanted: Vec<u32> = k.checked_sub(read).into_iter().collect();
            assert_eq!(heard(&mut decoders[1], &inbox), (wanted, 0), "{latency_ms} ms, tick {k}");
            inbox.clear();
            reading.receive(now, &bytes(k), &mut inbox);
        }
    }
}

/// On a line with latency, a command acts at the nanosecond of its arrival and then restarts the
/// watchdog. The times at which the rig is advanced do not matter.
#[test]
fn a_late_command_acts_when_it_arrives() {
    let mut late = with(Link { command_latency_s: 2.5e-3, ..PERFECT });
    let mut reply = Vec::new();
    late.receive(MS, &bytes(1), &mut reply);
    assert_eq!(late.next_arrival_ns(), Some(3_500_000));
    late.advance_to(3_499_999);
    assert_eq!(late.joint_torque(), &[0.0; 16]);
    let held = late.clone();
    late.advance_to(3_500_000);
    assert!(late.joint_torque()[0] != 0.0);
    late.advance_to(23_499_999);
    assert!(late.joint_torque()[0] != 0.0);
    late.advance_to(23_500_000);
    assert_eq!(late.joint_torque(), &[0.0; 16], "the watchdog's 20 ms, from its arrival");
    // One advance or many give the same motion.
    let mut once = held;
    once.advance_to(23_500_000);
    let apart = (once.state().omega - late.state().omega).length();
    assert!(apart < 1e-9 && once.state().omega.length() > 1e-3, "{apart}");
    once.receive(23_500_000, &[], &mut reply);
    assert_eq!(heard(&mut Decoder::new(), &reply), (vec![1], 0));
}

/// On a noisy line, lost and damaged frames have the requested rates, within four standard
/// deviations. Damaged frames are refused. All other frames that arrive do so once and in order.
#[test]
fn loss_and_damage_have_their_rates_and_nothing_damaged_is_accepted() {
    const N: u32 = 50_000;
    let (loss, corrupt) = (0.01, 0.02);
    let mut noisy = with(Link { loss, corrupt, jitter_s: 3e-3, latency_s: 1e-3, ..PERFECT });
    let mut decoder = Decoder::new();
    let (mut all, mut refused) = (Vec::new(), 0);
    let mut reply = Vec::new();
    for k in 0..N + 10 {
        let sent = if k < N { bytes(k) } else { Vec::new() };
        noisy.receive(u64::from(k) * MS, &sent, &mut reply);
        let (sequences, bad) = heard(&mut decoder, &reply);
        all.extend(sequences);
        refused += u64::from(bad);
        reply.clear();
    }
    let [commands, answers] = noisy.traffic().unwrap();
    assert_eq!(commands.sent, u64::from(N));
    // Every command that arrives whole is answered, and every answer that arrives whole is
    // accepted.
    assert_eq!(answers.sent, commands.sent - commands.lost - commands.corrupted);
    assert_eq!(all.len() as u64, answers.sent - answers.lost - answers.corrupted);
    assert!(all.is_sorted_by(|a, b| a < b), "in order, none twice");
    // Damage that makes a zero cuts a frame in two, and both parts are refused: one frame in 255,
    // and perhaps more.
    for (refused, traffic) in [(noisy.refused_frames(), commands), (refused, answers)] {
        assert!(
            (traffic.corrupted..traffic.corrupted + traffic.corrupted / 20).contains(&refused),
            "{refused}"
        );
        let within = |count: u64, of: u64, p: f64| {
            let (count, of) = (count as f64, of as f64);
            let deviation = (of * p * (1.0 - p)).sqrt();
            assert!((count - of * p).abs() < 4.0 * deviation, "{count} of {of} at {p}");
        };
        within(traffic.lost, traffic.sent, loss);
        within(traffic.corrupted, traffic.sent - traffic.lost, corrupt);
    }
}

/// Jitter never reorders frames, and each delay is at most latency plus jitter. Frames so rare that
/// they do not wait for each other have delays over the whole range.
#[test]
fn jitter_does_not_reorder() {
    for every in [1, 30] {
        let mut shaky = with(Link { latency_s: 2e-3, jitter_s: 10e-3, ..PERFECT });
        let (mut decoder, mut reply, mut next) = (Decoder::new(), Vec::new(), 0);
        let mut delays = Vec::new();
        for step in 0..30_000u32 {
            let now = u64::from(step) * MS / 10;
            let sent = if step.is_multiple_of(10 * every) { bytes(step / 10 / every) } else { Vec::new() };
            shaky.receive(now, &sent, &mut reply);
            for sequence in heard(&mut decoder, &reply).0 {
                assert_eq!(sequence, next);
                next += 1;
                delays.push((now - u64::from(sequence * every) * MS) as f64 / 1e6);
            }
            reply.clear();
        }
        // There is jitter in both directions, and the rig is read every 0.1 ms.
        assert!(delays.iter().all(|ms| (2.0..22.1).contains(ms)), "{delays:?}");
        let (least, most) = delays.iter().fold((f64::MAX, 0.0_f64), |(a, b), ms| (a.min(*ms), b.max(*ms)));
        assert!((every == 1 || least < 6.0) && most > 18.0, "{least} {most}");
    }
}

/// On an impaired line, equal seeds give equal bytes, however the frames are cut into pieces.
/// Another seed gives other bytes.
#[test]
fn what_is_random_comes_from_the_seed() {
    let run = |seed: u32, pieces: usize| {
        let link = Link { seed, loss: 0.1, corrupt: 0.1, ..Link::default() };
        let (mut rig, mut reply) = (with(link), Vec::new());
        for k in 0..500u32 {
            for piece in bytes(k).chunks(pieces) {
                rig.receive(u64::from(k) * MS, piece, &mut reply);
            }
        }
        reply
    };
    let whole = run(1, 1000);
    assert_eq!(run(1, 1000), whole);
    assert_eq!(run(1, 7), whole);
    assert_ne!(run(2, 1000), whole);
}

/// The memory for frames in flight is bounded, even if a host sends without end. Frames beyond the
/// limit are lost and counted.
#[test]
fn what_is_on_its_way_is_bounded() {
    let mut full = with(Link { command_latency_s: 0.1, ..PERFECT });
    let mut reply = Vec::new();
    for _ in 0..10 {
        full.receive(0, &bytes(1).repeat(1000), &mut reply);
    }
    let [commands, _] = full.traffic().unwrap();
    assert_eq!((commands.sent, commands.lost), (10_000, 10_000 - 1024));
    // Bytes without a zero travel in pieces and are never accepted as a frame.
    full.receive(0, &[7; 100_000], &mut reply);
    full.receive(200 * MS, &bytes(2), &mut reply);
    full.receive(400 * MS, &bytes(3), &mut reply);
    let (sequences, refused) = heard(&mut Decoder::new(), &reply);
    assert_eq!(
        (sequences.len(), refused),
        (1024, 0),
        "of the next frame garbage before it made one too long"
    );
    reply.clear();
    full.receive(600 * MS, &[], &mut reply);
    assert_eq!(heard(&mut Decoder::new(), &reply), (vec![3], 0));
}

/// If the parameters of an impaired line change, frames in flight arrive at the times already set.
/// If the impairment ends, frames in flight are lost.
#[test]
fn lines_change_under_way() {
    let slow = Link { latency_s: 5e-3, ..PERFECT };
    let mut rig = with(slow);
    let mut reply = Vec::new();
    rig.receive(0, &bytes(1), &mut reply);
    rig.set_phenomena(Phenomena { link: Some(PERFECT), ..Phenomena::default() });
    rig.receive(MS, &bytes(2), &mut reply);
    assert!(reply.is_empty(), "the second waits for the first");
    rig.receive(5 * MS, &[], &mut reply);
    assert_eq!(heard(&mut Decoder::new(), &reply), (vec![1, 2], 0));

    rig.set_link(Some(slow));
    reply.clear();
    rig.receive(6 * MS, &bytes(3), &mut reply);
    rig.set_phenomena(Phenomena::default());
    assert_eq!((rig.traffic(), rig.next_arrival_ns()), (None, None));
    rig.receive(7 * MS, &bytes(4), &mut reply);
    assert_eq!(heard(&mut Decoder::new(), &reply), (vec![4], 0));
}
