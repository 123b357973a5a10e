//! `hbot scene plot`: what a scene will feel like, as a picture. Look before you feel.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, anyhow};
use clap::Args;
use hbot_config::SceneFile;
use hbot_core::Vec3;
use plotters::backend::SVGBackend;
use plotters::prelude::*;

use super::sweep::Probe;
use super::{picture, say};

/// Options of `hbot scene plot`.
#[derive(Debug, Args)]
pub(crate) struct PlotArgs {
    /// The scene file (TOML)
    file: PathBuf,
    /// The picture (SVG)
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Axis to turn about: x, y, z, or three numbers such as 1,0,-1; may be given several times [default: x y z]
    #[arg(long, value_name = "AXIS", value_parser = axis, allow_hyphen_values = true)]
    axis: Vec<Axis>,
}

/// An axis in N with its name.
#[derive(Debug, Clone)]
struct Axis {
    name: String,
    unit: Vec3,
}

fn axis(text: &str) -> Result<Axis, String> {
    let wrong = || "x, y, z, or three numbers, not all zero, such as 1,0,-1".to_owned();
    let v = match text {
        "x" => Vec3::X,
        "y" => Vec3::Y,
        "z" => Vec3::Z,
        _ => {
            let numbers: Vec<f64> =
                text.split(',').map(|x| x.trim().parse()).collect::<Result<_, _>>().map_err(|_| wrong())?;
            Vec3::from_array(numbers.try_into().map_err(|_| wrong())?)
        }
    };
    let unit = v.try_normalize().ok_or_else(wrong)?;
    Ok(Axis { name: text.to_owned(), unit })
}

/// The kind whose energy is worth a picture on the sphere of directions.
const LANDSCAPE: &str = "snaps";
/// Of curves, in turns; all dark enough on white.
const COLORS: [RGBColor; 6] = [
    RGBColor(0, 90, 181),
    RGBColor(220, 50, 32),
    RGBColor(0, 128, 96),
    RGBColor(170, 68, 153),
    RGBColor(200, 130, 0),
    RGBColor(90, 90, 90),
];
const WIDTH: u32 = 840;
const PANEL: u32 = 250;

pub(super) fn run(args: &PlotArgs) -> anyhow::Result<()> {
    let scene = SceneFile::from_path(&args.file)?;
    let axes = if args.axis.is_empty() {
        ["x", "y", "z"].map(axis).into_iter().collect::<Result<_, _>>().map_err(|error| anyhow!(error))?
    } else {
        args.axis.clone()
    };
    let svg = draw(&scene, &axes).map_err(|error| anyhow!("the picture could not be drawn: {error}"))?;
    write(&args.out, &svg)?;
    say!("{}", args.out.display())
}

fn write(path: &Path, svg: &str) -> anyhow::Result<()> {
    std::fs::write(path, svg).with_context(|| format!("{}: cannot be written", path.display()))
}

type Drawn<T> = Result<T, Box<dyn std::error::Error>>;
type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;

fn draw(scene: &SceneFile, axes: &[Axis]) -> Drawn<String> {
    let kinds: Vec<&str> = scene.effects().iter().map(|effect| effect.kind_name()).collect();
    let mut probe = Probe::new(scene);
    let time = still_time(&kinds);
    let landscape = kinds.contains(&LANDSCAPE);
    let panels = axes.len() as u32 + u32::from(time.is_some());
    let height = 40 + PANEL * panels + if landscape { picture::HEIGHT } else { 0 };
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, (WIDTH, height)).into_drawing_area();
        root.fill(&WHITE)?;
        let (title, mut rest) = root.split_vertically(40);
        title.draw(&Text::new(scene.name().to_owned(), (14, 12), ("sans-serif", 20).into_font()))?;
        let parts = probe.parts();
        for axis in axes {
            let (panel, below) = rest.split_vertically(PANEL);
            swing(&panel, &probe, &parts, axis)?;
            rest = below;
        }
        if let Some((time, every)) = time {
            let (panel, below) = rest.split_vertically(PANEL);
            still(&panel, &probe, time, every)?;
            rest = below;
        }
        if landscape {
            picture::sphere(&rest, &mut probe)?;
        }
        root.present()?;
    }
    Ok(svg)
}

