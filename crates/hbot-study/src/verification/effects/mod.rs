//! The study `effects`: the cost per tick of each kind of effect and each phenomenon of the
//! simulated rig, alone and in pairs. It also checks that anything a scene does not name costs
//! nothing.

mod desk;
mod short;

use std::cell::OnceCell;
use std::fmt::Write as _;

use serde_json::Value;

use crate::context::Context;
use crate::report::{Report, row, spread};
use crate::timing::{Difference, Time, Timed, compared};

use super::Job;
use super::callgrind::{Counter, MANY};
use desk::{Desk, SceneSetup};
use hbot_plot::{Bar, bars};

/// Largest allowed cost that remains after a scene has removed an effect or phenomenon: the number
/// of instructions per tick, relative to a whole tick.
///
/// It is not zero because the numbers in the frames on the line differ, and one more zero byte
/// costs an instruction or two.
const NOTHING: f64 = 1.0e-3;
/// Largest allowed cost that remains after a scene has removed an effect or phenomenon: the time
/// per tick, relative to a whole tick. It is larger than [`NOTHING`] because measured times are
/// noisy.
const NOTHING_NS: f64 = 0.25;
/// Number of ticks in a run whose time is measured. It equals the number of ticks in the run whose
/// instructions are counted, because another number would give another cost per tick: a solver
/// needs more steps while contacts stick or slide.
const TICKS: usize = MANY;

/// Measured computing time and number of instructions per tick with one setup.
struct Cost {
    setup: SceneSetup,
    time: Time,
    /// How much longer a tick takes than one without any effect or phenomenon.
    longer: Difference,
    instructions: Option<f64>,
}

/// Runs the study `effects` and returns its report. `counter` says how to count instructions, if
/// that is possible.
pub(crate) fn study(context: &Context, counter: Option<&Counter>) -> Report {
    let mut report = Report::new("effects", context.quick);
    introduce(&mut report);
    let names: Vec<String> = desk::names();
    let none = SceneSetup::default();
    let singles: Vec<SceneSetup> = names.iter().map(|name| SceneSetup::of(&[name])).collect();
    let gone: Vec<SceneSetup> = singles.iter().map(SceneSetup::gone).collect();
    let mut pairs = Vec::new();
    for (k, a) in names.iter().enumerate().filter(|_| !context.quick) {
        pairs.extend(names[k + 1..].iter().map(|b| SceneSetup::of(&[a, b])));
    }
    let all: Vec<SceneSetup> = [none].into_iter().chain(singles).chain(gone).chain(pairs).collect();
    context.expect(3);

    context.part("instructions");
    let counted = match counter {
        Some(counter) => counter.count(&all.iter().map(SceneSetup::to_json).collect::<Vec<_>>()),
        None => Err("this program cannot run itself under valgrind".to_owned()),
    };
    context.part("times");
    let active = Desk::active();
    let mut runs: Vec<Timed<'_>> = all
        .iter()
        .map(|setup| {
            let desk = active.with(setup);
            Timed::new(move || desk.clone().run(TICKS)).in_units_of(TICKS as f64)
        })
        .collect();
    let times = compared(context.quick, &mut runs);
    drop(runs);

    context.part("tables");
    let costs: Vec<Cost> = all
        .into_iter()
        .zip(times)
        .enumerate()
        .map(|(k, (setup, (time, longer)))| Cost {
            setup,
            time,
            longer,
            instructions: counted.as_ref().ok().map(|all| all[k]),
        })
        .collect();
    if let Err(why) = &counted {
        report.say(&format!("**{}**", not_counted(why)));
    }
    tell(&mut report, &costs, names.len());
    short::conclude(&mut report, &costs[..=names.len()], counted.as_ref().err());
    report
}

/// Returns the ticks with one setup, whose instructions are counted. `job` is the setup as JSON.
/// Returns `None` if it is something else. `active` is made at the first call.
pub(super) fn job(job: &Value, active: &OnceCell<Desk>) -> Option<Job> {
    let setup = SceneSetup::from_json(job)?;
    let desk = active.get_or_init(Desk::active).with(&setup);
    Some(Box::new(move |ticks| desk.clone().run(ticks)))
}

/// Returns a sentence for the report that says why instructions were not counted.
fn not_counted(why: &str) -> String {
    format!("Instructions were not counted: {why}. All costs are times, which vary.")
}

