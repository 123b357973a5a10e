"""A key in a lock: it turns by 43 degrees each way, against a spring, and hardly tilts.

The lock is four walls around the blade of the key, which turns about a ball joint. Needs
`pip install 'hbot[mujoco]'` and a server. `--viewer` shows it on a screen, `--seconds 20` ends it.
"""

import argparse

import mujoco

import hbot
import hbot.mujoco

LOCK = """
<mujoco>
  <option timestep="0.002"/>
  <default><geom solref="0.004 1" friction="0.2"/></default>
  <worldbody>
    <light pos="0 0 1"/>
    <body name="key" pos="0 0 0.2">
      <joint type="ball" stiffness="0.05" damping="0.002"/>
      <geom type="box" size="0.006 0.02 0.06" mass="0.05" rgba="0.8 0.7 0.2 1"/>
      <geom type="cylinder" size="0.03 0.004" pos="0 0 0.09" euler="0 90 0" mass="0.05"/>
    </body>
    <geom type="box" size="0.01 0.05 0.05" pos="0.028 0 0.19"/>
    <geom type="box" size="0.01 0.05 0.05" pos="-0.028 0 0.19"/>
    <geom type="box" size="0.05 0.01 0.05" pos="0 0.034 0.19" rgba="0.5 0.5 0.5 0.3"/>
    <geom type="box" size="0.05 0.01 0.05" pos="0 -0.034 0.19"/>
  </worldbody>
</mujoco>
"""

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float)
    parser.add_argument("--viewer", action="store_true")
    options = parser.parse_args()
    model = mujoco.MjModel.from_xml_string(LOCK)
    with hbot.one_line_errors(), hbot.connect(name="key") as rig, rig.lease():
        rig.load_scene({"name": "A key in MuJoCo", "effect": []})
        rig.enable()
        felt = hbot.mujoco.run(rig, model, "key", duration=options.seconds, viewer=options.viewer)
    print(felt)
