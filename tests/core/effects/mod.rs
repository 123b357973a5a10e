//! Tests of the kinds of effect: their energies, their edges, and their promises.

mod bits;
mod clicks;
mod damping;
mod edges;
mod energy;
mod knocks;
mod live;
mod mass;
mod places;
mod play;
mod snaps;
mod sticking;
mod tracks;

use crate::prelude::*;
use hbot_core::render::effects::{Friction, Guide, Inertia, Motion, Pendulum, Pulse, Vibration, Wave};

#[derive(Clone)]
pub struct Felt {
    scene: CompiledScene,
    renderer: Renderer,
    tick: u64,
}

impl Felt {
    pub fn new(kind: Kind) -> Self {
        Self::with_numbers(kind, &[])
    }

    pub fn with_numbers(kind: Kind, figures: &[f64]) -> Self {
        let span = Span { start: 0, len: figures.len() as u16 };
        let effect = Effect { numbers: span, ..effect(0, 1, kind) };
        Self {
            scene: CompiledScene::with_numbers(1, &[effect], figures).unwrap(),
            renderer: Renderer::new(&rig()),
            tick: 0,
        }
    }

    /// Renders one tick with the sphere at rest at `q`. Returns the torque, N m in N.
    pub fn at(&mut self, q: Quat) -> Vec3 {
        self.moving(q, Vec3::ZERO)
    }

    /// Renders one tick with the sphere at `q` turning at `omega` (rad/s in N). Returns the torque,
    /// N m in N.
    pub fn moving(&mut self, q: Quat, omega: Vec3) -> Vec3 {
        self.renderer.adopt(&self.scene, q);
        self.tick += 1;
        let torque = self.renderer.render(&self.scene, &Motion { q, omega }, self.tick, DT, 1.0);
        assert!(torque.is_finite(), "{:?} at {q}, {omega}: {torque}", self.scene.effects()[0].kind);
        torque
    }

    /// Returns the energy at `q`, J. If the effect counts turns, call [`at`](Self::at) first.
    pub fn energy(&mut self, q: Quat) -> f64 {
        self.renderer.adopt(&self.scene, q);
        let energy = self.renderer.energy(&self.scene, q).expect("a conservative effect");
        assert!(energy.is_finite());
        energy
    }
}

/// Returns a reference that is not aligned with any frame, so that mixing up frames is noticed.
pub fn askew() -> Target {
    Target::new(rotation::exp(Vec3::new(0.4, -0.7, 0.2)), Anchor::Absolute).unwrap()
}

pub fn axis() -> Vec3 {
    Vec3::new(0.48, -0.6, 0.64)
}

/// Returns a random orientation, uniform over SO(3) (Shoemake 1992).
pub fn anywhere(rng: &mut Rng) -> Quat {
    const TURN: f64 = core::f64::consts::TAU;
    let (u, a, b) = (rng.between(0.0, 1.0), rng.between(0.0, TURN), rng.between(0.0, TURN));
    let (r, s) = ((1.0 - u).sqrt(), u.sqrt());
    Quat::from_xyzw(r * a.sin(), r * a.cos(), s * b.sin(), s * b.cos())
}

/// Returns a symmetric positive definite matrix with these eigenvalues, whose principal axes are
/// not the coordinate axes.
pub fn uneven(x: f64, y: f64, z: f64) -> Mat3 {
    let r = Mat3::from_quat(rotation::exp(Vec3::new(0.3, 0.5, -0.2)));
    let m = r * Mat3::from_diagonal(Vec3::new(x, y, z)) * r.transpose();
    (m + m.transpose()) * 0.5
}

fn spring(law: SpringLaw, deadband: f64) -> Kind {
    let spring = Spring::new(law, uneven(1.0, 4.0, 9.0), Mat3::ZERO, askew().reference().0, Anchor::Absolute);
    Kind::Spring(spring.unwrap().with_deadband(deadband))
}

