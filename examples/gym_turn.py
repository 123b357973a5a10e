"""A controller that turns the sphere to goals in the environment of Gymnasium, as a policy would.

Needs the extra `gym` of the client and a server. `--episodes 3` is the number of goals.
"""

import argparse

import gymnasium
import numpy as np

import hbot
import hbot.gym

STIFFNESS, DAMPING = 0.6, 0.04  # N m/rad, N m s/rad


def policy(observation: dict[str, np.ndarray]) -> np.ndarray:
    """Return the torque of a spring to the goal and a damper, N m."""
    away = hbot.gym.turn(observation["goal"], observation["q"])
    torque: np.ndarray = STIFFNESS * away - DAMPING * observation["omega"]
    return torque


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--episodes", type=int, default=3)
    options = parser.parse_args()
    with hbot.one_line_errors():
        env = gymnasium.make("Hbot-v0", every=10, tolerance=0.1, max_episode_steps=300)
        for episode in range(options.episodes):
            observation, _ = env.reset(seed=episode)
            over, steps, total = False, 0, 0.0
            while not over:
                observation, reward, there, late, _ = env.step(policy(observation))
                over, steps, total = there or late, steps + 1, total + float(reward)
            print(
                f"goal {episode}: {'reached' if there else 'missed'} in {steps} steps, {total:.1f}"
            )
        env.close()
