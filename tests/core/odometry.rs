//! The methods of odometry have the orders that they are said to have (physics notes, section 4).

use crate::designs::prototype_wheels;
use crate::rng::Rng;
use hbot_core::odometry::{advance, turn};
use hbot_core::rig::OdometryMethod::{self, Euler, Magnus4, Midpoint};
use hbot_core::{Device, Quat, Vec3, WheelSpec, kinematics::Posture, rotation};

/// A device with its joints at constant rates, none of which fits the others: the sphere slips as well.
struct Segment {
    device: Device,
    theta: Vec<f64>,
    rates: Vec<f64>,
}

/// How long it lasts, s.
const TIME: f64 = 0.3;

impl Segment {
    fn new(rng: &mut Rng) -> Self {
        let [mut a, mut b] = prototype_wheels();
        for wheel in [&mut a, &mut b] {
            wheel.axis += rng.vector(0.2);
            wheel.toe = rng.between(-0.3, 0.3);
        }
        let third = WheelSpec { axis: Vec3::new(0.0, 0.5, -1.0), cone: rng.between(0.2, 0.5), ..a };
        let device = Device::new(0.102, 0.467, &[a, b, third]).unwrap();
        let theta: Vec<f64> = (0..3).map(|_| rng.between(-3.0, 3.0)).collect();
        let mut omega = rng.vector(2.0);
        omega.x += 2.0;
        let fit = Posture::new(&device, &theta).inverse(omega);
        let rates = fit[..6].iter().map(|rate| rate + rng.between(-2.0, 2.0)).collect();
        Self { device, theta, rates }
    }

    /// The orientation after it, in `n` steps.
    fn end(&self, method: OdometryMethod, n: u32) -> Quat {
        let h = TIME / f64::from(n);
        let delta: Vec<f64> = self.rates.iter().map(|rate| rate * h).collect();
        (0..n).fold(Quat::IDENTITY, |q, k| {
            let at = |i: usize| self.theta[i] + self.rates[2 * i] * h * f64::from(k);
            advance(q, turn(&self.device, method, &[at(0), at(1), at(2)], &delta))
        })
    }
}

#[test]
fn euler_midpoint_and_magnus_have_orders_1_2_and_4() {
    let mut rng = Rng(3);
    let segments: Vec<Segment> = (0..15).map(|_| Segment::new(&mut rng)).collect();
    // Steps in which the steering turns by some 5 to 20 mrad: each method's leading error is far above rounding (Magnus: 1e-10)
    // and far above its next order.
    for (method, order, n) in [(Euler, 1.0, 4000), (Midpoint, 2.0, 1000), (Magnus4, 4.0, 250)] {
        let mut orders: Vec<f64> = segments
            .iter()
            .map(|segment| {
                // Sixteen times as fine, Magnus's error is 65,536 times smaller than that of the coarser steps.
                let reference = segment.end(Magnus4, 4000);
                let [coarse, fine] =
                    [n, 2 * n].map(|n| rotation::angle_between(segment.end(method, n), reference));
                (coarse / fine).log2()
            })
            .collect();
        orders.sort_by(f64::total_cmp);
        let median = orders[orders.len() / 2];
        assert!((median - order).abs() < 0.1, "{method:?}: order {median}, of {orders:?}");
    }
}

#[test]
fn midpoint_and_magnus_are_exact_where_the_steering_stands_still() {
    let mut rng = Rng(4);
    for _ in 0..20 {
        let mut segment = Segment::new(&mut rng);
        for steer in segment.rates.iter_mut().step_by(2) {
            *steer = 0.0;
        }
        let reference = segment.end(Magnus4, 1);
        for method in [Euler, Midpoint, Magnus4] {
            // The frames stand still: one step is as good as a hundred, but for their rounding.
            let off = rotation::angle_between(segment.end(method, 100), reference);
            assert!(off < 100.0 * f64::EPSILON * 8.0, "{method:?}: {off:e}");
        }
    }
}
