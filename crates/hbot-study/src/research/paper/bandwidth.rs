//! Fig. 5: the bandwidth of closed-loop position control (fig. 6), and what determines it.

use hbot_core::Vec3;
use hbot_plot::{Lines, Series, short};

use super::position::{MOTOR, Setting, bandwidth, gain_for, linear_bandwidth, linear_response, response};
use crate::context::Context;
use crate::report::{Report, row};
use crate::threads;
use crate::whole::{inertia, prototype};

/// Bandwidth that the paper reports about every axis, Hz (table II).
const PAPER: f64 = 5.5;
/// The settings of the position loop that a figure uses unless it names others. The gain is chosen
/// so that the bandwidth is near the paper's.
const STATED: Setting =
    Setting { gain: 50.0, inner_hz: 20.0, amplitude: 0.05, axis: Vec3::X, friction: false };
/// Corner frequencies of the drives' rate loops for which the bandwidth is measured, Hz.
const INNER: [f64; 4] = [5.0, 10.0, 20.0, 40.0];
/// Gains K_O of the position loop for which the bandwidth is measured, 1/s. The position loop
/// surrounds the rate loops.
const GAINS: [f64; 6] = [20.0, 35.0, 50.0, 70.0, 100.0, 140.0];
/// Amplitudes of the desired sinusoidal motion for which the bandwidth is measured, rad.
const AMPLITUDES: [f64; 7] = [0.01, 0.05, 0.1, 0.2, 0.3, 0.45, 0.6];
/// Gains K_O for which the amplitude is varied, 1/s.
const AMPLITUDE_GAINS: [f64; 3] = [35.0, 50.0, 100.0];
/// Largest allowed relative difference between the simulated bandwidth for a small sine and the
/// bandwidth of the linear model. The interpolation between the measured frequencies causes 1 %.
/// The rest is caused by the wheels' steering, which already matters for a sine of 0.05 rad.
const WITHIN: f64 = 0.02;
/// Largest allowed difference between the simulated bandwidth with the settings [`STATED`] and the
/// bandwidth that the paper reports, Hz.
const NEAR_PAPER: f64 = 0.3;

pub(crate) fn study(context: &Context, report: &mut Report) {
    context.part("position bandwidth");
    introduce(report);
    bode(context, report);

    // All settings run in one batch, so that all threads share them.
    let (inner, gains): (&[f64], &[f64]) =
        if context.quick { (&INNER[1..3], &GAINS[1..4]) } else { (&INNER, &GAINS) };
    let (amplitudes, with): (&[f64], &[f64]) = if context.quick {
        (&AMPLITUDES[2..6], &AMPLITUDE_GAINS[1..])
    } else {
        (&AMPLITUDES, &AMPLITUDE_GAINS)
    };
    let grid = |outer: &[f64], across: &[f64], make: &dyn Fn(f64, f64) -> Setting| -> Vec<Setting> {
        outer.iter().flat_map(|a| across.iter().map(|b| make(*a, *b)).collect::<Vec<_>>()).collect()
    };
    let mut settings = vec![
        STATED,
        Setting { axis: Vec3::Y, ..STATED },
        Setting { axis: Vec3::Z, ..STATED },
        Setting { friction: true, ..STATED },
    ];
    let first = settings.len();
    settings.extend(grid(inner, gains, &|inner_hz, gain| Setting { inner_hz, gain, ..STATED }));
    let second = settings.len();
    settings.extend(grid(with, amplitudes, &|gain, amplitude| Setting { gain, amplitude, ..STATED }));
    let measured = threads::map(&settings, |setting| bandwidth(*setting));

    stated(report, &measured);
    let over_gain = over_gain(report, inner, gains, &measured[first..second]);
    let by_amplitude = over_amplitude(report, with, amplitudes, &measured[second..]);
    explain(report, &by_amplitude, &measured);
    checks(report, over_gain, &measured);
    report.compare(
        "position bandwidth about n1, n2, n3 (fig. 5, table II)",
        "5.5, 5.5, 5.5 Hz",
        format!("{:.2}, {:.2}, {:.2} Hz", measured[0], measured[1], measured[2]),
        "neither gain nor rate loops nor amplitude is given: K_O 50 1/s over rate loops of 20 Hz is chosen for it, and other pairs do as well",
    );
}

