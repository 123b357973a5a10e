//! Names the field in which two outputs differ.

use std::fmt::Debug;

use hbot_core::Outputs;

/// Returns the first field whose text differs in two outputs, with both texts. Rust writes a real
/// with as many digits as it needs, so only the bits of a NaN can differ without that.
pub(crate) fn first(recorded: &Outputs, computed: &Outputs) -> Option<(String, [String; 2])> {
    let mut pairs = all(recorded).zip(all(computed));
    let (a, b) = pairs.find(|(a, b)| a.1 != b.1)?;
    Some((a.0, [a.1, b.1].map(|text| text.trim_end_matches(',').to_owned())))
}

/// Lists the fields of outputs with their texts: the state first, the command to the motors last.
fn all(outputs: &Outputs) -> impl Iterator<Item = (String, String)> {
    let replies = outputs.replies.iter().enumerate();
    let replies = replies.map(|(k, reply)| (format!("replies[{k}]"), format!("{reply:?}")));
    fields("state", &outputs.state).into_iter().chain(replies).chain(fields("drive", &outputs.drive))
}

/// Lists the fields of a struct of the name `name`.
fn fields(name: &str, value: &impl Debug) -> Vec<(String, String)> {
    let mut fields: Vec<(String, String)> = Vec::new();
    // The first and the last line are not indented, and the parts of a field are indented twice.
    for line in format!("{value:#?}").lines().filter_map(|line| line.strip_prefix("    ")) {
        match (line.split_once(": "), fields.last_mut()) {
            (Some((field, text)), _) if !field.starts_with(' ') => {
                fields.push((format!("{name}.{field}"), text.to_owned()));
            }
            (_, Some((_, text))) => *text += line.trim_start(),
            (_, None) => {}
        }
    }
    fields
}

#[cfg(test)]
mod tests {
    use hbot_config::RigConfig;
    use hbot_core::{CompiledScene, Controller, Inputs, Vec3};

    #[test]
    fn a_difference_in_any_field_is_named() {
        let mut controller = Controller::new(RigConfig::prototype().rig);
        let one = controller.tick(&CompiledScene::empty(), &Inputs::quiet(1));
        assert_eq!(super::first(&one, &one), None);
        let mut other = one;
        other.drive.torque[3] = -0.0;
        assert_eq!(super::first(&one, &other).expect("a difference").0, "drive.torque");
        other.state.sigma = Some(Vec3::new(0.5, 1e-9, 0.0));
        let (field, values) = super::first(&one, &other).expect("a difference");
        assert_eq!(
            (field.as_str(), values),
            ("state.sigma", ["None", "Some(DVec3(0.5,1e-9,0.0,),)"].map(Into::into))
        );
    }
}
