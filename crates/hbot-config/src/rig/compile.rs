//! Makes a [`RigConfig`] of a rig file whose values are each in range. Checks what depends on more
//! than one value.

use std::collections::HashSet;
use std::net::SocketAddr;

use hbot_core::Vec3;
use hbot_core::design::device::{Device, DeviceError, MAX_JOINTS, WheelSpec};
use hbot_core::design::rig as core;

use super::compensation;
use super::file::{self, RigFile};
use super::settings::{self, Protocol};
use super::{ApiConfig, LineConfig, Port, RigConfig, TlsFiles};
use crate::advice::RateAdvice;
use crate::document::Report;

/// Default watchdog time on a serial port, ms: motor controllers switch their motors off if no
/// command arrives for this time. The simulated rig has a longer one, because its pseudo-terminal
/// can be slow on a busy machine.
const WATCHDOG_MS: u16 = 20;
const WATCHDOG_SIM_MS: u16 = 50;

/// Smoothing of the fed friction divided by the noise of the joint rates. A joint that rests is
/// then fed a seventh of its friction (root mean square), which does not move it.
const NOISES: f64 = 3.0;

/// Finds the value that the core has refused, and returns its path in the rig file.
fn place(mistake: &core::RigError) -> String {
    let field = match mistake.field {
        "timing.period_ns" => "loop.rate_hz",
        "timing.timeout_ticks" => "link.timeout_ticks",
        "counts" => "gear",
        "lead.factor" => "loop.lead.factor",
        "lead.longest" => "loop.lead.longest_ms",
        "drift" => "sphere.drift",
        "compensation.friction" => "loop.compensation.friction",
        "compensation.smoothing" => "loop.compensation.smoothing",
        field => field,
    };
    match mistake.joint {
        Some(joint) => {
            format!("wheel[{}].{}.{field}", joint / 2, if joint % 2 == 0 { "steer" } else { "drive" })
        }
        None => field.replace("methods.rate.", "loop.rate_estimate.").replace("methods.", "loop."),
    }
}