fn introduce(report: &mut Report) {
    report.heading("Position bandwidth (fig. 5, fig. 6, table II)");
    let device = prototype(&[]).rig.device;
    let [j1, j2, j3] = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| inertia(&device, axis));
    report.say(&format!(
        "The loop of fig. 6 on the simulated rig: q_d swings as a sine, zd = G K_O e_O goes to the four drives (no w_d: a step or a sine of orientation alone), and each drive follows its rate by a PI loop at 1 kHz over the line: \
         torque = k (asked - measured rate + w_i times its integral). The paper says nothing of these loops. Their gains here are in the ratio of the squared contact arms, so that the sphere feels the same whatever the headings, and are named by the corner that they give \
         a turn about the axis, k R² sum(1 - (c3.n)²) = 2 pi f J, with w_i a fifth of that; J is {:.2e}, {:.2e}, {:.2e} kg m² about n1, n2, n3 with both wheels at zero. A reading is one period old when its torque acts; motors lag by {} ms, have back-EMF, and peak torques of 0.93 and 0.14 N m; \
         as on the rig the torque on the sphere keeps within 0.9 N m and each contact's force within 8 N. Each point is a steady state over whole periods, one bin of its Fourier series, of the true orientation. \
         The bandwidth is where its size has fallen to -3 dB.",
        j1, j2, j3, 1.0e3 * MOTOR.lag_s
    ));
    report.family("bandwidth_hz | Hz | position bandwidth about n1 in the stated configuration: K_O 50 1/s (chosen for it), rate loops of 20 Hz, 0.05 rad; `predicted` by the linear loop, `paper`");
    report.family("bandwidth_about_{axis}_hz | Hz | the same about another axis");
    report.family("bandwidth_friction_hz | Hz | the same about n1 with friction of joints and cage");
    report.family("bandwidth_gain{k}_inner{f}_hz | Hz | bandwidth about n1 over K_O (1/s) and the corner of the rate loops (Hz); `predicted`");
    report.family("bandwidth_gain{k}_amplitude{a}_hz | Hz | bandwidth about n1 over K_O (1/s) and amplitude (mrad), rate loops of 20 Hz");
    report.family("bandwidth_gain_for_paper_inner{f}_per_s | 1/s | the K_O with which the linear loop has 5.5 Hz, over the corner of the rate loops (Hz)");
}

/// Reports the bandwidth of the position loop with the settings [`STATED`]. `measured` holds four
/// bandwidths in Hz: about n1, n2 and n3 without friction, and about n1 with friction.
fn stated(report: &mut Report, measured: &[f64]) {
    let predicted = linear_bandwidth(&STATED);
    report.figure("bandwidth_hz".to_owned(), measured[0]).note("predicted", predicted).note("paper", PAPER);
    for (k, axis) in [(1, "n2"), (2, "n3")] {
        report.figure(format!("bandwidth_about_{axis}_hz"), measured[k]).note("paper", PAPER);
    }
    report.figure("bandwidth_friction_hz".to_owned(), measured[3]);
}

/// Adds the checks of the measured bandwidths to the report. `over_gain` is the largest relative
/// difference between the simulated bandwidth for a small sine and that of the linear model.
/// `measured` holds the bandwidths about n1, n2 and n3, in Hz.
fn checks(report: &mut Report, over_gain: f64, measured: &[f64]) {
    report.check_within("the bandwidth of a small sine is that of the linear loop", over_gain, WITHIN);
    let off = (measured[0] - PAPER).abs();
    report.check(
        format!("the stated configuration has the paper's 5.5 Hz within {NEAR_PAPER} Hz"),
        format!("{:.2} Hz", measured[0]),
        off <= NEAR_PAPER,
    );
    let apart = measured[..3].iter().fold(0.0, |worst: f64, hz| worst.max((hz / measured[0] - 1.0).abs()));
    report.check(
        "the bandwidth is the same about all axes within 5 %",
        format!("{:.1} %", 100.0 * apart),
        apart < 0.05,
    );
}

