"""Estimate the stiffness of the contacts between wheels and sphere from a flight log with a tap.

    python examples/ringing.py FLIGHT_LOG.csv rigs/prototype.toml

Tap the sphere once while no spring acts, and press the emergency stop within a second after it
(`hbot estop`): the server then writes a flight log. After a tap the wheels ring against the sphere.
The program looks for the slowest ringing in the rates of the steer joints, at the frequency f, and
prints the stiffness k of each contact along the sphere's surface for which the linear equations of
docs/simulator.md ring at f:

    k = (2 pi f)² / lambda        lambda: the least eigenvalue of H J_q⁻¹ Hᵀ + Z Zᵀ / I_s

It takes the steer angles from the log, and geometry and inertias from the rig file. It assumes that
nothing holds the sphere and that the cage is much stiffer than the contacts. docs/stability.md says
what the result is good for.
"""

from __future__ import annotations

import csv
import math
import sys
import tomllib

Vector = list[float]
Matrix = list[Vector]

# Part of the log after the tap that is searched, s, and the lowest frequency, Hz.
WINDOW_S = 0.15
LOWEST_HZ = 40.0


def dot(a: Vector, b: Vector) -> float:
    return sum(x * y for x, y in zip(a, b, strict=True))


def cross(a: Vector, b: Vector) -> Vector:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


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
        v = turned(unit, n3, wheel.get("toe", 0.0))
        v = turned(v, [1.0, 0.0, 0.0], wheel["cone"])
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


def ringing(time: Vector, rates: list[Vector]) -> float:
    """Return the frequency of the slowest ringing after the sharpest change of the rates, Hz."""
    dt = (time[-1] - time[0]) / (len(time) - 1)
    # Second differences leave the ringing, and take the slow motion of the sphere away.
    sharp = [[r[k + 1] - 2 * r[k] + r[k - 1] for k in range(1, len(r) - 1)] for r in rates]
    length = int(WINDOW_S / dt)
    size = [max(abs(s[k]) for s in sharp) for k in range(len(sharp[0]) - length)]
    tap = size.index(max(size)) + 2
    parts = [s[tap : tap + length] for s in sharp]
    step = 0.25 / (length * dt)
    count = int((0.45 / dt - LOWEST_HZ) / step)
    found = [power(parts, dt, LOWEST_HZ + k * step) for k in range(count)]
    peaks = [k for k in range(1, count - 1) if found[k - 1] < found[k] >= found[k + 1]]
    first = next(k for k in peaks if found[k] > 0.1 * max(found))
    left, middle, right = (math.log(found[first + i]) for i in (-1, 0, 1))
    return LOWEST_HZ + step * (first + 0.5 * (left - right) / (left - 2 * middle + right))


def main() -> None:
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    with open(sys.argv[2], "rb") as file:
        rig = tomllib.load(file)
    with open(sys.argv[1], newline="") as file:
        rows = list(csv.DictReader(file))
    steers = range(1, 2 * len(rig["wheel"]), 2)
    rates = [[float(row[f"joint{j}_rate_rad_s"]) for row in rows] for j in steers]
    steer = [float(rows[-1][f"joint{j}_angle_rad"]) for j in steers]
    frequency = ringing([float(row["t_s"]) for row in rows], rates)
    values = eigenvalues(mobility(rig, steer))
    stiffness = (2 * math.pi * frequency) ** 2 / values[0]
    print(f"ringing at {frequency:.0f} Hz, contacts of {stiffness:.3g} N/m")
    others = ", ".join(f"{math.sqrt(stiffness * value) / 2 / math.pi:.0f}" for value in values[1:])
    print(f"the other frequencies of such contacts: {others} Hz")


if __name__ == "__main__":
    main()