fn introduce(report: &mut Report) {
    report.say(
        "What each kind of effect and each phenomenon of the simulated rig costs a tick, with the parameters that it has where a scene names \
         nothing but it: `{}`. One tick is `Controller::tick` of the prototype, active, on recorded readings of a brisk motion, and one exchange with the \
         simulated rig over its line in memory: command frame, a step of the plant, feedback frame. Costs are those beyond the same tick without any of \
         them. Instructions are callgrind's, of two runs of different length, subtracted, so that the start of the program is not in them; they are the same in every \
         run. Times vary with the machine; they are of the same ticks, from the rig's rest on. A time is the median over rounds of its difference from the tick without anything in the same round; where it is not larger than its spread, the distance of the quartiles of these differences, the report says \"below\" and a bound. Where something sticks, slides or has play (joint and cage friction, slip, pivoting, gear) the rig solves for it in steps \
         of 250 microseconds, four a tick. Most of a tick without any of them is the line's: two frames written, checked and read byte by byte.",
    );
    report.say(
        "*Afterwards* is the same tick without the thing, in a program in which a scene has had it and dropped it: it must cost what a tick costs in which it \
         never was.",
    );
    report.family("effects_none_instructions | 1 | instructions of a tick without any effect or phenomenon");
    report.family("effects_none_ns | ns | time of such a tick");
    report.family("effects_dropped_left | 1 | most that is left of an effect or phenomenon once a scene has dropped it, over a tick's instructions");
    report.family("effects_{name}_instructions | 1 | instructions a tick that a kind or phenomenon adds");
    report.family("effects_{name}_added_ns | ns | time a tick that it adds, as measured; `q1`, `q3`: quartiles; `found`: whether it is larger than their distance, so that it is more than noise; `tick`: the time of the whole tick");
    report.family("effects_{name}_afterwards_instructions | 1 | instructions a tick that are left of it once a scene has dropped it");
    report.family("effects_{a}_with_{b}_instructions | 1 | instructions a tick that two of them add together; `more_than_sum`: beyond what each adds alone");
    report.family("effects_{a}_with_{b}_added_ns | ns | time a tick that two of them add together");
}

/// Adds figures, tables, plots and checks to the report. `costs` holds first the cost of the empty
/// setup, then of each of the `count` effects and phenomena alone, then after each was removed, and
/// then of pairs of them.
fn tell(report: &mut Report, costs: &[Cost], count: usize) {
    let none = &costs[0];
    let base = none.instructions;
    if let Some(base) = base {
        report.figure("effects_none_instructions".to_owned(), base);
    }
    report.time("effects_none_ns".to_owned(), none.time);
    let (alone, rest) = costs[1..].split_at(count);
    let (afterwards, pairs) = rest.split_at(count);
    let added = |cost: &Cost| Some(cost.instructions? - base?);

    let (left, left_ns) = alone_table(report, none, [alone, afterwards], &added);
    if base.is_some() {
        report.figure("effects_dropped_left".to_owned(), left);
    }
    // Counts say it exactly; where there are none, times have to.
    let (unit, bound, shown, holds) = if base.is_some() {
        ("of a tick's instructions", NOTHING, format!("{left:.1e}"), left <= NOTHING)
    } else {
        ("of a tick's least time, for noise", NOTHING_NS, format!("{left_ns:.2}"), left_ns <= NOTHING_NS)
    };
    report.check(format!("what a scene no longer names costs nothing: at most {bound} {unit}"), shown, holds);
    report.say(&format!(
        "By the least times, at most {left_ns:.2} of a tick is left of anything that a scene has dropped."
    ));
    if pairs.is_empty() {
        report.say("Pairs are measured without `--quick`.");
        return;
    }
    in_pairs(report, pairs, alone, &added);
}

type Added<'a> = &'a dyn Fn(&Cost) -> Option<f64>;

/// Reports the cost per tick of each effect and phenomenon alone. Also returns the largest cost
/// that remains after one of them has been removed, relative to a whole tick: in instructions, and
/// in shortest computing time.
fn alone_table(
    report: &mut Report,
    none: &Cost,
    [alone, afterwards]: [&[Cost]; 2],
    added: Added<'_>,
) -> (f64, f64) {
    let base = none.instructions;
    let or_dash = |x: Option<f64>| x.map_or("-".to_owned(), hbot_plot::short);
    report.heading("Each alone");
    let mut table =
        vec![row(["", "what it is", "instructions a tick", "time a tick", "afterwards, instructions"])];
    let (mut instructions, mut times) = (Vec::new(), Vec::new());
    let (mut left, mut left_ns) = (0.0_f64, 0.0_f64);
    for (cost, after) in alone.iter().zip(afterwards) {
        let name = cost.setup.name();
        let kind = if desk::is_kind(&name) { "effect" } else { "phenomenon" };
        if let (Some(more), Some(after), Some(base)) = (added(cost), added(after), base) {
            report.figure(format!("effects_{name}_instructions"), more);
            report.figure(format!("effects_{name}_afterwards_instructions"), after);
            left = left.max((after / base).abs());
            instructions.push((name.clone(), more));
        }
        added_time(report, &name, cost);
        times.push(time_bar(&name, usize::from(kind == "phenomenon"), &cost.longer));
        // Compares the shortest times, because noise only adds time.
        left_ns = left_ns.max(after.time.least / none.time.least - 1.0);
        let [counted, left] = [added(cost), added(after)].map(or_dash);
        table.push(row([name, kind.to_owned(), counted, cost.longer.told(), left]));
    }
    report.table(&table);
    let counted = base.map_or(String::new(), |base| format!("{base:.0} instructions, "));
    report.say(&format!("A tick without any of them: {counted}{} ns.", spread(none.time)));
    all_plots(report, &times, instructions);
    (left, left_ns)
}