/// Reports gain and phase of the position loop over frequency, as a Bode plot.
fn bode(context: &Context, report: &mut Report) {
    let points = if context.quick { 8 } else { 18 };
    let ticks: Vec<u32> = (0..points)
        .map(|k| libm::round(5000.0 * libm::pow(33.0 / 5000.0, f64::from(k) / f64::from(points - 1))) as u32)
        .collect();
    let cases = [
        ("n1, 0.05 rad", STATED),
        ("n2, 0.05 rad", Setting { axis: Vec3::Y, ..STATED }),
        ("n3, 0.05 rad", Setting { axis: Vec3::Z, ..STATED }),
        ("n1, 0.45 rad", Setting { amplitude: 0.45, ..STATED }),
        ("n1, with friction", Setting { friction: true, ..STATED }),
    ];
    let jobs: Vec<(Setting, u32)> =
        cases.iter().flat_map(|(_, setting)| ticks.iter().map(|ticks| (*setting, *ticks))).collect();
    let found = threads::map(&jobs, |(setting, ticks)| response(*setting, *ticks));
    let names: Vec<&str> = cases.iter().map(|(name, _)| *name).collect();
    draw(report, &names, &ticks, &found);
}

/// Plots gain and phase of the position loop over frequency. Each name in `names` is a case, such
/// as "n1, with friction". `found` holds the gain and phase of the first case for each sine period
/// in `ticks`, then those of the second case, and so on.
fn draw(report: &mut Report, names: &[&str], ticks: &[u32], found: &[[f64; 2]]) {
    let hertz = |ticks: u32| 1.0e3 / f64::from(ticks);
    let decibel = |size: f64| 20.0 * libm::log10(size);
    // The response is never ahead by more than rounding. A positive phase is therefore one turn too
    // high.
    let degrees = |phase: f64| {
        let phase = phase.to_degrees();
        if phase > 20.0 { phase - 360.0 } else { phase }
    };
    let (mut sizes, mut phases) = (Vec::new(), Vec::new());
    for (k, name) in names.iter().enumerate() {
        let of = |each: &dyn Fn([f64; 2]) -> f64| {
            ticks.iter().zip(&found[k * ticks.len()..]).map(|(n, found)| (hertz(*n), each(*found))).collect()
        };
        let line = |points| Series::new((*name).to_owned(), points, k);
        sizes.push(line(of(&|[size, _]| decibel(size))));
        phases.push(line(of(&|[_, phase]| degrees(phase))));
    }
    let linear = |each: &dyn Fn([f64; 2]) -> f64| {
        let points = ticks.iter().map(|n| (hertz(*n), each(linear_response(&STATED, hertz(*n))))).collect();
        Series::new("linear loop", points, 6).open(true)
    };
    sizes.push(linear(&|[size, _]| decibel(size)));
    phases.push(linear(&|[_, phase]| degrees(phase)));
    let down = vec![(hertz(ticks[0]), -3.0103), (hertz(33), -3.0103)];
    sizes.push(Series::new("-3 dB", down, 7).open(true));
    for (name, y, series) in
        [("magnitude", "turn over desired turn, dB", sizes), ("phase", "phase, degrees", phases)]
    {
        report.lines(
            &format!("bandwidth_{name}"),
            &format!("Closed-loop position control, {name}: K_O 50 1/s, rate loops of 20 Hz"),
            Lines::new(
                format!("Position control about an axis: {name}"),
                "frequency, Hz",
                y.to_owned(),
                series,
            )
            .log([true, false]),
        );
    }
}

/// Adds the table and the plot of the bandwidth for different gains and corner frequencies of the
/// rate loops. Returns the largest relative difference between the simulated bandwidth and that of
/// the linear model.
fn over_gain(report: &mut Report, inner: &[f64], gains: &[f64], measured: &[f64]) -> f64 {
    let head = gains.iter().map(|gain| format!("K_O {} 1/s", short(*gain)));
    let mut table = vec![row(["rate loops, Hz".to_owned()]
        .into_iter()
        .chain(head)
        .chain(["K_O for 5.5 Hz (linear loop), 1/s".to_owned()]))];
    let (mut series, mut worst) = (Vec::new(), 0.0_f64);
    for (k, (inner_hz, measured)) in inner.iter().zip(measured.chunks(gains.len())).enumerate() {
        let mut points = Vec::new();
        for (gain, measured) in gains.iter().zip(measured) {
            let predicted = linear_bandwidth(&Setting { gain: *gain, inner_hz: *inner_hz, ..STATED });
            // Above 12 Hz an amplitude of 0.05 rad needs all available torque, and the loop is no
            // longer linear.
            if predicted < 12.0 {
                worst = worst.max((measured / predicted - 1.0).abs());
            }
            report
                .figure(format!("bandwidth_gain{}_inner{}_hz", short(*gain), short(*inner_hz)), *measured)
                .note("predicted", predicted);
            points.push((*gain, *measured));
        }
        let needed = gain_for(&Setting { inner_hz: *inner_hz, ..STATED }, PAPER);
        report.figure(format!("bandwidth_gain_for_paper_inner{}_per_s", short(*inner_hz)), needed);
        let cells = points.iter().map(|(_, hz)| format!("{hz:.2}"));
        table.push(row([short(*inner_hz)].into_iter().chain(cells).chain([format!("{needed:.1}")])));
        series.push(Series::new(format!("rate loops {} Hz", short(*inner_hz)), points, k));
    }
    report.table(&table);
    series.push(level(gains));
    report.lines(
        "bandwidth_gain",
        "Position bandwidth about n1 over K_O and the corner of the drives' rate loops, 0.05 rad",
        Lines::new("Which gains give which bandwidth", "K_O, 1/s", "bandwidth, Hz", series),
    );
    worst
}

