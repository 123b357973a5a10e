"""Connects an Hbot to ROS 2. Needs the extra `ros2`, or a ROS installation that is sourced.

    python -m hbot.ros2 127.0.0.1:4268 --command --scene spring
    python -m hbot.ros2.bag run.mcap bag

The first publishes the rig as the node `hbot` and takes commands, the second makes a bag of a
recording. docs/ros2.md lists topics, frames and stamps.
"""
