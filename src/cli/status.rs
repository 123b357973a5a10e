//! The status line of a server that runs in a terminal, and the statistics that it prints at its
//! end.

use std::fmt::Write as _;

use hbot_api::Distribution;
use hbot_server::recording::{FilesWritten, Recorded};
use hbot_server::server::Finished;
use hbot_server::service::Status;

use super::out::foreign;
use super::{style, terminal};

/// Below this width of the terminal, columns, the status line has its short form. It adds up
/// skipped and missed ticks, and so has room for the holder.
const FULL: usize = 100;

/// Returns the status line: time, mode, orientation, torque, ticks that were late, skipped or
/// missed, clients and holder of the lease. It takes at most `columns` columns.
pub(crate) fn line(status: &Status, columns: usize) -> String {
    let Some(sample) = &status.sample else { return "waiting for the first tick".to_owned() };
    let (state, counters) = (&sample.state, &sample.counters);
    let mode = status.mode();
    let mut line = String::new();
    let angle = (2.0 * state.q.w.abs().min(1.0).acos()).to_degrees();
    let torque = state.torque.length();
    let (colour, off) = (style::of_mode(mode), style::OFF);
    let t = sample.t_ns as f64 * 1e-9;
    let (late, skipped, missed) = (counters.late, counters.skipped, counters.missed);
    if columns < FULL {
        let _ = write!(line, "{t:6.1} s  {colour}{mode}{off}  {angle:5.1} deg  {torque:.3} N m  late {late}");
        if skipped + missed > 0 {
            let _ = write!(line, " lost {}", skipped + missed);
        }
    } else {
        let _ = write!(
            line,
            "{t:8.1} s  {colour}{mode}{off}  turned {angle:5.1} deg  torque {torque:.3} N m  \
             late {late} skipped {skipped} missed {missed}"
        );
    }
    let plural = if status.clients == 1 { "" } else { "s" };
    let _ = write!(line, "  {} client{plural}", status.clients);
    if let Some(holder) = &status.holder {
        let _ = write!(line, ", held by {}", foreign(holder));
    }
    terminal::cut(&line, columns)
}

/// Returns the statistics that are printed when the server ends.
pub(crate) fn summary(finished: &Finished) -> String {
    let s = &finished.summary;
    let mut text = format!(
        "{}stopped{} after {} ticks: {} late, {} skipped, {} missed, {} damaged frames\n  median (99 %) in us: lateness {}, \
         compute {}, line {}, torque age {}",
        style::NAME,
        style::OFF,
        // The service does not see every tick of a loop that is faster than it.
        s.ticks + s.dropped_samples,
        s.late_ticks,
        s.skipped_ticks,
        s.missed_ticks,
        s.corrupt_frames,
        pair(&s.lateness_us),
        pair(&s.compute_us),
        pair(&s.link_us),
        pair(&s.age_us),
    );
    if let Some(ratio) = finished.speed {
        let _ = write!(text, "\n  {ratio:.0} times real time");
    }
    if let Some(recorded) = finished.recorded {
        text.push_str(&recording(recorded, &finished.files));
    }
    if let Some(part) = finished.failed {
        let _ = write!(
            text,
            "\n  {}{part} crashed, which is an error in hbot{}: motors were switched off",
            style::BAD,
            style::OFF
        );
    }
    text
}

/// Returns the lines of the statistics about a recording.
fn recording(recorded: Recorded, files: &FilesWritten) -> String {
    let Recorded { written, lost, failed_files } = recorded;
    let plural = if failed_files == 1 { "" } else { "s" };
    let mut text = format!("\n  {written} ticks recorded, {lost} lost, {failed_files} file{plural} failed");
    let FilesWritten { count, bytes, last, cut_short, last_cut_short } = files;
    let (last, size, last_cut_short) = (last.display(), size(*bytes), last_cut_short.display());
    match *count {
        0 => {}
        1 => _ = write!(text, "\n  recorded to {last}: {size}"),
        _ => _ = write!(text, "\n  recorded to {count} files, the last is {last}: {size} in all"),
    }
    match *cut_short {
        0 => {}
        1 => _ = write!(text, "\n  cut short: {last_cut_short}"),
        _ => _ = write!(text, "\n  cut short: {cut_short} files, the last is {last_cut_short}"),
    }
    text
}

