//! The cases of the conformance suite. Each runs on a new bus.

use super::{Bench, Case, Renewed, Subject, WATCHDOG_MS, Wire, expect};
use crate::bus::{Expected, MeetError};
use crate::line::Line as _;

/// All cases of the conformance suite.
pub const CASES: &[Case] = &[
    Case { name: "each command is answered in the next tick, and motors do as commanded", run: good },
    Case { name: "a silent line gives no reading, and readings come back with it", run: silent },
    Case { name: "an incomplete answer is no reading, whether or not the rest follows", run: half },
    Case { name: "garbage is counted, gives no reading, and good readings come back after it", run: garbage },
    Case { name: "a late answer is as old as the command that it answers", run: late },
    Case { name: "an answer that comes twice is one reading", run: twice },
    Case { name: "answers out of order never go back", run: out_of_order },
    Case { name: "an answer to a command that was never sent is counted as foreign", run: ahead },
    Case { name: "a command that the line refuses is reported, and the next one is whole", run: refused },
    Case { name: "a command that is cut short does not spoil the next one", run: cut },
    Case { name: "a line that vanishes and comes back is reported once", run: vanished },
    Case {
        name: "controllers that lose power have lost their zeros, their motors are off, and they are met again",
        run: rebooted,
    },
    Case { name: "motors that are on against the command are reported", run: disobedient },
    Case {
        name: "an expired watchdog ends torque and is reported until motors were commanded off",
        run: expired,
    },
    Case { name: "the last word switches motors off, even after an incomplete command", run: last_word },
    Case { name: "switching off ends torque and says whether power was lost", run: switched_off },
    Case { name: "controllers that are not the rig's are refused", run: foreign_controllers },
    Case { name: "a tick sends no more bytes than the driver states", run: traffic },
];

fn good(subject: &Subject) -> Result<(), String> {
    let mut bench = Bench::new(subject)?;
    bench.tick(false);
    for enable in [false, true, false] {
        for _ in 0..20 {
            bench.expect_good(enable)?;
        }
        bench.expect_torque(enable)?;
    }
    Ok(())
}

fn silent(subject: &Subject) -> Result<(), String> {
    let mut bench = Bench::pushing(subject)?;
    bench.tap.line().fate = Some(Box::new(|_| Vec::new()));
    bench.tick(true);
    for _ in 0..50 {
        let (heard, taken) = bench.tick_taken(true);
        expect(taken && heard == Default::default(), || format!("on a silent line: {heard:?}, {taken}"))?;
    }
    bench.tap.line().fate = None;
    bench.tick(true);
    bench.expect_recovery(true, 0)
}

fn half(subject: &Subject) -> Result<(), String> {
    for rest_follows in [true, false] {
        let mut bench = Bench::pushing(subject)?;
        for _ in 0..10 {
            bench.tap.line().fate = Some(Box::new(move |mut answer: Vec<u8>| {
                let rest = answer.split_off(answer.len() / 2);
                vec![(0, answer), (1, if rest_follows { rest } else { Vec::new() })]
            }));
            bench.tick(true);
            bench.tap.line().fate = None;
            let heard = bench.tick(true);
            expect(heard.reading.is_none(), || format!("half an answer was heard as {heard:?}"))?;
            let lost = u32::from(!rest_follows);
            bench
                .expect_recovery(true, lost)
                .map_err(|what| format!("the rest follows: {rest_follows}; {what}"))?;
        }
    }
    Ok(())
}

/// A pseudo-random number generator that repeats its sequence in every run (xorshift, Marsaglia
/// 2003).
struct Numbers(u32);

impl Numbers {
    fn next(&mut self) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        self.0
    }
}

