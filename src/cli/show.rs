//! `hbot info` and `hbot stats`: show what a running server reports about its rig and its loop.

use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::Args;
use hbot_api::{Client, Event, Fault, InfoOk, Mode, RenderInfo, StateEvent, StatsOk};

use super::out::{foreign, note, say, tell};
use super::{ServerAddress, controllers, orders, style};

/// What `hbot stats` prints, for its help.
pub(super) const ROWS: &str = "\
The first line counts since the server's start:
  late               ticks that started more than a quarter period late
  skipped            ticks whose deadline passed before the tick before them
                     ended
  missed             ticks without a new reading
  damaged frames     frames on the serial line with errors
  commands not sent  commands that the serial line did not take completely

Rows, microseconds. `99 %` is what 99 of 100 ticks do not exceed:
  awake_us           time that the loop was awake before a deadline
  lateness_us        from the deadline to the start of a tick
  compute_us         computing time of a tick
  link_us            time spent on reading, decoding, encoding and writing
  age_us             from the sampling of the joints until the torque computed
                     from it was sent";

/// Options of `hbot info` and `hbot stats`.
#[derive(Debug, Args)]
pub(crate) struct ShowArgs {
    #[command(flatten)]
    address: ServerAddress,
    /// Print one object of JSON, for programs
    #[arg(long)]
    json: bool,
}