pub fn detents(count: u16, damping: f64) -> Detents {
    Detents { target: askew(), axis: axis(), strength: 0.1, width: 0.2, count, end_stiffness: 2.0, damping }
}

pub fn snaps(set: SnapSet, figures: &[f64]) -> Snaps {
    Snaps {
        target: askew(),
        set,
        strength: 0.1,
        width: 0.2,
        rounding: Snaps::rounding(set, figures),
        damping: 0.0,
    }
}

fn end_stop(damping: f64) -> EndStop {
    EndStop {
        target: askew(),
        axis: axis(),
        cone: Some(0.5),
        twist: Some([-0.3, 0.8]),
        stiffness: 3.0,
        damping,
    }
}

fn guide(free: Freedom, damping: f64, deadband: f64) -> Kind {
    Kind::Guide(Guide { target: askew(), axis: axis(), free, stiffness: 3.0, damping, deadband })
}

pub fn pointer() -> Vec3 {
    Vec3::new(0.0, 0.8, 0.6)
}

pub fn own() -> Vec<f64> {
    let turns = [Vec3::ZERO, Vec3::new(1.0, 0.2, 0.0), Vec3::new(-0.4, 1.1, 0.3), Vec3::new(0.2, -0.3, 2.5)];
    turns.into_iter().flat_map(|v| rotation::to_wxyz(rotation::exp(v))).collect()
}

/// A conservative effect, for tests of all such effects.
pub struct Case {
    pub name: &'static str,
    pub kind: Kind,
    pub figures: Vec<f64>,
    /// Whether the energy is a single function of the orientation with a continuous slope on all of
    /// SO(3). Other effects are only tested on paths near their reference: the torque of a geodesic
    /// spring changes sides at a half turn, and some effects count turns from the start.
    pub everywhere: bool,
}

pub fn conservative() -> Vec<Case> {
    let case = |name, kind, figures, everywhere| Case { name, kind, figures, everywhere };
    let snap = |set, figures: Vec<f64>| (Kind::Snaps(snaps(set, &figures)), figures);
    let (tetrahedron, _) = snap(SnapSet::Tetrahedron, vec![]);
    let (cube, _) = snap(SnapSet::Cube, vec![]);
    let (icosahedron, _) = snap(SnapSet::Icosahedron, vec![]);
    let (own, four) = snap(SnapSet::Own, own());
    let positions = vec![-0.9, -0.3, -0.1, 0.5];
    vec![
        case("geodesic spring", spring(SpringLaw::Geodesic, 0.0), vec![], false),
        case("geodesic spring with play", spring(SpringLaw::Geodesic, 0.3), vec![], false),
        case("quaternion spring", spring(SpringLaw::Quaternion, 0.0), vec![], true),
        case("quaternion spring with play", spring(SpringLaw::Quaternion, 0.3), vec![], true),
        case("detents around", Kind::Detents(detents(12, 0.0)), vec![], true),
        case("one detent", Kind::Detents(Detents { width: 3.2, ..detents(1, 0.0) }), vec![], true),
        case("detents with ends", Kind::Detents(detents(0, 0.0)), positions, false),
        case("tetrahedron", tetrahedron, vec![], true),
        case("cube", cube, vec![], true),
        case("icosahedron", icosahedron, vec![], true),
        case("own snaps", own, four, true),
        case("cone", Kind::EndStop(EndStop { twist: None, ..end_stop(0.0) }), vec![], true),
        case("twist", Kind::EndStop(EndStop { cone: None, ..end_stop(0.0) }), vec![], false),
        case("hinge", guide(Freedom::Axis, 0.0, 0.0), vec![], true),
        case("hinge with play", guide(Freedom::Axis, 0.0, 0.2), vec![], true),
        case("no twist", guide(Freedom::Swing, 0.0, 0.2), vec![], true),
        case("plane", guide(Freedom::Plane(pointer()), 0.0, 0.0), vec![], true),
        case("plane with play", guide(Freedom::Plane(pointer()), 0.0, 0.2), vec![], true),
        case("texture", Kind::Texture(Texture { at: axis(), wave_number: 30.0, depth: 0.05 }), vec![], true),
        case("pendulum", pendulum(), vec![], true),
        case("magnet", Kind::Magnet(Magnet { target: askew(), strength: 0.2, width: 0.3 }), vec![], true),
    ]
}

