//! A stored state of the control law goes on like the original, with every stage that a rig can
//! have, and with inputs that no server has in virtual time.

use hbot_config::RigConfig;
use hbot_core::design::rig::{
    EnergyLimit, OdometryMethod, PassivityLimit, PathFit, RateEstimate, Rig, Traction,
};
use hbot_core::inputs::{Command, Complaints, JointReadings};
use hbot_core::{CompiledScene, Controller, Inputs, MAX_JOINTS};
use hbot_record::Exact;

use crate::made::{assert_exact, replay, written};

/// Rigs whose stages differ as much as possible.
fn rigs() -> [Rig; 3] {
    let rig = RigConfig::prototype().rig;
    let window = RateEstimate::AdaptiveWindow { tolerance_counts: 2, longest_ticks: 40 };
    let with = |rate, path| {
        rig.with(|parts| {
            parts.methods.odometry = OdometryMethod::Magnus4;
            (parts.methods.rate, parts.methods.path) = (rate, path);
            parts.methods.passivity = Some(PassivityLimit::of(&parts.device, 1e-3));
            parts.limits.thermal_time = Some(10.0);
            parts.limits.energy = Some(EnergyLimit { burst: 5.0, power: 5.0 });
            parts.limits.traction = Some(Traction { mu: 0.8, normal_force: 10.0 });
            // Counts that walk at random have large rates.
            (parts.limits.speed, parts.limits.slip) = (500.0, 50.0);
        })
        .unwrap()
    };
    [
        with(window, PathFit::Quadratic),
        with(RateEstimate::Kalman { acceleration: 100.0 }, PathFit::Cubic),
        with(RateEstimate::LowPass { cutoff_hz: 40.0 }, PathFit::Straight),
    ]
}

/// A scene with effects that have memory.
fn scene() -> CompiledScene {
    let text = r#"{"name": "memories", "effect": [
        {"id": "spring", "kind": "spring", "stiffness": 1, "anchor": "here"},
        {"id": "friction", "kind": "friction"},
        {"id": "mass", "kind": "inertia", "mass": 0.0005},
        {"id": "hum", "kind": "vibration", "axis": [0, 0, 1], "amplitude": 0.02, "frequency": 40}]}"#;
    let file = hbot_config::SceneFile::from_json(serde_json::from_str(text).unwrap()).unwrap();
    hbot_config::RunningScene::new().load(file)
}

/// Inputs in which everything happens: motion, lost and damaged frames, late ticks, a reboot, a
/// rate that is not a number.
fn inputs(tick: u64) -> Inputs {
    let mut inputs = Inputs::quiet(tick);
    let turned = |joint: usize| (40.0 * (0.011 * (tick as f64) + joint as f64).sin()) as i32;
    let mut rates = [0.0; MAX_JOINTS];
    if tick == 2500 {
        rates[1] = f64::NAN;
    }
    if tick % 37 != 5 {
        inputs.feedback = Some(JointReadings {
            sequence: (tick as u32).wrapping_sub(1),
            counts: std::array::from_fn(turned),
            rates,
            index_seen: u16::MAX,
            complaints: Complaints::default(),
        });
    }
    inputs.corrupt_frames = u16::from(tick % 311 == 7);
    inputs.lateness_ns = tick * 7919 % 100_000;
    inputs.rebooted = tick == 1800;
    if tick % 50 == 3 {
        let command = if tick % 100 == 3 { Command::Reset } else { Command::Enable };
        inputs.commands.push(command).unwrap();
    }
    inputs
}

#[test]
fn a_stored_state_of_the_law_goes_on_like_the_original() {
    const TICKS: u64 = 3000;
    for rig in rigs() {
        let (mut law, scene) = (Controller::new(rig), scene());
        let mut records =
            vec![Exact::Scene(Box::new(scene.clone())), Exact::Controller(Box::new(law.clone()))];
        let mut faults = 0;
        for tick in 0..TICKS {
            let inputs = inputs(tick);
            let outputs = law.tick(&scene, &inputs);
            faults += u64::from(outputs.state.cause.is_some());
            records.push(Exact::Tick(Box::new((inputs, outputs))));
            if tick % 97 == 0 {
                // The replay forgets its own state and goes on with the stored one.
                records.push(Exact::Lost(0));
                records.push(Exact::Scene(Box::new(scene.clone())));
                records.push(Exact::Controller(Box::new(law.clone())));
            }
        }
        assert!(faults > 0 && faults < TICKS, "{faults} ticks with a fault");
        let records: Vec<(Exact, u64)> = records.into_iter().map(|record| (record, 0)).collect();
        let report = replay(&written(&records)).unwrap();
        assert_eq!((report.ticks, &report.difference), (TICKS, &None));

        let whole: Vec<_> = records
            .into_iter()
            .scan(0, |begun, record| {
                *begun += u64::from(matches!(record.0, Exact::Tick(_)));
                Some((*begun > 0 && !matches!(record.0, Exact::Tick(_)), record))
            })
            .filter_map(|(again, record)| (!again).then_some(record))
            .collect();
        assert_exact(&written(&whole), TICKS);
    }
}
