//! Tests with a real window on a virtual display (Xvfb), drawn in software, in six situations.

use std::ops::Range;

use crate::bench::{AloneServer, ServerSetup, alone};
use crate::display::{Display, Shot, folder};
use crate::identity::Identity;

/// Starts the panel for a server and waits until it has saved a picture of its window. Returns the
/// pixels of the picture.
fn picture(display: &Display, name: &str, server: &str, size: [u32; 2], theme: &str) -> Vec<u8> {
    picture_with(display, name, &["--server", server], size, theme)
}

fn picture_with(display: &Display, name: &str, args: &[&str], size: [u32; 2], theme: &str) -> Vec<u8> {
    Shot::start(display, name, &[args, &["--theme", theme]].concat(), size, 3).pixels(|| ())
}

/// Counts the pixels whose colour is nearly this one.
pub(crate) fn count(pixels: &[u8], [r, g, b]: [u8; 3]) -> usize {
    let near = |a: u8, b: u8| a.abs_diff(b) <= 2;
    pixels.chunks_exact(3).filter(|p| near(p[0], r) && near(p[1], g) && near(p[2], b)).count()
}

/// Counts the pixels in these columns of the bar at the top whose colour is nearly this one, in a
/// window of this size.
pub(crate) fn count_in_bar(
    pixels: &[u8],
    [width, _]: [u32; 2],
    columns: Range<u32>,
    color: [u8; 3],
) -> usize {
    let line = |y: u32| [columns.start, columns.end].map(|x| 3 * (y * width + x) as usize);
    let lines = (4..24).map(line).map(|[from, to]| count(&pixels[from..to], color));
    lines.sum()
}

/// Red of the stop button.
pub(crate) const STOP: [u8; 3] = [0xb8, 0x25, 0x08];
/// Colour of a real rig's badge.
pub(crate) const LIVE: [u8; 3] = [0xff, 0xc4, 0x00];
/// Colour of good news to the user, on a dark background.
pub(crate) const GOOD: [u8; 3] = [0x9b, 0xd2, 0x4a];
/// Colour of bad news and warnings to the user, on a dark background.
pub(crate) const WARN: [u8; 3] = [0xf0, 0xb0, 0x20];
/// Colour of what is neither good nor bad news, on a dark background.
pub(crate) const TEXT: [u8; 3] = [0xd8, 0xd8, 0xd8];
/// Colour of the tab that is open, on a dark background.
pub(crate) const CHOSEN: [u8; 3] = [0x00, 0x5c, 0x80];
/// Colour of the axis n3 in the picture of the sphere, on a dark background.
pub(crate) const N3: [u8; 3] = [0x56, 0xb4, 0xe9];

/// Counts the white pixels in the picture of the sphere in a window of the size [`DESKTOP`], below
/// the legend. The picture of a spring has none.
fn white_in_the_middle(pixels: &[u8]) -> usize {
    let middle = |k: usize| {
        let (x, y) = (k % DESKTOP[0] as usize, k / DESKTOP[0] as usize);
        (300..950).contains(&x) && (92..420).contains(&y)
    };
    let white = |p: &[u8]| p.iter().all(|c| *c > 225);
    pixels.chunks_exact(3).enumerate().filter(|(k, p)| middle(*k) && white(p)).count()
}

/// A scene with a shape of each sort.
const FELT: &str = r#"
name = "Shapes"
[[effect]]
id = "room"
kind = "end_stop"
walls = "both"
cone = 0.5
twist = [-0.8, 0.8]
[[effect]]
id = "dial"
kind = "detents"
count = 12
[[effect]]
id = "hinge"
kind = "guide"
axis = [1, 0, 0]
stiffness = 0.2
[[effect]]
id = "faces"
kind = "snaps"
strength = 0.05
[[effect]]
id = "magnet"
kind = "magnet"
reference = [0.94, 0.2, 0.28, 0]
[[effect]]
id = "weight"
kind = "pendulum"
mass = 0.1
"#;

const DESKTOP: [u32; 2] = [1280, 760];

#[test]
fn pictures_of_six_situations() {
    let _alone = alone();
    let Some(display) = Display::start() else { return };
    let bench = |scene: &str, rig: &[(&str, &str)]| {
        AloneServer::beside(&ServerSetup { scene, rig, paced: true, ..ServerSetup::default() })
    };
    let spring = include_str!("../../../../scenes/spring.toml");
    // A spring that saturates the torque: 10 N m/rad reaches the rig's 0.9 N m at 0.09 rad.
    let stiff =
        spring.replace("stiffness = 1 ", "stiffness = 10 ") + "[simulate]\nhand = { stiffness = 8 }\n";

    let running = bench(spring, &[]);
    let pixels = picture(&display, "light", &running.address.to_string(), [900, 600], "light");
    assert!(count(&pixels, STOP) > 8_000, "the smallest window, on a light background");
    running.stop();

    // A hand that is in the wall of a cone and off the middle of a twist.
    let felt = FELT.to_owned() + "[simulate]\nhand = { amplitude = 0.6, rate = 0.05 }\n";
    let felt = bench(&felt, &[]);
    let pixels = picture(&display, "felt", &felt.address.to_string(), DESKTOP, "dark");
    let white = white_in_the_middle(&pixels);
    assert!(white > 100, "the walls are drawn and glow: {white} pixels");
    felt.stop();

    let saturated = bench(&stiff, &[]);
    let pixels = picture(&display, "saturated", &saturated.address.to_string(), DESKTOP, "dark");
    assert!(count(&pixels, STOP) > 10_000 && count(&pixels, WARN) > 200, "the meters are at their ends");
    saturated.stop();

    let ours = Identity::new();
    let encrypted = AloneServer::beside(&ServerSetup {
        scene: spring,
        paced: true,
        tls: Some(&ours),
        ..ServerSetup::default()
    });
    let address = encrypted.address.to_string();
    let (ca, other) = (folder().join("ours.pem"), folder().join("other.pem"));
    std::fs::write(&ca, &ours.certificate).expect("written");
    std::fs::write(&other, Identity::new().certificate).expect("written");
    let [ca, other] = [ca, other].map(|path| path.to_str().expect("UTF-8").to_owned());
    let pixels = picture_with(&display, "encrypted", &["--server", &address, "--ca", &ca], DESKTOP, "dark");
    assert!(count(&pixels, N3) > 200, "axes and curves are drawn");
    let args = ["--server", &address, "--ca", &other];
    let pixels = picture_with(&display, "wrong-certificate", &args, DESKTOP, "dark");
    assert!(count(&pixels, STOP) > 10_000 && count(&pixels, N3) < 50, "nothing is drawn of a stranger's");
    encrypted.stop();

    let pixels = picture(&display, "no-server", &address, DESKTOP, "dark");
    assert!(count(&pixels, STOP) > 10_000, "the stop button is there whatever else is");
    assert!(count(&pixels, GOOD) < 50, "nothing looks well");
}