fn garbage(subject: &Subject) -> Result<(), String> {
    let mut bench = Bench::pushing(subject)?;
    let mut numbers = Numbers(0x1234_5678);
    let (mut counted, mut rounds) = (0, 0);
    while rounds < 200 {
        let length = 1 + numbers.next() as usize % 300;
        let noise: Vec<u8> = (0..length).map(|_| numbers.next() as u8).collect();
        bench.tap.line().fate = Some(Box::new(move |_| vec![(0, noise.clone())]));
        bench.tick(true);
        bench.tap.line().fate = None;
        let heard = bench.tick(true);
        counted += u32::from(heard.damaged) + heard.foreign;
        expect(heard.reading.is_none(), || format!("{length} bytes of garbage were heard as {heard:?}"))?;
        bench.expect_recovery(true, 2)?;
        rounds += 1;
    }
    // A short piece of garbage can look like the beginning of a frame, so not every piece is
    // counted.
    expect(counted >= rounds / 2, || format!("of {rounds} pieces of garbage {counted} were counted"))
}

fn late(subject: &Subject) -> Result<(), String> {
    const LATE: u32 = 5;
    let mut bench = Bench::pushing(subject)?;
    bench.tap.line().fate = Some(Box::new(|answer| vec![(LATE, answer)]));
    // What comes unasked does not say how long it was on its way. The bus has some time to find
    // out.
    let known = LATE + bench.reports.delay_ms;
    for tick in 0..known + 50 {
        let now = bench.tick;
        let heard = bench.tick(true);
        if tick > known {
            // If the protocol leaves it open which command is answered, the bus must name the older
            // one.
            let age = heard.reading.map(|reading| now - reading.answers);
            let right = age.is_some_and(|age| age > LATE);
            expect(right, || format!("an answer {LATE} ticks late was heard as {age:?} ticks old"))?;
        }
    }
    Ok(())
}

fn twice(subject: &Subject) -> Result<(), String> {
    let mut bench = Bench::pushing(subject)?;
    bench.tap.line().fate = Some(Box::new(|answer| vec![(0, answer.clone()), (1, answer)]));
    let mut last = None;
    for _ in 0..50 {
        let answers = bench.tick(true).reading.map(|reading| reading.answers);
        expect(answers.is_none() || answers > last, || format!("{answers:?} came after {last:?}"))?;
        last = answers.or(last);
    }
    // Only the duplicate of the last answer arrives.
    bench.tap.line().fate = Some(Box::new(|_| Vec::new()));
    bench.tick(true);
    bench.tick(true);
    let heard = bench.tick(true);
    expect(heard.reading.is_none(), || format!("with no new answer: {heard:?}"))
}

fn out_of_order(subject: &Subject) -> Result<(), String> {
    let mut bench = Bench::pushing(subject)?;
    let mut odd = false;
    bench.tap.line().fate = Some(Box::new(move |answer| {
        odd = !odd;
        vec![(if odd { 2 } else { 0 }, answer)]
    }));
    let mut last = None;
    for tick in 0..50 {
        let now = bench.tick;
        let answers = bench.tick(true).reading.map(|reading| reading.answers);
        let forwards = answers.is_none() || (answers > last && answers < Some(now));
        expect(forwards, || format!("{answers:?} came after {last:?} in tick {now}"))?;
        last = answers.or(last);
        expect(tick < 5 || last >= Some(now - 3), || format!("nothing newer than {last:?} by tick {now}"))?;
    }
    Ok(())
}

/// Checks that the bus ignores answers to a command that it has not sent: one of tick 1000, and the
/// one that it is about to send. Such answers come from other controllers.
fn ahead(subject: &Subject) -> Result<(), String> {
    if subject.protocol.reports().unasked {
        // Such readings answer no command: they are as new as they arrive.
        return Ok(());
    }
    for about_to_be_sent in [false, true] {
        let mut bench = Bench::pushing(subject)?;
        for _ in 0..10 {
            let now = bench.tick;
            let answered = if about_to_be_sent { now } else { 1000 };
            let mut other = Bench::new(subject)?;
            other.tick = answered;
            other.tick(true);
            let future = other.tap.take();
            expect(!future.is_empty(), || "controllers do not answer a command at once".to_owned())?;
            bench.tap.say(future);
            let heard = bench.tick(true);
            let right = heard.reading.is_none_or(|reading| reading.answers < now);
            expect(right, || format!("in tick {now} an answer to tick {answered} was heard as {heard:?}"))?;
        }
        bench.expect_recovery(true, 2)?;
    }
    Ok(())
}

