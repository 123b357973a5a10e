//! Compares docs/link.md with the tests of this crate, sentence by sentence. A duty that is added
//! to the page must be added here with its test.

use std::collections::BTreeSet;

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

/// The tests that fail if a duty of a controller is not met, each with its duties in the words of
/// the page.
const DUTIES: &str = r#"
nothing_else_is_answered
- A controller sends only when the host has sent something:
- | anything else | nothing | |
- Two zeros in a row are an empty frame and mean nothing.
each_describe_is_answered_with_the_identity
- | `Describe` | one `Description` | after the port is opened, and again whenever the host wants it |
- | protocol | `u16` | | 1 | version of this protocol that the firmware speaks |
- | firmware | `string` | | up to 32 bytes | name and version of the firmware, for people to read |
- | joints | list of joint descriptions | | up to 16 | sets the number and the order of the joints |
- | counts_per_turn | `u32` | counts | 4 to 1073741824 | counts in one turn of the encoder, before the gear |
each_command_is_answered_with_its_sequence
- | a valid `Command` | one `Feedback` with the `sequence` of the command | in every tick of the loop, 1000 times a second by default |
- It collects bytes up to a zero.
- | sequence | `u32` | | | the `sequence` of the command that this feedback answers |
a_description_clears_undescribed
- The controller answers with its `Description` and clears its flag `UNDESCRIBED`.
- | `UNDESCRIBED` | 0x0008 | set from boot until the controller has answered a `Describe` |
readings_are_sent_unchanged_in_the_order_of_the_description
- Both contain all joints of the port, in the order of the description.
- | joints | list of readings | | one per joint | in the order of the description |
torques_reach_the_joints_in_their_order
- Both contain all joints of the port, in the order of the description.
- | enable | `bool` | | | true: apply the torques. False: the joints are free of torque, and an expired watchdog is cleared |
- | torque | `list of f32` | N m | finite; one per joint | torque at the joint, after the gear. A positive torque turns the joint towards greater counts |
a_command_is_answered_with_a_reading_of_its_own
- When a command arrives, the controller samples its joints, all as close to one instant as it can, and answers at once.
a_damaged_command_changes_nothing_whichever_bit_is_damaged
- It decodes COBS, checks the CRC and decodes the body.
- It accepts the frame only if all three succeed and no byte of the body is left over.
- **Valid commands only.** A command is valid if its frame is accepted, if it has one torque for each joint, and if all torques are finite.
a_frame_with_a_byte_left_over_changes_nothing
- It accepts the frame only if all three succeed and no byte of the body is left over.
a_refused_frame_is_dropped_and_the_next_one_is_heard
- It drops a refused frame without an answer.
- The next frame begins after the zero.
- If more bytes than the longest frame come without a zero, the receiver drops all bytes up to the next zero.
enable_false_frees_the_joints_whatever_the_torques
- | enable | `bool` | | | true: apply the torques. False: the joints are free of torque, and an expired watchdog is cleared |
after_the_watchdog_commands_are_answered_without_torque_until_enable_is_false
- | enable | `bool` | | | true: apply the torques. False: the joints are free of torque, and an expired watchdog is cleared |
- | `WATCHDOG_EXPIRED` | 0x0002 | no valid command came in time: zero torque until a command with `enable` false |
- Answer commands with `enable` true, but apply no torque.
- The first command with `enable` false clears the flag; the next one with `enable` true can apply torque again.
a_watchdog_time_of_zero_has_expired_at_once
- | watchdog_ms | `u16` | ms | 1 to 65535 | how long this command is valid if no other follows. The host never sends 0; treat a 0 as expired at once |
each_valid_command_restarts_the_watchdog_with_its_own_time
- | watchdog_ms | `u16` | ms | 1 to 65535 | how long this command is valid if no other follows. The host never sends 0; treat a 0 as expired at once |
- **The watchdog.** It expires when `watchdog_ms` of the last valid command have passed without another valid command.
flags_are_those_after_the_command
- | flags | `u16` | | controller flags | state of the controller after it has taken in that command |
enabled_means_that_the_torques_are_applied
- | `ENABLED` | 0x0001 | the controller applies the torques of the command that it answers |
a_fault_ends_torque_and_is_reported
- | `FAULT` | 0x0004 | the controller itself has a fault (driver, supply, encoder, heat): zero torque |
- **Faults.** While `FAULT` is set, the torque is zero.
a_new_boot_is_undescribed_again
- | `UNDESCRIBED` | 0x0008 | set from boot until the controller has answered a `Describe` |
- Never keep this flag in memory that survives a reset.
no_torque_exceeds_the_peak_of_its_joint
- | `OVERCURRENT` | 0x0002 | the current is at the limit of motor or driver, so the torque can be smaller than commanded |
- **Limits.** The controller limits current and heat, whatever the host commands.
a_hot_joint_gets_no_torque_until_it_is_cooler
- | `OVERTEMPERATURE` | 0x0004 | motor or driver is hotter than permitted |
- **Limits.** The controller limits current and heat, whatever the host commands.
bits_without_a_name_are_sent_as_zero
- Send 0 in the bits that have no name, and ignore them in received flags.
a_command_with_a_torque_that_is_not_finite_changes_nothing
- The firmware must check that each torque is finite ([duty 1](#what-keeps-people-safe)).
- **Valid commands only.** A command is valid if its frame is accepted, if it has one torque for each joint, and if all torques are finite.
a_command_with_a_wrong_number_of_torques_changes_nothing
- **Valid commands only.** A command is valid if its frame is accepted, if it has one torque for each joint, and if all torques are finite.
- Do not apply or answer an invalid command, and do not let it restart the watchdog.
invalid_commands_and_other_bytes_do_not_restart_the_watchdog
- Do not apply or answer an invalid command, and do not let it restart the watchdog.
the_watchdog_ends_torque_when_its_time_has_passed_and_not_before
- **The watchdog.** It expires when `watchdog_ms` of the last valid command have passed without another valid command.
- Then set every torque to zero, set `WATCHDOG_EXPIRED`, clear `ENABLED`, and stay in this state.
the_watchdog_also_expires_while_the_joints_are_free
- **The watchdog.** It expires when `watchdog_ms` of the last valid command have passed without another valid command.
a_late_command_does_not_bring_torque_back
- **The watchdog.** It expires when `watchdog_ms` of the last valid command have passed without another valid command.
after_boot_the_torque_is_zero
- **Boot.** After boot the torque is zero.
before_a_describe_commands_are_answered_without_torque
- As long as `UNDESCRIBED` is set, answer commands but apply no torque.
a_fault_that_lasts_only_between_two_commands_is_reported
- **Faults.** While `FAULT` is set, the torque is zero.
a_fault_stays_until_its_cause_is_gone_and_enable_is_false
- The flag stays set until its cause is gone and a command with `enable` false has come.
the_last_word_is_a_command_like_any_other
- For a controller it is a command like any other, and duties 1 and 2 apply unchanged.
"#;

/// The hash of the other sentences and rows, which explain, say what the host does, or say what the
/// builder's `read` must give: it is sent unchanged, which
/// `readings_are_sent_unchanged_in_the_order_of_the_description` tests.
const OTHERS: u64 = 0xABBE_D3DD_AB3B_69E5;

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
    let tests = [include_str!("conversation.rs"), include_str!("safety.rs")].concat();
    let mut duties = BTreeSet::new();
    for line in DUTIES.lines().filter(|line| !line.is_empty()) {
        match line.strip_prefix("- ") {
            Some(duty) => _ = duties.insert(duty.to_owned()),
            None => assert!(tests.contains(&format!("#[test]\nfn {line}()")), "no test {line}"),
        }
    }
    let page = on_the_page();
    let gone: Vec<_> = duties.difference(&page).collect();
    assert!(gone.is_empty(), "tests quote what docs/link.md does not say: {gone:#?}");
    let others: Vec<_> = page.difference(&duties).collect();
    // FNV-1a.
    let hash =
        others.iter().flat_map(|sentence| sentence.bytes()).fold(0xCBF2_9CE4_8422_2325, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3_u64)
        });
    assert_eq!(
        hash, OTHERS,
        "docs/link.md says something new. Each duty needs a test; beside them it says {others:#?} (0x{hash:016X})"
    );
}
