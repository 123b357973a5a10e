//! The questions of `hbot rig new`, and the mistakes in their answers.

use anyhow::bail;
use clap::ValueEnum as _;
use hbot_config::{Diagnostic, RigConfig};

use super::units::Quantity;
use super::{Answers, Controllers, NewArgs, file};

/// A number that the command asks for.
struct Number {
    option: &'static str,
    /// The question, which ends with the unit.
    words: &'static str,
    /// The unit in words. Empty for a number without one.
    unit: &'static str,
    quantity: Quantity,
    /// What `?` answers.
    help: &'static str,
    given: fn(&NewArgs) -> Option<f64>,
    place: fn(&mut Answers) -> &mut f64,
}

/// The numbers, in the order in which the command asks for them.
const NUMBERS: [Number; 10] = [
    Number {
        option: "--radius",
        words: "radius of the sphere, m",
        unit: "metres",
        quantity: Quantity::Length,
        help: "Of the ball that the wheels touch, without the cage: half its diameter, or its circumference / 6.28.",
        given: |args| args.radius,
        place: |answers| &mut answers.radius,
    },
    Number {
        option: "--mass",
        words: "mass of the sphere, kg",
        unit: "kilograms",
        quantity: Quantity::Mass,
        help: "Of the sphere alone. It counts as a thin shell.",
        given: |args| args.mass,
        place: |answers| &mut answers.mass,
    },
    Number {
        option: "--wheel-radius",
        words: "radius of the wheels, m",
        unit: "metres",
        quantity: Quantity::Length,
        help: "From the wheel's axle to the point that touches the sphere, tyre included.",
        given: |args| args.wheel_radius,
        place: |answers| &mut answers.wheel_radius,
    },
    Number {
        option: "--cone",
        words: "angle between steering axis and contact, degrees",
        unit: "degrees",
        quantity: Quantity::Angle,
        help: "Seen from the centre of the sphere: the angle between a wheel's steering axis and the line to the point that it touches. The wheel stands off its axis by it, so that steering moves the contact on a small circle; 0 would be singular. `cone` in the drawing of docs/build-one.md.",
        given: |args| args.cone,
        place: |answers| &mut answers.cone_deg,
    },
    Number {
        option: "--steer-gear",
        words: "gear of the steer joints, turns of the motor per turn of the joint",
        unit: "turns of the motor",
        quantity: Quantity::Ratio,
        help: "1 if the motor steers directly.",
        given: |args| args.steer_gear,
        place: |answers| &mut answers.steer.gear,
    },
    Number {
        option: "--steer-peak",
        words: "largest torque of a steer joint after its gear, N m",
        unit: "newton metres",
        quantity: Quantity::Torque,
        help: "Torque constant times the largest current, times the gear. The motor's data sheet calls it peak or stall torque.",
        given: |args| args.steer_peak,
        place: |answers| &mut answers.steer.peak,
    },
    Number {
        option: "--drive-gear",
        words: "gear of the drive joints, turns of the motor per turn of the joint",
        unit: "turns of the motor",
        quantity: Quantity::Ratio,
        help: "1 if the wheel is on the motor's shaft.",
        given: |args| args.drive_gear,
        place: |answers| &mut answers.drive.gear,
    },
    Number {
        option: "--drive-peak",
        words: "largest torque of a drive joint after its gear, N m",
        unit: "newton metres",
        quantity: Quantity::Torque,
        help: "Torque constant times the largest current, times the gear. The motor's data sheet calls it peak or stall torque.",
        given: |args| args.drive_peak,
        place: |answers| &mut answers.drive.peak,
    },
    Number {
        option: "--friction",
        words: "friction coefficient between wheel and sphere",
        unit: "",
        quantity: Quantity::Ratio,
        help: "Lay the tyre on a plate of the sphere's material and tilt it: the tangent of the angle at which it slides. Usual are 0.8 for rubber on a smooth plastic and 0.3 for a hard wheel. With the next answer it limits the torque, because a wheel that slips is no longer felt.",
        given: |args| args.friction,
        place: |answers| &mut answers.friction,
    },
    Number {
        option: "--normal-force",
        words: "force with which each wheel presses on the sphere, N",
        unit: "newtons",
        quantity: Quantity::Force,
        help: "What the spring of the wheel's holder, or the cage, presses with: pull the wheel off by a spring scale. `N` in the drawing of docs/build-one.md.",
        given: |args| args.normal_force,
        place: |answers| &mut answers.normal_force,
    },
];

/// Names the options that together make a mistake in the arrangement of the wheels.
const WHEELS_AND_CONE: &str = "--wheels and --cone";

/// Cone angle below which motors can hardly steer, degrees.
const LEAST_CONE_DEG: f64 = 1.0;

