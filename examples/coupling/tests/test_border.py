"""The linear theory against its limits and against a simulation in time."""

from __future__ import annotations

import math

import numpy as np
import pytest

from coupling.border import Coupled

INERTIA, DAMPING = 0.0034, 0.02  # kg m², N m s/rad: a free prototype with the spring of the study


def grows(coupled: Coupled, stiffness: float) -> float:
    """Return how much the difference of both angles swings at the end, relative to before.

    Integrates the equation of the difference in time, with steps of 1/50 of a millisecond.
    """
    step, seconds = 2e-5, 3.0
    lag, delay = round(coupled.lag / step), round(coupled.delay / step)
    angle, rate = [0.0] * (lag + delay + 2), [0.0] * (lag + delay + 2)
    rate[-1] = 1.0
    for _ in range(round(seconds / step)):
        late = angle[-1 - lag] + angle[-1 - lag - delay]
        torque = -coupled.damping * rate[-1 - lag] - stiffness * late
        torque -= coupled.grip_damping * rate[-1] + coupled.grip_stiffness * angle[-1]
        rate.append(rate[-1] + step * torque / coupled.inertia)
        angle.append(angle[-1] + step * rate[-1])
    half = len(rate) // 2
    return float(np.abs(rate[half:]).max() / np.abs(rate[len(rate) // 4 : half]).max())


@pytest.mark.parametrize(
    "coupled",
    [
        Coupled(INERTIA, DAMPING, 0.001, 0.0015),
        Coupled(INERTIA, DAMPING, 0.020, 0.0015),
        Coupled(INERTIA + 0.002, DAMPING, 0.020, 0.0015, 3.0, 0.05),
    ],
    ids=["at once", "20 ms", "20 ms with a hand"],
)
def test_a_simulation_in_time_changes_its_mind_at_the_border(coupled: Coupled) -> None:
    stiffness, omega = coupled.border()
    assert omega > 1.0
    # 10 % is far above the error of the integration, which is of the order of step/lag = 1 %.
    assert grows(coupled, 0.9 * stiffness) < 1.0 < grows(coupled, 1.1 * stiffness)


def test_with_a_short_delay_the_damping_is_shared_by_delay_and_lag() -> None:
    for delay in (1e-5, 1e-4, 1e-3):
        coupled = Coupled(INERTIA, DAMPING, delay, 1e-4)
        short = DAMPING / (delay + 2e-4)
        # The next order of the expansion is b (T + 2 lag)/I, 0.7 % at most.
        assert coupled.border()[0] == pytest.approx(
            short, rel=1.5 * DAMPING * (delay + 2e-4) / INERTIA
        )


def test_without_lag_the_border_has_a_closed_form() -> None:
    for delay in (0.005, 0.02, 0.1, 1.0):
        stiffness, omega = Coupled(INERTIA, DAMPING, delay, 1e-9).border()
        phase = omega * delay
        # Rounding of the bisection, and the lag of a nanosecond.
        assert phase * math.tan(phase / 2) == pytest.approx(DAMPING * delay / INERTIA, rel=1e-4)
        assert stiffness == pytest.approx(DAMPING * omega / math.sin(phase), rel=1e-4)


def test_a_weak_spring_is_stable_with_any_delay() -> None:
    always = DAMPING**2 / (2 * INERTIA)
    borders = [Coupled(INERTIA, DAMPING, delay, 1e-9).border()[0] for delay in (0.1, 1.0, 10.0)]
    assert borders == sorted(borders, reverse=True)
    assert borders[-1] > always
    # The distance from the limit falls with the square of pi/(b T/I) = 0.05.
    assert borders[-1] == pytest.approx(always, rel=0.05**2 * 2)


def test_a_hand_makes_a_stiffer_spring_stable_with_any_delay() -> None:
    grip, held = 3.0, 0.05  # N m/rad, N m s/rad: the simulated hand
    inertia, damping = INERTIA + 0.002, DAMPING + held
    always = damping**2 / (2 * inertia) + damping * math.sqrt(grip / inertia)
    delays = np.arange(0.05, 0.3, 0.002)
    borders = [Coupled(inertia, DAMPING, float(d), 1e-9, grip, held).border()[0] for d in delays]
    # Some delay of the scan meets the worst phase within 0.001 s times 30 rad/s. The error is of
    # the order of its square.
    assert min(borders) == pytest.approx(always, rel=2e-3)


def test_the_growth_is_zero_at_the_border_and_rises_with_the_stiffness() -> None:
    coupled = Coupled(INERTIA, DAMPING, 0.02, 0.0015)
    stiffness, omega = coupled.border()
    assert abs(coupled.growth(stiffness) - 1j * omega) < 1e-6 * omega
    rates = [coupled.growth(part * stiffness).real for part in (0.7, 0.9, 1.1, 1.5)]
    assert rates == sorted(rates)
    assert rates[1] < 0.0 < rates[2]


def last_swing(coupled: Coupled, part: float, apart: float, reference_rate: float) -> float:
    """Return the speed of two spheres 5 to 6 s after they are let go `apart`, rad/s.

    Integrates both equations in time, with steps of 0.1 ms. References turn at a limited rate.
    """
    step, seconds = 1e-4, 6.0
    lag, delay = round(coupled.lag / step), round(coupled.delay / step)
    stiffness = part * coupled.border()[0]
    angles, rates = [[apart / 2], [-apart / 2]], [[0.0], [0.0]]
    references = [[apart / 2], [-apart / 2]]
    for now in range(round(seconds / step)):
        late = max(0, now - lag)
        for own, other in ((0, 1), (1, 0)):
            way = angles[other][max(0, now - delay)] - references[own][-1]
            reach = reference_rate * step
            references[own].append(references[own][-1] + max(-reach, min(reach, way)))
        for own in (0, 1):
            torque = -coupled.damping * rates[own][late]
            torque -= stiffness * (angles[own][late] - references[own][late])
            rates[own].append(rates[own][-1] + step * torque / coupled.inertia)
            angles[own].append(angles[own][-1] + step * rates[own][-1])
    return max(map(abs, rates[0][-round(1.0 / step) :]))


def test_a_limit_on_the_reference_rate_makes_a_large_swing_grow_inside_the_border() -> None:
    coupled = Coupled(INERTIA, DAMPING, 0.021, 0.0015)
    # A smaller swing, a higher limit or a softer spring comes to rest. A swing that lasts is
    # several times as fast as the limit of 2 rad/s, one that fades is slower than the limit.
    assert last_swing(coupled, 0.8, 0.6, reference_rate=2.0) > 4.0
    assert last_swing(coupled, 0.8, 0.3, reference_rate=2.0) < 1.0
    assert last_swing(coupled, 0.8, 0.6, reference_rate=100.0) < 1.0
    assert last_swing(coupled, 0.7, 0.6, reference_rate=2.0) < 1.0