fn pendulum() -> Kind {
    Kind::Pendulum(Pendulum { centre: Vec3::new(0.01, 0.02, -0.05), weight: Vec3::new(0.0, 0.0, -4.0) })
}

pub fn dissipative() -> Vec<(Kind, Vec<f64>)> {
    let plain = |kind| (kind, vec![]);
    vec![
        plain(Kind::Damper(Damper::new(uneven(0.01, 0.02, 0.03)).unwrap())),
        plain(Kind::Damper(Damper::new(uneven(0.01, 0.02, 0.03)).unwrap().with_deadband(0.7))),
        plain(Kind::Detents(detents(12, 0.02))),
        (Kind::Detents(detents(0, 0.02)), vec![-0.5, 0.5]),
        plain(Kind::Snaps(Snaps { damping: 0.02, ..snaps(SnapSet::Cube, &[]) })),
        plain(Kind::EndStop(end_stop(0.05))),
        plain(guide(Freedom::Axis, 0.05, 0.1)),
        plain(guide(Freedom::Swing, 0.05, 0.0)),
        plain(guide(Freedom::Plane(pointer()), 0.05, 0.0)),
    ]
}

pub fn active() -> Vec<(Kind, Vec<f64>)> {
    let swing =
        TrackPath::Swing { axis: axis(), amplitude: 0.4, from: 0.5, to: 3.0, sweep: 2.0, repeat: true };
    let track =
        |path| Kind::Track(Track { target: askew(), path, stiffness: 2.0, damping: 0.02, deadband: 0.01 });
    let points = vec![0.0, 1.0, 0.0, 0.0, 0.0, 0.5, 0.8, 0.6, 0.0, 0.0, 1.5, 1.0, 0.0, 0.0, 0.0];
    vec![
        (Kind::Constant(Constant { torque: axis() * 0.1, frame: Frame::World }), vec![]),
        (Kind::Constant(Constant { torque: axis() * 0.1, frame: Frame::Sphere }), vec![]),
        (Kind::Vibration(vibration(Wave::Sine)), vec![]),
        (Kind::Vibration(vibration(Wave::Square)), vec![]),
        (Kind::Vibration(vibration(Wave::Saw)), vec![]),
        (Kind::Pulse(pulse()), vec![]),
        (track(swing), vec![]),
        (track(TrackPath::Points { rest: true, repeat: true }), points.clone()),
        (track(TrackPath::Points { rest: false, repeat: false }), points),
        (Kind::Inertia(Inertia { mass: uneven(0.001, 0.002, 0.003), smoothing: 0.01 }), vec![]),
        (Kind::Friction(Friction { torque: 0.05, stiffness: 5.0, damping: 0.005 }), vec![]),
    ]
}

pub fn vibration(wave: Wave) -> Vibration {
    Vibration {
        axis: axis(),
        amplitude: 0.1,
        frequency: 40.0,
        wave,
        attack: 0.02,
        hold: 0.1,
        release: 0.05,
        repeat: 0.3,
    }
}

pub fn pulse() -> Pulse {
    Pulse { target: askew(), axis: axis(), strength: 0.2, duration: 0.01, fire: 0, period: 0.1, count: 12 }
}

pub fn all() -> Vec<(Kind, Vec<f64>)> {
    let mut all = active();
    all.extend(dissipative());
    all.extend(conservative().into_iter().map(|case| (case.kind, case.figures)));
    all
}
