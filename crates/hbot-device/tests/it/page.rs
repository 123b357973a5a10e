//! Compares docs/link.md with the tests of this crate, sentence by sentence. A duty that is added
//! to the page must be added here with its test.

use std::collections::BTreeSet;

use crate::{conversation, safety};

const PAGE: &str = include_str!("../../../../docs/link.md");

/// The sections of the page that say what a controller does, and the words with which they begin.
const SECTIONS: [(&str, &str); 8] = [
    ("## The conversation", ""),
    ("## A frame", "**A receiver**"),
    ("### To the controller", ""),
    ("### From the controller", ""),
    ("## What keeps people safe", ""),
    ("### What the host does with the flags", ""),
    ("### The host's last word", ""),
    ("### Seeing a reboot", ""),
];

/// A sentence of the page, and the tests that go red if it does not hold.
type Duty = (&'static str, &'static [fn()]);

/// The duties of a controller, in the words of the page, and the tests that fail if a duty is not
/// met.
const DUTIES: &[Duty] = &[
    ("A controller sends only when the host has sent something:", &[conversation::nothing_else_is_answered]),
    (
        "| `Describe` | one `Description` | after the port is opened, and again whenever \
         the host wants it |",
        &[conversation::each_describe_is_answered_with_the_identity],
    ),
    (
        "| a valid `Command` | one `Feedback` with the `sequence` of the command | in every \
         tick of the loop, 1000 times a second by default |",
        &[conversation::each_command_is_answered_with_its_sequence],
    ),
    ("| anything else | nothing | |", &[conversation::nothing_else_is_answered]),
    (
        "The controller answers with its `Description` and clears its flag `UNDESCRIBED`.",
        &[conversation::a_description_clears_undescribed],
    ),
    (
        "Both contain all joints of the port, in the order of the description.",
        &[
            conversation::readings_are_sent_unchanged_in_the_order_of_the_description,
            conversation::torques_reach_the_joints_in_their_order,
        ],
    ),
    (
        "When a command arrives, the controller samples its joints, all as close to one \
         instant as it can, and answers at once.",
        &[conversation::a_command_is_answered_with_a_reading_of_its_own],
    ),
    ("It collects bytes up to a zero.", &[conversation::each_command_is_answered_with_its_sequence]),
    (
        "It decodes COBS, checks the CRC and decodes the body.",
        &[safety::a_damaged_command_changes_nothing_whichever_bit_is_damaged],
    ),
    (
        "It accepts the frame only if all three succeed and no byte of the body is left \
         over.",
        &[
            safety::a_damaged_command_changes_nothing_whichever_bit_is_damaged,
            safety::a_frame_with_a_byte_left_over_changes_nothing,
        ],
    ),
    (
        "It drops a refused frame without an answer.",
        &[conversation::a_refused_frame_is_dropped_and_the_next_one_is_heard],
    ),
    (
        "The next frame begins after the zero.",
        &[conversation::a_refused_frame_is_dropped_and_the_next_one_is_heard],
    ),
    ("Two zeros in a row are an empty frame and mean nothing.", &[conversation::nothing_else_is_answered]),
    (
        "If more bytes than the longest frame come without a zero, the receiver drops all \
         bytes up to the next zero.",
        &[conversation::a_refused_frame_is_dropped_and_the_next_one_is_heard],
    ),
    (
        "| enable | `bool` | | | true: apply the torques. False: the joints are free of \
         torque, and an expired watchdog is cleared |",
        &[
            conversation::enable_false_frees_the_joints_whatever_the_torques,
            conversation::torques_reach_the_joints_in_their_order,
            safety::after_the_watchdog_commands_are_answered_without_torque_until_enable_is_false,
        ],
    ),
    (
        "| watchdog_ms | `u16` | ms | 1 to 65535 | how long this command is valid if no \
         other follows. The host never sends 0; treat a 0 as expired at once |",
        &[
            safety::a_watchdog_time_of_zero_has_expired_at_once,
            safety::each_valid_command_restarts_the_watchdog_with_its_own_time,
        ],
    ),
    (
        "| torque | `list of f32` | N m | finite; one per joint | torque at the joint, \
         after the gear. A positive torque turns the joint towards greater counts |",
        &[conversation::torques_reach_the_joints_in_their_order],
    ),
    (
        "| protocol | `u16` | | 1 | version of this protocol that the firmware speaks |",
        &[conversation::each_describe_is_answered_with_the_identity],
    ),
    (
        "| firmware | `string` | | up to 32 bytes | name and version of the firmware, for \
         people to read |",
        &[conversation::each_describe_is_answered_with_the_identity],
    ),
    (
        "| joints | list of joint descriptions | | up to 16 | sets the number and the order \
         of the joints |",
        &[conversation::each_describe_is_answered_with_the_identity],
    ),
    (
        "| counts_per_turn | `u32` | counts | 1 or more | counts in one turn of the \
         encoder, before the gear |",
        &[conversation::each_describe_is_answered_with_the_identity],
    ),
    (
        "| sequence | `u32` | | | the `sequence` of the command that this feedback answers \
         |",
        &[conversation::each_command_is_answered_with_its_sequence],
    ),
    (
        "| flags | `u16` | | controller flags | state of the controller after it has taken \
         in that command |",
        &[conversation::flags_are_those_after_the_command],
    ),
    (
        "| joints | list of readings | | one per joint | in the order of the description |",
        &[conversation::readings_are_sent_unchanged_in_the_order_of_the_description],
    ),
    (
        "| `ENABLED` | 0x0001 | the controller applies the torques of the command that it \
         answers |",
        &[conversation::enabled_means_that_the_torques_are_applied],
    ),
    (
        "| `WATCHDOG_EXPIRED` | 0x0002 | no valid command came in time: zero torque until a \
         command with `enable` false |",
        &[safety::after_the_watchdog_commands_are_answered_without_torque_until_enable_is_false],
    ),
    (
        "| `FAULT` | 0x0004 | the controller itself has a fault (driver, supply, encoder, \
         heat): zero torque |",
        &[safety::a_fault_ends_torque_and_is_reported],
    ),
    (
        "| `UNDESCRIBED` | 0x0008 | set from boot until the controller has answered a \
         `Describe` |",
        &[conversation::a_description_clears_undescribed, conversation::a_new_boot_is_undescribed_again],
    ),
    (
        "| `OVERCURRENT` | 0x0002 | the current is at the limit of motor or driver, so the \
         torque can be smaller than commanded |",
        &[safety::no_torque_exceeds_the_peak_of_its_joint],
    ),
    (
        "| `OVERTEMPERATURE` | 0x0004 | motor or driver is hotter than permitted |",
        &[safety::a_hot_joint_gets_no_torque_until_it_is_cooler],
    ),
    (
        "Send 0 in the bits that have no name, and ignore them in received flags.",
        &[conversation::bits_without_a_name_are_sent_as_zero],
    ),
    (
        "The firmware must check that each torque is finite ([duty \
         1](#what-keeps-people-safe)).",
        &[safety::a_command_with_a_torque_that_is_not_finite_changes_nothing],
    ),
    (
        "**Valid commands only.** A command is valid if its frame is accepted, if it has \
         one torque for each joint, and if all torques are finite.",
        &[
            safety::a_command_with_a_wrong_number_of_torques_changes_nothing,
            safety::a_command_with_a_torque_that_is_not_finite_changes_nothing,
            safety::a_damaged_command_changes_nothing_whichever_bit_is_damaged,
        ],
    ),
    (
        "Do not apply or answer an invalid command, and do not let it restart the watchdog.",
        &[
            safety::a_command_with_a_wrong_number_of_torques_changes_nothing,
            safety::invalid_commands_and_other_bytes_do_not_restart_the_watchdog,
        ],
    ),
    (
        "**The watchdog.** It expires when `watchdog_ms` of the last valid command have \
         passed without another valid command.",
        &[
            safety::the_watchdog_ends_torque_when_its_time_has_passed_and_not_before,
            safety::each_valid_command_restarts_the_watchdog_with_its_own_time,
            safety::the_watchdog_also_expires_while_the_joints_are_free,
            safety::a_late_command_does_not_bring_torque_back,
        ],
    ),
    (
        "Then set every torque to zero, set `WATCHDOG_EXPIRED`, clear `ENABLED`, and stay \
         in this state.",
        &[safety::the_watchdog_ends_torque_when_its_time_has_passed_and_not_before],
    ),
    (
        "Answer commands with `enable` true, but apply no torque.",
        &[safety::after_the_watchdog_commands_are_answered_without_torque_until_enable_is_false],
    ),
    (
        "The first command with `enable` false clears the flag; the next one with `enable` \
         true can apply torque again.",
        &[safety::after_the_watchdog_commands_are_answered_without_torque_until_enable_is_false],
    ),
    ("**Boot.** After boot the torque is zero.", &[safety::after_boot_the_torque_is_zero]),
    (
        "As long as `UNDESCRIBED` is set, answer commands but apply no torque.",
        &[safety::before_a_describe_commands_are_answered_without_torque],
    ),
    (
        "**Faults.** While `FAULT` is set, the torque is zero.",
        &[
            safety::a_fault_ends_torque_and_is_reported,
            safety::a_fault_that_lasts_only_between_two_commands_is_reported,
        ],
    ),
    (
        "The flag stays set until its cause is gone and a command with `enable` false has \
         come.",
        &[safety::a_fault_stays_until_its_cause_is_gone_and_enable_is_false],
    ),
    (
        "**Limits.** The controller limits current and heat, whatever the host commands.",
        &[
            safety::no_torque_exceeds_the_peak_of_its_joint,
            safety::a_hot_joint_gets_no_torque_until_it_is_cooler,
        ],
    ),
    (
        "For a controller it is a command like any other, and duties 1 and 2 apply \
         unchanged.",
        &[conversation::the_last_word_is_a_command_like_any_other],
    ),
    (
        "Never keep this flag in memory that survives a reset.",
        &[conversation::a_new_boot_is_undescribed_again],
    ),
];