/// Checks that the tables of a rig file agree, and compiles the file to a rig. If they do not
/// agree, adds mistakes to the report and returns `None`.
pub(super) fn compile(file: RigFile, report: &mut Report) -> Option<RigConfig> {
    let wheels = wheel_names(&file, report);
    let timing = core::Timing {
        period_ns: (1_000_000_000 + u64::from(file.r#loop.rate_hz) / 2) / u64::from(file.r#loop.rate_hz),
        timeout_ticks: file.link.timeout_ticks,
    };
    let link = link(&file, &timing, report);
    let (ports, controllers) = controllers(&file, &link.port, report);
    let api = api(&file, report);
    file.r#loop.rate_estimate.check(report);
    let joints = joints(&file, link.protocol);
    let device = exact_zeros(device(&file, report)?, &file, &joints);
    let zero_offsets = each_joint(&file).map(|(_, settings)| settings.zero_offset).collect();
    let driven = each_joint(&file).filter(|(_, settings)| settings.motor);
    let usual = file.link.protocol.torque_lag();
    let torque_lag = driven.map(|(_, joint)| joint.torque_lag.unwrap_or(usual)).fold(0.0, f64::max);
    let usual = file.link.protocol.rate_lag();
    let rate_lag = each_joint(&file).map(|(_, joint)| joint.rate_lag.unwrap_or(usual)).fold(0.0, f64::max);
    let methods = core::Methods {
        rate: file.r#loop.rate_estimate.compile(),
        passivity: file.r#loop.passivity.compile(&device, timing.period_s()),
        ..file.r#loop.accuracy.methods()
    };
    let lead = file.r#loop.lead.compile();
    let limits = limits(&file.limits);
    let compensation = compensation::compile(&file);
    let drift = file.sphere.drift;
    let parts =
        core::RigParts { device, joints, limits, timing, methods, torque_lag, lead, compensation, drift };
    for mistake in parts.mistakes() {
        let path = place(&mistake);
        // The check of the wheels has reported its own.
        if !report.knows(&path) {
            report.push(&path, format!("{} is out of range", mistake.value), mistake.range.to_string());
        }
    }
    let rig = core::Rig::new(parts).ok().filter(|_| report.clean_under(""))?;
    let is_auto = file.r#loop.rate_estimate.is_auto();
    let mut config = RigConfig {
        name: file.name,
        certificate: file.certificate,
        rig,
        wheels,
        ports,
        controllers,
        zero_offsets,
        torque_lag,
        rate_lag,
        rate_pick: None,
        rate_hz: file.r#loop.rate_hz,
        early_ns: 1000 * u64::from(file.r#loop.early_us),
        wake_us: (file.r#loop.wake_us < settings::ANY_WAKE_US).then_some(file.r#loop.wake_us),
        cpu: file.r#loop.cpu,
        shaking_guard: file.r#loop.shaking_guard,
        accuracy: file.r#loop.accuracy.name(),
        link,
        api: api?,
    };
    if is_auto && let Some(pick) = RateAdvice::of(&config).map(|advice| advice.pick()) {
        config.rig = config.rig.with(|parts| parts.methods.rate = pick.picked.estimate).ok()?;
        config.rate_pick = Some(pick);
    }
    if config.rig.compensation.is_some() && !compensation::says_smoothing(&file.r#loop.compensation) {
        let noise = RateAdvice::of(&config).map_or(0.0, |advice| advice.noise_at_rest());
        let noisy = (NOISES * noise).min(core::legal::SMOOTHING.most);
        let smooth = |known: &mut core::Compensation| known.smoothing = known.smoothing.max(noisy);
        config.rig = config.rig.with(|parts| parts.compensation.iter_mut().for_each(smooth)).ok()?;
    }
    Some(config)
}

fn wheel_names(file: &RigFile, report: &mut Report) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for (i, (wheel, letter)) in file.wheel.iter().zip('A'..).enumerate() {
        let name = wheel.name.clone().unwrap_or_else(|| letter.to_string());
        if let Some(other) = names.iter().position(|n| *n == name) {
            let message = format!("{name:?} is the name of wheel[{other}] already");
            report.push(&format!("wheel[{i}].name"), message, "names that differ".to_owned());
        }
        names.push(name);
    }
    names
}

/// Iterates over all joints of a rig file, each with its path in the file. The order is that of the
/// wheels; each has its steer joint, then its drive joint.
fn each_joint(file: &RigFile) -> impl Iterator<Item = (String, &file::Joint)> {
    file.wheel.iter().enumerate().flat_map(|(i, wheel)| {
        [(format!("wheel[{i}].steer"), &wheel.steer), (format!("wheel[{i}].drive"), &wheel.drive)]
    })
}

/// Returns two lists with one element per joint: the index of the joint's serial line, and the
/// joint's position on that line. Adds a mistake to the report if a position is used twice or does
/// not exist.
fn controllers(file: &RigFile, port: &Port, report: &mut Report) -> (Vec<usize>, Vec<usize>) {
    let ports: Vec<usize> = each_joint(file).map(|(_, settings)| settings.port as usize).collect();
    let mut taken = HashSet::new();
    let mut order = Vec::new();
    let protocol = file.link.protocol;
    for (joint, (path, settings)) in each_joint(file).enumerate() {
        let line = ports[joint];
        let count = ports.iter().filter(|p| **p == line).count();
        let own = ports[..joint].iter().filter(|p| **p == line).count();
        if report.knows(&format!("{path}.controller")) {
            order.push(own);
            continue;
        }
        let position = settings.controller.map_or(own, |c| c as usize);
        let words = || match protocol.ids() {
            None => format!(
                "each of 0 to {} once; the place of a joint that names none is its own, here {own}",
                count - 1
            ),
            Some(_) => "ids that differ on each port".to_owned(),
        };
        if protocol.ids().is_none() && position >= count {
            let message = format!("{position} is past the last of {count} joints");
            report.push(&format!("{path}.controller"), message, words());
        } else if count > 1 && protocol.broadcast_id().is_some_and(|id| id as usize == position) {
            let message = format!("all controllers of this line would obey commands to {position}");
            report.push(
                &format!("{path}.controller"),
                message,
                format!("another id, or a separate port for the controller {position}"),
            );
        } else if !taken.insert((line, position)) {
            report.push(
                &format!("{path}.controller"),
                format!("{position} is taken by another joint"),
                words(),
            );
        }
        // The simulated rig always has one line.
        if let Port::Devices(devices) = port
            && line >= devices.len()
        {
            let message = format!("{line} is past the last of {} in link.port", devices.len());
            report.push(&format!("{path}.port"), message, format!("0 to {}", devices.len() - 1));
        }
        order.push(position);
    }
    if let Port::Devices(devices) = port {
        for (line, device) in devices.iter().enumerate() {
            if !ports.contains(&line) {
                report.push("link.port", format!("no joint is on {device}"), "ports with joints".to_owned());
            }
            if devices[..line].contains(device) {
                report.push("link.port", format!("{device} is named twice"), "ports that differ".to_owned());
            }
        }
    }
    (ports, order)
}

fn link(file: &RigFile, timing: &core::Timing, report: &mut Report) -> LineConfig {
    let port = match &file.link.port {
        settings::Ports::One(name) => Port::from(name.as_str()),
        settings::Ports::Several(names) => match names.as_slice() {
            [name] => Port::from(name.as_str()),
            names => Port::Devices(names.to_vec()),
        },
    };
    let default = if port.is_simulated() { WATCHDOG_SIM_MS } else { WATCHDOG_MS };
    let watchdog_ms = file.link.watchdog_ms.unwrap_or(default);
    let rate_hz = file.r#loop.rate_hz;
    let least_ms = timing.least_watchdog_ms();
    if u64::from(watchdog_ms) < least_ms {
        let message = format!("{watchdog_ms} ms is less than two loop periods at {rate_hz} Hz");
        report.push("link.watchdog_ms", message, format!("{least_ms} to 1000 ms"));
    }
    LineConfig {
        port,
        protocol: file.link.protocol,
        baud: file.link.baud,
        watchdog_ms,
        timeout_ticks: file.link.timeout_ticks,
    }
}

fn api(file: &RigFile, report: &mut Report) -> Option<ApiConfig> {
    let Ok(listen) = file.api.listen.parse::<SocketAddr>() else {
        let message = format!("{:?} is not an address with a port", file.api.listen);
        report.push("api.listen", message, "such as \"127.0.0.1:4268\" or \"[::1]:4268\"".to_owned());
        return None;
    };
    Some(ApiConfig {
        listen,
        token_file: file.api.token_file.clone(),
        tls: file
            .api
            .tls
            .as_ref()
            .map(|tls| TlsFiles { certificate: tls.certificate.clone(), key: tls.key.clone() }),
        on_client_lost: file.api.on_client_lost,
    })
}

fn device(file: &RigFile, report: &mut Report) -> Option<Device> {
    let specs: Vec<WheelSpec> = file
        .wheel
        .iter()
        .map(|wheel| WheelSpec {
            axis: Vec3::from_array(wheel.axis),
            cone: wheel.cone,
            toe: wheel.toe,
            radius: wheel.radius,
            steer_inertia: wheel.steer.inertia,
            drive_inertia: wheel.drive.inertia,
            axial_inertia: 0.0,
        })
        .collect();
    let error = match Device::new(file.sphere.radius, file.sphere.mass, &specs) {
        Ok(device) => return Some(device),
        Err(error) => error,
    };
    let path = match error {
        DeviceError::WheelCount(_) => "wheel".to_owned(),
        DeviceError::SphereRadius(_) => "sphere.radius".to_owned(),
        DeviceError::SphereMass(_) => "sphere.mass".to_owned(),
        DeviceError::Axis { wheel } => format!("wheel[{wheel}].axis"),
        DeviceError::Cone { wheel, .. } | DeviceError::BoundarySingular { wheel, .. } => {
            format!("wheel[{wheel}].cone")
        }
        DeviceError::Toe { wheel, .. } => format!("wheel[{wheel}].toe"),
        DeviceError::WheelRadius { wheel, .. } => format!("wheel[{wheel}].radius"),
        DeviceError::Inertia { wheel, .. } => format!("wheel[{wheel}]"),
        DeviceError::InteriorSingular { wheels: [_, later], .. } => format!("wheel[{later}].axis"),
    };
    // A missing direction of an axis has already been reported.
    if !report.knows(&path) {
        report.push(&path, error.to_string(), None);
    }
    None
}

/// Turns each wheel of `device` by the part of its zero offset that is less than a count. The loop
/// adds the whole counts to the readings ([`core::Joint::whole_counts`]).
fn exact_zeros(device: Device, file: &RigFile, joints: &[core::Joint; MAX_JOINTS]) -> Device {
    file.wheel.iter().enumerate().fold(device, |device, (i, wheel)| {
        let (joint, offset) = (&joints[2 * i], wheel.steer.zero_offset);
        match offset - joint.whole_counts(offset) * joint.radians_per_count() {
            0.0 => device,
            part => device.with_steering_zero(i, part),
        }
    })
}

fn joints(file: &RigFile, protocol: Protocol) -> [core::Joint; MAX_JOINTS] {
    let mut joints = [core::Joint::default(); MAX_JOINTS];
    for (joint, (_, settings)) in joints.iter_mut().zip(each_joint(file)) {
        let torque = |value: Option<f64>| value.filter(|_| settings.motor).unwrap_or(0.0);
        let (peak, continuous) = (torque(settings.peak), torque(settings.continuous));
        *joint = core::Joint { peak, continuous, ..settings.encoder(protocol) };
    }
    joints
}

fn limits(limits: &settings::Limits) -> core::Limits {
    core::Limits {
        torque: limits.torque,
        torque_rate: limits.torque_rate,
        speed: limits.speed,
        slip: limits.slip,
        traction: limits.traction.as_ref().map(|t| core::Traction { mu: t.mu, normal_force: t.normal_force }),
        enable_max_angle: limits.enable_max_angle,
        align_rate: limits.align_rate,
        reference_rate: limits.reference_rate,
        thermal_time: limits.thermal_time,
        energy: limits.energy.as_ref().map(|e| core::EnergyLimit { burst: e.burst, power: e.power }),
        max_age_ticks: limits.max_age_ticks,
    }
}
