//! `hbot scene plot`: draws the torque of a scene, so that a user sees it before feeling it.

use std::io::Write as _;
use std::ops::Range;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, anyhow, ensure};
use clap::Args;
use hbot_config::SceneFile;
use hbot_config::advice::Abilities;
use hbot_config::sweep::{Curves, Probe};
use hbot_core::Vec3;
use hbot_plot::{Curve, Hemispheres, PlotPanel, sheet};

use super::super::numbers::real;
use super::super::out::{WrongLine, create_new, refuse_folder_or_pipe, taken};
use super::{Which, say, warn};

/// Options of `hbot scene plot`.
#[derive(Debug, Args)]
pub(crate) struct PlotArgs {
    #[command(flatten)]
    which: Which,
    /// File for the picture; its name ends in .svg. An earlier picture is replaced, another file is
    /// not [default: the name of the scene's file, here]
    #[arg(long, value_name = "FILE.svg", value_parser = svg)]
    out: Option<PathBuf>,
    /// Draw from this angle on, degrees, -180 to 180
    #[arg(long, value_name = "DEG", default_value_t = -180.0, value_parser = degrees, allow_hyphen_values = true)]
    from: f64,
    /// Draw up to this angle, degrees, -180 to 180
    #[arg(long, value_name = "DEG", default_value_t = 180.0, value_parser = degrees, allow_hyphen_values = true)]
    to: f64,
    /// Axis to turn about: n1 or x, n2 or y, n3 or z, or three numbers such as 1,0,-1; can be
    /// given several times
    /// [default: x y z]
    #[arg(long, value_name = "AXIS", value_parser = axis, allow_hyphen_values = true)]
    axis: Vec<Axis>,
}

/// An axis in frame N, with its name.
#[derive(Debug, Clone)]
pub(super) struct Axis {
    name: String,
    unit: Vec3,
}

fn axis(text: &str) -> Result<Axis, String> {
    let wrong = || "n1, n2, n3, x, y, z, or three numbers, not all zero, such as 1,0,-1".to_owned();
    let v = match text {
        "x" | "n1" => Vec3::X,
        "y" | "n2" => Vec3::Y,
        "z" | "n3" => Vec3::Z,
        _ => {
            let numbers: Vec<f64> =
                text.split(',').map(|x| x.trim().parse()).collect::<Result<_, _>>().map_err(|_| wrong())?;
            Vec3::from_array(numbers.try_into().map_err(|_| wrong())?)
        }
    };
    let unit = v.try_normalize().ok_or_else(wrong)?;
    Ok(Axis { name: text.to_owned(), unit })
}

fn degrees(text: &str) -> Result<f64, String> {
    real("deg", |angle| (-180.0..=180.0).contains(&angle), "-180 to 180")(text)
}

/// Parses the name of the picture. Other formats are refused, because the picture would still be
/// SVG.
pub(crate) fn svg(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    if path.extension().is_some_and(|end| end.eq_ignore_ascii_case("svg")) {
        Ok(path)
    } else {
        Err("the picture is SVG: a name that ends in .svg".to_owned())
    }
}

/// Returns the axes of a plot if the user names none: x, y and z.
pub(super) fn usual_axes() -> anyhow::Result<Vec<Axis>> {
    ["x", "y", "z"].map(axis).into_iter().collect::<Result<_, _>>().map_err(|error| anyhow!(error))
}

pub(super) fn run(args: &PlotArgs) -> anyhow::Result<()> {
    ensure!(args.from < args.to, WrongLine(format!("--from {} is not below --to {}", args.from, args.to)));
    let (scene, abilities) = args.which.load()?;
    let axes = if args.axis.is_empty() { usual_axes()? } else { args.axis.clone() };
    let out = args.out.clone().unwrap_or_else(|| here(&args.which.scene));
    write(&out, &draw(&scene, &axes, args.from..args.to, &abilities))?;
    say!("{} shows the torque against the angle", out.display())?;
    warn(&abilities.warnings(&scene));
    Ok(())
}

