//! What a serial line does to the engine: frames in pieces, damaged, late, twice, out of order; several lines; lines that
//! vanish and come back.

use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use hbot_config::{RigConfig, RunningScene, SceneFile};
use hbot_core::Controller;
use hbot_core::inputs::Command as Order;
use hbot_core::mode::{Cause, Mode};
use hbot_link::{
    Command, ControllerFlags, Decoder, Feedback, FromController, JointReading, MAX_FEEDBACK_FRAME,
    ToController, encode,
};
use hbot_sim::controller::Fault;
use hbot_sim::pty::{PtyOptions, PtyRig, spawn_pty};
use hbot_sim::rig::{RigConfig as SimulatedConfig, SimulatedRig};

use crate::bridge::{ServiceEnd, bridge};
use crate::engine::{Engine, Line, Moment, Place};
use crate::handshake::{Expected, handshake};
use crate::sample::Sample;
use crate::serial::Serial;
use crate::wire::{Renewed, Wire};

/// Controllers that answer every command with counts that stand still, and what the line does to their answers.
#[derive(Default)]
struct Far {
    joints: usize,
    decoder: Decoder<ToController>,
    heard: Vec<Command>,
    flags: ControllerFlags,
    silent: bool,
    renewed: Option<Renewed>,
    /// Frames that have not been read yet.
    answers: Vec<Vec<u8>>,
}

#[derive(Clone)]
struct Fake(Arc<Mutex<Far>>);

impl Fake {
    fn new(joints: usize) -> Self {
        Self(Arc::new(Mutex::new(Far { joints, ..Far::default() })))
    }

    fn with<T>(&self, what: impl FnOnce(&mut Far) -> T) -> T {
        what(&mut self.0.lock().expect("no test has panicked"))
    }
}

fn framed(feedback: Feedback) -> Vec<u8> {
    let mut frame = [0; MAX_FEEDBACK_FRAME];
    let n = encode(&FromController::Feedback(feedback), &mut frame).expect("it fits");
    frame[..n].to_vec()
}

fn answer(sequence: u32, flags: ControllerFlags, joints: usize) -> Vec<u8> {
    let reading = |j: usize| JointReading { count: j as i32, ..JointReading::default() };
    framed(Feedback { sequence, flags, joints: (0..joints).map(reading).collect() })
}

impl Wire for Fake {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        self.with(|far| {
            let bytes: Vec<u8> = far.answers.drain(..).flatten().collect();
            buffer[..bytes.len()].copy_from_slice(&bytes);
            Ok(bytes.len())
        })
    }

    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.with(|far| {
            let Far { joints, decoder, heard, flags, silent, answers, .. } = far;
            decoder.feed(bytes, |message| {
                if let Ok(ToController::Command(command)) = message {
                    if !*silent {
                        answers.push(answer(command.sequence, *flags, *joints));
                    }
                    heard.push(command);
                }
            });
        });
        Ok(bytes.len())
    }

    fn renewed(&mut self) -> Option<Renewed> {
        self.with(|far| far.renewed.take())
    }
}

struct Bench<W> {
    _runtime: tokio::runtime::Runtime,
    engine: Engine<W>,
    end: ServiceEnd,
    tick: u64,
}

impl<W: Wire> Bench<W> {
    fn new(rig: &RigConfig, wires: Vec<W>, line: &Line) -> Self {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
        let entered = runtime.enter();
        let (inner, end) = bridge().expect("a bridge");
        drop(entered);
        let scene = Box::new(RunningScene::new().load(SceneFile::default_scene()));
        let engine = Engine::new(wires, line, Controller::new(rig.rig), scene, inner, None);
        Self { _runtime: runtime, engine, end, tick: 0 }
    }

    fn tick(&mut self) -> Sample {
        let moment = Moment { tick: self.tick, t_ns: 0, lateness_ns: 0, late: false, skipped: 0 };
        self.engine.tick(&moment);
        self.tick += 1;
        self.end.try_sample().expect("a sample a tick")
    }

