"""Measures which stiffness couples two simulated rigs stably, and what bounds an unstable coupling.

    python examples/couple.py --study docs/coupling

Starts two servers with simulated rigs at 1 kHz for each setting of the energy bound, couples them
as `couple.py` does, and taps both spheres in opposite directions. Writes `study.json`, `report.md`
and two plots. It takes about ten minutes and needs a machine that keeps 1 kHz.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from couple import Coupling, CouplingError, End, connected

from .border import Coupled

RATE_HZ = 1000
LAG = 1.5 / RATE_HZ
"""Lag from a reading to its torque, in the mean, s (docs/internals/borders.md)."""
WAY = 1.1 / RATE_HZ
"""About what the way from server to server adds to a delay, s."""
DAMPING = 0.02  # N m s/rad
DELAYS_MS = (0, 5, 10, 20, 30, 50)
TAP, TAP_MS = 0.05, 10
"""Torque of a tap, N m, and its duration, ms; a ramp of 20 ms follows. It makes 0.25 rad/s."""
LINEAR = 1.0
"""Speed below which nothing limits the coupling, rad/s. Half of the rig's `reference_rate`."""
QUIET = 0.004
"""Speed below which a swing is not told from the rounding to encoder counts, rad/s."""
MAX_JITTER = 0.003
"""Jitter above which a trial is repeated, s: most of what a busy machine adds for some ticks."""
SETTINGS: dict[str, dict[str, str]] = {
    "off": {"passivity = true": "passivity = false"},
    "fast": {
        "passivity = true": "passivity = false",
        "reference_rate = 2 ": "reference_rate = 100 ",
    },
    "passivity": {"passivity = true": "passivity = { strict = true }"},
    "limit": {
        "passivity = true": "passivity = false",
        "\nslip = 0.05 ": "\nenergy = { burst = 0.01, power = 0.02 }\nslip = 0.05 ",
    },
}
"""Changes of the prototype's rig file: none, no limit on the reference, two bounds on energy."""
FREE: dict[str, Any] = {"simulate": {}}
GRIP: dict[str, Any] = {"simulate": {"hand": {"amplitude": 0.0}}}
"""The simulated hand with its defaults. It keeps still."""
GRIPPED = {"grip_stiffness": 3.0, "grip_damping": 0.05}  # N m/rad, N m s/rad: the hand's defaults
HAND_INERTIA = 0.002  # kg m², the hand's default


@dataclass
class Trial:
    """One run of two coupled rigs, from the tap on."""

    stiffness: float
    """N m/rad."""
    delay: float
    """From a tick to the tick in which its orientation acts, mean of both ways, s."""
    jitter: float
    """99 % of the delays, less their median, the larger of both ways, s."""
    growth: float | None
    """Rate at which the swing grows, 1/s. None: too few swings to tell."""
    frequency: float | None
    """Angular frequency of the swing, rad/s."""
    speed: float
    """Largest speed of a sphere, rad/s."""
    last_speed: float
    """Largest speed in the last half second, rad/s."""
    energy: float
    """Largest energy that the motors of a rig gave out in total since the tap, J."""
    ended: str | None
    """The fault that ended the coupling."""


def settled(ends: tuple[End, End], stiffness: float, more: dict[str, Any]) -> None:
    """Enable both rigs at rest, with empty logs."""
    for end in ends:
        end.rig.disable()
        end.rig.reset()
        brake = {"id": "d", "kind": "damper", "damping": 0.05}
        end.rig.load_scene({"name": "Brake", "effect": [brake], **more})
        end.rig.enable()
    for end in ends:
        for state in end.rig.states():
            if state.mode == "active" and max(map(abs, state.omega)) < QUIET / 4:
                break
    for end in ends:
        end.start(stiffness, DAMPING, more)
        end.log = []


def trial(
    ends: tuple[End, End], stiffness: float, delay_ms: float, seconds: float, more: dict[str, Any]
) -> Trial:
    """Couple two rigs, tap both spheres and watch them for `seconds`."""
    settled(ends, stiffness, more)
    ended, tapped = None, [0, 0]
    try:
        with Coupling(*ends, delay_ms * 1e-3) as coupling:
            coupling.wait(0.6)  # The soft start.
            tapped = [len(end.log or ()) for end in ends]
            for end, sign in zip(ends, (1.0, -1.0), strict=True):
                end.watch.clear()
                end.rig.torque([0.0, 0.0, sign * TAP], TAP_MS, wait=False)
            coupling.wait(seconds)
    except CouplingError as error:
        ended = str(error)
    return measured(ends, tapped, stiffness, ended)


