//! The passivity controller on a simulated prototype. A spring far too stiff for the loop
//! oscillates without it and comes to rest with it (physics notes, section 9).

use crate::effects::vibration;
use crate::prelude::*;
use hbot_core::render::effects::Wave;
use hbot_sim::hand::Grip;
use hbot_sim::phenomena::Hand;
use hbot_sim::plant::{Method, Plant, PlantState, SpringDamper, Sum};

pub const DT: f64 = 1e-3;

/// The rig's own viscous damping, N m s/rad. It is less than that of bearings and a light hand.
const OWN: f64 = 0.005;

/// The stiffest stable spring in a loop of 1 kHz with one tick of delay: b / (h (1/2 + 1)), 3.3 N
/// m/rad.
pub const BORDER: f64 = OWN / (1.5 * DT);

/// A control loop around a simulated plant. The motor controllers answer each command at once with
/// a reading, and hold the commanded torque for one tick. In contrast to the simulated rig, the
/// damping of the device is set here alone, so the stability limit is known exactly.
pub struct Loop {
    controller: Controller,
    scene: CompiledScene,
    plant: Plant,
    pub motion: PlantState,
    grip: Option<Grip>,
    held: [f64; MAX_JOINTS],
    /// Viscous damping of the rig itself, N m s/rad.
    own: f64,
    tick: u64,
    pub rig: Rig,
    /// Energy that the motors have delivered, J: the sum over joints of the held torque times the
    /// turn made.
    given: f64,
    /// Largest value of `given` so far, J.
    pub most: f64,
}

impl Loop {
    pub fn new(rig: Rig, scene: CompiledScene) -> Self {
        let mut run = Self {
            controller: Controller::new(rig),
            scene,
            plant: Plant::new(&rig.device).unwrap(),
            motion: PlantState::default(),
            grip: None,
            held: [0.0; MAX_JOINTS],
            own: OWN,
            tick: 1,
            rig,
            given: 0.0,
            most: 0.0,
        };
        run.step(None);
        run.step(Some(Command::Enable));
        run.run(600);
        assert_eq!(run.run(1).mode, Mode::Active);
        run
    }

    fn grip(&mut self, hand: Hand) {
        self.grip = Some(Grip::new(hand, self.tick as f64 * DT, self.motion.q));
        self.plant.set_sphere_inertia(self.rig.device.sphere_inertia() + hand.inertia);
    }

    fn let_go(&mut self) {
        self.grip = None;
        self.plant.set_sphere_inertia(self.rig.device.sphere_inertia());
    }

    fn step(&mut self, command: Option<Command>) -> State {
        let angles = self.motion.joints();
        let reading = encoders(&self.rig, &angles, &self.plant.joint_rates(&self.motion), self.tick - 1);
        let own = SpringDamper { stiffness: 0.0, damping: self.own, reference: Quat::IDENTITY };
        let time = self.tick as f64 * DT;
        match self.grip {
            None => self.plant.step(Method::Rk4, &mut self.motion, time, DT, &self.held, &own),
            Some(grip) => {
                self.plant.step(Method::Rk4, &mut self.motion, time, DT, &self.held, &Sum(own, grip));
            }
        }
        for (j, angle) in self.motion.joints().iter().enumerate() {
            self.given += self.held[j] * (angle - angles[j]);
        }
        self.most = self.most.max(self.given);
        let mut inputs = Inputs { feedback: Some(reading), ..Inputs::quiet(self.tick) };
        command.into_iter().for_each(|command| inputs.commands.push(command).unwrap());
        let outputs = self.controller.tick(&self.scene, &inputs);
        self.held = outputs.drive.torque;
        self.tick += 1;
        outputs.state
    }

    pub fn run(&mut self, ticks: u32) -> State {
        for _ in 1..ticks {
            self.step(None);
        }
        self.step(None)
    }

    /// Runs `ticks` ticks. Returns the largest torque (N m) and the largest rate of the sphere
    /// (rad/s).
    pub fn largest(&mut self, ticks: u32) -> (f64, f64) {
        (0..ticks).fold((0.0, 0.0), |(torque, rate): (f64, f64), _| {
            let state = self.step(None);
            (torque.max(state.torque.length()), rate.max(self.motion.omega.length()))
        })
    }
}

