//! Orders of the integration methods, and comparison with numbers of the physics notes and of
//! another program.

use crate::devices::task;
use crate::prelude::*;
use hbot_testing::prototype::of_the_task;

/// The state of the comparison task after 2 s equals the result of an independent program.
#[test]
fn the_task_of_the_speed_comparison_ends_where_it_should() {
    let (plant, load) = task();
    let mut state = PlantState::default();
    plant.advance_exactly(&mut state, 0.0, 2.0, &[0.0; 16], &load, 1e-13).unwrap();
    let q =
        Quat::from_xyzw(-0.011_088_770_246_2, -0.023_327_731_080_3, 0.002_250_636_229_4, 0.999_663_838_884_7);
    let omega = Vec3::new(1.780_737_097_989_3, 1.978_626_463_011_1, -0.047_745_379_529_5);
    // Both results have tolerances of 1e-13 a step and some thousand steps.
    assert!(rotation::angle_between(state.q, q) < 1e-11, "{:?}", state.q);
    assert!((state.omega - omega).length() < 2e-11, "{}", state.omega);
    for (th, wanted) in state.steer.iter().zip([-0.503_341_296_753_1, -0.280_281_238_430_9]) {
        assert!((th - wanted).abs() < 2e-11, "{th}");
    }
}

#[test]
fn errors_fall_with_the_order() {
    let (plant, load) = task();
    let mut exact = PlantState::default();
    plant.advance_exactly(&mut exact, 0.0, 0.5, &[0.0; 16], &load, 1e-13).unwrap();
    for method in Method::ALL {
        let error = |steps: u32| {
            let h = 0.5 / f64::from(steps);
            let mut state = PlantState::default();
            for i in 0..steps {
                plant.step(method, &mut state, f64::from(i) * h, h, &[0.0; 16], &load);
            }
            rotation::angle_between(state.q, exact.q) + (state.omega - exact.omega).length()
        };
        let (coarse, fine) = (error(250), error(500));
        let order = (coarse / fine).log2();
        // Steps of 1 and 2 ms are short enough that the leading term dominates to within some per
        // cent.
        assert!(
            (order - f64::from(method.order())).abs() < 0.25,
            "{method:?}: {coarse:e}, {fine:e}, order {order:.2}"
        );
    }
}

/// The plant's joint rates equal those of the physics notes, section 5, to the ten digits printed
/// there.
#[test]
fn check_numbers_of_the_physics_notes() {
    let plant = Plant::new(&device_with(of_the_task)).unwrap();
    let rates = plant.joint_rates(&brisk());
    for (rate, wanted) in rates.iter().zip([14.165_133_59, 21.110_592_26, 10.973_452_59, -2.822_380_84]) {
        assert!((rate - wanted).abs() < 1e-8, "{rates:?}");
    }
}

/// With the reference integrator, a motion that runs forwards and then backwards in time ends where
/// it began. The wheels have toe.
#[test]
fn the_reference_runs_back() {
    let plant = Plant::new(&toed(3)).unwrap();
    let start = brisk();
    let mut state = start;
    let load = |_: f64, q: Quat, _: Vec3| rotation::log(q) * -2.0;
    plant.advance_exactly(&mut state, 0.0, 0.1, &[0.0; 16], &load, 1e-13).unwrap();
    state.omega = -state.omega;
    plant.advance_exactly(&mut state, 0.1, 0.1, &[0.0; 16], &load, 1e-13).unwrap();
    // Rolling back multiplies the error of a steer angle by exp(cot a x angle): 5 times for 0.4 rad
    // here.
    let (turn, rate) = (rotation::angle_between(state.q, start.q), (state.omega + start.omega).length());
    assert!(turn < 1e-10 && rate < 1e-9, "{turn:e} {rate:e}");
}

#[test]
fn a_load_that_is_no_number_is_refused_by_the_reference() {
    let (plant, _) = task();
    let mut state = PlantState::default();
    let error = plant.advance_exactly(&mut state, 1.0, 1.0, &[0.0; 16], &Vec3::NAN, 1e-12).unwrap_err();
    assert_eq!((error.t, state), (1.0, PlantState::default()));
}