/// A mistake in the answers: the option that has the wrong value, and what is wrong.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Mistake {
    option: &'static str,
    why: String,
}

/// Asks a person: prints the prompt and returns the answer. Returns `None` if nobody is there.
pub(super) type Ask<'a> = &'a mut dyn FnMut(&str) -> anyhow::Result<Option<String>>;

/// Takes the answers of the command line, and asks for the others. An answer that is not legal is
/// asked for again, with the reason.
pub(super) fn answers(args: &NewArgs, ask: Ask<'_>) -> anyhow::Result<Answers> {
    let mut answers = given(args)?;
    if args.protocol.is_none() {
        let take = |answers: &mut Answers, text: &str| -> Result<(), String> {
            answers.protocol = Controllers::from_str(text, true)
                .map_err(|_| "the protocol is hbot, moteus or odrive; boards with own firmware, such as an Arduino, speak hbot".to_owned())?;
            Ok(())
        };
        let question = "protocol of the motor controllers (hbot, moteus, odrive)";
        let help = "What the motor controllers speak: moteus servos and ODrives their vendor's protocol, and firmware of your own hbot's. docs/controllers.md, docs/firmware.md.";
        settle(ask, &mut answers, (question, "hbot", help), &["--protocol"], &take)?;
    }
    if args.name.is_none() {
        let take = |answers: &mut Answers, text: &str| -> Result<(), String> {
            answers.name = text.to_owned();
            Ok(())
        };
        settle(
            ask,
            &mut answers,
            ("name of the rig", "My Hbot", "Any text. Panel, recordings and messages show it."),
            &["--name"],
            &take,
        )?;
    }
    if args.port.is_none() {
        let take = |answers: &mut Answers, text: &str| -> Result<(), String> {
            // A path, a port of Windows, or one of the names of the simulated rig.
            if !(text.contains('/') || text.starts_with("COM") || ["sim", "sim:pty"].contains(&text)) {
                return Err("it must be sim, or the path of a device, such as /dev/ttyACM0".to_owned());
            }
            if text.contains(',') {
                return Err("it is one device; for several write port = [\"/dev/ttyACM0\", \"/dev/ttyACM1\"] into the file".to_owned());
            }
            answers.port = text.to_owned();
            Ok(())
        };
        let help = "The path of the adapter, such as /dev/ttyACM0 (`ls /dev/serial/by-id` lists them). sim is the simulated rig; `--port` of each command replaces it.";
        settle(ask, &mut answers, ("serial device, or sim", "sim", help), &["--port"], &take)?;
    }
    if args.wheels.is_none() {
        let take = |answers: &mut Answers, text: &str| -> Result<(), String> {
            let wheels = text.parse::<u32>().ok().filter(|wheels| (2..=8).contains(wheels));
            answers.wheels = wheels.ok_or("a whole number, 2 to 8")?;
            Ok(())
        };
        // The cone decides with the number of wheels whether they meet. It may still be asked for.
        let options = ["--wheels", WHEELS_AND_CONE];
        let options = if args.cone.is_some() { &options[..] } else { &options[..1] };
        let help = "The wheels that motors steer and drive. The file arranges them evenly around n3; correct `axis` there. docs/build-one.md has a drawing.";
        settle(ask, &mut answers, ("number of wheels", "2", help), options, &take)?;
    }
    for number in NUMBERS {
        if (number.given)(args).is_some() {
            continue;
        }
        let default = (number.place)(&mut answers).to_string();
        let take = |answers: &mut Answers, text: &str| -> Result<(), String> {
            let value = number.quantity.read(text).and_then(|value| {
                value.is_finite().then_some(value).ok_or_else(|| "it is not finite".to_owned())
            });
            let of = if number.unit.is_empty() { "" } else { " of " };
            *(number.place)(answers) = value.map_err(|why| {
                format!("it must be a number{of}{}, such as {default} ({why})", number.unit)
            })?;
            Ok(())
        };
        let options = [number.option, WHEELS_AND_CONE];
        let options = if number.option == "--cone" { &options[..] } else { &options[..1] };
        settle(ask, &mut answers, (number.words, &default, number.help), options, &take)?;
    }
    refuse(&mistakes(&answers)?)?;
    Ok(answers)
}

