//! `hbot hand`: lets the hand of a simulated rig turn the sphere, and shows the torque that it
//! feels.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use anyhow::{anyhow, bail};
use clap::{Args, Subcommand};
use hbot_api::{
    Client, ClientError, ErrorBody, ErrorCode, Event, Fault, HandCommand, HandHold, InfoOk, MAX_OVER_MS,
    Mode, Op, StateEvent,
};
use hbot_config::SceneFile;
use hbot_config::sweep::Probe;
use hbot_core::{Quat, Vec3, rotation};
use hbot_host::run_loop::{StopFlag, signals};
use hbot_plot::{Curve, PlotPanel, sheet};

use super::numbers::real;
use super::out::{error, note, say, tell};
use super::progress::Progress;
use super::scene::plot::{svg, writable, write};
use super::show;
use super::{Commanding, orders};

/// Number of rows of the table.
const ROWS: usize = 12;
/// Longest time without a state after which the command gives up.
const SILENCE: Duration = Duration::from_secs(2);
/// Longest time for which the hand waits at the end of the turn until the sphere rests, s.
const REST_S: f64 = 3.0;
/// Time for which the sphere is still when it counts as at rest, s.
const STILL_S: f64 = 0.1;
/// Below this rate about the axis the sphere counts as still, rad/s: in a slow turn below a part of
/// the turn's rate.
const STILL: f64 = 0.02;
const STILL_PART: f64 = 0.2;
/// Angle by which the pull of the hand may differ from where the sphere is, rad.
const ASTRAY: f64 = 0.2;
/// A fraction of a limit at which it counts as reached.
const AT_LIMIT: f64 = 0.98;

/// The subcommands of `hbot hand`.
#[derive(Debug, Subcommand)]
pub(crate) enum HandCommands {
    /// Turn the sphere from where it is and print the torque against the angle, beside that of the
    /// scene's law. After that, the hand of the scene goes on from there
    Turn(TurnArgs),
}

/// Options of `hbot hand turn`.
#[derive(Debug, Args)]
pub(crate) struct TurnArgs {
    /// Axis: n1 or x, n2 or y, n3 or z
    #[arg(value_parser = axis)]
    axis: NamedAxis,
    /// Angle, such as 40deg or 0.7rad, at most 175deg
    #[arg(value_parser = angle, allow_hyphen_values = true)]
    angle: f64,
    /// Time in which the hand turns, such as 2s, 0.1s to 60s
    #[arg(long, value_name = "TIME", default_value = "2s", value_parser = time)]
    over: f64,
    /// Stiffness of the hand's grip, 0 to 100 N m/rad
    #[arg(long, value_name = "NM/RAD", default_value_t = 20.0, value_parser = grip, allow_negative_numbers = true)]
    stiffness: f64,
    /// File for a picture of torque against angle; its name ends in .svg
    #[arg(long, value_name = "FILE.svg", value_parser = svg)]
    out: Option<PathBuf>,
    #[command(flatten)]
    to: Commanding,
}

/// An axis of frame N.
#[derive(Debug, Clone)]
pub(super) struct NamedAxis {
    name: &'static str,
    unit: Vec3,
}

pub(super) fn axis(text: &str) -> Result<NamedAxis, String> {
    let all = [("n1", "x", Vec3::X), ("n2", "y", Vec3::Y), ("n3", "z", Vec3::Z)];
    let found = all.into_iter().find(|(name, other, _)| [*name, *other].contains(&text));
    found
        .map(|(name, _, unit)| NamedAxis { name, unit })
        .ok_or_else(|| "n1 or x, n2 or y, n3 or z".to_owned())
}

/// Parses an angle with its unit. Returns it in rad.
fn angle(text: &str) -> Result<f64, String> {
    let number = |text: &str| text.trim().parse::<f64>().ok();
    let rad = text.strip_suffix("deg").and_then(number).map(f64::to_radians);
    rad.or_else(|| text.strip_suffix("rad").and_then(number))
        .filter(|rad| *rad != 0.0 && rad.abs() <= MOST)
        .ok_or_else(|| "an angle with its unit, such as 40deg or -0.7rad, at most 175deg".to_owned())
}