    fn ticks(&mut self, n: u32) -> Sample {
        (1..n).for_each(|_| _ = self.tick());
        self.tick()
    }

    fn order(&mut self, command: Order) -> Sample {
        self.end.order(command).expect("a place");
        self.tick()
    }

    fn active(&mut self) {
        self.ticks(5);
        self.order(Order::Enable);
        assert_eq!(self.ticks(600).state.mode, Mode::Active);
    }
}

/// The prototype on one line that does what a test says.
fn one_line() -> (Bench<Fake>, Fake) {
    let fake = Fake::new(4);
    let mut bench = Bench::new(&RigConfig::prototype(), vec![fake.clone()], &Line::single(0..4, 20));
    bench.active();
    (bench, fake)
}

#[test]
fn a_frame_in_two_pieces_and_two_frames_in_one() {
    let (mut bench, fake) = one_line();
    let before = bench.tick().counters;
    // The answer of one tick comes by halves with the next two reads.
    let whole = fake.with(|far| std::mem::take(&mut far.answers)).concat();
    let (first, rest) = whole.split_at(whole.len() / 2);
    fake.with(|far| far.answers.push(first.to_vec()));
    let torn = bench.tick();
    assert!(!torn.state.fresh && torn.state.mode == Mode::Active);
    let next = fake.with(|far| std::mem::take(&mut far.answers));
    fake.with(|far| far.answers.extend([rest.to_vec(), next.concat()]));
    let merged = bench.tick();
    assert!(merged.state.fresh, "the newer of the two counts");
    assert_eq!(merged.counters.corrupt_frames, before.corrupt_frames);
    assert_eq!(merged.counters.missed, before.missed + 1);
}

#[test]
fn short_frames_and_damaged_ones_are_counted_and_ride_through() {
    let (mut bench, fake) = one_line();
    for damage in [
        (|frame: &mut Vec<u8>| frame[7] ^= 0x10) as fn(&mut Vec<u8>),
        // Bytes lost in the middle, at the end with the delimiter kept, and all but the delimiter.
        |frame| drop(frame.drain(4..9)),
        |frame| drop(frame.drain(frame.len() - 4..frame.len() - 1)),
        |frame| drop(frame.drain(1..frame.len() - 1)),
        // A device that babbles.
        |frame| *frame = b"login: \0".to_vec(),
    ] {
        let before = bench.ticks(100).counters.corrupt_frames;
        fake.with(|far| far.answers.iter_mut().for_each(damage));
        let hit = bench.tick();
        assert_eq!((hit.counters.corrupt_frames, hit.state.fresh), (before + 1, false));
        let after = bench.tick();
        assert!(after.state.fresh && after.state.mode == Mode::Active);
    }
}

#[test]
fn half_of_all_frames_damaged_is_a_fault_of_its_own_name() {
    let (mut bench, fake) = one_line();
    let mut ticks = 0;
    let state = loop {
        if ticks % 2 == 0 {
            fake.with(|far| far.answers.iter_mut().for_each(|frame| frame[5] ^= 1));
        }
        let state = bench.tick().state;
        ticks += 1;
        if state.mode == Mode::Fault {
            break state;
        }
    };
    assert_eq!(state.cause, Some(Cause::LinkCorrupt));
    // Each costs 1 and one in 20 ticks is forgiven: 10 of them take 22 ticks.
    assert!(ticks <= 23, "{ticks}");
    assert!(!fake.with(|far| far.heard.last().expect("commands").enable), "zero torque in the same tick");
}