fn refused(subject: &Subject) -> Result<(), String> {
    let mut bench = Bench::pushing(subject)?;
    for _ in 0..10 {
        bench.tap.line().takes = Some(0);
        let (_, taken) = bench.tick_taken(true);
        expect(!taken, || "a command of which the line took nothing counts as taken".to_owned())?;
        bench.tap.line().takes = None;
        let (heard, taken) = bench.tick_taken(true);
        let answered = heard.reading.is_some() && !bench.reports.unasked;
        expect(!answered && taken, || format!("after it: {heard:?}, {taken}"))?;
        bench.expect_recovery(true, 0)?;
    }
    Ok(())
}

fn cut(subject: &Subject) -> Result<(), String> {
    let whole = subject.protocol.off_bytes(&subject.expected).len();
    for most in 1..whole {
        let mut bench = Bench::pushing(subject)?;
        bench.tap.line().takes = Some(most);
        let (_, taken) = bench.tick_taken(true);
        // Some commands are shorter than the one that switches the motors off.
        bench.tap.line().takes = None;
        if taken {
            continue;
        }
        bench.tick(false);
        bench.expect_torque(false).map_err(|what| format!("{most} bytes taken, then off: {what}"))?;
        bench.expect_recovery(false, 1).map_err(|what| format!("{most} bytes taken: {what}"))?;
    }
    Ok(())
}

fn vanished(subject: &Subject) -> Result<(), String> {
    for rebooted in [false, true] {
        let mut bench = Bench::pushing(subject)?;
        // The line is lost in the middle of an answer. The bus must have forgotten the first half
        // when the line is back.
        bench.tap.line().fate = Some(Box::new(|mut answer: Vec<u8>| {
            answer.truncate(answer.len() / 2);
            vec![(0, answer)]
        }));
        bench.tick(true);
        bench.tick(true);
        bench.tap.line().fate = None;
        bench.tap.line().gone = true;
        for _ in 0..30 {
            let (heard, taken) = bench.tick_taken(true);
            expect(heard.reading.is_none() && !taken, || {
                format!("on a line that is gone: {heard:?}, {taken}")
            })?;
        }
        bench.tap.line().gone = false;
        // As the thread that reopens a line does.
        let off = subject.protocol.switch_off(&mut bench.tap.wire(), &subject.expected);
        expect(off.is_ok(), || format!("switched off on the line that is back: {off:?}"))?;
        bench.tap.begin();
        bench.tap.line().renewed = Some(Renewed { rebooted });
        let heard = bench.tick(false);
        let right = heard.reopened && heard.zeros_lost == rebooted;
        expect(right, || format!("back, power lost: {rebooted}; heard as {heard:?}"))?;
        bench.expect_recovery(false, 0)?;
    }
    Ok(())
}

fn rebooted(subject: &Subject) -> Result<(), String> {
    let mut bench = Bench::pushing(subject)?;
    bench.tap.controllers(|controllers| controllers.lose_power());
    let within = bench.reports.status_ms.max(5);
    let heard: Vec<_> = (0..within).map(|_| bench.tick(false)).collect();
    expect(heard.iter().any(|heard| heard.zeros_lost), || format!("within {within} ticks: {heard:?}"))?;
    bench.expect_torque(false)?;
    // The line stays open. The bus must identify the controllers again within one second.
    bench.expect_recovery(false, 1000)
}

/// Checks that the bus complains of motors that are on although its command switched them off. To
/// cause this, the controllers receive a foreign command with the same tick number, which switches
/// the motors on.
fn disobedient(subject: &Subject) -> Result<(), String> {
    let mut bench = Bench::pushing(subject)?;
    let mut other = Bench::pushing(subject)?;
    other.tick = bench.tick;
    other.tap.line().diverted = Some(Vec::new());
    other.tick(true);
    let on = other.tap.line().diverted.take().unwrap_or_default();
    let mut heard = Vec::new();
    for _ in 0..bench.reports.status_ms {
        bench.tap.line().diverted = Some(Vec::new());
        let now_ns = bench.now_ns();
        heard.push(bench.tick(false));
        bench.tap.line().diverted = None;
        bench.tap.write(now_ns, &on);
    }
    // An answer may show the motors before the command that it answers: then the next one
    // complains.
    heard.extend([bench.tick(false), bench.tick(false)]);
    let said = heard.iter().any(|heard| heard.complaints.disobeyed);
    expect(said, || format!("motors on against the command: {heard:?}"))?;
    bench.tick(false);
    bench.expect_recovery(false, bench.reports.status_ms - 1)
}

