"""Two experiments on an Hbot.

`python -m hbot_experiments.matching` measures how well a person turns the sphere to a target
orientation, with and without haptic guidance. `python -m hbot_experiments.discrimination` measures
the smallest difference of stiffness that a person feels.

With `--simulate`, a simulated participant with known parameters takes the person's place, so that
an experiment runs unattended.
"""
