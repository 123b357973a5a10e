"""A valve in the hand: friction, and a stop at each end.

Needs `pip install 'hbot[mujoco]'` and a server.

`--viewer` shows it on a screen, `--seconds 20` ends it.
"""

import argparse

import mujoco

import hbot
import hbot.mujoco

VALVE = """
<mujoco>
  <option timestep="0.002"/>
  <default><joint solreflimit="0.004 1"/></default>
  <worldbody>
    <light pos="0 0 1"/>
    <geom type="cylinder" size="0.02 0.1" pos="0 0 0.1"/>
    <body name="valve" pos="0 0 0.22">
      <joint type="hinge" axis="0 0 1" range="-90 90" frictionloss="0.03" damping="0.004"/>
      <geom type="cylinder" size="0.05 0.008" mass="0.2" rgba="0.8 0.1 0.1 1"/>
      <geom type="capsule" size="0.008" fromto="-0.07 0 0.012 0.07 0 0.012" mass="0.05"/>
    </body>
  </worldbody>
</mujoco>
"""

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float)
    parser.add_argument("--viewer", action="store_true")
    options = parser.parse_args()
    model = mujoco.MjModel.from_xml_string(VALVE)
    with hbot.one_line_errors(), hbot.connect(name="valve") as rig, rig.lease():
        rig.load_scene({"name": "A valve in MuJoCo", "effect": []})
        rig.enable()
        felt = hbot.mujoco.run(rig, model, "valve", duration=options.seconds, viewer=options.viewer)
    print(felt)
