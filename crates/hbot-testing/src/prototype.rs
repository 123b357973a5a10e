//! The prototype: its geometry, its simulated rig, and its rig file with long time-outs.

use hbot_config::RigConfig;
use hbot_core::{Device, WheelSpec};
use hbot_sim::rig::{SimulatedConfig, SimulatedRig};

/// Returns the geometry and inertia of the prototype, as described in `rigs/prototype.toml`.
pub fn device() -> Device {
    RigConfig::prototype().rig.device
}

/// Returns the specifications of the prototype's two wheels.
pub fn wheels() -> [WheelSpec; 2] {
    let wheels: Vec<WheelSpec> = device().wheels().iter().map(|wheel| *wheel.spec()).collect();
    wheels.try_into().expect("two wheels")
}

/// Returns the prototype with changed wheels: `alter` returns the changed specification of each
/// wheel.
pub fn device_with(alter: impl Fn(WheelSpec) -> WheelSpec) -> Device {
    let device = device();
    let wheels = wheels().map(alter);
    Device::new(device.sphere_radius(), device.sphere_mass(), &wheels).expect("a legal device")
}

/// Returns `wheel` with the radius and joint inertias that are used to compare hbot with other
/// simulators (docs/internals/plant.md). They differ from those of the prototype.
pub fn of_the_task(wheel: WheelSpec) -> WheelSpec {
    WheelSpec { radius: 0.0102, steer_inertia: 3.105_468_222_7e-5, drive_inertia: 3.5202e-6, ..wheel }
}

/// Creates a simulated rig from `rigs/prototype.toml`, at rest.
pub fn simulated() -> SimulatedRig {
    simulated_as(&RigConfig::prototype(), |_| ())
}

/// Creates a simulated rig from a rig file. Before that, `spoil` can change the settings of the
/// simulation, for example to make the rig imperfect.
pub fn simulated_as(rig: &RigConfig, spoil: impl FnOnce(&mut SimulatedConfig)) -> SimulatedRig {
    let mut config = SimulatedConfig::new(&rig.rig);
    spoil(&mut config);
    SimulatedRig::new(&config).expect("it can be simulated")
}

/// Returns the prototype with a watchdog of 1 s and a time-out of 1000 ticks, so that tests on a
/// busy computer cause no fault. The kernel moves the bytes of a pseudo-terminal with ordinary
/// priority, so other work can delay them.
pub fn patient() -> RigConfig {
    RigConfig::from_toml(&patient_file(), "patient.toml").expect("a legal rig")
}

/// Returns the text of the rig file that [`patient`] reads: `rigs/prototype.toml` with a longer
/// time-out and watchdog.
pub fn patient_file() -> String {
    let prototype = include_str!("../../../rigs/prototype.toml");
    let patient = prototype.replace("timeout_ticks = 20", "timeout_ticks = 1000\nwatchdog_ms = 1000");
    assert_ne!(patient, prototype, "the prototype's time-out is written otherwise");
    patient
}
