"""Estimate the stiffness of the contacts between wheels and sphere from a flight log with a tap.

    python examples/ringing.py FLIGHT_LOG.csv my.toml

Tap the sphere once while no spring acts, and press the emergency stop within 0.8 s after it
(`hbot estop`): the server then writes a flight log. After a tap the wheels ring against the sphere.
The program looks for the slowest ringing in the rates of the steer joints, at the frequency f, and
prints the stiffness k of each contact along the sphere's surface for which the linear equations of
docs/simulator.md ring at f:

    k = (2 pi f)² / lambda        lambda: the least eigenvalue of H J_q⁻¹ Hᵀ + Z Zᵀ / I_s

It takes the steer angles from the log, and geometry and inertias from the rig file. It assumes that
nothing holds the sphere and that the cage is much stiffer than the contacts. docs/stability.md says
what the result is good for. A tap about an axis that the slowest ringing does not turn the sphere
about gives the frequency of the next one, and so too large a stiffness.
"""

from __future__ import annotations

import csv
import math
import sys
import tomllib
from statistics import median

Vector = list[float]
Matrix = list[Vector]

# Part of the log after the tap that is searched, s, and the lowest frequency, Hz.
WINDOW_S = 0.15
LOWEST_HZ = 40.0
# Longest time from the first contact of a finger to the sharpest change of the rates, s. The log
# before it shows the noise of the rates.
TAP_S = 0.03
# Least power of a ringing, as a multiple of the noise. Noise alone does not have as much.
LEAST_POWER = 12.0
# Least size of a ringing, relative to the tap: rounding, which differs at rest and in motion, is
# smaller.
LEAST_SIZE = 0.002


def dot(a: Vector, b: Vector) -> float:
    return sum(x * y for x, y in zip(a, b, strict=True))


def cross(a: Vector, b: Vector) -> Vector:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def radians(value: float | str) -> float:
    """Return an angle of a rig file, a number in rad or a text such as "10 deg", in rad."""
    if not isinstance(value, str):
        return value
    for unit, size in (("deg", math.pi / 180), ("°", math.pi / 180), ("rad", 1.0)):
        number = value.strip().removesuffix(unit)
        if number != value.strip():
            return float(number) * size
    raise ValueError(f"{value!r} is no angle; legal: rad, or a text such as '10 deg'")


def turned(v: Vector, axis: Vector, angle: float) -> Vector:
    """Return `v` turned about the unit vector `axis` by `angle`, rad (Rodrigues)."""
    c, s = math.cos(angle), math.sin(angle)
    across, along = cross(axis, v), dot(axis, v) * (1 - c)
    return [c * x + s * y + along * a for x, y, a in zip(v, across, axis, strict=True)]


def frame(wheel: dict, steer: float) -> list[Vector]:
    """Return c1, c2 and c3 of a contact in frame N (docs/internals/physics.md, section 1)."""
    length = math.sqrt(dot(wheel["axis"], wheel["axis"]))
    axis = [x / length for x in wheel["axis"]]
    n3 = [0.0, 0.0, 1.0]
    tilt = cross(n3, axis)
    sine = math.sqrt(dot(tilt, tilt))
    if sine < 1e-12:
        tilt, sine = [1.0, 0.0, 0.0], 1.0
    tilt = [x / sine for x in tilt]
    columns = []
    for unit in ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], n3):
        v = turned(unit, n3, radians(wheel.get("toe", 0.0)))
        v = turned(v, [1.0, 0.0, 0.0], radians(wheel["cone"]))
        v = turned(v, n3, steer)
        columns.append(turned(v, tilt, math.atan2(math.hypot(axis[0], axis[1]), axis[2])))
    return columns


def mobility(rig: dict, steer: Vector) -> Matrix:
    """Return H J_q⁻¹ Hᵀ + Z Zᵀ / I_s, the inverse mass between the contacts, 1/kg."""
    radius, mass = rig["sphere"]["radius"], rig["sphere"]["mass"]
    inertia = 2 / 3 * mass * radius**2
    rows, own = [], []
    for wheel, angle in zip(rig["wheel"], steer, strict=True):
        c1, c2, _ = frame(wheel, angle)
        length = math.sqrt(dot(wheel["axis"], wheel["axis"]))
        axis = [x / length for x in wheel["axis"]]
        steering, driving = 1 / wheel["steer"]["inertia"], 1 / wheel["drive"]["inertia"]
        h = [[radius * dot(axis, c2), 0.0], [-radius * dot(axis, c1), wheel["radius"]]]
        own.append([[h[i][0] * steering * h[j][0] + h[i][1] * driving * h[j][1] for j in (0, 1)] for i in (0, 1)])
        rows += [[-radius * x for x in c2], [radius * x for x in c1]]
    n = len(rows)
    matrix = [[dot(rows[i], rows[j]) / inertia for j in range(n)] for i in range(n)]
    for w, block in enumerate(own):
        for i in (0, 1):
            for j in (0, 1):
                matrix[2 * w + i][2 * w + j] += block[i][j]
    return matrix