/// Returns a size in words, for people.
fn size(bytes: u64) -> String {
    let bytes = bytes as f64;
    match bytes {
        ..1.0e6 => format!("{:.1} kB", bytes * 1.0e-3),
        ..1.0e9 => format!("{:.1} MB", bytes * 1.0e-6),
        _ => format!("{:.2} GB", bytes * 1.0e-9),
    }
}

fn pair(d: &Distribution) -> String {
    // A thread that wakes early and waits awake is less than 0.1 µs late.
    let shown = |us: f64| if us < 1.0 { format!("{us:.3}") } else { format!("{us:.1}") };
    format!("{} ({})", shown(d.p50), shown(d.p99))
}

#[cfg(test)]
mod tests {
    use hbot_core::inputs::MAX_COMMANDS;
    use hbot_core::{CompiledScene, Controller, Inputs};
    use hbot_host::run_loop::sample::{Counters, Sample, TickTiming};

    use super::*;

    /// Returns what the loop says of its first tick.
    fn still() -> Sample {
        let mut controller = Controller::new(hbot_config::RigConfig::prototype().rig);
        let state = controller.tick(&CompiledScene::empty(), &Inputs::quiet(0)).state;
        Sample {
            state,
            t_ns: 0,
            scene: 0,
            timing: TickTiming::default(),
            counters: Counters::default(),
            answers: [None; MAX_COMMANDS],
            telemetry: Default::default(),
            complaints: Default::default(),
            restarted: false,
        }
    }

    #[test]
    fn the_status_line_ends_at_the_terminal_s_width() {
        let mut sample = Status { sample: Some(still()), clients: 1, ..Status::default() };
        let shown =
            |status: &Status, columns| anstream::adapter::strip_str(&line(status, columns)).to_string();
        let short = shown(&sample, 80);
        assert!(short.ends_with("N m  late 0  1 client") && !short.contains("turned"), "{short}");
        let full = shown(&sample, FULL);
        assert!(full.contains("turned   0.0 deg  torque 0.000 N m  late 0 skipped 0 missed 0"), "{full}");
        if let Some(sample) = &mut sample.sample {
            sample.counters = Counters { late: 12, skipped: 3, missed: 4, ..Counters::default() };
        }
        let bad = shown(&sample, 80);
        assert!(bad.ends_with("late 12 lost 7  1 client"), "{bad}");
        (sample.sample, sample.holder) = (Some(still()), Some("x".to_owned()));
        // The mode with the longest name.
        let held = shown(&sample, 80);
        assert!(held.contains("unreferenced") && held.ends_with("1 client, held by x"), "{held}");
        sample.holder = Some("the panel of somebody on a machine with a long name".to_owned());
        for columns in [40, 80, 100] {
            let cut = shown(&sample, columns);
            assert!(cut.chars().count() == columns && cut.ends_with('…'), "{cut}");
        }
    }

    #[test]
    fn a_recording_that_was_cut_short_is_told_apart_from_one_that_is_complete() {
        let told = |failed_files, files| recording(Recorded { written: 8, lost: 2, failed_files }, &files);
        let whole = FilesWritten { count: 1, bytes: 1500, last: "a.mcap".into(), ..FilesWritten::default() };
        let complete = "\n  8 ticks recorded, 2 lost, 0 files failed\n  recorded to a.mcap: 1.5 kB";
        assert_eq!(told(0, whole), complete);
        let cut = FilesWritten { cut_short: 1, last_cut_short: "b.mcap".into(), ..FilesWritten::default() };
        let failed = "\n  8 ticks recorded, 2 lost, 1 file failed\n  cut short: b.mcap";
        assert_eq!(told(1, cut.clone()), failed);
        let two = told(2, FilesWritten { cut_short: 2, ..cut });
        assert!(two.ends_with("2 files failed\n  cut short: 2 files, the last is b.mcap"), "{two}");
    }
}
