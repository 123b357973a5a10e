//! Sine and cosine of two angles at once, equal to those of `libm` within rounding.
//!
//! The range reduction and the polynomials are those of `libm` (fdlibm's polynomials, each accurate
//! to half an ulp on an eighth of a turn). They are written without branches so that both wheels of
//! a pair are computed together. A test compares them with `libm`.

use super::pair::Pair;

/// Size of an angle, rad, from which `libm` computes sine and cosine: about 160,000 turns. For
/// larger angles the reduction in this module loses digits.
const FAR: f64 = 1.0e6;

/// Adding this number, 1.5 * 2^52, and subtracting it again rounds a number to the nearest integer.
/// After the addition the low bits hold that integer.
const ROUND: f64 = 6_755_399_441_055_744.0;

/// A quarter turn in rad, as the sum of three parts. The first two have 33 bits each, so that their
/// products with a quadrant number are exact.
const QUARTER: [f64; 3] = [
    f64::from_bits(0x3FF9_21FB_5440_0000),
    f64::from_bits(0x3DD0_B461_1A60_0000),
    f64::from_bits(0x3BA3_198A_2E03_7073),
];

/// Returns (sin, cos) of two angles in rad. The error is about one ulp of 1.
#[inline(always)]
pub(crate) fn sincos(angle: Pair) -> (Pair, Pair) {
    let [a, b] = angle.0;
    if a.abs() < FAR && b.abs() < FAR { near(angle) } else { far(angle) }
}

#[cold]
#[inline(never)]
fn far(angle: Pair) -> (Pair, Pair) {
    let [(s0, c0), (s1, c1)] = angle.0.map(libm::sincos);
    (Pair([s0, s1]), Pair([c0, c1]))
}

#[inline(always)]
fn near(angle: Pair) -> (Pair, Pair) {
    let shifted = angle * Pair::splat(core::f64::consts::FRAC_2_PI) + Pair::splat(ROUND);
    let k = shifted - Pair::splat(ROUND);
    let y = angle - k * Pair::splat(QUARTER[0]) - k * Pair::splat(QUARTER[1]) - k * Pair::splat(QUARTER[2]);

    let z = y * y;
    let poly =
        |start: f64, rest: [f64; 5]| rest.iter().fold(Pair::splat(start), |p, c| p * z + Pair::splat(*c));
    let s = poly(SIN[0], [SIN[1], SIN[2], SIN[3], SIN[4], SIN[5]]);
    let c = poly(COS[0], [COS[1], COS[2], COS[3], COS[4], COS[5]]);
    let s = y + y * z * s;
    let c = Pair::splat(1.0) - (Pair::splat(0.5) * z - z * z * c);

    let mut sin = [0.0; 2];
    let mut cos = [0.0; 2];
    for i in 0..2 {
        let quadrant = shifted.0[i].to_bits();
        let swap = 0u64.wrapping_sub(quadrant & 1);
        let (s, c) = (s.0[i].to_bits(), c.0[i].to_bits());
        let both = (s ^ c) & swap;
        sin[i] = f64::from_bits((s ^ both) ^ ((quadrant & 2) << 62));
        cos[i] = f64::from_bits((c ^ both) ^ ((quadrant.wrapping_add(1) & 2) << 62));
    }
    (Pair(sin), Pair(cos))
}

/// Coefficients of (sin y - y) / y³ in powers of y², highest first.
const SIN: [f64; 6] = [
    1.58969099521155e-10,
    -2.5050760253406863e-8,
    2.7557313707070068e-6,
    -0.0001984126982985795,
    0.00833333333332249,
    -0.16666666666666632,
];

/// Coefficients of (cos y - 1 + y²/2) / y⁴ in powers of y², highest first.
const COS: [f64; 6] = [
    -1.1359647557788195e-11,
    2.087572321298175e-9,
    -2.7557314351390663e-7,
    2.480158728947673e-5,
    -0.001388888888887411,
    0.0416666666666666,
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_libm_within_an_ulp_of_one() {
        let mut worst: f64 = 0.0;
        let mut angle = -1.0e6;
        while angle < 1.0e6 {
            for near in [angle, angle * 1e-3, angle * 1e-6] {
                // The f64 nearest to a multiple of a quarter turn, at which the reduction cancels
                // most.
                let quarter = (near * core::f64::consts::FRAC_2_PI).round() * core::f64::consts::FRAC_PI_2;
                let (s, c) = sincos(Pair([near, quarter]));
                for (i, x) in [near, quarter].into_iter().enumerate() {
                    let (s_libm, c_libm) = libm::sincos(x);
                    worst = worst.max((s.0[i] - s_libm).abs()).max((c.0[i] - c_libm).abs());
                }
            }
            angle += 37.123_456;
        }
        assert!(worst <= f64::EPSILON, "{worst:e}");
    }

    #[test]
    fn far_angles_and_no_numbers_are_libm_s() {
        let (s, c) = sincos(Pair([1.0e9, f64::NAN]));
        assert_eq!((s.0[0], c.0[0]), libm::sincos(1.0e9));
        assert!(s.0[1].is_nan() && c.0[1].is_nan());
    }
}