/// Returns the file for the picture of a scene if the user names none: in this folder, with the
/// name of the scene's file.
fn here(scene: &Path) -> PathBuf {
    Path::new(scene.file_name().unwrap_or_default()).with_extension("svg")
}

/// Writes a picture into a new file, or in place of an earlier picture.
pub(crate) fn write(path: &Path, svg: &str) -> anyhow::Result<()> {
    let written = match writable(path)? {
        Place::Free => create_new(path)?.write_all(svg.as_bytes()),
        Place::Earlier => std::fs::write(path, svg),
    };
    written.with_context(|| format!("{}: cannot be written", path.display()))
}

/// What stands where a picture shall be written.
pub(crate) enum Place {
    Free,
    /// An earlier picture of hbot, which gives way.
    Earlier,
}

/// Returns what stands where a picture shall be written. Fails if it must not give way.
pub(crate) fn writable(path: &Path) -> anyhow::Result<Place> {
    /// Pictures of hbot begin like this; those of drawing programs have other words first.
    const HEAD: &str = "<svg width=";
    refuse_folder_or_pipe(path, "a file for the picture")?;
    match std::fs::read(path) {
        Ok(before) if before.starts_with(HEAD.as_bytes()) => Ok(Place::Earlier),
        Ok(_) => Err(taken(path)),
        Err(_) => Ok(Place::Free),
    }
}

/// The angles of a whole turn, degrees.
pub(super) const WHOLE_TURN: Range<f64> = -180.0..180.0;

/// Returns the picture of a scene as SVG, for angles in the range `angles`, degrees. A torque
/// beyond the limit of the rig is hatched.
pub(super) fn draw(scene: &SceneFile, axes: &[Axis], angles: Range<f64>, abilities: &Abilities) -> String {
    let probe = Probe::new(scene);
    let parts = probe.parts();
    let swung = |axis| swing(&probe, &parts, axis, &angles);
    let mut panels: Vec<PlotPanel> = axes.iter().map(swung).collect();
    panels.extend(still(&probe));
    for panel in &mut panels {
        panel.limit = Some(abilities.torque).filter(|limit| panel.y_range.end > *limit);
        if let Some(most) = panel.limit.map(|limit| BEYOND * limit).filter(|most| panel.y_range.end > *most) {
            panel.y_range = -most..most;
            panel.curves = panel.curves.iter().flat_map(|curve| within(curve, most)).collect();
        }
    }
    let landscape = probe.has_wells().then(|| {
        let title = "where the sphere's third axis points, and the least energy there; dark is deep";
        Hemispheres::new(title, |direction| probe.least_energy(direction))
    });
    sheet(scene.name(), &panels, landscape.as_ref())
}

/// The vertical axis ends at this multiple of the rig's torque limit at most. Walls that are many
/// times as strong would flatten everything that the hand can feel.
const BEYOND: f64 = 1.25;

/// Returns the parts of a curve between `-most` and `most`. The first has the curve's name.
fn within(curve: &Curve, most: f64) -> Vec<Curve> {
    let mut parts: Vec<Vec<(f64, f64)>> = vec![Vec::new()];
    let inside = |point: &(f64, f64)| point.1.abs() <= most;
    for (k, point) in curve.points.iter().enumerate() {
        if let Some(before) = k.checked_sub(1).map(|k| &curve.points[k])
            && inside(before) != inside(point)
        {
            let edge = most.copysign(if inside(before) { point.1 } else { before.1 });
            let share = (edge - before.1) / (point.1 - before.1);
            let at = (before.0 + share * (point.0 - before.0), edge);
            if inside(point) {
                parts.push(vec![at]);
            } else if let Some(part) = parts.last_mut() {
                part.push(at);
            }
        }
        if let (true, Some(part)) = (inside(point), parts.last_mut()) {
            part.push(*point);
        }
    }
    parts.retain(|part| part.len() > 1);
    let name = |k: usize| curve.name.clone().filter(|_| k == 0);
    let part = |(k, points)| Curve { name: name(k), points, colour: curve.colour, dashed: curve.dashed };
    parts.into_iter().enumerate().map(part).collect()
}