/// Parses the stiffness of a grip, N m/rad.
fn grip(text: &str) -> Result<f64, String> {
    real("N m/rad", |stiffness| (0.0..=100.0).contains(&stiffness), "0 to 100")(text)
}

/// Parses the time of a turn, s.
fn time(text: &str) -> Result<f64, String> {
    real("s", |s| (0.1..=MAX_OVER_MS as f64 * 1.0e-3).contains(&s), "0.1 to 60")(text)
}

/// Largest angle of a turn, rad: 175 degrees. Near half a turn, the hand can go the other way.
const MOST: f64 = 3.0544;

/// One state of the turn: torques about the axis, N m, against the angle about it, rad.
struct Point {
    angle: f64,
    hand: f64,
    rig: f64,
    /// `None` if the state does not show where the effects are anchored.
    law: Option<f64>,
}

pub(crate) fn run(HandCommands::Turn(args): &HandCommands) -> anyhow::Result<ExitCode> {
    // Before the sphere turns.
    args.out.as_deref().map(writable).transpose()?;
    let mut client = orders::connect(&args.to.address, "hbot hand")?;
    let info = client.info().map_err(orders::remedied)?;
    if !info.rig.simulated {
        bail!("this server drives a real rig; only a simulated one has a hand that a program moves");
    }
    if let Some(mode) = info.mode.filter(|mode| !matches!(mode, Mode::Active | Mode::Enabling)) {
        note!("the rig makes no torque, because it is in the mode {mode}{}", show::next(mode));
    }
    if info.incident.as_ref().is_some_and(|incident| incident.fault == Some(Fault::LinkLost)) {
        bail!(
            "there are no readings (fault link_lost), so nobody sees the turn: `hbot info` shows what to do"
        );
    }
    let stop = signals::stop_flag()?;
    let states = orders::holding(&mut client, args.to.steal, |client| turn(client, args, &stop))?;
    let points = points(&info, &states, args.axis.unit)?;
    if !stop.is_set() || states.len() > ROWS {
        table(&points)?;
    }
    if stop.is_set() {
        // The hand lets go with the lease.
        let (first, last) = (&states[0], &states[states.len() - 1]);
        let turned = rotation::difference(quat(last.q), quat(first.q)).dot(args.axis.unit);
        error(&format!(
            "the turn was broken off after {:.1} s at {:.1} deg",
            last.t - first.t,
            turned.to_degrees()
        ));
        signals::end_as_interrupted()?;
    }
    for line in told(&info, &states, &points, args) {
        tell!("{line}")?;
    }
    let (end, last) = (&points[points.len() - 1], &states[states.len() - 1]);
    let astray = is_still(last, args).then(|| astray(args, end)).flatten();
    if let Some(off) = astray {
        bail!(
            "the hand holds the sphere {:.0} deg from where its pull says: the server does not know the sphere's orientation, \
             since it had no readings for a while or a wheel slipped. Start the server again",
            off.to_degrees()
        );
    }
    // Where no hand held the sphere before, none does after the turn.
    if states[0].hand.is_some() {
        let back = (-1.0e2 * points[points.len() - 1].angle.to_degrees()).round() / 1.0e2;
        tell!(
            "the scene's hand goes on from there; `hbot hand turn {} {back}deg` turns it back",
            args.axis.name
        )?;
    }
    if let Some(path) = &args.out {
        write(path, &picture(&info, &points, args.axis.name))?;
        say!("{}", path.display())?;
    }
    // A turn that a stop or a fault has ended is no measurement.
    let has_torque = |state: &StateEvent| matches!(state.mode, Mode::Active | Mode::Enabling);
    let is_stopped = has_torque(&states[0]) && !states.iter().all(has_torque);
    Ok(if is_stopped { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// Turns the sphere until a signal sets `stop`, at most. Returns the states of the turn.
fn turn(client: &mut Client, args: &TurnArgs, stop: &StopFlag) -> Result<Vec<StateEvent>, ClientError> {
    let rate_hz = client.hello().rate_hz;
    client.subscribe(1)?;
    let begin = next(client, 0.0)?;
    let to = rotation::exp(args.axis.unit * args.angle) * quat(begin.q);
    let hold = HandHold {
        q: [to.w, to.x, to.y, to.z],
        over_ms: (args.over * 1.0e3) as u64,
        stiffness: Some(args.stiffness),
        damping: None,
        inertia: None,
    };
    client.call(Op::Hand(HandCommand::Hold(hold)))?;
    let ticks = |s: f64| (s * rate_hz) as u64;
    let (over, longest) = (begin.tick + ticks(args.over), begin.tick + ticks(args.over + REST_S));
    let (mut moved, begun) = (begin.tick, begin.t);
    let mut states = vec![begin];
    let mut progress = Progress::new();
    while !stop.is_set() {
        let last = &states[states.len() - 1];
        if !is_still(last, args) {
            moved = last.tick;
        }
        if last.tick >= longest || last.tick >= over && last.tick >= moved + ticks(STILL_S) {
            break;
        }
        let since = last.t - begun;
        progress.show(|_| format!("{since:.0} s of {} s", args.over));
        states.push(next(client, since)?);
    }
    // The turn is over: a server that is too busy to answer takes nothing of it away.
    let _ = client.unsubscribe();
    Ok(states)
}

/// Returns whether the sphere does not turn about the axis.
fn is_still(state: &StateEvent, args: &TurnArgs) -> bool {
    let rate = Vec3::from_array(state.omega).dot(args.axis.unit);
    rate.abs() < STILL.min(STILL_PART * args.angle.abs() / args.over)
}

/// Returns by how much the turn ended elsewhere than the pull of the hand's spring says, rad, if
/// that is much.
fn astray(args: &TurnArgs, end: &Point) -> Option<f64> {
    let off = rotation::wrap_angle(args.angle - end.angle - end.hand / args.stiffness);
    (args.stiffness > 0.0 && off.abs() > ASTRAY).then_some(off)
}

/// Returns the next state. Fails if another client takes the lease. `since` is the time since the
/// turn began, s.
fn next(client: &mut Client, since: f64) -> Result<StateEvent, ClientError> {
    let own = client.hello().session;
    loop {
        match client.next_event(SILENCE)? {
            Some(Event::State(state)) => return Ok(state),
            Some(Event::Lease(lease)) if lease.session != Some(own) => {
                let holder = lease.holder.unwrap_or_else(|| "nobody".to_owned());
                let said =
                    format!("the lease was lost {since:.1} s after the turn began; now {holder:?} holds it");
                return Err(ClientError::Server(ErrorBody::new(ErrorCode::NotHolder, said)));
            }
            Some(_) => {}
            None => return Err(ClientError::NoState { after: SILENCE }),
        }
    }
}

fn quat([w, x, y, z]: [f64; 4]) -> Quat {
    Quat::from_xyzw(x, y, z, w)
}

/// Returns the torques of the turn, with that of the scene's law at each orientation.
fn points(info: &InfoOk, states: &[StateEvent], axis: Vec3) -> anyhow::Result<Vec<Point>> {
    let scene = SceneFile::from_json(info.scene.clone()).map_err(|error| anyhow!("{error}"))?;
    let first = &states[0];
    let probe = Probe::new(&scene);
    let anchor = probe.anchor(quat(first.reference.unwrap_or(first.q)));
    let period_s = 1.0 / f64::from(info.rig.rate_hz);
    let motion = |state: &StateEvent| (quat(state.q), Vec3::from_array(state.omega));
    let law = anchor.map(|anchor| probe.along(anchor, period_s, states.iter().map(motion)));
    let point = |(k, state): (usize, &StateEvent)| Point {
        angle: rotation::difference(quat(state.q), quat(first.q)).dot(axis),
        hand: Vec3::from_array(state.hand.unwrap_or_default()).dot(axis),
        rig: Vec3::from_array(state.torque).dot(axis),
        law: law.as_ref().map(|law| law[k].dot(axis)),
    };
    Ok(states.iter().enumerate().map(point).collect())
}

fn table(points: &[Point]) -> anyhow::Result<()> {
    say!("  angle, deg   hand, N m    rig, N m    law, N m")?;
    for row in 0..=ROWS {
        let Point { angle, hand, rig, law } = points[row * (points.len() - 1) / ROWS];
        // Without a sign at a zero.
        let rounded = |x: f64, digits: i32| (x * 10f64.powi(digits)).round() / 10f64.powi(digits) + 0.0;
        let [hand, rig] = [hand, rig].map(|torque| rounded(torque, 4));
        let law = law.map_or_else(|| "-".to_owned(), |law| format!("{:.4}", rounded(law, 4)));
        say!("{:12.2}{hand:12.4}{rig:12.4}{law:>12}", rounded(angle.to_degrees(), 2))?;
    }
    if points.iter().any(|point| point.law.is_none()) {
        tell!(
            "the law is not known: an effect is anchored where the sphere was when the scene began, and the state shows only the \
             reference of the first effect, which is absolute. Load the anchored effect alone"
        )?;
    }
    Ok(())
}

/// Says in sentences where the sphere stopped, and whether limits have cut the torque off.
fn told(info: &InfoOk, states: &[StateEvent], points: &[Point], args: &TurnArgs) -> Vec<String> {
    let (first, last, end) = (&states[0], &states[states.len() - 1], &points[points.len() - 1]);
    let since = |state: &StateEvent| state.t - first.t;
    let mut lines = Vec::new();
    let rate = |state: &StateEvent| Vec3::from_array(state.omega).dot(args.axis.unit);
    let moving = states.iter().rposition(|state| !is_still(state, args));
    lines.push(match moving.map(|at| states.get(at + 1)) {
        None => "the sphere did not turn".to_owned(),
        Some(None) => {
            format!("the sphere still turns after {:.2} s, with {:.2} rad/s", since(last), rate(last).abs())
        }
        Some(Some(stopped)) => format!(
            "the sphere stopped after {:.2} s at {:.2} deg; the hand asked for {:.2} deg",
            since(stopped),
            end.angle.to_degrees(),
            args.angle.to_degrees()
        ),
    });
    if let Some((state, _)) =
        states.iter().zip(points).find(|(state, _)| !matches!(state.mode, Mode::Active | Mode::Enabling))
    {
        lines.push(format!(
            "after {:.2} s the rig made no torque, because it was in the mode {}{}{}",
            since(state),
            state.mode,
            state.fault.map(|fault| format!(" {fault}")).unwrap_or_default(),
            show::next(state.mode)
        ));
    }
    let most = info.limits.torque;
    let full = |state: &StateEvent| Vec3::from_array(state.torque).length() >= AT_LIMIT * most;
    if let Some((state, point)) = states.iter().zip(points).find(|(state, _)| full(state)) {
        lines.push(format!(
            "the rig reached its largest torque of {most} N m (limits.torque) after {:.2} s at {:.2} deg",
            since(state),
            point.angle.to_degrees()
        ));
    } else if let Some((state, point)) =
        states.iter().zip(points).find(|(state, _)| state.mode == Mode::Active && state.scale < AT_LIMIT)
    {
        lines.push(format!(
            "motors, friction or torque_rate limited the torque to {:.0} % of what the scene asked for, first after {:.2} s at \
             {:.2} deg",
            100.0 * states.iter().map(|state| state.scale).fold(1.0, f64::min),
            since(state),
            point.angle.to_degrees()
        ));
    }
    lines
}

/// Returns the picture of torque against angle as SVG.
fn picture(info: &InfoOk, points: &[Point], axis: &str) -> String {
    let curve = |name: &str, colour, dashed, value: fn(&Point) -> Option<f64>| Curve {
        name: Some(name.to_owned()),
        points: points.iter().filter_map(|point| Some((point.angle.to_degrees(), value(point)?))).collect(),
        colour,
        dashed,
    };
    let curves = vec![
        curve("hand, on the sphere", Some(0), false, |point| Some(point.hand)),
        curve("rig, on the sphere", Some(1), false, |point| Some(point.rig)),
        curve("law of the scene", None, true, |point| point.law),
    ];
    let all = || curves.iter().flat_map(|curve| &curve.points);
    let most = 1.1 * all().map(|(_, y)| y.abs()).fold(1.0e-3, f64::max);
    let (from, to) = all().fold((0.0_f64, 0.0_f64), |(from, to), (x, _)| (from.min(*x), to.max(*x)));
    let panel = PlotPanel {
        x: format!("angle about {axis} since the start, degrees"),
        y: "torque about it, N m".to_owned(),
        x_range: (from - 1.0..to + 1.0, 11),
        y_range: -most..most,
        limit: None,
        curves,
    };
    let name = info.scene["name"].as_str().unwrap_or("scene");
    sheet(&format!("{name}, turned by the simulated hand"), &[panel], None)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, clap::Parser)]
    struct Line {
        #[command(flatten)]
        args: TurnArgs,
    }

    /// The sphere turns with 1 rad/s for half a second. From 0.3 s on the torque is `torque`, N m.
    fn turned(torque: f64, scale: f64) -> Vec<String> {
        let states: Vec<StateEvent> = (0..=100)
            .map(|k| {
                let t = f64::from(k) * 0.01;
                let late = t > 0.295;
                StateEvent {
                    t,
                    mode: Mode::Active,
                    omega: [0.0, 0.0, if t < 0.495 { 1.0 } else { 0.0 }],
                    torque: [0.0, 0.0, if late { -torque } else { 0.0 }],
                    scale: if late { scale } else { 1.0 },
                    ..StateEvent::default()
                }
            })
            .collect();
        let point = |state: &StateEvent| Point { angle: state.t.min(0.5), hand: 0.0, rig: 0.0, law: None };
        let points: Vec<Point> = states.iter().map(point).collect();
        let limits = hbot_api::LimitsInfo { torque: 0.9, ..Default::default() };
        let info = InfoOk { limits, ..InfoOk::default() };
        let Line { args } = clap::Parser::try_parse_from(["hbot", "n3", "40deg"]).unwrap();
        told(&info, &states, &points, &args)
    }

    #[test]
    fn where_the_sphere_stopped_and_which_limit_it_reached_is_said() {
        let stopped = "the sphere stopped after 0.50 s at 28.65 deg; the hand asked for 40.00 deg";
        assert_eq!(turned(0.5, 1.0), [stopped]);
        let limit = "the rig reached its largest torque of 0.9 N m (limits.torque) after 0.30 s at 17.19 deg";
        assert_eq!(turned(0.9, 0.4), [stopped, limit]);
        let said = turned(0.5, 0.4);
        assert!(said[1].contains("to 40 % of what the scene asked for, first after 0.30 s"), "{said:?}");
    }

    #[test]
    fn angles_and_times_have_their_units() {
        assert_eq!(angle("175deg"), Ok(175_f64.to_radians()));
        assert_eq!(angle("-0.5rad"), Ok(-0.5));
        assert_eq!(time("2s"), Ok(2.0));
        for wrong in ["40", "deg", "0deg", "181deg", "NaNrad", "1e9rad"] {
            assert!(angle(wrong).is_err(), "{wrong}");
        }
        for wrong in ["0s", "61s", "-1s", "s"] {
            assert!(time(wrong).is_err(), "{wrong}");
        }
        assert!(axis("n4").is_err());
    }
}