/// Returns the answers of the command line, and the usual ones for the rest.
fn given(args: &NewArgs) -> anyhow::Result<Answers> {
    let mut answers = Answers::usual();
    let mut options = Vec::new();
    if let Some(protocol) = args.protocol {
        answers.protocol = protocol;
    }
    if let Some(name) = &args.name {
        answers.name.clone_from(name);
        options.push("--name");
    }
    if let Some(port) = &args.port {
        answers.port.clone_from(port);
        options.push("--port");
    }
    if let Some(wheels) = args.wheels {
        answers.wheels = wheels;
        options.push("--wheels");
        options.extend(args.cone.map(|_| WHEELS_AND_CONE));
    }
    for number in NUMBERS {
        let Some(value) = (number.given)(args) else { continue };
        if !value.is_finite() {
            bail!("{}: {value} is not a number ({})", number.option, number.words);
        }
        *(number.place)(&mut answers) = value;
        options.push(number.option);
    }
    let mut wrong = mistakes(&answers)?;
    wrong.retain(|mistake| options.contains(&mistake.option));
    refuse(&wrong)?;
    Ok(answers)
}

/// Fails if there are mistakes. The error names the option of each, with its unit.
fn refuse(mistakes: &[Mistake]) -> anyhow::Result<()> {
    if mistakes.is_empty() {
        return Ok(());
    }
    let lines = mistakes.iter().map(|Mistake { option, why }| {
        match NUMBERS.iter().find(|number| number.option == *option) {
            Some(Number { words, .. }) => format!("{option}: {why} ({words})"),
            None => format!("{option}: {why}"),
        }
    });
    bail!(lines.collect::<Vec<_>>().join("\n"))
}

/// Asks a question until the answer is legal. The question has its words, the default, and what the
/// answer `?` explains. The answer is legal if `take` takes it, and if none of `options` has a
/// mistake then.
fn settle(
    ask: Ask<'_>,
    answers: &mut Answers,
    (words, default, help): (&str, &str, &str),
    options: &[&str],
    take: &dyn Fn(&mut Answers, &str) -> Result<(), String>,
) -> anyhow::Result<()> {
    let question = format!("{words} [{default}]: ");
    let mut prompt = question.clone();
    // If nobody is there, the usual answer stays.
    while let Some(answer) = ask(&prompt)? {
        if answer == "?" {
            prompt = format!("  {help}\n{question}");
            continue;
        }
        let text = if answer.is_empty() { default } else { answer.as_str() };
        let mut with = answers.clone();
        let why = match take(&mut with, text) {
            Err(why) => why,
            Ok(()) => match mistakes(&with)?.into_iter().find(|mistake| options.contains(&mistake.option)) {
                Some(mistake) => mistake.why,
                None => {
                    *answers = with;
                    break;
                }
            },
        };
        prompt = format!("  {text:?} is not possible: {why}\n{question}");
    }
    Ok(())
}

/// Returns the mistakes in a rig with these answers.
fn mistakes(answers: &Answers) -> anyhow::Result<Vec<Mistake>> {
    let mut all: Vec<Mistake> = Vec::new();
    let cone = answers.cone_deg;
    if cone > 0.0 && cone < LEAST_CONE_DEG {
        let why = format!("{cone} degrees are hardly a cone; for radians write `{cone} rad`");
        all.push(Mistake { option: "--cone", why });
    }
    let Err(found) = RigConfig::from_toml(&file::text(answers)?, "rig") else { return Ok(all) };
    for mistake in found.iter().map(|diagnostic| mistake(answers, diagnostic)) {
        // All wheels are alike, and so are their mistakes.
        if all.iter().all(|other| other.option != mistake.option) {
            all.push(mistake);
        }
    }
    Ok(all)
}

/// Finds the option whose value a diagnostic of the rig file is about.
fn mistake(answers: &Answers, diagnostic: &Diagnostic) -> Mistake {
    let path = diagnostic.path.as_str();
    let option = match path.split_once("].").map_or(path, |(_, key)| key) {
        "name" => "--name",
        "link.port" => "--port",
        "wheel" => "--wheels",
        "axis" => WHEELS_AND_CONE,
        "sphere.radius" => "--radius",
        "sphere.mass" => "--mass",
        "radius" => "--wheel-radius",
        "cone" => "--cone",
        "steer.gear" => "--steer-gear",
        "steer.peak" | "steer.continuous" => "--steer-peak",
        "drive.gear" => "--drive-gear",
        "drive.peak" | "drive.continuous" => "--drive-peak",
        "limits.traction.mu" => "--friction",
        "limits.traction.normal_force" => "--normal-force",
        // A default that follows from the mass.
        "loop.passivity.damping" => {
            let mass = answers.mass;
            let why = format!("{mass} kg is too much for a sphere in a hand; for grams write `{mass} g`");
            return Mistake { option: "--mass", why };
        }
        _ => return Mistake { option: "the answers", why: diagnostic.to_string() },
    };
    let why = match &diagnostic.legal {
        // The rig file has the angle in radians.
        Some(_) if option == "--cone" => {
            format!("{} is out of range; legal: above 0 and below 180 degrees", answers.cone_deg)
        }
        Some(legal) => format!("{}; legal: {legal}", diagnostic.message),
        None => diagnostic.message.clone(),
    };
    Mistake { option, why }
}