fn stiff(times: f64) -> CompiledScene {
    let kind = spring(times * BORDER, 0.0, Quat::IDENTITY, Anchor::Absolute);
    CompiledScene::new(1, &[effect(0, 1, kind)]).unwrap()
}

pub fn guarded(rate: RateEstimate) -> Rig {
    altered(&rig(), |rig| {
        rig.methods.rate = rate;
        rig.methods.passivity = Some(PassivityLimit::of(&rig.device, DT));
        // A difference of counts is noisy, and the slip limit must not react to that noise.
        rig.limits.slip = 10.0;
    })
}

/// Angular velocity after a tap on the sphere, rad/s in N: 1.6 mJ of motion.
pub const TAP: Vec3 = Vec3::new(0.6, -0.48, 0.64);

#[test]
fn a_spring_far_too_stiff_buzzes_without_it_and_comes_to_rest_with_it() {
    for times in [3.0, 10.0, 30.0] {
        let bare = altered(&rig(), |rig| rig.limits.slip = 10.0);
        let mut run = Loop::new(bare, stiff(times));
        run.motion.omega = TAP;
        let state = run.run(3000);
        // The sphere swings as fast as the torque limit allows, or until its speed is a fault.
        let stopped = state.mode == Mode::Fault && state.cause == Some(Cause::Overspeed);
        assert!(stopped || run.largest(500).1 > 20.0, "{times}: {} rad/s", run.motion.omega);
        assert!(run.most > 1.0, "{times}: {} J", run.most);

        for estimate in [RateEstimate::Controller, RateEstimate::Difference] {
            let mut run = Loop::new(guarded(estimate), stiff(times));
            run.motion.omega = TAP;
            run.run(3000);
            let (torque, rate) = run.largest(500);
            assert!(torque < 0.1 && rate < 0.1, "{times}, {estimate:?}: {torque} N m, {rate} rad/s");
            // Beyond the allowance the energy is at most what a spring two ticks late leaks in its
            // first cycle: 2 pi times twice the tick in radians of its oscillation, times the
            // energy it holds.
            let inertia = run.rig.device.sphere_inertia();
            let tick = DT * (times * BORDER / inertia).sqrt();
            let leak = 4.0
                * core::f64::consts::PI
                * tick
                * run.plant.energy(&PlantState { omega: TAP, ..PlantState::default() });
            let most = run.rig.methods.passivity.unwrap().allowance + leak;
            assert!(run.most < most, "{times}, {estimate:?}: {} J of {most} J", run.most);
        }
    }
}

#[test]
fn a_spring_within_its_limits_feels_the_same_with_it() {
    let kind = spring(2.0, 0.02, Quat::IDENTITY, Anchor::Absolute);
    let scene = CompiledScene::new(1, &[effect(0, 1, kind)]).unwrap();
    let [mut with, mut without] =
        [guarded(RateEstimate::Controller), rig()].map(|rig| Loop::new(rig, scene.clone()));
    [&mut with, &mut without]
        .into_iter()
        .for_each(|run| run.grip(Hand { amplitude: 0.4, rate: 0.5, ..Hand::default() }));
    let mut wound: f64 = 0.0;
    for _ in 0..8000 {
        let state = with.step(None);
        wound = wound.max(-state.energy);
        assert_eq!(state, without.step(None));
        assert_eq!(state.damping, 0.0);
    }
    // The spring was wound up and released, with many times the energy of the allowance.
    assert!(wound > 0.1, "{wound} J");
}