#[test]
fn late_doubled_and_reordered_answers_do_no_harm() {
    let (mut bench, fake) = one_line();
    let q = bench.tick().state.q;
    for round in 0..300 {
        fake.with(|far| match round % 3 {
            // Twice.
            0 => far.answers.extend(far.answers.clone()),
            // Lost, and then a tick late, behind the one that came after it.
            1 => far.answers.clear(),
            _ => far.answers.push(answer(bench.tick as u32 - 2, ControllerFlags::empty(), 4)),
        });
        let state = bench.tick().state;
        assert_eq!((state.mode, state.q), (Mode::Active, q), "round {round}");
    }
    let state = bench.ticks(3);
    // In the wrong order within a tick: the newer one counts.
    let tick = bench.tick as u32;
    fake.with(|far| {
        far.answers = vec![
            answer(tick - 1, ControllerFlags::empty(), 4),
            answer(tick - 2, ControllerFlags::empty(), 4),
        ];
    });
    assert!(state.state.fresh && bench.tick().state.fresh);
    assert!(bench.tick().state.fresh, "and the next is newer still");
}

#[test]
fn answers_to_commands_never_sent_and_from_other_controllers_are_counted() {
    let (mut bench, fake) = one_line();
    let before = bench.tick().counters.foreign_frames;
    let tick = bench.tick as u32;
    fake.with(|far| {
        far.answers.push(answer(tick + 1000, ControllerFlags::empty(), 4));
        far.answers.push(answer(tick - 1, ControllerFlags::empty(), 3));
    });
    let hit = bench.tick();
    assert_eq!(hit.counters.foreign_frames, before + 2);
    // What they said was not taken: the next answer is not old beside a sequence of the future.
    assert!(bench.tick().state.fresh);
}

#[test]
fn a_line_that_was_gone_is_a_fault_even_where_its_controllers_do_not_complain() {
    for rebooted in [false, true] {
        let (mut bench, fake) = one_line();
        assert!(bench.tick().state.fresh);
        fake.with(|far| far.renewed = Some(Renewed { rebooted }));
        let state = bench.tick().state;
        let cause = if rebooted { Cause::ControllerFault } else { Cause::LinkLost };
        assert_eq!((state.mode, state.cause), (Mode::Fault, Some(cause)));
        assert!(!fake.with(|far| far.heard.last().expect("a command").enable));
        bench.order(Order::Reset);
        let back = if rebooted { Mode::Unreferenced } else { Mode::Idle };
        assert_eq!(bench.tick().state.mode, back);
    }
}

/// The prototype with wheel A on one line and wheel B on another, in the opposite order.
fn two_lines() -> (Bench<Fake>, [Fake; 2]) {
    let fakes = [Fake::new(2), Fake::new(2)];
    let place = |port, at| Place { port, at };
    let places = vec![place(0, 0), place(0, 1), place(1, 1), place(1, 0)];
    let line = Line { places, ..Line::single([], 20) };
    let mut bench = Bench::new(&RigConfig::prototype(), fakes.to_vec(), &line);
    bench.active();
    (bench, fakes)
}

#[test]
fn several_lines_are_one_rig() {
    let (mut bench, fakes) = two_lines();
    let torque = hbot_core::Vec3::new(0.05, 0.02, 0.01);
    bench.order(Order::Stream { torque, valid_ticks: 100, stamp: Default::default() });
    let state = bench.ticks(5).state;
    let heard = |port: usize| fakes[port].with(|far| far.heard.last().expect("a command").clone());
    let (a, b) = (heard(0), heard(1));
    assert!(a.enable && b.enable && a.sequence == b.sequence);
    let sent = [a.torque[0], a.torque[1], b.torque[1], b.torque[0]];
    assert_eq!(sent, std::array::from_fn(|j| state.joint_torque[j] as f32));
    assert!(sent.iter().all(|t| *t != 0.0), "{sent:?}");
    // Counts 0 and 1 of each line, in the order of the rig; drive joints have a gear of 17.
    let count = std::f64::consts::TAU / 16384.0;
    let angles: [f64; 4] = std::array::from_fn(|j| state.angle[j]);
    for (angle, expected) in angles.into_iter().zip([0.0, count / 17.0, count, 0.0]) {
        assert!((angle - expected).abs() < 1e-12, "{angles:?}");
    }
}