/// How long to hold the sphere still, s, for kinds that go by time, and every how many ticks to look.
fn still_time(kinds: &[&str]) -> Option<(f64, u64)> {
    if kinds.contains(&"track") {
        Some((12.0, 10))
    } else if kinds.contains(&"pulse") {
        Some((2.5, 1))
    } else {
        kinds.contains(&"vibration").then_some((0.8, 1))
    }
}

/// A range about zero that holds all values, with room.
fn span<'a>(values: impl Iterator<Item = &'a (f64, f64)>) -> f64 {
    1.1 * values.map(|(_, y)| y.abs()).fold(1.0e-3, f64::max)
}

fn swing(panel: &Area<'_>, probe: &Probe, parts: &[(String, Probe)], axis: &Axis) -> Drawn<()> {
    let curves = probe.swing(axis.unit);
    let each: Vec<_> = parts.iter().map(|(name, part)| (name, part.swing(axis.unit))).collect();
    let all = each.iter().flat_map(|(_, c)| c.forth.iter().chain(&c.back));
    let most = span(curves.forth.iter().chain(&curves.back).chain(all));
    let mut chart = ChartBuilder::on(panel)
        .margin(8)
        .x_label_area_size(34)
        .y_label_area_size(64)
        .build_cartesian_2d(-180.0..180.0, -most..most)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .x_labels(13)
        .x_desc(format!("angle about {}, degrees", axis.name))
        .y_desc("torque about it, N m")
        .draw()?;
    let degrees = |curve: &[(f64, f64)]| curve.iter().map(|(x, y)| (x.to_degrees(), *y)).collect::<Vec<_>>();
    for (i, (name, part)) in each.iter().enumerate() {
        let color = COLORS[i % COLORS.len()];
        chart
            .draw_series(LineSeries::new(degrees(&part.forth), color.stroke_width(1)))?
            .label(name.as_str())
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], color.stroke_width(2)));
    }
    chart.draw_series(LineSeries::new(degrees(&curves.forth), BLACK.stroke_width(2)))?;
    let differs =
        curves.forth.iter().zip(curves.back.iter().rev()).any(|(a, b)| (a.1 - b.1).abs() > 1.0e-3 * most);
    if differs {
        chart.draw_series(DashedLineSeries::new(degrees(&curves.back), 4, 4, BLACK.stroke_width(1)))?;
    }
    if !each.is_empty() {
        legend(&mut chart)?;
    }
    Ok(())
}

fn still(panel: &Area<'_>, probe: &Probe, time: f64, every: u64) -> Drawn<()> {
    let curves = probe.still(time, every);
    let most = span(curves.iter().flatten());
    let mut chart = ChartBuilder::on(panel)
        .margin(8)
        .x_label_area_size(34)
        .y_label_area_size(64)
        .build_cartesian_2d(0.0..time, -most..most)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .x_desc("time, s, held still")
        .y_desc("torque, N m")
        .draw()?;
    for (i, (curve, name)) in curves.into_iter().zip(["about x", "about y", "about z"]).enumerate() {
        let color = COLORS[i % COLORS.len()];
        chart
            .draw_series(LineSeries::new(curve, color.stroke_width(1)))?
            .label(name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], color.stroke_width(2)));
    }
    legend(&mut chart)
}

type Chart<'a, 'b> = ChartContext<
    'a,
    SVGBackend<'b>,
    Cartesian2d<plotters::coord::types::RangedCoordf64, plotters::coord::types::RangedCoordf64>,
>;

fn legend<'a, 'b: 'a>(chart: &mut Chart<'a, 'b>) -> Drawn<()> {
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE.mix(0.8))
        .border_style(BLACK.mix(0.2))
        .draw()?;
    Ok(())
}