#[test]
fn what_was_dissipated_before_buys_no_more_than_the_store() {
    let damper = Kind::Damper(Damper::new(Mat3::from_diagonal(Vec3::splat(0.1))).unwrap());
    let honey = CompiledScene::new(1, &[effect(0, 1, damper)]).unwrap();
    for store in [0.05, 0.2] {
        let guarded = guarded(RateEstimate::Controller);
        let rig = altered(&guarded, |rig| rig.methods.passivity.as_mut().unwrap().store = store);
        let mut run = Loop::new(rig, honey.clone());
        run.grip(Hand { amplitude: 0.4, rate: 1.5, ..Hand::default() });
        let taken = -run.run(8000).energy;
        assert!(taken > 1.0, "{taken} J");
        run.let_go();
        let kind = spring(10.0 * BORDER, 0.0, run.motion.q, Anchor::Absolute);
        run.scene = CompiledScene::new(2, &[effect(0, 2, kind)]).unwrap();
        run.motion.omega = TAP;
        (run.given, run.most) = (0.0, 0.0);
        run.run(6000);
        let (torque, rate) = run.largest(500);
        // At 33 N m/rad the sphere then swings with the energy of the store. The leak of one cycle,
        // 1.2 times that energy, is added.
        assert!(run.most < 2.2 * store, "{} J of a store of {store} J", run.most);
        assert!(torque < 0.1 && rate < 0.1, "{store}: {torque} N m, {rate} rad/s");
    }
}

/// Returns a spring at half the border of its own damping, a constant torque and a vibration. The
/// spring rests 0.4 rad away, so it gives out energy that nobody put in.
fn on_purpose() -> CompiledScene {
    let turned = hbot_core::rotation::exp(Vec3::new(0.1, 0.3, -0.2));
    let effects = [
        effect(0, 1, spring(3.0, 0.01, turned, Anchor::Absolute)),
        effect(1, 2, Kind::Constant(Constant { torque: Vec3::X * 0.1, frame: Frame::World })),
        effect(2, 3, Kind::Vibration(vibration(Wave::Sine))),
    ];
    CompiledScene::new(1, &effects).unwrap()
}

#[test]
fn energy_that_a_scene_gives_out_on_purpose_is_not_damped() {
    let [mut with, mut without] =
        [guarded(RateEstimate::Controller), altered(&rig(), |rig| rig.limits.slip = 10.0)]
            .map(|rig| Loop::new(rig, on_purpose()));
    for _ in 0..3000 {
        assert_eq!(with.step(None), without.step(None));
    }
    assert!(with.most > 0.05, "{} J", with.most);
    // If all energy counts, it is damped.
    let strict = altered(&guarded(RateEstimate::Controller), |rig| {
        rig.methods.passivity = Some(PassivityLimit::strict(&rig.device, DT));
    });
    let mut strict = Loop::new(strict, on_purpose());
    assert!((0..3000).any(|_| strict.step(None).damping > 0.0));
}

#[test]
fn a_free_sphere_gains_no_energy_from_notches_and_bumps() {
    let target = Target::N;
    let kinds = [
        Kind::Detents(Detents {
            target,
            axis: Vec3::Z,
            strength: 0.9,
            width: 1.0,
            count: 30,
            end_stiffness: 0.0,
            damping: 0.0,
        }),
        Kind::Texture(Texture { at: Vec3::X, wave_number: 40.0, depth: 0.2 }),
    ];
    for kind in kinds {
        let scene = CompiledScene::new(1, &[effect(0, 1, kind)]).unwrap();
        let gained = |rig: Rig| {
            let mut run = Loop::new(rig, scene.clone());
            run.own = 0.0;
            run.motion.omega = TAP;
            // Motion and the effect's own energy together, J.
            let effects = Renderer::new(&run.rig);
            let held = |run: &Loop| {
                run.plant.energy(&run.motion) + effects.energy(&run.scene, run.motion.q).unwrap_or(0.0)
            };
            let before = held(&run);
            (0..10_000).fold(0.0, |most: f64, _| {
                run.step(None);
                most.max(held(&run) - before)
            })
        };
        let (with, without) = (
            gained(guarded(RateEstimate::Controller)),
            gained(altered(&rig(), |rig| rig.limits.slip = 10.0)),
        );
        println!("{kind:?}: {with:e} J, {without:e} J without");
        // The allowance, and what the prediction of a tick misses.
        assert!(with < 1.0e-3 + 0.2e-3, "{with} J");
        assert!(without > 10.0 * with, "{without} J");
    }
}