pub(crate) fn info(args: &ShowArgs) -> anyhow::Result<ExitCode> {
    let mut client = orders::connect(&args.address, "hbot info")?;
    let info = client.info().map_err(orders::remedied)?;
    let controllers = controllers::ask(&mut client);
    if args.json {
        let mut object = serde_json::to_value(&info)?;
        object["controllers"] = serde_json::to_value(controllers?)?;
        say!("{object}")?;
        return Ok(ExitCode::SUCCESS);
    }
    let hello = client.hello();
    tell!("{} {} on {}", live_or_simulated(&info), foreign(&hello.rig), args.address.server)?;
    tell!(
        "  server     {}, {} Hz, accuracy {}",
        foreign(&hello.server),
        info.rig.rate_hz,
        foreign(&info.accuracy)
    )?;
    tell!("  mode       {}", mode(state(&mut client, |_| true)?.as_ref(), info.limits.speed))?;
    if let Some(incident) = &info.incident {
        tell!("  cause      at {:.1} s: {}", incident.t, foreign(&incident.message))?;
        if let Some(log) = &incident.flight_log {
            tell!("  explain    what happened before: `hbot explain {}`", foreign(log))?;
        }
    }
    if let Some(shaking) = &info.shaking {
        tell!("  shaking    at {:.1} s: {}", shaking.t, foreign(&shaking.message))?;
    }
    let limits = &info.limits;
    tell!(
        "  limits     {} N m, {} N m/s, {} rad/s, slip {} m/s",
        number(limits.torque),
        number(limits.torque_rate),
        number(limits.speed),
        number(limits.slip)
    )?;
    if let Some(passivity) = limits.passivity {
        tell!(
            "  passivity  damps what delay creates beyond {} J, with a store of {} J, by up to {:.2} N m s/rad",
            number(passivity.allowance),
            number(passivity.store),
            passivity.damping
        )?;
    }
    if let Some([a, b, c]) = info.capability {
        tell!(
            "  torque     of the motors alone, at these steering angles: up to {a:.2} {b:.2} {c:.2} N m about n1 n2 n3"
        )?;
    }
    if let Some(render) = &info.render {
        tell!("{}", stable(render))?;
        if let Some(pick) = &render.rate_pick {
            tell!("  rates      {}", foreign(pick))?;
        }
    }
    let holder = info.lease.as_ref().and_then(|lease| lease.holder.as_deref());
    tell!(
        "  lease      {}",
        holder.map_or_else(|| "free".to_owned(), |name| format!("held by {}", foreign(name)))
    )?;
    match controllers {
        Ok(controllers) => controllers::print(&info, &controllers)?,
        Err(error) => tell!("  motor controllers: no answer ({})", foreign(&format!("{error:#}")))?,
    }
    let text = |value: &serde_json::Value| foreign(value.as_str().unwrap_or("?")).to_string();
    tell!("  scene      {}", text(&info.scene["name"]))?;
    if !info.scene["description"].is_null() {
        tell!("             {}", text(&info.scene["description"]))?;
    }
    for effect in info.scene["effect"].as_array().into_iter().flatten() {
        tell!("    {:12} {}", text(&effect["id"]), text(&effect["kind"]))?;
    }
    for warning in &info.warnings {
        tell!("    {}warning:{} {}", style::WARN, style::OFF, foreign(warning))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Says that a scene is not felt now, and which command comes next, if the rig has no torque.
pub(crate) fn note_without_torque(info: &InfoOk) {
    let torque = |mode: &Mode| matches!(mode, Mode::Enabling | Mode::Active);
    if let Some(mode) = info.mode.filter(|mode| !torque(mode)) {
        note!("{}{mode}{}{}", style::of_mode(mode.as_str()), style::OFF, next(mode));
    }
}

/// Says which stiffness and damping the rig is expected to keep stable.
fn stable(render: &RenderInfo) -> String {
    let stiffness = format!(
        "  stiffness  in small motions stable up to {:.1} N m/rad with a damping of {} N m s/rad, for example, and up to {:.0} with \
         the best damping; after a tap often less, which the warnings about a scene say",
        render.stiffness_stable,
        number(render.damping),
        render.stiffness_most
    );
    // An older server does not tell it.
    if render.damping_most > 0.0 {
        format!("{stiffness}\n  damping    alone stable up to {:.3} N m s/rad", render.damping_most)
    } else {
        stiffness
    }
}

/// A server whose loop runs sends a state well within this time.
const STATE_WITHIN: Duration = Duration::from_secs(2);

/// Returns the next state that is as `wanted`. Returns `None` if no state arrives in time.
pub(super) fn state(
    client: &mut Client,
    wanted: impl Fn(&StateEvent) -> bool,
) -> anyhow::Result<Option<StateEvent>> {
    client.subscribe(1).map_err(orders::remedied)?;
    let mut until = Instant::now() + STATE_WITHIN;
    while let Some(left) = until.checked_duration_since(Instant::now()) {
        if let Some(Event::State(state)) = client.next_event(left)? {
            if wanted(&state) {
                return Ok(Some(state));
            }
            until = Instant::now() + STATE_WITHIN;
        }
    }
    Ok(None)
}

/// Says what a mode means and which command comes next: the end of a sentence that begins with the
/// mode.
pub(crate) const fn next(mode: Mode) -> &'static str {
    match mode {
        Mode::Fault => ": the torque is off. When the cause is gone: `hbot reset`, then `hbot enable`",
        Mode::Estop => ": the rig is stopped. When it is safe: `hbot reset`, then `hbot enable`",
        Mode::Idle => ": the torque is off. `hbot enable` switches it on",
        Mode::Unreferenced => {
            ": the zero of a steering angle is not known, so there is no torque. What to do depends on `zero` in the rig file:\n  \
             index      turn each wheel until its index has passed\n  \
             assume     set the wheels to zero, switch the controllers off and on, and start the server again\n  \
             calibrate  run `hbot rig calibrate`"
        }
        Mode::Enabling => ": the torque rises over half a second. `hbot estop` stops the rig at once",
        Mode::Active => ": the torque is on. `hbot estop` stops the rig at once",
    }
}

/// Says in which mode the rig is, why, and how torque comes back. `speed_limit` is that of the
/// sphere, rad/s.
fn mode(state: Option<&StateEvent>, speed_limit: f64) -> String {
    let Some(state) = state else {
        return format!("unknown: no state has arrived for {} s", STATE_WITHIN.as_secs());
    };
    let next = next(state.mode);
    let fault = match state.fault.filter(|_| state.mode == Mode::Fault) {
        None => String::new(),
        Some(fault @ Fault::Overspeed) => {
            let speed = state.omega.iter().map(|rate| rate * rate).sum::<f64>().sqrt();
            let limit = number(speed_limit);
            format!(" {fault} (now the sphere turns at {} rad/s, the limit is {limit})", number(speed))
        }
        Some(fault) => format!(" {fault}"),
    };
    format!("{}{fault}{next}", state.mode)
}

/// Returns a number for people: with six significant digits at most, and no zeros at its end.
pub(crate) fn number(x: f64) -> String {
    let rounded: f64 = format!("{x:.5e}").parse().unwrap_or(x);
    rounded.to_string()
}

/// Returns the word that tells at a glance whether motors can push.
pub(crate) fn live_or_simulated(info: &InfoOk) -> String {
    let (colour, word) = if info.rig.simulated { (style::WARN, "SIMULATED") } else { (style::BAD, "LIVE") };
    format!("{colour}{word}{}", style::OFF)
}

pub(crate) fn stats(args: &ShowArgs) -> anyhow::Result<ExitCode> {
    let mut client = orders::connect(&args.address, "hbot stats")?;
    let stats = client.stats().map_err(orders::remedied)?;
    if args.json {
        say!("{}", serde_json::to_string(&stats)?)?;
    } else {
        print(&stats)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Prints the statistics of a running server's loop.
pub(crate) fn print(stats: &StatsOk) -> anyhow::Result<()> {
    tell!(
        "the running server after {} ticks: {} late, {} skipped, {} missed; {} damaged frames, {} commands not sent",
        stats.ticks,
        stats.late_ticks,
        stats.skipped_ticks,
        stats.missed_ticks,
        stats.corrupt_frames,
        stats.send_failures,
    )?;
    let times = [
        ("awake_us", stats.awake_us),
        ("lateness_us", stats.lateness_us),
        ("compute_us", stats.compute_us),
        ("link_us", stats.link_us),
        ("age_us", stats.age_us),
    ];
    for (name, d) in times {
        tell!(
            "  {name:<12} median {:.1}, 99 % {:.1}, 99.9 % {:.1}, 99.99 % {:.1}, most {:.1}",
            d.p50,
            d.p99,
            d.p99_9,
            d.p99_99,
            d.max
        )?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_as_many_digits_as_people_read() {
        for (x, shown) in [
            (0.809_777_999_999_999_9, "0.809778"),
            (0.02, "0.02"),
            (20.0, "20"),
            (1234.5678, "1234.57"),
            (1.0e6, "1000000"),
            (0.0, "0"),
            (-0.1 - 0.2, "-0.3"),
        ] {
            assert_eq!(number(x), shown);
        }
    }

    #[test]
    fn the_damping_of_a_stable_stiffness_is_called_an_example() {
        let render = RenderInfo {
            damping: 0.02,
            stiffness_stable: 9.96,
            stiffness_most: 495.2,
            damping_most: 1.25,
            ..RenderInfo::default()
        };
        let stiffness = "  stiffness  in small motions stable up to 10.0 N m/rad with a damping of 0.02 N m s/rad, for example, and up to \
                         495 with the best damping; after a tap often less, which the warnings about a scene say";
        assert_eq!(stable(&render), format!("{stiffness}\n  damping    alone stable up to 1.250 N m s/rad"));
        assert_eq!(stable(&RenderInfo { damping_most: 0.0, ..render.clone() }), stiffness, "an older server");
    }

    #[test]
    fn every_mode_without_torque_says_what_is_next() {
        let said = |mode, fault| {
            let omega = [3.0, 0.0, 4.0];
            super::mode(Some(&StateEvent { mode, fault, omega, ..StateEvent::default() }), 2.5)
        };
        assert_eq!(said(Mode::Idle, None), "idle: the torque is off. `hbot enable` switches it on");
        assert!(said(Mode::Unreferenced, None).contains("`hbot rig calibrate`"));
        let fault = said(Mode::Fault, Some(Fault::Thermal));
        assert!(
            fault.starts_with("fault thermal: the torque is off") && fault.contains("`hbot reset`"),
            "{fault}"
        );
        let fast = said(Mode::Fault, Some(Fault::Overspeed));
        let values = "fault overspeed (now the sphere turns at 5 rad/s, the limit is 2.5): the torque is off";
        assert!(fast.starts_with(values), "{fast}");
        assert!(said(Mode::Estop, None).contains("stopped. When it is safe: `hbot reset`"));
        assert!(said(Mode::Active, None).contains("`hbot estop` stops"));
    }
}