/// What the builder's `read` must give. This crate sends it unchanged, which
/// `readings_are_sent_unchanged_in_the_order_of_the_description` tests.
const READINGS: &[&str] = &[
    "| count | `i32` | counts | any, wraps | position at the encoder, before the gear. It \
     wraps from 2147483647 to -2147483648 and back |",
    "| rate | `f32` | rad/s | finite | rate of the joint, after the gear; positive towards \
     greater counts |",
    "| current | `f32` | A | finite | motor current; a positive current drives towards \
     greater counts; 0 if it is not measured |",
    "| temperature | `f32` | °C | finite | temperature of the motor; 0 if it is not \
     measured |",
    "| flags | `u16` | | joint flags | |",
    "| `INDEX_SEEN` | 0x0001 | only for a steer joint with `zero = \"index\"`: the encoder has \
     passed its index mark since boot. From the first reading with this flag on, `count` is \
     measured from the mark: it jumps once, and goes on counting over any number of turns |",
    "**Signs.** All signs are those of the controller: count, rate, current and torque of a \
     joint agree with one another.",
];

/// Sentences that explain, or that say what the host does.
const NO_DUTIES: &[&str] = &[
    "Any serial line with 8 data bits, no parity and 1 stop bit works: a UART, or a USB \
     serial device.",
    "One controller owns a port and up to 16 joints on it.",
    "Several boards can share a port if they speak as one controller.",
    "A rig can have several ports.",
    "The host opens the port.",
    "It sends one zero byte, which ends any incomplete frame on the line, and then \
     `Describe`.",
    "The host compares the protocol version, the number of joints and the counts per turn \
     with its own version and with the rig file.",
    "If they differ, it does not continue.",
    "If no answer comes, it asks again.",
    "From then on, there is one `Command` and one `Feedback` in each tick.",
    "The age of a reading is a delay in the control loop: with late readings the sphere can \
     render less stiffness.",
    "Nobody repeats a lost frame; the next tick brings the next one.",
    "**A receiver** does this:",
    "If noise damages a zero, two frames become one, and both are lost.",
    "**`Describe`**, message 0, has no fields.",
    "**`Command`**, message 1:",
    "| sequence | `u32` | | any, wraps | grows by one with each command of this port |",
    "**`Description`**, message 0:",
    "A joint description:",
    "**`Feedback`**, message 1:",
    "A reading:",
    "Controller flags:",
    "Joint flags:",
    "The host knows from the rig file which way the joint is built into the rig, its gear, \
     and where its zero is.",
    "**Impossible values.** The decoder accepts every bit pattern of a float, also NaN and \
     infinity, because it checks only the form of a frame.",
    "The host checks that each reading is finite and plausible, and stops the rig if it is \
     not.",
    "Limit heat in the power stage too: temperatures are checked only when a command \
     arrives.",
    "These five points are duties of the firmware.",
    "The host cannot do them in its place.",
    "So torque never comes back by surprise after a host that hangs for a moment, or after \
     a loose plug.",
    "| `ENABLED` is clear although the command that the reading answers has `enable` true, \
     and none of `WATCHDOG_EXPIRED`, `FAULT`, `UNDESCRIBED` is set; or `ENABLED` is set \
     although that command has `enable` false | after 20 ms without a break: fault \
     `controller_fault`. So torque does not come back when the motor supply is switched off \
     and on again. A power stage has 20 ms to start |",
    "| `WATCHDOG_EXPIRED` while torque was commanded | fault `link_lost` |",
    "| `FAULT` or `UNDESCRIBED` | fault `controller_fault` |",
    "| `OVERCURRENT`, or a current beyond 1000 A | fault `overtorque` |",
    "| `OVERTEMPERATURE`, or a temperature above 150 °C | fault `thermal` |",
    "| a rate, current or temperature that is not finite | fault `non_finite` |",
    "| a `sequence` that is older than `timeout_ticks`; or, over a long time, readings in \
     less than one tick of five | fault `link_lost` |",
    "| counts that disagree with the rates for 50 ms; or counts that move further in a tick \
     than four times `limits.speed` explains | fault `implausible_feedback` |",
    "The *last word* is the command that ends a session on the line.",
    "A host that ends sends three commands with `enable` false and torques of 0.",
    "If the server is killed or aborts, a helper process writes in its place.",
    "It first writes one zero byte, which ends a frame that the server left incomplete.",
    "Then it writes a valid `Command` for all joints of the port three times, 3 ms apart.",
    "This command has `sequence` 0, `enable` false and a `watchdog_ms` of 1.",
    "If the whole machine of the host fails, only the watchdog is left.",
    "A controller can restart during a run, because its supply dips or its own processor \
     watchdog resets it.",
    "It then counts from a new zero and has forgotten its state.",
    "The flag `UNDESCRIBED` shows this: the host has had its description, so a feedback \
     with this flag can only come from a controller that has rebooted.",
    "The host then goes to zero torque, forgets the zeros of the joints, and asks for the \
     description again.",
    "If the new description is not that of the rig file, the fault stays.",
];