#[test]
fn a_line_that_falls_silent_stops_all_of_them() {
    let (mut bench, fakes) = two_lines();
    fakes[1].with(|far| far.silent = true);
    let timeout = RigConfig::prototype().link.timeout_ticks;
    // One answer is on its way.
    assert_eq!(bench.ticks(timeout + 1).state.mode, Mode::Active);
    assert_eq!(bench.tick().state.cause, Some(Cause::LinkLost));
    for fake in &fakes {
        assert!(!fake.with(|far| far.heard.last().expect("a command").enable));
    }
}

#[test]
fn a_complaint_on_one_line_is_heard_while_another_is_silent() {
    let (mut bench, fakes) = two_lines();
    fakes[1].with(|far| far.silent = true);
    bench.ticks(3);
    fakes[0].with(|far| far.flags = ControllerFlags::FAULT);
    bench.tick();
    assert_eq!(bench.tick().state.cause, Some(Cause::ControllerFault));
}

/// A rig behind a pseudo-terminal that a link in a folder leads to, as udev makes one for a USB device.
fn plug(rig: SimulatedRig, link: &Path) -> PtyRig {
    let pty = spawn_pty(rig, PtyOptions::default()).expect("a pseudo-terminal");
    // Not there until now, or leading nowhere.
    let _ = std::fs::remove_file(link);
    std::os::unix::fs::symlink(pty.path(), link).expect("a link");
    pty
}

/// The rig behind `link`, active, with a line that is kept open.
fn plugged(link: &Path) -> (Bench<Serial>, PtyRig) {
    plugged_in(RigConfig::prototype(), link)
}

fn plugged_in(rig: RigConfig, link: &Path) -> (Bench<Serial>, PtyRig) {
    let pty = plug(SimulatedRig::new(&SimulatedConfig::new(&rig.rig)).expect("it can be simulated"), link);
    let port = link.to_str().expect("UTF-8");
    let line = Line::single(0..4, 1000);
    let mut wire = Serial::open(port, rig.link.baud).expect("it opens");
    let expected = Expected::new(port, &rig.rig, &line, 0);
    handshake(&mut wire, &expected).expect("it answers");
    wire.keep_open(port, rig.link.baud, expected).expect("a thread");
    let mut bench = Bench::new(&rig, vec![wire], &line);
    until(&mut bench, "idle", |sample| sample.state.mode == Mode::Idle);
    bench.order(Order::Enable);
    until(&mut bench, "active", |sample| sample.state.mode == Mode::Active);
    (bench, pty)
}

fn until(bench: &mut Bench<Serial>, what: &str, found: impl Fn(&Sample) -> bool) -> Sample {
    let deadline = Instant::now() + Duration::from_secs(60);
    loop {
        let sample = bench.tick();
        if found(&sample) {
            return sample;
        }
        assert!(Instant::now() < deadline, "{what}: {:?} {:?}", sample.state.mode, sample.state.cause);
        std::thread::sleep(Duration::from_millis(1));
    }
}

fn has_pty() -> bool {
    let there = serialport::TTYPort::pair().is_ok();
    if !there {
        println!("no pseudo-terminal on this machine: not tested here");
    }
    there
}

#[test]
fn a_line_that_vanishes_is_a_lost_link_and_comes_back_without_torque() {
    if !has_pty() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let link = folder.path().join("hbot");
    let (mut bench, pty) = plugged(&link);
    // The cable is cut; the controllers keep their power and their zeros.
    let rig = pty.stop().expect("it ran");
    let lost = until(&mut bench, "lost", |sample| sample.state.mode == Mode::Fault);
    assert_eq!(lost.state.cause, Some(Cause::LinkLost));
    assert!(lost.counters.send_failures > 0);
    assert_eq!(bench.order(Order::Reset).state.mode, Mode::Fault, "not while it is away");
    let pty = plug(rig, &link);
    let back = until(&mut bench, "back", |sample| sample.counters.reopened == 1);
    assert_eq!(back.state.cause, Some(Cause::LinkLost), "still, until somebody resets it");
    until(&mut bench, "readings", |sample| sample.state.fresh);
    assert_eq!(bench.ticks(10).state.mode, Mode::Fault);
    assert_eq!(pty.call(|rig| *rig.joint_torque()).expect("it runs"), [0.0; 16]);
    bench.order(Order::Reset);
    until(&mut bench, "idle: the zeros are those of before", |sample| sample.state.mode == Mode::Idle);
    bench.order(Order::Enable);
    until(&mut bench, "active", |sample| sample.state.mode == Mode::Active);
}

