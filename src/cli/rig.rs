//! `hbot rig check`: prints a rig's margins over all steer angles, its torque and stiffness, and
//! whether its serial line is fast enough.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Subcommand;
use hbot_config::RigConfig;
use hbot_config::advice::{StiffnessBound, USUAL_DAMPING};
use hbot_core::allocation::{JointLimits, capability};
use hbot_core::design::kinematics::Posture;
use hbot_core::design::rig::Joint;
use hbot_core::design::singularity::{
    Indices, Meeting, actuation_margin, boundary_determinant, closest_approach, interior_margin_over_all,
};
use hbot_core::{Device, Vec3};
use hbot_host::bus::{BusTraffic, driver, late_rates};
use hbot_host::commission::doctor::{MOST_LOAD, lines};
use hbot_host::rig::host::uncalibrated;

use super::out::{note, tell};
use super::scene::plot::{svg, write};
use super::{bringup, rig_drawing, rig_new, style};

/// Number of postures that are examined.
const SAMPLES: usize = 4096;

/// The axes of frame N.
const AXES: [Vec3; 3] = [Vec3::X, Vec3::Y, Vec3::Z];

/// Returns the axes of frame N, and the directions between two or three of them.
fn directions() -> impl Iterator<Item = Vec3> {
    let signs = [-1.0, 0.0, 1.0];
    let all = signs.into_iter().flat_map(move |x| signs.map(|y| signs.map(|z| Vec3::new(x, y, z))));
    all.flatten().filter(|v| *v != Vec3::ZERO).map(Vec3::normalize)
}

/// The subcommands of `hbot rig`.
#[derive(Debug, Subcommand)]
pub(crate) enum RigCommand {
    /// Write a commented rig file from a few answers
    New(rig_new::NewArgs),
    /// Check a rig file: margins over all steering angles, capability, indices, serial line
    Check {
        /// The rig file (TOML) [default: the prototype, built in]
        file: Option<PathBuf>,
        /// The same, as an option
        #[arg(long = "rig", value_name = "FILE", conflicts_with = "file")]
        named: Option<PathBuf>,
        /// Draw the sphere, the wheels, their cones and contact frames into this file; its name
        /// ends in .svg
        #[arg(long, value_name = "OUT.svg", value_parser = svg)]
        drawing: Option<PathBuf>,
    },
    /// List the controllers that answer on each line, and each setting that is not as it must be;
    /// changes nothing
    Scan(bringup::ScanArgs),
    /// Test one joint (sign, counts, gear) with a small torque within watched limits, the sphere
    /// taken out
    Test(bringup::TestArgs),
    /// Find signs, steering zeros, wheel radii and cones while a person turns the sphere, with
    /// motors off
    Calibrate(bringup::CalibrateArgs),
    /// Find the true axes, cones, toes, radii and zeros in recordings of a person who turns the
    /// sphere, with motors off; or, with --motors, torque constants, friction and inertias
    Identify(bringup::IdentifyArgs),
    /// Write a page about a rig: geometry, drift, torque, friction, inertia, stiffness, latency,
    /// each with its interval and how it was measured
    Certify(bringup::CertifyArgs),
}

