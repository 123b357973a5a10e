#!/usr/bin/env python3
"""Runs the task of docs/internals/plant.md in MuJoCo, to reproduce the MuJoCo rows of its table.

    pip install mujoco numpy
    python3 benches/peer/mujoco_task.py [--quick]

A sphere of radius 102 mm rests on two steered and driven wheels of radius 10.2 mm. A geodesic spring
holds it (4 N m/rad, 0.05 N m s/rad). The torques 0.5 sin(2 pi 2 t) about n1 and 0.3 sin(2 pi 3 t) about
n2, in N m, drive it from rest for 2 s.

Contacts are between a sphere and cylinders, with an elliptic friction cone and high friction. The
reference time of the friction is proportional to the step (with refsafe off), because the solution does
not converge otherwise.

For each integrator and step, the program prints the time per step in microseconds, the time per simulated
second in milliseconds, and the error of the orientation at 2 s relative to the exact solution of the
reduced model.
"""

import argparse
import time

import mujoco
import numpy as np

R, RW, CONE, MASS = 0.102, 0.0102, 0.1745, 0.467
SPHERE = 2.0 / 3.0 * MASS * R * R
WHEEL_MASS, STEER_ROTOR, DRIVE_ROTOR = 0.01, 2.7e-5, 3.0e-6
EXACT = np.array([0.9996638388847, -0.0110887702462, -0.0233277310803, 0.0022506362294])


def least_rotation(l):
    """Returns the matrix of the smallest rotation that takes n3 to the unit vector l."""
    f = 1.0 / (1.0 + l[2])
    return np.array([
        [1 - f * l[0] ** 2, -f * l[0] * l[1], l[0]],
        [-f * l[0] * l[1], 1 - f * l[1] ** 2, l[1]],
        [-l[0], -l[1], l[2]],
    ])


def wheel(i, x, preload):
    l = np.array([x, 0.0, -1.0]) / np.sqrt(2.0)
    c, s = np.cos(CONE), np.sin(CONE)
    frame = least_rotation(l) @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    centre = (R + RW - preload) * frame[:, 2]
    axle = frame[:, 0]
    # The axis of a cylinder is its z, so the wheel's z is along the axle.
    end = centre + 0.002 * axle
    start = centre - 0.002 * axle
    spin, across = 0.5 * WHEEL_MASS * RW**2, 0.25 * WHEEL_MASS * RW**2
    numbers = lambda v: " ".join(f"{c:.17g}" for c in v)
    return f"""
    <body name="fork{i}">
      <inertial pos="0 0 0" mass="1e-9" diaginertia="1e-12 1e-12 1e-12"/>
      <joint name="steer{i}" type="hinge" axis="{numbers(l)}" armature="{STEER_ROTOR}"/>
      <body name="wheel{i}" pos="{numbers(centre)}" xyaxes="{numbers(frame[:, 1])} {numbers(frame[:, 2])}">
        <inertial pos="0 0 0" mass="{WHEEL_MASS}" diaginertia="{across} {across} {spin}"/>
        <joint name="drive{i}" type="hinge" axis="0 0 1" armature="{DRIVE_ROTOR}"/>
        <geom name="tyre{i}" type="cylinder" size="{RW} 0.002"/>
      </body>
    </body>"""


def model(step, integrator):
    preload = 1e-5
    pairs = "".join(
        f'<pair geom1="ball" geom2="tyre{i}" condim="3" friction="5 5 0.005 0.0001 0.0001" '
        f'solref="-1e6 -1e3" solreffriction="{2 * step} 1" solimp="0.9999 0.9999 0.001"/>'
        for i in (1, 2)
    )
    xml = f"""
    <mujoco>
      <option timestep="{step}" integrator="{integrator}" cone="elliptic" gravity="0 0 0" impratio="10" tolerance="1e-14" iterations="100">
        <flag refsafe="disable" eulerdamp="disable"/>
      </option>
      <worldbody>
        <body name="sphere">
          <inertial pos="0 0 0" mass="{MASS}" diaginertia="{SPHERE} {SPHERE} {SPHERE}"/>
          <joint name="ball" type="ball" stiffness="4" damping="0.05"/>
          <geom name="ball" type="sphere" size="{R}"/>
        </body>{wheel(1, 1.0, preload)}{wheel(2, -1.0, preload)}
      </worldbody>
      <contact>{pairs}</contact>
    </mujoco>"""
    return mujoco.MjModel.from_xml_string(xml)


def run(step, integrator):
    m = model(step, integrator)
    d = mujoco.MjData(m)
    n = round(2.0 / step)
    sphere = mujoco.mj_name2id(m, mujoco.mjtObj.mjOBJ_BODY, "sphere")
    t = np.arange(n) * step
    n1 = 0.5 * np.sin(2 * np.pi * 2 * t)
    n2 = 0.3 * np.sin(2 * np.pi * 3 * t)
    applied = d.xfrc_applied[sphere]
    start = time.perf_counter()
    for k in range(n):
        applied[3], applied[4] = n1[k], n2[k]
        mujoco.mj_step(m, d)
    seconds = time.perf_counter() - start
    q = d.qpos[:4] / np.linalg.norm(d.qpos[:4])
    error = 2 * np.arccos(min(1.0, abs(float(q @ EXACT))))
    return seconds, n, error, int(d.ncon)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="two steps of each integrator only")
    quick = parser.parse_args().quick
    print(f"MuJoCo {mujoco.__version__}")
    print(f"{'integrator':<14} {'step':>9} {'us a step':>10} {'ms a second':>12} {'error, rad':>11}  contacts")
    steps = {"Euler": [1e-3, 1e-4, 1e-5], "implicitfast": [1e-3, 1e-4], "RK4": [1e-3, 1e-4]}
    for integrator, choice in steps.items():
        for step in choice[: 2 if quick else None]:
            best = min((run(step, integrator) for _ in range(3 if step > 2e-5 else 1)), key=lambda r: r[0])
            seconds, n, error, contacts = best
            print(
                f"{integrator:<14} {step * 1e3:>6.3f} ms {seconds / n * 1e6:>10.2f} {seconds * 500:>12.3f} "
                f"{error:>11.2e}  {contacts}"
            )


if __name__ == "__main__":
    main()