#[cfg(test)]
mod tests {
    use super::super::Motor;
    use super::*;

    /// What `hbot rig new` is called with.
    #[derive(clap::Parser)]
    struct Line {
        #[command(flatten)]
        args: NewArgs,
    }

    /// Returns the answers that come of options and of what a person types, and all prompts.
    fn asked(options: &[&str], typed: &[&str]) -> (anyhow::Result<Answers>, Vec<String>) {
        let line = ["new", "new.toml"].iter().chain(options);
        let Line { args } = clap::Parser::try_parse_from(line).unwrap();
        let (mut prompts, mut typed) = (Vec::new(), typed.iter());
        let mut ask = |prompt: &str| -> anyhow::Result<Option<String>> {
            prompts.push(prompt.to_owned());
            Ok(typed.next().map(|answer| (*answer).to_owned()))
        };
        let answers = answers(&args, &mut ask);
        (answers, prompts)
    }

    #[test]
    fn a_wrong_answer_is_asked_for_again_and_the_others_stay() {
        let typed = [
            "arduino",
            "moteus",
            "Ball",
            "ttyACM0",
            "/dev/ttyACM0,/dev/ttyACM1",
            "",
            "9",
            "3",
            "0",
            "?",
            "100 mm",
            "x",
            "0,5",
            "0.5",
            "",
            "200",
            "12",
            "",
            "-1",
            "2",
            "",
            "",
            "",
            "20 N",
        ];
        let (answers, prompts) = asked(&[], &typed);
        let usual = Answers::usual();
        let steer = Motor { peak: 2.0, ..usual.steer };
        let (name, protocol) = ("Ball".to_owned(), Controllers::Moteus);
        let wanted =
            Answers { name, protocol, wheels: 3, radius: 0.1, mass: 0.5, cone_deg: 12.0, steer, ..usual };
        let wanted = Answers { normal_force: 20.0, ..wanted };
        assert_eq!(answers.unwrap(), wanted, "{prompts:#?}");
        let again = |text: &str, why: &str| {
            let begin = format!("  {text:?} is not possible: ");
            let found =
                prompts.iter().find(|prompt| prompt.starts_with(&begin)).unwrap_or_else(|| panic!("{text}"));
            assert!(found.contains(why), "{found}");
        };
        again("arduino", "such as an Arduino, speak hbot");
        again("/dev/ttyACM0,/dev/ttyACM1", "write port = [");
        again("9", "2 to 8");
        again("0", "out of range; legal: 0.001");
        again("x", "it must be a number of kilograms, such as 0.467");
        again("0,5", "write a decimal point: 0.5");
        assert!(
            prompts
                .iter()
                .any(|prompt| prompt.ends_with("circumference / 6.28.\nradius of the sphere, m [0.102]: ")),
            "{prompts:?}"
        );
        again("ttyACM0", "it must be sim, or the path of a device, such as /dev/ttyACM0");
        again("200", "200 is out of range; legal: above 0 and below 180 degrees");
        again("-1", "-1 is out of range");
    }

    /// Whether a cone is legal depends on the number of wheels.
    #[test]
    fn a_cone_with_which_the_wheels_can_meet_is_asked_for_again() {
        let (answers, prompts) = asked(&["--wheels", "2"], &["", "", "", "", "", "", "60", "20"]);
        assert_eq!(answers.unwrap().cone_deg, 20.0);
        assert!(
            prompts.iter().any(|prompt| prompt.contains("\"60\" is not possible: wheels 1 and 2")),
            "{prompts:#?}"
        );
    }

    #[test]
    fn a_wrong_option_is_named_with_its_unit_before_any_question() {
        for (options, why) in [
            (&["--cone", "200"][..], "--cone: 200 is out of range; legal: above 0 and below 180 degrees"),
            (&["--radius", "nan"], "--radius: NaN is not a number (radius of the sphere, m)"),
            (&["--mass", "0"], "--mass: 0 is out of range"),
            (&["--wheel-radius", "-1"], "--wheel-radius: -1 is out of range"),
            (&["--drive-peak", "1e30"], "(largest torque of a drive joint after its gear, N m)"),
            (&["--wheels", "2", "--cone", "60"], "--wheels and --cone: "),
        ] {
            let (answers, prompts) = asked(options, &[]);
            let said = answers.unwrap_err().to_string();
            assert!(said.contains(why) && !said.contains("new.toml"), "{options:?}: {said}");
            assert_eq!(prompts, [""; 0], "{options:?}");
        }
    }
}
