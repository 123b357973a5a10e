"""The program `python -m hbot.ros2`."""

from ..program import one_line_errors

if __name__ == "__main__":
    with one_line_errors():  # Also if a package of ROS is missing.
        from .node import main

        main()