/// Returns `rig` with a lead that takes the whole delay of [`Loop`] out: a tick, and half of the
/// time for which the torque is held.
fn leading(rig: &Rig) -> Rig {
    altered(rig, |rig| rig.lead = Some(LeadTime { factor: 1.0, longest: 0.01 }))
}

#[test]
fn what_a_lead_takes_out_of_the_loop_is_no_energy_given_out() {
    // Six times the border without a lead, and stable with it.
    let kind = spring(6.0 * BORDER, 0.0, Quat::IDENTITY, Anchor::Absolute);
    let scene = CompiledScene::new(1, &[effect(0, 1, kind)]).unwrap();
    let bare = altered(&rig(), |rig| rig.limits.slip = 10.0);
    let [mut with, mut without] =
        [guarded(RateEstimate::Controller), bare].map(|rig| Loop::new(leading(&rig), scene.clone()));
    [&mut with, &mut without].into_iter().for_each(|run| run.motion.omega = TAP);
    for _ in 0..5000 {
        let state = with.step(None);
        assert_eq!(state, without.step(None));
    }
    assert!(with.motion.omega.length() < 0.05, "{} rad/s", with.motion.omega);
    // Without the lead the stage has to act.
    let mut late = Loop::new(guarded(RateEstimate::Controller), scene);
    late.motion.omega = TAP;
    assert!((0..3000).any(|_| late.step(None).damping > 0.0));
}

#[test]
fn a_spring_too_stiff_even_for_its_lead_comes_to_rest_with_both() {
    // The prototype's largest torque. With more, the slew limit delays the swing and the damping.
    let weak = |rig: Rig| leading(&altered(&rig, |rig| rig.limits.torque = 0.9));
    let bare = altered(&rig(), |rig| rig.limits.slip = 10.0);
    let mut run = Loop::new(weak(bare), stiff(90.0));
    run.motion.omega = TAP;
    let state = run.run(3000);
    assert!(state.mode == Mode::Fault || run.largest(500).1 > 2.0, "{}", run.motion.omega);
    let mut run = Loop::new(weak(guarded(RateEstimate::Controller)), stiff(90.0));
    run.motion.omega = TAP;
    run.run(3000);
    let (torque, rate) = run.largest(500);
    assert!(torque < 0.1 && rate < 0.1, "{torque} N m, {rate} rad/s");
}

#[test]
fn a_swing_that_nothing_damps_dies_out_instead_of_staying_at_the_allowance() {
    for times in [3.0, 30.0] {
        let mut run = Loop::new(guarded(RateEstimate::Controller), stiff(times));
        run.own = 0.0;
        run.motion.omega = TAP;
        run.run(6000);
        let rate = run.largest(500).1;
        // The energy of the allowance alone is a swing of 0.77 rad/s.
        assert!(rate < 0.1, "{times}: {rate} rad/s");
    }
}

#[test]
fn a_spring_too_stiff_is_damped_while_its_reference_moves_too() {
    const TURNS: Vec3 = Vec3::new(0.0, 0.0, 0.2);
    let swing = |rig: Rig| {
        let mut run = Loop::new(rig, stiff(20.0));
        let (mut most, mut fault) = (0.0_f64, false);
        for k in 0..3000_u32 {
            let q = hbot_core::rotation::exp(TURNS * (DT * f64::from(k)));
            let stamp = Stamp::default();
            let moved = Command::Reference { slot: 0, epoch: 1, q, omega: TURNS, valid_ticks: 20, stamp };
            fault |= run.step(Some(moved)).mode == Mode::Fault;
            if k >= 2500 {
                most = most.max((run.motion.omega - TURNS).length());
            }
        }
        if fault { f64::INFINITY } else { most }
    };
    let bare = swing(altered(&rig(), |rig| rig.limits.slip = 10.0));
    let rate = swing(guarded(RateEstimate::Controller));
    // What the damping takes from the turn itself pays for a swing of two to three times its rate.
    assert!(bare > 10.0 && rate < 3.0 * TURNS.length(), "{bare} rad/s without, {rate} with the stage");
}