/// Adds a figure: the time per tick that the effect, phenomenon or pair `name` adds.
fn added_time(report: &mut Report, name: &str, cost: &Cost) {
    let Difference { median, q1, q3 } = cost.longer;
    let figure = report.figure(format!("effects_{name}_added_ns"), median);
    figure.note("q1", q1).note("q3", q3).note("found", cost.longer.is_found()).note("tick", cost.time.median);
}

/// Returns the bar of an added time. A time that noise hides has no bar, only its spread.
fn time_bar(name: &str, colour: usize, longer: &Difference) -> Bar {
    if longer.is_found() {
        let spread = Some([longer.q1, longer.q3]);
        return Bar { name: name.to_owned(), value: longer.median, label: None, spread, colour };
    }
    let spread = Some([0.0, longer.bound()]);
    Bar { name: name.to_owned(), value: 0.0, label: Some(longer.told()), spread, colour }
}

/// Plots the instructions per tick that each effect and phenomenon adds, if they were counted. Also
/// plots the added time.
fn all_plots(report: &mut Report, times: &[Bar], instructions: Vec<(String, f64)>) {
    if !instructions.is_empty() {
        let bar = |(name, value): (String, f64)| {
            let colour = usize::from(!desk::is_kind(&name));
            Bar { name, value, label: Some(format!("{value:.0}")), spread: None, colour }
        };
        let all: Vec<Bar> = instructions.into_iter().map(bar).collect();
        plots(report, "instructions", "Instructions", &all);
    }
    plots(report, "ns", "Time", times);
}

/// Plots the cost that each effect and each phenomenon adds, in `unit`. Effects and phenomena have
/// separate plots, because a solver for friction costs a hundred times as much as an effect.
fn plots(report: &mut Report, unit: &str, what: &str, all: &[Bar]) {
    let (phenomena, effects): (Vec<Bar>, Vec<Bar>) = all.iter().cloned().partition(|bar| bar.colour == 1);
    for (group, name, members) in
        [("effects", "effect", effects), ("phenomena", "phenomenon of the simulated rig", phenomena)]
    {
        report.plot(
            &format!("{group}_{unit}"),
            &format!("{what} a tick that each {name} adds, alone"),
            bars(&format!("What each {name} adds to a tick"), unit, &members),
        );
    }
}

fn in_pairs(report: &mut Report, pairs: &[Cost], alone: &[Cost], added: Added<'_>) {
    report.heading("In pairs");
    report.say(
        "What two add together, in instructions a tick (in ns where they were not counted), and in brackets how much that is beyond what each adds alone: \
         where it is not small, the two meet in one computation, such as a solver that either needs (less than the sum), or one makes the other's harder, as what pushes on a sphere that sticks (more). The first effect of a scene also pays for the allocation of a torque that \
         is no longer zero, some thousand instructions; the second does not again.",
    );
    let single = |name: &str| alone.iter().find(|cost| cost.setup.name() == name);
    let mut table = vec![row([""])];
    table[0].extend(alone.iter().map(|cost| cost.setup.name()));
    let mut rows: Vec<Vec<String>> = alone
        .iter()
        .map(|cost| {
            let mut row = vec![String::new(); alone.len() + 1];
            row[0] = cost.setup.name();
            row
        })
        .collect();
    for pair in pairs {
        let [a, b] = [0, 1].map(|k| pair.setup.names[k].clone());
        let places = [&a, &b].map(|name| alone.iter().position(|cost| cost.setup.name() == *name));
        let [Some(i), Some(j)] = places else { continue };
        let mut cell = String::new();
        if let Some(together) = added(pair) {
            let sum = [&a, &b].iter().filter_map(|name| added(single(name)?)).sum::<f64>();
            let beyond = together - sum;
            report
                .figure(format!("effects_{a}_with_{b}_instructions"), together)
                .note("more_than_sum", beyond);
            let _ = write!(cell, "{together:.0} ({beyond:+.0})");
        }
        added_time(report, &pair.setup.name(), pair);
        if cell.is_empty() {
            cell = pair.longer.told();
        }
        rows[i][j + 1] = cell;
    }
    table.extend(rows);
    report.table(&table);
}