#[test]
fn a_line_that_is_back_before_anybody_misses_it_is_a_fault_all_the_same() {
    if !has_pty() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let link = folder.path().join("hbot");
    let mut patient = RigConfig::prototype();
    patient.rig.timing.timeout_ticks = 1_000_000;
    let (mut bench, pty) = plugged_in(patient, &link);
    let rig = pty.stop().expect("it ran");
    until(&mut bench, "gone", |sample| sample.counters.send_failures > 0);
    let _pty = plug(rig, &link);
    until(&mut bench, "back", |sample| sample.counters.reopened == 1);
    let state = until(&mut bench, "a reading", |sample| sample.state.fresh).state;
    assert_eq!((state.mode, state.cause), (Mode::Fault, Some(Cause::LinkLost)));
}

#[test]
fn controllers_that_lost_power_while_away_come_back_without_zeros() {
    if !has_pty() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let link = folder.path().join("hbot");
    let (mut bench, pty) = plugged(&link);
    let mut rig = pty.stop().expect("it ran");
    rig.inject(Fault::Reboot);
    until(&mut bench, "lost", |sample| sample.state.mode == Mode::Fault);
    let _pty = plug(rig, &link);
    until(&mut bench, "back", |sample| sample.counters.reopened == 1);
    until(&mut bench, "readings", |sample| sample.state.fresh);
    // `assume` is believed once.
    bench.order(Order::Reset);
    let state = until(&mut bench, "reset", |sample| sample.state.mode != Mode::Fault).state;
    assert_eq!(state.mode, Mode::Unreferenced);
    assert_eq!(bench.order(Order::Enable).state.mode, Mode::Unreferenced);
}

#[test]
fn other_controllers_on_a_line_that_is_back_are_not_let_in() {
    if !has_pty() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let link = folder.path().join("hbot");
    let (mut bench, pty) = plugged(&link);
    drop(pty.stop());
    let mut config = SimulatedConfig::new(&RigConfig::prototype().rig);
    config.joints[2].counts_per_turn += 4;
    let other = plug(SimulatedRig::new(&config).expect("it can be simulated"), &link);
    let asked = Instant::now();
    while asked.elapsed() < Duration::from_secs(2) {
        assert_eq!(bench.tick().counters.reopened, 0);
        std::thread::sleep(Duration::from_millis(5));
    }
    drop(other);
}

#[test]
fn a_line_that_takes_no_bytes_costs_no_allocation() {
    if !has_pty() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let (mut bench, pty) = plugged(&folder.path().join("hbot"));
    let (go, wait) = std::sync::mpsc::channel::<()>();
    pty.post(move |_| _ = wait.recv()).expect("it runs");
    let deadline = Instant::now() + Duration::from_secs(60);
    let mut full = 0;
    // The terminal's buffers fill up, and then every write finds no room.
    while full < 1000 {
        assert!(Instant::now() < deadline);
        let before = bench.engine.counters().send_failures;
        let moment = Moment { tick: bench.tick, t_ns: 0, lateness_ns: 0, late: false, skipped: 0 };
        let info = allocation_counter::measure(|| bench.engine.tick(&moment));
        assert_eq!((info.count_total, info.count_current), (0, 0));
        bench.tick += 1;
        full += u32::from(bench.engine.counters().send_failures > before);
        while bench.end.try_sample().is_some() {}
    }
    drop(go);
}
