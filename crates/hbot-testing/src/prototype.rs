//! The prototype in simulation.

use hbot_config::RigConfig;
use hbot_core::{Device, WheelSpec};
use hbot_sim::rig::{SimulatedConfig, SimulatedRig};

/// The prototype.
#[must_use]
pub fn device() -> Device {
    RigConfig::prototype().rig.device
}

/// Its wheels.
///
/// # Panics
/// If the rig file has other than two.
#[must_use]
pub fn wheels() -> [WheelSpec; 2] {
    let wheels: Vec<WheelSpec> = device().wheels().iter().map(|wheel| *wheel.spec()).collect();
    wheels.try_into().expect("two wheels")
}

/// The prototype with wheels that `alter` changes.
///
/// # Panics
/// If the device is then not legal.
#[must_use]
pub fn device_with(alter: impl Fn(WheelSpec) -> WheelSpec) -> Device {
    let device = device();
    let wheels = wheels().map(alter);
    Device::new(device.sphere_radius(), device.sphere_mass(), &wheels).expect("a legal device")
}

/// The wheels of the comparison task of the plant's methods (docs/simulator.md): a smaller radius
/// and other inertias than the prototype's.
#[must_use]
pub fn of_the_task(wheel: WheelSpec) -> WheelSpec {
    WheelSpec { radius: 0.0102, steer_inertia: 3.105_468_222_7e-5, drive_inertia: 3.5202e-6, ..wheel }
}

/// The simulated rig of `rigs/prototype.toml`, at rest.
#[must_use]
pub fn simulated() -> SimulatedRig {
    simulated_as(&RigConfig::prototype(), |_| ())
}

/// The simulated rig of a rig file, with what `spoil` changes in it.
///
/// # Panics
/// If the rig cannot be simulated.
#[must_use]
pub fn simulated_as(rig: &RigConfig, spoil: impl FnOnce(&mut SimulatedConfig)) -> SimulatedRig {
    let mut config = SimulatedConfig::new(&rig.rig);
    spoil(&mut config);
    SimulatedRig::new(&config).expect("it can be simulated")
}

/// The prototype with a watchdog of 1 s and a time-out of 1000 ticks, which a busy machine does not
/// trip: the kernel moves a pseudo-terminal's bytes by a worker of ordinary priority, so other work
/// can hold them up.
///
/// # Panics
/// If the rig is not legal.
#[must_use]
pub fn patient() -> RigConfig {
    RigConfig::from_toml(&patient_file(), "patient.toml").expect("a legal rig")
}

/// The rig file of [`patient`].
///
/// # Panics
/// If `rigs/prototype.toml` writes its time-out in other words.
#[must_use]
pub fn patient_file() -> String {
    let prototype = include_str!("../../../rigs/prototype.toml");
    let patient = prototype.replace("timeout_ticks = 20", "timeout_ticks = 1000\nwatchdog_ms = 1000");
    assert_ne!(patient, prototype, "the prototype's time-out is written otherwise");
    patient
}