pub(crate) fn run(command: RigCommand) -> anyhow::Result<ExitCode> {
    let (file, drawing) = match command {
        RigCommand::Check { file, named, drawing } => (file.or(named), drawing),
        RigCommand::New(args) => return rig_new::run(args),
        RigCommand::Scan(args) => return bringup::run_scan(&args),
        RigCommand::Test(args) => return bringup::test(&args),
        RigCommand::Calibrate(args) => return bringup::run_calibrate(&args),
        RigCommand::Identify(args) => return bringup::run_identify(&args),
        RigCommand::Certify(args) => return bringup::run_certify(&args),
    };
    let config = super::rig_file::load(file.as_deref(), &[])?;
    if let Some(out) = &drawing {
        write(out, &rig_drawing::svg(&config))?;
    }
    let warnings = Warnings::of(&config);
    tell!("{}{}{}: a legal design{}", style::NAME, config.name, style::OFF, warnings.in_words())?;
    if file.is_none() {
        note!("{}note{}: without a file this checks the built-in prototype", style::WARN, style::OFF);
    }
    if let Some(pick) = &config.rate_pick {
        tell!("  {}rates:{} {}", style::NAME, style::OFF, pick.sentence())?;
    }
    if let Some(advice) = late_rates(&config) {
        tell!("  {}note:{} {advice}", style::NAME, style::OFF)?;
    }
    for warning in warnings.unlikely.iter().chain(&warnings.lax).chain(&warnings.uncalibrated) {
        tell!("  {}warning:{} {warning}", style::WARN, style::OFF)?;
    }
    geometry(&config, &warnings)?;
    abilities(&config, &warnings)?;
    stiffness(&config)?;
    let fits = line(&config)?;
    if let Some(out) = &drawing {
        tell!("\ndrawing {}", out.display())?;
    }
    // The headline has left a small terminal by now. A simulated line carries everything.
    let simulated = config.link.port.is_simulated();
    let lines = match (fits, simulated) {
        (true, _) => "every line fits",
        (false, true) => "a real line would not fit (see \"line\" above)",
        (false, false) => "a line does not fit",
    };
    tell!("\n{}{}{}: a legal design{}; {lines}", style::NAME, config.name, style::OFF, warnings.in_words())?;
    Ok(if fits || simulated { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// What `hbot rig check` warns about. It is found first, so that the headline can count it.
struct Warnings {
    /// A sentence for each size that is probably in another unit.
    unlikely: Vec<String>,
    /// A sentence for each limit that protects nobody.
    lax: Vec<String>,
    /// A sentence for each wheel that leaves its steering zero to a calibration.
    uncalibrated: Vec<String>,
    /// The pairs of wheels that can collide, from 0.
    colliding: Vec<[usize; 2]>,
    /// The least spectral index of the driven joints over all postures.
    actuation: f64,
    /// The largest tangential force that a drive motor can make at its contact, N, if nothing says
    /// what friction holds.
    unlimited: Option<f64>,
    /// The largest torque that the motors make about an axis at any steering angles, N m, if
    /// `limits.torque` permits more and so limits nothing.
    exceeded: Option<f64>,
}

impl Warnings {
    fn of(config: &RigConfig) -> Self {
        let (device, joints) = (&config.rig.device, &config.rig.joints);
        let wheels = device.wheels();
        let pairs = (0..wheels.len()).flat_map(|j| (0..j).map(move |i| [i, j]));
        let can_collide =
            |&[i, j]: &[usize; 2]| closest_approach(&wheels[i], &wheels[j], Meeting::Collocated) == 0.0;
        let driven: Vec<bool> = joints[..device.joints()].iter().map(|joint| joint.peak > 0.0).collect();
        let margins = torus(device).map(|th| actuation_margin(&Posture::new(device, &th), &driven));
        let peak = JointLimits::of(&config.rig);
        let most = torus(device)
            .flat_map(|th| {
                let posture = Posture::new(device, &th);
                directions().map(move |axis| capability(posture.rows(), &peak, axis))
            })
            .fold(0.0, f64::max);
        Self {
            unlikely: unlikely(config),
            lax: lax(config),
            uncalibrated: uncalibrated(config),
            colliding: pairs.filter(can_collide).collect(),
            actuation: margins.fold(f64::INFINITY, f64::min),
            unlimited: config.rig.limits.traction.is_none().then(|| largest_push(config)),
            exceeded: (config.rig.limits.torque > most).then_some(most),
        }
    }

    /// Returns whether the motors can hardly make some torques at some steering angles.
    fn is_weak(&self) -> bool {
        self.actuation < 0.05
    }

    /// Returns number and kinds of the warnings as the end of the headline. Empty if there is none.
    fn in_words(&self) -> String {
        let kinds = [
            ("unlikely size", self.unlikely.len()),
            ("limit that protects nobody", self.lax.len()),
            ("steering zero not known", self.uncalibrated.len()),
            ("wheels can collide", self.colliding.len()),
            ("weak at some steering angles", usize::from(self.is_weak())),
            ("no limits.traction", usize::from(self.unlimited.is_some())),
            ("limits.torque limits nothing", usize::from(self.exceeded.is_some())),
        ];
        let count: usize = kinds.iter().map(|(_, count)| count).sum();
        let names: Vec<&str> = kinds.iter().filter(|(_, count)| *count > 0).map(|(name, _)| *name).collect();
        match count {
            0 => String::new(),
            1 => format!(", 1 warning ({})", names.join(", ")),
            _ => format!(", {count} warnings ({})", names.join(", ")),
        }
    }
}

/// Returns a sentence for each size that looks as if it was written in another unit.
fn unlikely(config: &RigConfig) -> Vec<String> {
    /// Density of lead, kg/m³.
    const LEAD: f64 = 11_340.0;
    let device = &config.rig.device;
    let (radius, mass) = (device.sphere_radius(), device.sphere_mass());
    let of_lead = mass / (4.0 / 3.0 * std::f64::consts::PI * radius.powi(3) * LEAD);
    let heavy = (of_lead > 1.0).then(|| {
        format!("sphere.mass {mass} kg is {of_lead:.1} times that of a ball of lead with this radius: is it in grams?")
    });
    let wheels = device.wheels().iter().enumerate().map(|(i, wheel)| (i, wheel.spec().radius));
    let large = wheels.filter(|(_, own)| *own > radius).map(|(i, own)| {
        format!("wheel[{i}].radius {own} m is more than the sphere's {radius} m: is it in another unit?")
    });
    heavy.into_iter().chain(large).collect()
}

/// Returns a sentence for each limit that is so lax that it protects nobody.
fn lax(config: &RigConfig) -> Vec<String> {
    /// Longest watchdog time that needs no warning, ms.
    const WATCHDOG_MS: u16 = 100;
    /// Largest limit of the sphere's speed that needs no warning, rad/s.
    const SPEED: f64 = 60.0;
    let (watchdog, speed) = (config.link.watchdog_ms, config.rig.limits.speed);
    let slow = (watchdog > WATCHDOG_MS).then(|| {
        format!("link.watchdog_ms {watchdog}: if commands stop, the motors hold their last torque for {watchdog} ms; 20 ms is usual")
    });
    let fast = (speed > SPEED)
        .then(|| format!("limits.speed {speed} rad/s: hands turn a sphere at up to 30 rad/s, and the rig stops a faster one only beyond this"));
    slow.into_iter().chain(fast).collect()
}

/// Returns the largest tangential force that a drive motor can make at its contact, N.
fn largest_push(config: &RigConfig) -> f64 {
    let wheels = config.rig.device.wheels().iter().enumerate();
    let pushes = wheels.map(|(i, wheel)| config.rig.joints[2 * i + 1].peak / wheel.spec().radius);
    pushes.fold(0.0, f64::max)
}

fn geometry(config: &RigConfig, warnings: &Warnings) -> anyhow::Result<()> {
    let device = &config.rig.device;
    tell!("\nmargins over all steering angles")?;
    for (wheel, name) in device.wheels().iter().zip(&config.wheels) {
        tell!(
            "  boundary   {name}: det H = {:.3e} m², sin(cone) cos(toe) = {:.4} (0 is singular)",
            boundary_determinant(device, wheel),
            wheel.axis_along_roll()
        )?;
    }
    for (j, b) in device.wheels().iter().enumerate() {
        for (i, a) in device.wheels()[..j].iter().enumerate() {
            let (names, near) =
                ([&config.wheels[i], &config.wheels[j]], closest_approach(a, b, Meeting::Collocated));
            let opposite = closest_approach(a, b, Meeting::Antipodal);
            let [first, second] = names;
            tell!(
                "  contacts   {first} and {second}: at least {:.2} deg apart, {:.2} deg from opposite",
                near.to_degrees(),
                opposite.to_degrees()
            )?;
            if warnings.colliding.contains(&[i, j]) {
                tell!(
                    "             {}warning:{} these wheels can collide; other wheels keep the sphere controlled",
                    style::WARN,
                    style::OFF
                )?;
            }
        }
    }
    let bound = if device.wheels().len() == 2 { "" } else { "at least " };
    tell!("  interior   sigma_min(Z)/R = {bound}{:.4} (0 is singular)", interior_margin_over_all(device))
}

fn abilities(config: &RigConfig, warnings: &Warnings) -> anyhow::Result<()> {
    let rig = &config.rig;
    let peak = JointLimits::of(rig);
    let lasting = |joint: &Joint| if joint.peak > 0.0 { joint.continuous } else { 0.0 };
    let continuous = JointLimits::of_device(&rig.device, |i| lasting(&rig.joints[i]));
    let (mut least, mut mean) = (f64::INFINITY, 0.0);
    let mut capable = [[f64::INFINITY; 3]; 2];
    for th in torus(&rig.device) {
        let posture = Posture::new(&rig.device, &th);
        let index = Indices::of(posture.rows()).spectral;
        least = least.min(index);
        mean += index / SAMPLES as f64;
        for (row, limits) in capable.iter_mut().zip([&peak, &continuous]) {
            for (value, axis) in row.iter_mut().zip(AXES) {
                *value = value.min(capability(posture.rows(), limits, axis));
            }
        }
    }
    let actuation = warnings.actuation;
    tell!("  actuation  least spectral index of the driven joints = {actuation:.3} (0 is singular)")?;
    if warnings.is_weak() {
        tell!(
            "             {}warning:{} at some steering angles the motors can hardly make some torques",
            style::WARN,
            style::OFF
        )?;
    }
    tell!("\nover {SAMPLES} postures spread evenly over all steering angles")?;
    tell!("  spectral index, all joints: mean {mean:.3}, least {least:.3}")?;
    for (name, [a, b, c]) in ["peak", "continuous"].iter().zip(capable) {
        tell!("  {name} torque, least about n1 n2 n3: {a:.3} {b:.3} {c:.3} N m")?;
    }
    if let Some(most) = warnings.exceeded {
        tell!(
            "             {}warning:{} limits.torque = {} N m limits nothing: the motors make at most {most:.3} N m about any axis. \
             limits.torque is what protects the hand: lower it",
            style::WARN,
            style::OFF,
            rig.limits.torque
        )?;
    }
    traction(config, warnings)
}

/// Says what friction holds at a contact, or warns that nothing says it.
fn traction(config: &RigConfig, warnings: &Warnings) -> anyhow::Result<()> {
    if let Some(push) = warnings.unlimited {
        return tell!(
            "  traction   {}warning:{} limits.traction is absent: a motor can push with {push:.0} N at its contact, and nothing says \
             what friction holds. A wheel that slips is not felt: write traction = {{ mu = .., normal_force = .. }}",
            style::WARN,
            style::OFF
        );
    }
    let Some(traction) = config.rig.limits.traction else { return Ok(()) };
    let (push, holds) = (largest_push(config), traction.mu * traction.normal_force);
    let less = if push <= holds { "friction holds it" } else { "friction limits the torque" };
    tell!("  traction   a contact holds {holds:.1} N, and a motor pushes with up to {push:.1} N: {less}")
}

/// Prints the stiffness that the rig can render, and the assumptions behind it.
fn stiffness(config: &RigConfig) -> anyhow::Result<()> {
    let Some(expected) = StiffnessBound::of(config) else { return Ok(()) };
    let [most, with] = expected.most();
    tell!(
        "\nstiffness to expect at {} Hz, from a reading to its torque D = {} tick, lag of the motors {:.3} ms (torque_lag), \
         least apparent inertia J = {:.2e} kg m²",
        config.rate_hz,
        expected.sampled().delay,
        1.0e3 * expected.sampled().lag,
        expected.inertia()
    )?;
    let examples = [USUAL_DAMPING / 2.0, USUAL_DAMPING, 2.5 * USUAL_DAMPING];
    let examples = examples.map(|damping| format!("{:.3} at {damping}", expected.stable(damping)));
    let examples = examples.join(", ").replacen(" at", " N m/rad at", 1);
    let lead = expected.sampled().lead;
    if lead > 0.0 {
        tell!(
            "  lead       {:.2} ms (loop.lead): a scene is rendered where the sphere will be when the torque acts",
            1.0e3 * lead
        )?;
        tell!("  stable     up to {examples} N m s/rad of damping, the device's and the spring's together")?;
        tell!("             whatever the damping, up to {most:.0} N m/rad, with {with:.2} N m s/rad")?;
    } else {
        tell!(
            "  stable     up to about (b + B) / (h (1/2 + D) + lag), b the device's damping and B the spring's: {examples} N m s/rad"
        )?;
        tell!(
            "             whatever the damping, up to {most:.0} N m/rad, with B = {with:.2} (J / (4 h²) without the lag)"
        )?;
    }
    tell!("             in small motions; after a tap often less, which `hbot scene check` says")?;
    tell!(
        "  counts     one turns the sphere by up to {:.1e} rad: passive up to 2 c/d = {:.3} N m/rad for each mN m of Coulomb friction c",
        expected.count(),
        expected.quiet(1.0e-3)
    )?;
    let stage = if config.rig.methods.passivity.is_some() { "on" } else { "off" };
    tell!(
        "  passivity  the stage is {stage} (loop.passivity); what it holds beyond the stable stiffness: docs/internals/borders.md"
    )
}

/// Returns steer angles spread evenly over all postures: a Kronecker sequence of the generalised
/// golden ratio (Roberts 2018).
fn torus(device: &Device) -> impl Iterator<Item = Vec<f64>> {
    let n = device.wheels().len();
    // The root of x^(n+1) = x + 1, by fixed-point iteration.
    let g = (0..64).fold(1.5_f64, |x, _| (1.0 + x).powf(1.0 / (n as f64 + 1.0)));
    (0..SAMPLES).map(move |k| {
        (1..=n).map(|i| (0.5 + k as f64 * g.powi(-(i as i32))).fract() * std::f64::consts::TAU).collect()
    })
}

/// Prints the load of each serial line. Returns whether every line can carry one command and one
/// reading per tick.
fn line(config: &RigConfig) -> anyhow::Result<bool> {
    // What the simulated rig has on one line can be meant for several.
    lines(config).iter().try_fold(true, |fits, (name, joints)| Ok(one_line(config, name, *joints)? && fits))
}

fn one_line(config: &RigConfig, name: &str, joints: usize) -> anyhow::Result<bool> {
    let traffic = driver(config.link.protocol).traffic(joints);
    if let Some(bus) = &traffic.bus {
        tell!("\nline {name}, {} Hz, {joints} joints", config.rate_hz)?;
        tell!(
            "  text: at most {} bytes a tick to the adapter and {} back",
            traffic.commands,
            traffic.feedback
        )?;
        return bus_line(config, bus);
    }
    tell!("\nserial line {name} at {} baud, {} Hz, {joints} joints", config.link.baud, config.rate_hz)?;
    let mut fits = true;
    // The controllers' own processing time lies between a command and its answer.
    let turnaround = f64::from(traffic.turnaround_us) * 1e-6 * f64::from(config.rate_hz);
    for (name, bytes, extra) in
        [("commands", traffic.commands, 0.0), ("feedback", traffic.feedback, turnaround)]
    {
        let load = config.link.load(bytes, config.rate_hz) + extra;
        let (fitting, verdict) = verdict(config, load);
        fits &= fitting;
        let remedy = if fitting { "" } else { ": raise link.baud or lower loop.rate_hz" };
        tell!(
            "  {name}: at most {bytes} bytes a tick, {:.0} % of the line, {verdict}{remedy}",
            100.0 * load
        )?;
    }
    Ok(fits)
}

/// Returns whether a line is fast enough if `load` is the used share of its capacity, and the words
/// that say so.
fn verdict(config: &RigConfig, load: f64) -> (bool, String) {
    // The simulated port and USB accept bytes faster than the baud rate suggests.
    let simulated = config.link.port.is_simulated();
    if load <= MOST_LOAD {
        (true, format!("{}fits{}", style::GOOD, style::OFF))
    } else if simulated {
        (false, format!("{}would not fit on a real line{}", style::WARN, style::OFF))
    } else {
        (false, format!("{}does not fit{}", style::BAD, style::OFF))
    }
}

/// Prints how long the frames of a tick take on the bus behind an adapter. If they do not fit,
/// prints what to change. Returns whether they fit.
fn bus_line(config: &RigConfig, bus: &BusTraffic) -> anyhow::Result<bool> {
    let period_ns = config.rig.timing.period_ns as f64;
    let load = bus.most_ns as f64 / period_ns;
    let (fits, verdict) = verdict(config, load);
    tell!(
        "  {}: {:.0} to {:.0} us a tick of {:.0} us, at most {:.0} % of the bus, {verdict}",
        bus.name,
        bus.least_ns as f64 / 1000.0,
        bus.most_ns as f64 / 1000.0,
        period_ns / 1000.0,
        100.0 * load
    )?;
    if load <= MOST_LOAD {
        return Ok(fits);
    }
    let rate = (MOST_LOAD * 1e9 / bus.most_ns as f64).floor();
    let when = if config.link.port.is_simulated() { "for a real line: " } else { "" };
    tell!(
        "    {when}spread the joints over {} lines (link.port a list, `port` of each joint), or lower loop.rate_hz to {rate}",
        (load / MOST_LOAD).ceil()
    )?;
    if let Some(expected) = StiffnessBound::of(config) {
        let slower = expected.at_rate(rate);
        tell!(
            "    at {rate} Hz a spring is stable up to about {:.0} N m/rad with a damping of {USUAL_DAMPING} N m s/rad, at {} Hz up to {:.0}",
            slower.stable(USUAL_DAMPING),
            config.rate_hz,
            expected.stable(USUAL_DAMPING)
        )?;
    }
    Ok(fits)
}
