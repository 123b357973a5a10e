//! The recorded run of firmware/core-hash: its hash is that of all other machines, in f32 and in
//! f64.

use crate::bench::{DT, Sphere, reading};
use hbot_core::Vec3;
use hbot_core::safety::mode::Mode;

/// The run in f64.
#[path = "../../../firmware/core-hash/src"]
pub mod double {
    pub(crate) use hbot_core as core;

    #[allow(clippy::duplicate_mod, reason = "the same source in both widths")]
    pub mod hash;
    #[allow(clippy::duplicate_mod, reason = "the same source in both widths")]
    pub(crate) mod run;
}

/// The run in f32.
#[allow(dead_code, reason = "the recording is made in f64 alone")]
#[path = "../../../firmware/core-hash/src"]
mod single {
    pub(crate) use hbot_core_f32 as core;

    #[allow(clippy::duplicate_mod, reason = "the same source in both widths")]
    mod hash;
    #[allow(clippy::duplicate_mod, reason = "the same source in both widths")]
    pub(crate) mod run;
}

use double::run::{Measured, RATE_UNIT, TICKS, follow, follow_led, rig};

const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../firmware/core-hash/src/recording.bin");

/// Returns the angular velocity with which a strong hand turns the sphere at the time `t` (s),
/// rad/s in N. It is smooth and reverses about each axis.
fn hand(t: f64) -> Vec3 {
    let wave = |rate: f64, start: f64| libm::sin(rate * t + start);
    Vec3::new(1.5 * wave(3.0, 0.0), 1.2 * wave(2.1, 1.0), wave(1.3, 2.0) + 0.5 * wave(11.0, 0.0))
}

/// Returns what the motor controllers of the prototype measure in each tick while the hand turns
/// the sphere.
fn record() -> Vec<Measured> {
    let rig = rig(false);
    let mut sphere = Sphere::new(rig.device);
    let mut counts = [0; 4];
    let each = |k: usize| {
        let reading = reading(&rig, &sphere, k as u32);
        sphere.turn(hand(k as f64 * DT), DT);
        core::array::from_fn(|j| {
            let change = reading.counts[j] - core::mem::replace(&mut counts[j], reading.counts[j]);
            (change as i16, (reading.rates[j] / RATE_UNIT).round() as i16)
        })
    };
    (0..TICKS).map(each).collect()
}

/// The recording is what [`record`] returns. `HBOT_BLESS=1` writes it anew.
#[test]
fn the_recording_is_that_of_a_sphere_that_a_hand_turns() {
    let bytes: Vec<u8> = record()
        .iter()
        .flatten()
        .flat_map(|(change, rate)| [change, rate])
        .flat_map(|x| x.to_le_bytes())
        .collect();
    if std::env::var_os("HBOT_BLESS").is_some() {
        std::fs::write(FILE, &bytes).expect("the recording can be written");
    }
    assert!(std::fs::read(FILE).expect("a recording") == bytes, "HBOT_BLESS=1 writes the recording anew");
}

#[test]
fn a_recorded_run_hashes_as_on_every_machine_in_both_widths() {
    for more in [false, true] {
        let mut seen = [0; 6];
        let mut saturated = 0;
        follow(more, |outputs| {
            seen[outputs.state.mode as usize] += 1;
            saturated += usize::from(outputs.state.scale < 1.0);
        });
        // The run contains everything that a hash should cover.
        assert!(seen[Mode::Active as usize] > 6000, "{seen:?}");
        for mode in [Mode::Idle, Mode::Enabling, Mode::Fault, Mode::Estop] {
            assert!(seen[mode as usize] > 50, "{mode:?}: {seen:?}");
        }
        assert!(!more || saturated > 100, "{saturated} ticks at a limit");
    }
    let (mut shaking, mut sigma) = (0, 0);
    follow_led(|outputs| {
        shaking += usize::from(outputs.state.shaking.is_some());
        sigma += usize::from(outputs.state.sigma.is_some());
    });
    assert!(shaking > 500 && sigma > 500, "{shaking} ticks, {sigma}");
    let (f32, f64) = (single::run::hashes(), double::run::hashes());
    let golden = (single::run::GOLDEN, double::run::GOLDEN);
    assert_eq!((f32, f64), golden, "the outputs hash to {f32:#018X?} in f32, {f64:#018X?} in f64");
}