/// Returns the sentences and rows of tables of a section, each in one line.
fn sentences(section: &str) -> BTreeSet<String> {
    let mut all = BTreeSet::new();
    let mut paragraph = String::new();
    // The empty line ends the last paragraph.
    for line in section.lines().chain([""]) {
        let row = line.starts_with('|');
        let item = line.split_once(' ').filter(|(mark, _)| *mark == "-" || is_number(mark));
        if row || line.is_empty() || item.is_some() {
            all.extend(split(&core::mem::take(&mut paragraph)));
        }
        if row {
            all.insert(line.to_owned());
        } else {
            let text = item.map_or(line, |(_, text)| text);
            paragraph += &format!(" {}", text.trim());
        }
    }
    // Each table begins with a row of names and a row of dashes.
    let lines: Vec<_> = section.lines().collect();
    for pair in lines.windows(2).filter(|pair| pair[1].starts_with("|---")) {
        all.remove(pair[0]);
        all.remove(pair[1]);
    }
    all
}

fn is_number(mark: &str) -> bool {
    mark.strip_suffix('.').is_some_and(|digits| digits.parse::<u32>().is_ok())
}

/// Splits a paragraph after each full stop or colon that is followed by the beginning of a
/// sentence.
fn split(paragraph: &str) -> Vec<String> {
    let mut all = vec![String::new()];
    for word in paragraph.split_whitespace() {
        let last = all.last_mut().expect("never empty");
        let begins = word.starts_with(|c: char| c.is_uppercase() || "`*([".contains(c));
        if begins && last.ends_with(['.', ':']) {
            all.push(word.to_owned());
        } else {
            *last += if last.is_empty() { "" } else { " " };
            *last += word;
        }
    }
    all.retain(|sentence| !sentence.is_empty());
    all
}

