//! Plots of the fronts, each along two of the four figures.

use hbot_plot::{Cloud, Scatter};

use super::front::front;
use super::fronts::{FIGURES, Fronts};
use super::space::WHEELS;
use super::torus::Measures;
use crate::report::Report;

/// Largest number of points that are drawn for the designs of one front, so that the plot stays
/// readable.
const DRAWN: usize = 400;

/// One of the four figures of a design, used as an axis of a plot.
struct Axis {
    name: &'static str,
    /// Label of the axis in the plot.
    long: &'static str,
    /// Whether a smaller value of this figure is better.
    falls: bool,
    of: fn(&Measures) -> f64,
}

const AXES: [Axis; 4] = [
    Axis {
        name: "conditioning",
        long: "mean spectral index, GCI (more is better)",
        falls: false,
        of: |m| m.gci,
    },
    Axis {
        name: "peak torque",
        long: "peak torque in the worst case, N m (more is better)",
        falls: false,
        of: |m| m.torque,
    },
    Axis {
        name: "apparent inertia",
        long: "largest apparent inertia, kg m² (less is better)",
        falls: true,
        of: |m| m.inertia,
    },
    Axis {
        name: "steering speed",
        long: "steering speed, rad/s per rad/s (less is better)",
        falls: true,
        of: |m| m.speed[0],
    },
];

pub(super) fn plots(report: &mut Report, fronts: &Fronts) {
    report.heading("The fronts");
    let joint = fronts.joint();
    report.say(
        "Designs that keep all margins and that no other with as many wheels beats in all four figures at once. Open points: those designs, seen along two of the four axes. Joined points: of them those that no other beats in \
         these two. A point that looks beaten in one plot is not in another. The black diamond is the prototype.",
    );
    report.family("design_front_{wheels}w_designs | 1 | designs on the front of so many wheels");
    report
        .family("design_front_{wheels}w_overall | 1 | of them those that no design of any wheel count beats");
    for wheels in WHEELS {
        report.figure(format!("design_front_{wheels}w_designs"), fronts.of(wheels).len() as f64);
        let overall = joint.iter().filter(|found| found.point.wheels == wheels).count();
        report.figure(format!("design_front_{wheels}w_overall"), overall as f64);
    }
    for (i, x) in AXES.iter().enumerate() {
        for (j, y) in AXES.iter().enumerate().skip(i + 1) {
            let clouds = clouds(fronts, x, y);
            report.plot(
                &format!("front_{}_{}", FIGURES[i], FIGURES[j]),
                &format!("{} against {}", capital(y.name), x.name),
                Scatter {
                    title: format!("{} against {}", capital(y.name), x.name),
                    x: x.long.to_owned(),
                    y: y.long.to_owned(),
                    clouds,
                    mark: (
                        "the prototype".to_owned(),
                        ((x.of)(&fronts.prototype), (y.of)(&fronts.prototype)),
                    ),
                }
                .svg(),
            );
        }
    }
}

/// Returns the points that a scatter plot shows of the best designs: for each number of wheels, the
/// designs that are best in all four figures and those that are best in `x` and `y` alone.
fn clouds(fronts: &Fronts, x: &Axis, y: &Axis) -> Vec<Cloud> {
    let mut clouds = Vec::new();
    for (colour, wheels) in WHEELS.into_iter().enumerate() {
        let all = fronts.of(wheels);
        let points: Vec<(f64, f64)> =
            all.iter().map(|found| ((x.of)(&found.measures), (y.of)(&found.measures))).collect();
        let name = |what: &str| format!("{wheels} wheels, {what}");
        let every = points.len().div_ceil(DRAWN).max(1);
        clouds.push(Cloud {
            name: name("front of all four"),
            points: points.iter().copied().step_by(every).collect(),
            colour,
            joined: false,
        });
        clouds.push(Cloud {
            name: name("of these two"),
            points: best_of_two(&points, x.falls, y.falls),
            colour,
            joined: true,
        });
    }
    clouds
}

fn capital(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map_or(String::new(), |first| first.to_uppercase().chain(chars).collect())
}

/// Returns the points that no other point dominates in the two figures of the plot, from left to
/// right. `x_falls` and `y_falls` say whether a smaller value is better.
fn best_of_two(points: &[(f64, f64)], x_falls: bool, y_falls: bool) -> Vec<(f64, f64)> {
    let sign = |falls: bool| if falls { 1.0 } else { -1.0 };
    let cost = |p: &(f64, f64)| [sign(x_falls) * p.0, sign(y_falls) * p.1, 0.0, 0.0];
    let costs: Vec<_> = points.iter().map(cost).collect();
    let mut best: Vec<(f64, f64)> = front(&costs).into_iter().map(|k| points[k]).collect();
    best.sort_by(|a, b| a.0.total_cmp(&b.0));
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_two_figures_the_best_from_left_to_right() {
        let points = [(1.0, 1.0), (2.0, 3.0), (3.0, 2.0), (2.5, 2.5), (0.5, 0.5)];
        assert_eq!(best_of_two(&points, false, false), [(2.0, 3.0), (2.5, 2.5), (3.0, 2.0)]);
        assert_eq!(best_of_two(&points, true, true), [(0.5, 0.5)]);
        assert_eq!(best_of_two(&points, true, false), [(0.5, 0.5), (1.0, 1.0), (2.0, 3.0)]);
    }
}
