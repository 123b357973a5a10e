//! Tests of the helper: what it writes and when, and programs that are not helpers.

use super::*;

/// Returns a helper program for a test: it reports that it is ready and then runs the shell script
/// `script`.
fn helper(script: &str) -> Program {
    Program::shell(&format!("printf '\\002' >&2; {script}"))
}

fn start(program: &Program) -> io::Result<(LastWord, io::PipeReader)> {
    let (far, line) = io::pipe()?;
    Ok((LastWord::start(program, &line, &[0, 7, 7, 0])?, far))
}

/// Runs a helper that receives `bytes` from its server. Returns the bytes that the helper writes to
/// the line, and whether it reported ready and ended without an error.
fn said(bytes: &[u8]) -> (Vec<u8>, bool) {
    let (mut far, line) = io::pipe().unwrap();
    let mut answer = Vec::new();
    let done = serve(bytes, &line, &mut answer);
    drop(line);
    let mut heard = Vec::new();
    far.read_to_end(&mut heard).unwrap();
    (heard, done.is_ok() && answer == [READY])
}

#[test]
fn a_frame_is_said_three_times_where_the_server_ends_without_a_word_and_not_otherwise() {
    let frame = [3, 0, 5, 0];
    assert_eq!(said(&frame), (frame[1..].repeat(3), true));
    assert_eq!(said(&[3, 0, 5, 0, ALL_SAID]), (Vec::new(), true));
    // An incomplete frame is not a command, so nothing is written.
    assert_eq!(said(&frame[..3]), (Vec::new(), false));
    assert_eq!(said(&[]), (Vec::new(), false));
}

#[test]
fn a_line_that_takes_no_bytes_holds_the_helper_up_for_a_while_only() {
    let (_far, line) = io::pipe().unwrap();
    let flags = rustix::fs::fcntl_getfl(&line).unwrap();
    rustix::fs::fcntl_setfl(&line, flags | rustix::fs::OFlags::NONBLOCK).unwrap();
    while rustix::io::write(&line, &[0; 4096]).is_ok() {}
    say(&line, &[0; 8]).unwrap();
}

#[test]
fn a_program_that_is_no_helper_is_refused() {
    for script in ["exit 0", "echo hello >&2"] {
        assert!(start(&Program::shell(script)).is_err(), "{script}");
    }
    let missing = Program { path: "/no/such/program".into(), arguments: Vec::new() };
    assert!(start(&missing).is_err());
}

#[test]
fn one_that_is_told_to_end_is_waited_for_and_one_that_ends_by_itself_is_noticed() {
    let (mut told, _far) = start(&helper("cat >/dev/null")).unwrap();
    let watched = told.watched();
    assert!(!watched.is_lost());
    told.all_said();
    assert!(matches!(held(&told.helper).child.try_wait(), Ok(Some(_))), "it is still there");
    assert!(!watched.is_lost(), "it was told to end");

    // This helper reads the frame with its length byte, and ends.
    let (lost, _far) = start(&helper("head -c 5 >/dev/null")).unwrap();
    let watched = lost.watched();
    hbot_testing::patience::eventually("its loss is noticed", || watched.is_lost());
}

/// A helper that takes some time to end is waited for and not killed. This test sleeps because time
/// is its subject.
#[test]
fn one_that_takes_its_time_to_end_is_given_it() {
    // The length byte and the frame of four bytes, then the byte that dismisses the helper.
    let (mut slow, mut far) = start(&helper("head -c 6 >/dev/null; sleep 0.1; printf done")).unwrap();
    slow.all_said();
    assert!(matches!(held(&slow.helper).child.try_wait(), Ok(Some(status)) if status.success()));
    drop(slow);
    let mut said = String::new();
    far.read_to_string(&mut said).unwrap();
    assert_eq!(said, "done");
}

#[test]
fn a_crash_writes_no_core_file() {
    without_core_file();
    let limit = getrlimit(Resource::Core);
    // One byte, because the system would pipe a core file to a program with a limit of zero.
    assert!(limit.current.is_some_and(|bytes| bytes <= 1), "{limit:?}");
    assert!(limit.maximum == Some(0) || limit.current == Some(1), "{limit:?}");
}

#[test]
fn a_descriptor_is_waited_for_until_it_is_ready_or_the_time_is_over() {
    let (far, line) = io::pipe().unwrap();
    let begun = Instant::now();
    let time = Duration::from_millis(30);
    assert!(!wait_for(&far, PollFlags::IN, time).unwrap());
    assert!(begun.elapsed() >= time);
    rustix::io::write(&line, &[1]).unwrap();
    // It is ready at once, however long it may take.
    assert!(wait_for(&far, PollFlags::IN, Duration::from_secs(1000)).unwrap());
}

#[test]
fn one_that_does_not_end_is_killed() {
    let (mut stubborn, _far) = start(&helper("exec sleep 1000")).unwrap();
    stubborn.all_said();
    assert!(matches!(held(&stubborn.helper).child.try_wait(), Ok(Some(_))));
}

/// If a server gives a line up without a word, its helper has ended before the line can be opened
/// again. It ends by itself: a helper that is killed does not write the last word of this one.
#[test]
fn one_whose_server_leaves_without_a_word_is_waited_for() {
    // The helper reads until the server drops it.
    let (word, mut far) = start(&helper("cat >/dev/null; sleep 0.1; printf done")).unwrap();
    let (process, watched) = (Arc::clone(&word.helper), word.watched());
    drop(word);
    assert!(matches!(held(&process).child.try_wait(), Ok(Some(_))), "it is still there");
    assert!(!watched.is_lost(), "it was to end");
    drop((process, watched));
    let mut said = String::new();
    far.read_to_string(&mut said).unwrap();
    assert_eq!(said, "done");
}

/// The frames have 3 ms between them, so that one disturbance of the line does not hit all three.
#[test]
fn the_frames_of_the_last_word_are_some_milliseconds_apart() {
    let begun = Instant::now();
    assert_eq!(said(&[2, 5, 0]), ([5_u8, 0].repeat(3), true));
    assert!(begun.elapsed() >= Duration::from_millis(6), "{:?}", begun.elapsed());
}