/// Returns the range of the vertical axis: the largest absolute value of all curves, plus a margin.
fn span<'a>(points: impl Iterator<Item = &'a (f64, f64)>) -> f64 {
    1.1 * points.map(|(_, y)| y.abs()).fold(1.0e-3, f64::max)
}

/// Plots torque against angle while the sphere turns about `axis` and back, for angles in the range
/// `angles`, degrees. The torque of the scene is black, behind the effects. The way back is dashed,
/// and is drawn only if it differs. If there are several effects, each has its own curve.
fn swing(probe: &Probe, parts: &[(String, Probe)], axis: &Axis, angles: &Range<f64>) -> PlotPanel {
    let fine = angles.end - angles.start < FINE;
    let degrees = |curve: Vec<(f64, f64)>| -> Vec<(f64, f64)> {
        let degrees = curve.into_iter().map(|(x, y)| (x.to_degrees(), y));
        degrees.filter(|(x, _)| *x >= angles.start - 1.0e-9 && *x <= angles.end + 1.0e-9).collect()
    };
    let both = |probe: &Probe| {
        let Curves { forth, back } = probe.swing(axis.unit, if fine { 1 } else { 5 });
        [degrees(forth), degrees(back)]
    };
    let whole = both(probe);
    let each: Vec<_> = parts.iter().map(|(name, part)| (name, both(part))).collect();
    let most = span(each.iter().flat_map(|(_, part)| part).chain(&whole).flatten());
    let mut pairs = whole[0].iter().zip(whole[1].iter().rev());
    let returns_otherwise = pairs.any(|(a, b)| (a.1 - b.1).abs() > 1.0e-3 * most);
    let [forth, back] = whole;
    let black =
        |name: &str, points, dashed| Curve { name: Some(name.to_owned()), points, colour: None, dashed };
    let mut curves = vec![black("whole scene", forth, false)];
    if returns_otherwise {
        curves.push(black("on the way back", back, true));
    }
    curves.extend(each.into_iter().enumerate().map(|(i, (name, [points, _]))| Curve {
        name: Some(name.clone()),
        points,
        colour: Some(i),
        dashed: false,
    }));
    PlotPanel {
        x: format!("angle about {}, degrees", axis.name),
        y: "torque about it, N m".to_owned(),
        x_range: (angles.clone(), 13),
        y_range: -most..most,
        limit: None,
        curves,
    }
}

/// Below this range of angles, degrees, a curve has a point in every tick of the swing.
const FINE: f64 = 120.0;

/// Plots torque against time while the sphere is held still. Returns `None` if the torque stays as
/// it is.
fn still(probe: &Probe) -> Option<PlotPanel> {
    let (time, curves) = probe.still()?;
    let most = span(curves.iter().flatten());
    let names = ["about x", "about y", "about z"];
    Some(PlotPanel {
        x: "time, s, held still".to_owned(),
        y: "torque, N m".to_owned(),
        x_range: (0.0..time, 11),
        y_range: -most..most,
        limit: None,
        curves: curves
            .into_iter()
            .zip(names)
            .enumerate()
            .map(|(i, (points, name))| Curve {
                name: Some(name.to_owned()),
                points,
                colour: Some(i),
                dashed: false,
            })
            .collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_is_cut_where_it_leaves_the_picture() {
        let points = vec![(0.0, -3.0), (1.0, -1.0), (2.0, 1.0), (3.0, 5.0), (4.0, -3.0)];
        let curve = Curve { name: Some("wall".to_owned()), points, colour: Some(1), dashed: false };
        let parts = within(&curve, 2.0);
        let points: Vec<_> = parts.iter().map(|part| part.points.clone()).collect();
        assert_eq!(points[0], [(0.5, -2.0), (1.0, -1.0), (2.0, 1.0), (2.25, 2.0)]);
        // From 5 to -3 N m the line crosses the picture without a point in it, and is left out.
        assert_eq!(points.len(), 1);
        assert_eq!(parts[0].name.as_deref(), Some("wall"));
    }
}