fn expired(subject: &Subject) -> Result<(), String> {
    let mut bench = Bench::pushing(subject)?;
    bench.tick += u32::from(WATCHDOG_MS) + 2;
    bench.expect_torque(false).map_err(|what| format!("{WATCHDOG_MS} ms without a command: {what}"))?;
    for _ in 0..bench.reports.status_ms {
        bench.tick(true);
    }
    for _ in 0..10 {
        let heard = bench.tick(true);
        expect(heard.complaints.watchdog, || format!("an expired watchdog was heard as {heard:?}"))?;
        bench.expect_torque(false).map_err(|what| format!("enabled on an expired watchdog: {what}"))?;
    }
    bench.tick(false);
    bench.expect_recovery(true, 1)?;
    bench.tick(true);
    bench.expect_torque(true)
}

fn last_word(subject: &Subject) -> Result<(), String> {
    let off = subject.protocol.off_bytes(&subject.expected);
    expect(off.len() <= 255, || format!("{} bytes are too many for the helper", off.len()))?;
    for most in 0..off.len() {
        let mut bench = Bench::pushing(subject)?;
        bench.tap.line().takes = Some(most);
        bench.tick(true);
        bench.tap.write(bench.now_ns(), &off);
        bench.expect_torque(false).map_err(|what| format!("after {most} bytes of a command: {what}"))?;
    }
    Ok(())
}

fn switched_off(subject: &Subject) -> Result<(), String> {
    for power_lost in [false, true] {
        let (mut wire, tap) = Wire::new((subject.controllers)());
        let failed = |error: MeetError| error.to_string();
        subject.protocol.meet(&mut wire, &subject.expected).map_err(failed)?;
        if power_lost {
            tap.controllers(|controllers| controllers.lose_power());
        }
        // An incomplete command, as an interrupted line leaves it.
        let off = subject.protocol.off_bytes(&subject.expected);
        let _ = wire.write(0, &off[..off.len() / 2]);
        let said = subject.protocol.switch_off(&mut wire, &subject.expected).map_err(failed)?;
        expect(said == power_lost, || format!("power lost: {power_lost}, said: {said}"))?;
        let torque = tap.controllers(|controllers| controllers.torque(0));
        expect(torque.iter().all(|torque| *torque == 0.0), || format!("motors give {torque:?} N m"))?;
    }
    // Motors that push are off when it returns.
    let bench = Bench::pushing(subject)?;
    let off = subject.protocol.switch_off(&mut bench.tap.wire(), &subject.expected);
    expect(off.is_ok(), || format!("while motors push: {off:?}"))?;
    bench.expect_torque(false)
}

fn foreign_controllers(subject: &Subject) -> Result<(), String> {
    let others: [(&str, Expected); 2] = [
        ("one joint fewer", subject.expected.without_last()),
        ("other encoders", subject.expected.with_other_counts()),
    ];
    for (what, other) in others {
        let (mut wire, _) = Wire::new((subject.controllers)());
        let met = subject.protocol.meet(&mut wire, &other);
        expect(met.is_err(), || format!("a rig file with {what} was taken for these controllers'"))?;
    }
    Ok(())
}

fn traffic(subject: &Subject) -> Result<(), String> {
    let said = subject.protocol.traffic(subject.torque.len());
    let mut bench = Bench::pushing(subject)?;
    bench.tap.take();
    bench.tick(true);
    let feedback = bench.tap.take().len();
    bench.tap.line().diverted = Some(Vec::new());
    bench.tick(true);
    let commands = bench.tap.line().diverted.take().unwrap_or_default().len();
    let right = commands <= said.commands && feedback <= said.feedback && commands > 0 && feedback > 0;
    expect(right, || format!("{commands} bytes to the controllers and {feedback} back, {said:?} was said"))
}
