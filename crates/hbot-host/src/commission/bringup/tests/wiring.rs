//! Tests with rigs that are wired wrongly: the message must name the error.

use hbot_link::{Command, Decoder, Feedback, FromController, encode};

use super::super::joint::{HOLD_S, Outcome};
use super::*;

/// Wiring errors that a test simulates between the motor controllers and their motors and encoders.
#[derive(Default, Clone)]
struct Wiring {
    /// Number of the joint whose motor has two leads exchanged.
    leads: Option<usize>,
    /// Numbers of two joints whose motors are connected to each other's controllers.
    motors: Option<(usize, usize)>,
    /// Numbers of two joints whose encoders are connected to each other's controllers.
    encoders: Option<(usize, usize)>,
    /// Number of the joint whose motor is not connected.
    dead_motor: Option<usize>,
    /// Number of the joint whose encoder count does not change.
    dead_encoder: Option<usize>,
    /// True if the controller of the dead encoder still reports rates.
    rates_stay: bool,
}

/// A line to simulated motor controllers that behave as if they were wired wrongly.
struct Miswired {
    line: Memory,
    wiring: Wiring,
    answers: Vec<u8>,
}

impl Wiring {
    fn spoil_command(&self, command: &mut Command) {
        if let Some(j) = self.leads {
            command.torque[j] = -command.torque[j];
        }
        if let Some((a, b)) = self.motors {
            command.torque.swap(a, b);
        }
        if let Some(j) = self.dead_motor {
            command.torque[j] = 0.0;
        }
    }

    fn spoil_feedback(&self, feedback: &mut Feedback) {
        if let Some((a, b)) = self.encoders {
            feedback.joints.swap(a, b);
        }
        if let Some(j) = self.dead_encoder {
            feedback.joints[j].count = 0;
            if !self.rates_stay {
                feedback.joints[j].rate = 0.0;
            }
        }
    }
}

impl Line for Miswired {
    fn read(&mut self, now_ns: u64, buffer: &mut [u8]) -> std::io::Result<usize> {
        let mut raw = [0; 4096];
        let n = self.line.read(now_ns, &mut raw)?;
        let (answers, wiring) = (&mut self.answers, &self.wiring);
        Decoder::<FromController>::new().feed(&raw[..n], |message| {
            let Ok(mut message) = message else { return };
            if let FromController::Feedback(feedback) = &mut message {
                wiring.spoil_feedback(feedback);
            }
            let mut frame = [0; hbot_link::MAX_FEEDBACK_FRAME];
            let n = encode(&message, &mut frame).unwrap();
            answers.extend_from_slice(&frame[..n]);
        });
        let n = self.answers.len().min(buffer.len());
        buffer[..n].copy_from_slice(&self.answers[..n]);
        self.answers.drain(..n);
        Ok(n)
    }

    fn write(&mut self, now_ns: u64, bytes: &[u8]) -> std::io::Result<usize> {
        let mut result = Ok(bytes.len());
        Decoder::<ToController>::new().feed(bytes, |message| {
            let Ok(mut message) = message else { return };
            if let ToController::Command(command) = &mut message {
                self.wiring.spoil_command(command);
            }
            let mut frame = [0; hbot_link::MAX_COMMAND_FRAME];
            let n = encode(&message, &mut frame).unwrap();
            result = self.line.write(now_ns, &frame[..n]).map(|_| bytes.len());
        });
        result
    }
}

fn miswired(wiring: Wiring) -> Bench {
    on(Miswired { line: Memory::new(simulated(), mpsc::channel().1), wiring, answers: Vec::new() })
}

fn tested(wiring: Wiring, joint: usize, torque: f64, speed: f64) -> Outcome {
    test(&mut miswired(wiring), joint, torque, HOLD_S, speed).unwrap()
}

#[test]
fn two_leads_exchanged_are_named_on_every_joint_and_on_no_other() {
    for leads in 0..4 {
        let wiring = Wiring { leads: Some(leads), ..Wiring::default() };
        for joint in 0..4 {
            let expected = if joint == leads { Verdict::Reversed } else { Verdict::Good };
            assert_eq!(tested(wiring.clone(), joint, 0.01, 50.0).verdict, expected, "{joint} of {leads}");
        }
        // The reversed sign is more important than the stop for speed.
        let outcome = tested(wiring, leads, 0.01, 1.5);
        assert!(outcome.fastest > 1.5 && outcome.verdict == Verdict::Reversed, "{outcome:?}");
    }
}

#[test]
fn a_joint_that_stands_may_have_a_dead_encoder_and_nobody_is_told_to_push_harder_then() {
    for joint in 0..4 {
        let outcome = tested(Wiring { dead_motor: Some(joint), ..Wiring::default() }, joint, 0.01, 50.0);
        assert_eq!(outcome.verdict, Verdict::Stands, "{outcome:?}");
        let told = outcome.verdict.to_string();
        assert!(told.contains("its encoder is dead") && told.contains("do not raise --torque"), "{told}");
        // The sphere turns other joints, which reveals the error.
        let wiring = Wiring { dead_encoder: Some(joint), ..Wiring::default() };
        let outcome = tested(wiring.clone(), joint, 0.01, 50.0);
        let Verdict::Another(other) = outcome.verdict else { panic!("{outcome:?}") };
        let told = outcome.verdict.to_string();
        assert!(other != joint && told.contains(&format!("those of joint {} did", other + 1)), "{told}");
        assert!(told.contains("its own encoder is dead"), "{told}");
        let wiring = Wiring { rates_stay: true, ..wiring };
        assert_eq!(tested(wiring, joint, 0.01, 50.0).verdict, Verdict::CountsStand);
    }
}

#[test]
fn whichever_joint_turns_too_fast_ends_the_push() {
    // The encoder of the tested joint is dead, so the other joints must be watched as well.
    let outcome = tested(Wiring { dead_encoder: Some(1), ..Wiring::default() }, 1, 0.05, 0.5);
    let Verdict::TooFast(other) = outcome.verdict else { panic!("{outcome:?}") };
    assert!(other != 1 && outcome.verdict.to_string().contains("--torque"), "{outcome:?}");
}

#[test]
fn exchanged_motors_and_encoders_are_not_good_where_the_counts_show_it() {
    for wiring in [
        Wiring { motors: Some((1, 3)), ..Wiring::default() },
        Wiring { encoders: Some((1, 3)), ..Wiring::default() },
        Wiring { motors: Some((0, 1)), encoders: Some((0, 1)), ..Wiring::default() },
    ] {
        assert!((0..4).any(|joint| tested(wiring.clone(), joint, 0.01, 50.0).verdict != Verdict::Good));
    }
}
