//! Draws horizontal bars, one below the other.

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use crate::{COLOURS, drawn, failed, short};

/// One bar of a bar chart, drawn by [`bars()`].
#[derive(Debug, Clone)]
pub struct Bar {
    /// Name, drawn left of the bar.
    pub name: String,
    /// Value that gives the length of the bar.
    pub value: f64,
    /// Text at the end of the bar. `None` for the value.
    pub label: Option<String>,
    /// Lower and upper quartile of the value, drawn as a line over the bar.
    pub spread: Option<[f64; 2]>,
    /// Index into the palette of eight colours. Larger numbers start again from the first.
    pub colour: usize,
}

/// Draws bars one below the other and returns the picture as SVG. `x` is the label of the x axis,
/// which shows the values.
#[must_use]
pub fn bars(title: &str, x: &str, bars: &[Bar]) -> String {
    let reach = |bar: &Bar| bar.spread.map_or(bar.value, |[_, high]| high.max(bar.value));
    let longest = bars.iter().map(reach).fold(0.0, f64::max).max(f64::MIN_POSITIVE);
    let least = bars.iter().map(|bar| bar.value).fold(0.0, f64::min);
    let names = bars.iter().map(|bar| bar.name.len()).max().unwrap_or(0) as u32;
    let height = 110 + 22 * bars.len() as u32;
    drawn((900, height), |area| {
        let mut chart = ChartBuilder::on(area)
            .caption(title, ("sans-serif", 20))
            .margin(12)
            .x_label_area_size(46)
            .y_label_area_size(24 + 8 * names)
            .build_cartesian_2d(1.05 * least..1.12 * longest, bars.len() as f64..0.0)
            .map_err(failed)?;
        let name = |row: &f64| {
            let inside = (row - 0.5).fract() == 0.0 && *row >= 0.0;
            if inside {
                bars.get(*row as usize).map_or(String::new(), |bar| bar.name.clone())
            } else {
                String::new()
            }
        };
        let number = |value: &f64| short(*value);
        chart
            .configure_mesh()
            .x_desc(x)
            .disable_y_mesh()
            .y_labels(0)
            .x_label_formatter(&number)
            .y_label_formatter(&name)
            .light_line_style(RGBColor(238, 238, 238))
            .label_style(("sans-serif", 14))
            .axis_desc_style(("sans-serif", 15))
            .draw()
            .map_err(failed)?;
        let label = ("sans-serif", 13).into_font().color(&BLACK);
        for (row, bar) in bars.iter().enumerate() {
            let y = row as f64;
            let colour = COLOURS[bar.colour % COLOURS.len()];
            let body = Rectangle::new([(0.0, y + 0.15), (bar.value, y + 0.85)], colour.filled());
            chart.draw_series([body]).map_err(failed)?;
            if let Some([low, high]) = bar.spread {
                let line = PathElement::new(vec![(low, y + 0.5), (high, y + 0.5)], BLACK.stroke_width(1));
                chart.draw_series([line]).map_err(failed)?;
            }
            let text = EmptyElement::at((reach(bar).max(0.0), y + 0.5))
                + Text::new(bar.label.clone().unwrap_or_else(|| short(bar.value)), (6, -6), label.clone());
            chart.draw_series([text]).map_err(failed)?;
            // Names are drawn left of the axis.
            let (x0, middle) = chart.backend_coord(&(1.05 * least, y + 0.5));
            let place = (x0 - 8, middle);
            let style = label.clone().pos(Pos::new(HPos::Right, VPos::Center));
            area.draw(&Text::new(bar.name.clone(), place, style)).map_err(failed)?;
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_carry_their_names_and_values() {
        let bar =
            |name: &str, value| Bar { name: name.to_owned(), value, label: None, spread: None, colour: 0 };
        let svg = bars("Costs", "ns", &[bar("spring", 51.0), bar("damper", 7.5)]);
        assert!(!svg.contains("below"));
        let hidden = Bar { label: Some("below 30 ns".to_owned()), ..bar("friction", 0.0) };
        assert!(bars("Costs", "ns", &[hidden]).contains("below 30 ns"));
        for text in ["spring", "damper", "51", "7.5", "Costs"] {
            assert!(svg.contains(text), "{text}");
        }
    }
}
