"""The server's answers to requests (docs/api.md, "Ops", "stats" and "controllers")."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from .events import Effect


@dataclass(frozen=True, slots=True)
class Loaded:
    """The answer to `load_scene`."""

    effects: tuple[Effect, ...]
    """Effects of the scene with their cost."""
    ignored: tuple[str, ...]
    """Phenomena in the scene that a real rig ignores."""
    warnings: tuple[str, ...] = ()
    """In words: what the rig cannot make or keep stable, what has no effect in the scene, and what
    the simulated rig keeps of an earlier scene."""


@dataclass(frozen=True, slots=True)
class Changed:
    """The answer to `set`."""

    warnings: tuple[str, ...] = ()
    """In words: what the rig cannot make of the changed scene or keep stable, and what has no
    effect in it."""


class Difference(float):
    """The answer to `align` and `align_direction`: the angle before the correction, rad."""

    used: bool = True
    """False if the measurement corrects nothing: the filter has ignored it."""

    @classmethod
    def of(cls, body: Any) -> Difference:
        """Return what an answer says."""
        made = cls(body["angle"])
        made.used = body.get("used", True)
        return made


@dataclass(frozen=True, slots=True)
class Pong:
    """The answer to `ping`."""

    data: Any
    """The data of the request."""
    tick: int
    """Number of the last tick."""
    t: float
    """Time of the last tick since the loop began, s."""


@dataclass(frozen=True, slots=True)
class Controller:
    """What the motor controller of one joint reports about itself.

    A field is None if it is not reported or not known.
    """

    joint: int
    """Number of the joint, from 0: its place in the joints of a state."""
    port: str | None = None
    """Port that leads to the controller."""
    protocol: str | None = None
    """Protocol, as the rig file names it."""
    id: int | None = None
    """Id on its line. None also if the protocol has no ids."""
    firmware: str | None = None
    """Name and version of the firmware."""
    current_a: float | None = None
    """Motor current that makes torque, A. Positive drives the joint in its positive direction."""
    temperature_c: float | None = None
    """The highest temperature that it reports, of the motor or of the power stage, °C."""
    flags: tuple[str, ...] = ()
    """What it complains of now, such as `overtemperature`."""


@dataclass(frozen=True, slots=True)
class Controllers:
    """The answer to `controllers`."""

    controllers: tuple[Controller, ...]
    """The motor controller of each joint, in the order of a state's joints."""


@dataclass(frozen=True, slots=True)
class Distribution:
    """Percentiles of measured times, us."""

    p50: float
    """Median, us."""
    p90: float
    """90 % of the times are at most this long, us."""
    p99: float
    """99 %, us."""
    p99_9: float
    """99.9 %, us."""
    p99_99: float
    """99.99 %, us."""
    max: float
    """Longest time, us."""
    count: int
    """Number of measured times."""


@dataclass(frozen=True, slots=True)
class Stats:
    """How long things took, and how often events happened, since the server began."""

    ticks: int
    """Ticks whose samples the service has received."""
    awake_us: Distribution
    """Time that the loop was awake before a deadline, us."""
    lateness_us: Distribution
    """From the deadline to the start of a tick, us."""
    compute_us: Distribution
    """Computing time of a tick, us."""
    link_us: Distribution
    """Time spent on the serial line in a tick, us."""
    age_us: Distribution
    """From the sampling of the joints until the torque computed from it was sent, us."""
    late_ticks: int
    """Ticks that started more than a quarter period late."""
    skipped_ticks: int
    """Ticks whose deadline passed before the tick before them ended."""
    missed_ticks: int
    """Ticks without a new reading."""
    corrupt_frames: int
    """Damaged frames on the serial line."""
    foreign_frames: int
    """Intact frames on the serial line that were not for this rig."""
    send_failures: int
    """Commands that the serial line did not take completely."""
    reopened_ports: int
    """How often a lost serial line came back."""
    dropped_samples: int
    """Samples that the service did not fetch in time."""
    dropped_states: int
    """States that were not sent because their reader was slow."""
    faults: dict[str, int]
    """Number of faults by cause."""
    estops: int
    """Number of emergency stops."""
    requests: int
    """Requests that were read."""
    refused: dict[str, int]
    """Refused requests by error code."""
    refused_streams: int
    """Refused requests that were stream messages."""
    connections: int
    """Connections that were accepted."""
    connections_turned_away: int
    """Connections refused because too many were open."""
    handshakes_failed: int
    """Connections whose TLS handshake failed."""
    connections_cut: int
    """Connections closed because the client did not read."""
    flight_logs: int
    """Flight logs written."""
    flight_logs_failed: int
    """Flight logs that could not be written."""
    recorded_ticks: int = 0
    """Ticks that were written to recordings."""
    unrecorded_ticks: int = 0
    """Ticks that are missing in recordings."""
    recordings_failed: int = 0
    """Recordings that could not be written to their end."""
    dropped_live: int = 0
    """Messages that slow live viewers did not get."""
