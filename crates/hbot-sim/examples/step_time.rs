use std::time::Instant;
use hbot_core::device::*;
use hbot_core::*;
use hbot_sim::plant::*;
fn main() {
    let s = core::f64::consts::FRAC_1_SQRT_2;
    let w = |x: f64| WheelSpec { axis: Vec3::new(x * s, 0.0, -s), cone: 0.1745, toe: 0.0, radius: 0.0102, steer_inertia: 3.1054682227e-5, drive_inertia: 3.5202e-6, axial_inertia: 0.0 };
    let d = Device::new(0.102, 0.467, &[w(1.0), w(-1.0)]).unwrap();
    let p = Plant::new(&d).unwrap();
    let load = Sum(SpringDamper { stiffness: 4.0, damping: 0.05, reference: Quat::IDENTITY }, Sum(Sine { amplitude: Vec3::X * 0.5, hertz: 2.0 }, Sine { amplitude: Vec3::Y * 0.3, hertz: 3.0 }));
    for m in Method::ALL {
        let mut best = f64::MAX;
        let mut st = State::default();
        for _ in 0..9 {
            st = State::default();
            let n = 20000;
            let h = 20.0 / n as f64;
            let t0 = Instant::now();
            for i in 0..n {
                p.step(m, &mut st, i as f64 * h, h, &[0.0; 16], &load);
            }
            best = best.min(t0.elapsed().as_secs_f64() / n as f64 * 1e9);
        }
        let mut st2 = State::default();
        for i in 0..2000 { p.step(m, &mut st2, i as f64 * 1e-3, 1e-3, &[0.0; 16], &load); }
        let q = Quat::from_xyzw(-0.0110887702462, -0.0233277310803, 0.0022506362294, 0.9996638388847);
        println!("{m:?} {best:.1} ns  {:?}  err at 2s {:e} {:e} {:e}", st.q, rotation::angle_between(st2.q, q), st2.steer[0]+0.5033412967531, (st2.omega-Vec3::new(1.7807370979893, 1.9786264630111, -0.0477453795288)).length());
    }
}