/// Returns all sentences of the sections above.
fn on_the_page() -> BTreeSet<String> {
    let mut all = BTreeSet::new();
    for (heading, first) in SECTIONS {
        let after = PAGE.split(&format!("\n{heading}\n")).nth(1);
        let after = after.unwrap_or_else(|| panic!("docs/link.md has no heading {heading}"));
        let section = after.split("\n## ").next().and_then(|text| text.split("\n### ").next());
        let section = section.expect("a split has a first part");
        let begin = section.find(first).unwrap_or_else(|| panic!("{heading}: no {first}"));
        all.extend(sentences(&section[begin..]));
    }
    all
}

#[test]
fn every_duty_on_the_page_has_a_test() {
    let known = DUTIES.iter().map(|(sentence, _)| sentence).chain(READINGS).chain(NO_DUTIES);
    let known: BTreeSet<String> = known.map(|sentence| (*sentence).to_owned()).collect();
    let page = on_the_page();
    let new: Vec<_> = page.difference(&known).collect();
    assert!(new.is_empty(), "docs/link.md says what no test knows: {new:#?}");
    let gone: Vec<_> = known.difference(&page).collect();
    assert!(gone.is_empty(), "tests quote what docs/link.md does not say: {gone:#?}");
    assert!(DUTIES.iter().all(|(_, tests)| !tests.is_empty()));
}