/// Adds the table and the plot of the bandwidth for different amplitudes of the sine. Returns the
/// bandwidth at the largest amplitude for each gain, Hz.
fn over_amplitude(report: &mut Report, gains: &[f64], amplitudes: &[f64], measured: &[f64]) -> Vec<f64> {
    let mut table = vec![row(["amplitude, rad".to_owned()]
        .into_iter()
        .chain(gains.iter().map(|gain| format!("K_O {} 1/s", short(*gain)))))];
    let of = |k: usize| &measured[k * amplitudes.len()..(k + 1) * amplitudes.len()];
    for (i, amplitude) in amplitudes.iter().enumerate() {
        table.push(row([short(*amplitude)]
            .into_iter()
            .chain((0..gains.len()).map(|k| format!("{:.2}", of(k)[i])))));
    }
    let mut series = Vec::new();
    for (k, gain) in gains.iter().enumerate() {
        for (amplitude, hz) in amplitudes.iter().zip(of(k)) {
            let milli = (1.0e3 * amplitude).round() as u32;
            report.figure(format!("bandwidth_gain{}_amplitude{milli}_hz", short(*gain)), *hz);
        }
        let points = amplitudes.iter().copied().zip(of(k).iter().copied()).collect();
        series.push(Series::new(format!("K_O {} 1/s", short(*gain)), points, k));
    }
    report.table(&table);
    series.push(level(amplitudes));
    report.lines(
        "bandwidth_amplitude",
        "Position bandwidth about n1 over the amplitude, rate loops of 20 Hz: where the torque runs out",
        Lines::new("Bandwidth and amplitude", "amplitude, rad", "bandwidth, Hz", series).log([true, false]),
    );
    (0..gains.len()).map(|k| of(k)[amplitudes.len() - 1]).collect()
}

/// Returns a plot line that shows the bandwidth that the paper reports. It is horizontal, from the
/// first to the last value of `x`.
fn level(x: &[f64]) -> Series {
    let points = vec![(x[0], PAPER), (x[x.len() - 1], PAPER)];
    Series::new("the paper", points, 6).open(true)
}

fn explain(report: &mut Report, largest: &[f64], measured: &[f64]) {
    let ideal = 4.0 * core::f64::consts::PI * PAPER;
    let largest: Vec<String> = largest.iter().map(|hz| format!("{hz:.2}")).collect();
    report.say(&format!(
        "**What sets 5.5 Hz.** e_O of a small turn is half of it, so about perfect rate loops the loop is of first order with the corner K_O/(4 pi): 5.5 Hz would be K_O = {ideal:.0} 1/s. Slower rate loops add phase and a resonance, which *raises* the bandwidth at the same \
         K_O; the last column has the K_O that each needs. So a whole line of pairs gives 5.5 Hz, and fig. 5 alone cannot tell them apart: its phase or its peak could. Neither is a limit of the device: higher gains reach twice that and more with a small sine. \
         A large one runs out of torque: J A (2 pi f)² reaches 0.9 N m at 5.5 Hz with A = {:.2} rad about n1, and at the largest amplitude here the bandwidths are {} Hz for the gains of the table. Friction of joints and cage takes little ({:.2} Hz instead of {:.2}). \
         The stated configuration, K_O = 50 1/s about rate loops of 20 Hz, is one choice of that line, made to lie near the paper.",
        0.9 / (3.42e-3 * (2.0 * core::f64::consts::PI * PAPER).powi(2)),
        largest.join(", "),
        measured[3],
        measured[0]
    ));
}