def eigenvalues(matrix: Matrix) -> Vector:
    """Return the eigenvalues of a symmetric matrix, ascending (the method of Jacobi)."""
    a = [row[:] for row in matrix]
    n = len(a)
    for _ in range(60):
        for p in range(n):
            for q in range(p + 1, n):
                if a[p][q] == 0.0:
                    continue
                angle = 0.5 * math.atan2(2 * a[p][q], a[q][q] - a[p][p])
                c, s = math.cos(angle), math.sin(angle)
                for k in range(n):
                    a[k][p], a[k][q] = c * a[k][p] - s * a[k][q], s * a[k][p] + c * a[k][q]
                for k in range(n):
                    a[p][k], a[q][k] = c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]
    return sorted(a[k][k] for k in range(n))


def power(signals: list[Vector], dt: float, frequency: float) -> float:
    """Return the power of all signals together at `frequency` (Hz), under a Hann window."""
    total = 0.0
    for signal in signals:
        n = len(signal)
        real = imaginary = 0.0
        for k, x in enumerate(signal):
            weight = math.sin(math.pi * (k + 0.5) / n) ** 2
            phase = 2 * math.pi * frequency * dt * k
            real += weight * x * math.cos(phase)
            imaginary += weight * x * math.sin(phase)
        total += real**2 + imaginary**2
    return total


def ringing(time: Vector, rates: list[Vector]) -> tuple[float, int] | None:
    """Find the slowest ringing after the sharpest change of the rates.

    Returns its frequency, Hz, and the tick in the middle of it.
    None: no ringing stands out from the noise before that change and after it.
    """
    dt = (time[-1] - time[0]) / (len(time) - 1)
    # Second differences leave the ringing, and take the slow motion of the sphere away.
    sharp = [[r[k + 1] - 2 * r[k] + r[k - 1] for k in range(1, len(r) - 1)] for r in rates]
    length = int(WINDOW_S / dt)
    size = [max(abs(s[k]) for s in sharp) for k in range(len(sharp[0]) - length - 1)]
    if not size:
        return None
    tap = size.index(max(size)) + 2
    quiet = tap - int(TAP_S / dt) - length
    if quiet < 0:
        return None
    step = 0.25 / (length * dt)
    tried = [LOWEST_HZ + k * step for k in range(int((0.45 / dt - LOWEST_HZ) / step))]
    after, before = (
        [power([s[start : start + length] for s in sharp], dt, frequency) for frequency in tried]
        for start in (tap, quiet)
    )
    peaks = [k for k in range(1, len(tried) - 1) if after[k - 1] < after[k] >= after[k + 1]]
    first = next((k for k in peaks if after[k] > 0.1 * max(after)), None)
    if first is None:
        return None
    # Over many widths of the window's lobe (4 steps), so that a gap in the noise does not count.
    near = slice(max(0, first - 60), first + 61)
    noise = max(sum(before[near]) / len(before[near]), median(after[near]))
    least = (LEAST_SIZE * max(size) * length / 4) ** 2
    if after[first] < max(LEAST_POWER * noise, least):
        return None
    left, middle, right = (math.log(after[first + i]) for i in (-1, 0, 1))
    frequency = tried[first] + step * 0.5 * (left - right) / (left - 2 * middle + right)
    return frequency, tap + length // 2


def rig_of(file: str) -> dict:
    """Read a rig file."""
    with open(file, "rb") as opened:
        rig = tomllib.load(opened)
    for number, wheel in enumerate(rig["wheel"], 1):
        for joint in ("steer", "drive"):
            if not wheel[joint].get("inertia"):
                raise ValueError(f"`{joint}` of wheel {number} needs an `inertia`, kg m²")
    return rig


def log_of(file: str, joints: range) -> tuple[Vector, list[Vector], list[Vector]]:
    """Return times, and rates and angles of some joints, of a flight log."""
    with open(file, newline="") as opened:
        rows = list(csv.DictReader(opened))
    if len(rows) < 3:
        raise ValueError("it has no ticks")
    rates = [[float(row[f"joint{j}_rate_rad_s"]) for row in rows] for j in joints]
    angles = [[float(row[f"joint{j}_angle_rad"]) for row in rows] for j in joints]
    time = [float(row["t_s"]) for row in rows]
    if not time[-1] > time[0]:
        raise ValueError("its times do not grow")
    return time, rates, angles


def main() -> None:
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    log, file = sys.argv[1:]
    reading = file
    try:
        rig = rig_of(file)
        mobility(rig, [0.0] * len(rig["wheel"]))
        reading = log
        time, rates, angles = log_of(log, range(1, 2 * len(rig["wheel"]), 2))
    except OSError as error:
        sys.exit(f"error: {reading}: {error.strerror}")
    except KeyError as error:
        sys.exit(f"error: {reading} has no {error}; name a flight log (CSV), then the rig file")
    except (ValueError, TypeError, csv.Error) as error:
        sys.exit(f"error: {reading}: {error}")
    found = ringing(time, rates)
    if found is None:
        sys.exit(f"no tap found in {log}: tap the sphere harder, within 0.8 s before the stop")
    frequency, tick = found
    values = eigenvalues(mobility(rig, [angle[tick] for angle in angles]))
    stiffness = (2 * math.pi * frequency) ** 2 / values[0]
    print(f"ringing at {frequency:.0f} Hz, contacts of {stiffness:.3g} N/m")
    others = ", ".join(f"{math.sqrt(stiffness * value) / 2 / math.pi:.0f}" for value in values[1:])
    print(f"the other frequencies of such contacts: {others} Hz")


if __name__ == "__main__":
    main()