def measured(
    ends: tuple[End, End], tapped: list[int], stiffness: float, ended: str | None
) -> Trial:
    """Evaluate the logs of both rigs."""
    fits, delays, jitters, speeds, lasts, energies = [], [], [], [], [], []
    for end, start in zip(ends, tapped, strict=True):
        log = (end.log or [])[start:]
        t = np.array([state.t for state in log])
        omega = np.array([state.omega[2] for state in log])
        fits.append(growth(t, omega))
        late = np.array(end.watch.delays)
        delays.append(float(late.mean()))
        jitters.append(float(np.percentile(late, 99) - np.median(late)))
        speed = [math.hypot(*state.omega) for state in log]  # A wild swing leaves its axis.
        speeds.append(max(speed))
        lasts.append(max(speed[-RATE_HZ // 2 :]))
        energies.append(max(state.energy for state in log) - log[0].energy)
    known = [fit for fit in fits if fit is not None]
    rate, frequency = np.mean(known, axis=0).tolist() if len(known) == 2 else (None, None)
    # Only the sum of both ways matters to the theory, and no error of the clocks is in it.
    return Trial(
        stiffness,
        sum(delays) / 2,
        max(jitters),
        rate,
        frequency,
        max(speeds),
        max(lasts),
        max(energies),
        ended,
    )


def growth(t: np.ndarray, omega: np.ndarray) -> tuple[float, float] | None:
    """Return the growth rate, 1/s, and the angular frequency, rad/s, of a swing after a tap.

    A line is fitted to the logarithms of the peaks, from 0.1 s after the tap until they are too
    small or no longer linear. None: fewer than five peaks.
    """
    size = np.abs(omega)
    peak = np.flatnonzero((size[1:-1] >= size[:-2]) & (size[1:-1] > size[2:])) + 1
    peak = peak[t[peak] > t[0] + 0.1]
    for limit in (size[peak] < QUIET, size[peak] > LINEAR):
        if limit.any():
            peak = peak[: int(np.argmax(limit))]
    if len(peak) < 5:
        return None
    rate = float(np.polyfit(t[peak], np.log(size[peak]), 1)[0])
    return rate, math.pi / float(np.median(np.diff(t[peak])))


def undisturbed(
    ends: tuple[End, End], stiffness: float, delay_ms: float, more: dict[str, Any]
) -> Trial:
    """Return a trial of 2 s that the machine has not disturbed: the least disturbed of three."""
    tried = []
    for _ in range(3):
        tried.append(trial(ends, stiffness, delay_ms, 2.0, more))
        print(f"  {delay_ms} ms: {tried[-1]}", flush=True)
        if tried[-1].jitter < MAX_JITTER:
            break
    return min(tried, key=lambda one: one.jitter)


def theory(inertia: float, delay: float, grip: bool) -> Coupled:
    """Return the theory of two rigs, free or held by the simulated hand."""
    if grip:
        return Coupled(inertia + HAND_INERTIA, DAMPING, delay, LAG, **GRIPPED)
    return Coupled(inertia, DAMPING, delay, LAG)


def border(ends: tuple[End, End], inertia: float, delay_ms: float, grip: bool) -> dict[str, Any]:
    """Measure the border for one delay, from growth rates on both sides of where it should be."""
    # The delay is measured only later. This guess only centres the search.
    guess = theory(inertia, delay_ms * 1e-3 + WAY, grip).border()[0]
    more = GRIP if grip else FREE
    trials = [undisturbed(ends, guess * part, delay_ms, more) for part in (0.8, 0.9, 1.0, 1.1, 1.2)]
    known = [(one.stiffness, one.growth) for one in trials if one.growth is not None]
    stiffness, rate = np.array(known).T
    slope, offset = np.polyfit(stiffness, rate, 1)
    delay = float(np.median([one.delay for one in trials]))
    predicted, omega = theory(inertia, delay, grip).border()
    found = {
        "delay_ms": delay_ms,
        "delay": delay,
        "predicted": predicted,
        "omega": omega,
        "measured": float(-offset / slope),
        "trials": [asdict(one) for one in trials],
    }
    print(f"grip {grip}, {delay_ms} ms: measured {found['measured']:.3f}, theory {predicted:.3f}")
    return found


def beyond(edits: dict[str, str], inertia: float) -> list[dict[str, Any]]:
    """Watch couplings inside and beyond the border for 6 s each, every time on new servers.

    A free sphere that a fault has let go turns for ever, so its server could not be used again.
    """
    found = []
    for delay_ms in (0, 20, 50):
        limit = theory(inertia, delay_ms * 1e-3 + WAY, False).border()[0]
        for part in (0.7, 1.5, 3.0):
            with pair(edits) as ends:
                one = trial(ends, limit * part, delay_ms, 6.0, FREE)
                log = [[s.t, s.omega[2]] for s in (ends[0].log or [])[::4]]
            print(f"  {delay_ms} ms, {part} of the border: {one}", flush=True)
            found.append({"delay_ms": delay_ms, "part": part, **asdict(one)})
            if delay_ms == 20 and part == 1.5:
                found[-1]["log"] = log
    return found


@contextlib.contextmanager
def pair(edits: dict[str, str]) -> Iterator[tuple[End, End]]:
    """Run two servers with simulated rigs, and connect to them."""
    # The servers of the tests of the Python client: long time-outs, and the clean-up.
    sys.path.insert(0, str(Path(__file__).parents[2] / "clients" / "python" / "tests"))
    from serving import Server

    with contextlib.ExitStack() as stack:
        ends = []
        for _ in range(2):
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
            server = Server(folder, rate_hz=RATE_HZ, edits=edits)
            stack.callback(server.kill)
            ends.append(stack.enter_context(connected(server.address, None)))
        yield ends[0], ends[1]


def prioritize() -> str:
    """Ask for real-time priority for this program. Returns what it got."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    except OSError:
        return "without real-time priority"
    return "with real-time priority"


def run(folder: Path) -> None:
    """Measure everything and write the results to `folder`."""
    priority = prioritize()
    print(f"{priority}; load {os.getloadavg()[0]:.0f} on {os.cpu_count()} processors")
    results: dict[str, Any] = {"priority": priority, "load": os.getloadavg()[0]}
    results |= {"border": [], "grip": [], "beyond": {}}
    with pair({}) as ends:
        assert ends[0].rig.info.render is not None
        inertia = results["inertia"] = ends[0].rig.info.render.inertia
        results["border"] = [border(ends, inertia, delay, False) for delay in DELAYS_MS]
        results["grip"] = [border(ends, inertia, delay, True) for delay in (20, 50)]
    for name, edits in SETTINGS.items():
        print(f"settings: {name}")
        results["beyond"][name] = beyond(edits, inertia)
    results["load"] = max(results["load"], os.getloadavg()[0])
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "study.json").write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    from . import report

    report.write(results, folder)
