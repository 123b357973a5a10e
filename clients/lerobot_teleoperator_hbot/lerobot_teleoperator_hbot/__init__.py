"""An Hbot as a teleoperator of LeRobot."""

from .teleoperator import Hbot, HbotConfig

__all__ = ["Hbot", "HbotConfig"]
