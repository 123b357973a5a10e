//! `hbot controllers`: simulated motor controllers behind a pseudo-terminal, so that a vendor's
//! tool, a driver or a server can be tried on them.

use std::io::BufRead as _;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{anyhow, bail};
use clap::{Args, ValueEnum};
use hbot_config::rig::{Port, Protocol};
use hbot_host::rig::attach::{simulated_joints, urgent};
use hbot_sim::controller::InjectedFault;
use hbot_sim::phenomena::{CageFriction, Hand, JointFriction, Phenomena};
use hbot_sim::pty::{PtyOptions, spawn_pty};
use hbot_sim::rig::{SimulatedConfig, SimulatedRig};

use super::out::{note, say};

/// Options of `hbot controllers`.
#[derive(Debug, Args)]
pub(crate) struct ControllersArgs {
    /// What the controllers speak [default: the rig file's protocol]
    #[arg(long, value_enum)]
    protocol: Option<Spoken>,
    /// Rig file (TOML) [default: the prototype, built in]
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,
}

/// A protocol that simulated controllers speak.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum Spoken {
    /// hbot's own serial link
    Hbot,
    /// moteus servos behind an fdcanusb
    Moteus,
    /// ODrives behind a CAN adapter that speaks slcan
    Odrive,
}

impl From<Spoken> for Protocol {
    fn from(spoken: Spoken) -> Self {
        match spoken {
            Spoken::Hbot => Self::Hbot,
            Spoken::Moteus => Self::Moteus,
            Spoken::Odrive => Self::Odrive,
        }
    }
}

/// What a person does at the rig: the word that is typed for it, what it means, and what happens.
type Deed = (&'static str, &'static str, fn(&mut SimulatedRig));

const DEEDS: [Deed; 5] = [
    // A scene's reference stays within reach: at most 0.43 rad from where the hand took hold.
    ("turn", "a hand turns the sphere to and fro about all axes", |rig| {
        rig.set_hand(Some(Hand { amplitude: 0.25, rate: 0.4, ..Hand::default() }));
    }),
    ("hold", "a hand holds the sphere still", |rig| {
        rig.set_hand(Some(Hand { stiffness: 50.0, damping: 1.0, amplitude: 0.0, ..Hand::default() }));
    }),
    ("free", "no hand is on the sphere", |rig| rig.set_hand(None)),
    ("unplug", "the line is cut", |rig| rig.inject(InjectedFault::Deaf(true))),
    ("plug", "the line is whole again", |rig| rig.inject(InjectedFault::Deaf(false))),
];

/// Runs the controllers until standard input ends or the program is interrupted.
pub(crate) fn run(args: &ControllersArgs) -> anyhow::Result<ExitCode> {
    let mut config = super::rig_file::load(args.rig.as_deref(), &[])?;
    if let Port::Devices(devices) = &config.link.port
        && devices.len() > 1
    {
        bail!(
            "this rig has {} lines, and one pseudo-terminal stands for one line. Try the rig with `--port sim`, or write one device \
             into link.port",
            devices.len()
        );
    }
    let protocol = args.protocol.map_or(config.link.protocol, Protocol::from);
    if let Some(counts) = protocol.counts_per_turn() {
        config.rig = config
            .rig
            .with(|parts| parts.joints.iter_mut().for_each(|joint| joint.counts_per_turn = counts))
            .map_err(|error| anyhow!("{error}"))?;
    }
    let rig = &config.rig;
    let mut simulated = SimulatedConfig::new(rig);
    simulated.line = protocol.into();
    // With the zeros of the file: a rehearsal must not find other ones.
    simulated.joints = simulated_joints(&config);
    // The friction that the rig file says, or that of bearings: without any, nothing comes to rest.
    let measured = rig.compensation.as_ref();
    let joints_rub = measured.is_some_and(|it| it.joints.iter().any(|joint| joint.friction.is_some()));
    let sphere_rubs = measured.is_some_and(|it| it.sphere.is_some());
    simulated.phenomena = Phenomena {
        joint_friction: (!joints_rub).then(JointFriction::default),
        cage_friction: (!sphere_rubs).then(CageFriction::default),
        ..Phenomena::default()
    };
    simulated.imperfect = rig.compensation;
    let mut rig = SimulatedRig::new(&simulated).map_err(|error| anyhow!("{error}"))?;
    if protocol == config.link.protocol {
        for (joint, id) in config.controllers.iter().enumerate() {
            rig.controllers_mut().set_id(joint, *id as u8);
        }
    }
    let options = PtyOptions { on_start: Box::new(urgent), ..PtyOptions::default() };
    let pty = spawn_pty(rig, options).map_err(|error| anyhow!("{error}"))?;
    let path = pty.path().display();
    say!("{path}")?;
    note!(
        "Simulated {} controllers of {} answer there. A server whose rig file has this protocol moves them: \
         `hbot server --rig FILE --port {path}`\nType a word and Enter; Ctrl-C, or the end of standard input, ends them",
        protocol.name(),
        config.name
    );
    for (word, what, _) in DEEDS {
        note!("  {word:<8} {what}");
    }
    // A script ends them by closing standard input.
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        match DEEDS.iter().find(|(word, ..)| *word == line.trim()) {
            Some((_, what, act)) => {
                pty.post(*act).map_err(|error| anyhow!("{error}"))?;
                note!("{what}");
            }
            None => note!("{:?} is none of {}", line.trim(), DEEDS.map(|(word, ..)| word).join(", ")),
        }
    }
    note!("standard input has ended, and the controllers with it");
    Ok(ExitCode::SUCCESS)
}
