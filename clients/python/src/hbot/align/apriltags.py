"""AprilTags on the sphere, seen by a calibrated camera. Needs the extra `align`.

A layout says where the tags are:

    family = "tag36h11"          # of the tags; this is also the default
    radius = 0.102               # distance of a tag's centre from that of the sphere, m

    [camera]
    focal = [610.2, 609.8]       # focal lengths, pixels
    centre = [318.9, 241.3]      # where the optical axis meets the picture, pixels
    right = [0, 1, 0]            # directions of the picture's right and lower edge in frame N
    down = [0, 0, -1]

    [[tag]]
    id = 0
    size = 0.03                  # edge of the black square, m
    normal = [1, 0, 0]           # outward, in the sphere's axes
    up = [0, 0, 1]               # towards the upper edge of the tag, in the sphere's axes
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pupil_apriltags import Detector

from .. import turns
from ..errors import IllegalInput
from ..scenes import read_scene
from ..turns import Quaternion
from . import Measured

Matrix = NDArray[np.float64]

NOISE_PIXELS = 0.3
"""Usual error of the corner of a tag in a picture, pixels."""
FAR_PIXELS = 4.0
"""Error from which on a tag is left out, pixels: it is misread, or it has come off."""
STEPS = 12
"""Number of Gauss-Newton steps, of which five are usually enough."""
CORNERS = np.array([[-0.5, 0.5, 0.0], [0.5, 0.5, 0.0], [0.5, -0.5, 0.0], [-0.5, -0.5, 0.0]])
"""The corners of a tag in its own axes and edges, in the detector's order."""


@dataclass(frozen=True)
class Tag:
    """A tag on the sphere."""

    size: float
    """Edge of the black square, m."""
    axes: Matrix
    """The tag's axes in those of the sphere, as columns: right, down, into the sphere."""
    corners: Matrix
    """Its corners in the sphere's axes, m, one row each."""


class Layout:
    """The camera, and the tags on the sphere."""

    def __init__(self, table: Mapping[str, Any]) -> None:
        """Read the tables of a layout.

        Raises:
            IllegalInput: something is missing or wrong.
        """
        try:
            camera = table["camera"]
            self.family = str(table.get("family", "tag36h11"))
            self.camera = (*map(float, camera["focal"]), *map(float, camera["centre"]))
            self.axes = _axes(camera["right"], camera["down"])
            radius = float(table["radius"])
            self.tags = {int(tag["id"]): _tag(tag, radius) for tag in table["tag"]}
        except (KeyError, TypeError, ValueError) as error:
            raise IllegalInput(
                f"a layout of tags needs {error}: see hbot.align.apriltags"
            ) from None
        if len(self.camera) != 4:
            raise IllegalInput("camera.focal and camera.centre: 2 numbers each")

    @staticmethod
    def read(path: Path) -> Layout:
        """Return the layout in a file.

        Raises:
            OSError: the file cannot be read.
            IllegalInput: the file is no layout.
        """
        # A scene file is the same kind of document.
        return Layout(read_scene(path))


class AprilTags:
    """Finds the orientation of the sphere in pictures."""

    def __init__(self, layout: Layout, delay: float = 0.0) -> None:
        """Prepare the detector.

        Args:
            layout: the camera and the tags.
            delay: time from the exposure of a picture to its arrival, s.
        """
        self._layout = layout
        self._delay = delay
        self._detector = Detector(families=layout.family, quad_decimate=1.0)
        # At its end the library would free the family before the detector that still uses it, which
        # can abort the program (pupil-labs/apriltags, issue 46). So the family is never freed.
        self._detector.tag_families.clear()

    def measure(self, picture: NDArray[np.uint8]) -> Measured | None:
        """Return the orientation in a grey picture, rows by columns. None: no tag is seen."""
        tags, corners = [], []
        turn, centre, least = np.eye(3), np.zeros(3), math.inf
        for size in {tag.size for tag in self._layout.tags.values()}:
            for seen in self._detector.detect(
                picture, estimate_tag_pose=True, camera_params=self._layout.camera, tag_size=size
            ):
                tag = self._layout.tags.get(seen.tag_id)
                if tag is None or tag.size != size:
                    continue
                tags.append(tag)
                corners.append(seen.corners)
                # The fit begins at the tag whose pose explains its corners best.
                if seen.pose_err < least:
                    least, turn = seen.pose_err, seen.pose_R @ tag.axes.T
                    centre = seen.pose_t[:, 0] - turn @ tag.corners.mean(axis=0)
        while tags:
            pose = self._fitted(tags, corners, turn, centre)
            if pose is None:
                return None
            turn, centre, covariance, errors = pose
            worst = int(np.argmax(errors))
            if errors[worst] < FAR_PIXELS:
                in_n = self._layout.axes
                variances = np.diag(in_n @ covariance @ in_n.T)
                x, y, z = np.sqrt(variances).tolist()
                return Measured(quaternion(in_n @ turn), (x, y, z), self._delay)
            del tags[worst], corners[worst]
        return None

    def _fitted(
        self, tags: list[Tag], seen: list[Matrix], turn: Matrix, centre: Matrix
    ) -> tuple[Matrix, Matrix, Matrix, Matrix] | None:
        """Return the pose of the sphere that explains all corners best, by least squares.

        Returns:
            Its orientation and its centre in the camera's axes, the covariance of the orientation,
            rad², and the largest error of each tag, pixels. None: the corners show no pose.
        """
        places, wanted = np.vstack([tag.corners for tag in tags]), np.vstack(seen)
        fx, fy, cx, cy = self._layout.camera
        for _ in range(STEPS):
            arms = places @ turn.T
            x, y, z = (arms + centre).T
            if not np.all(z > 1e-3):
                return None
            off = np.column_stack([fx * x / z + cx, fy * y / z + cy]) - wanted
            # How the pixels move with the point, and the point with a turn and a shift.
            by_point = np.zeros((len(places), 2, 3))
            by_point[:, 0, 0], by_point[:, 0, 2] = fx / z, -fx * x / z**2
            by_point[:, 1, 1], by_point[:, 1, 2] = fy / z, -fy * y / z**2
            crossed = np.cross(arms[:, None, :], by_point)
            slope = np.concatenate([crossed, by_point], axis=2).reshape(-1, 6)
            normal = slope.T @ slope
            if not np.linalg.cond(normal) < 1e15:
                return None
            change = np.linalg.solve(normal, slope.T @ off.ravel())
            turn, centre = _turned(-change[:3]) @ turn, centre - change[3:]
        covariance = NOISE_PIXELS**2 * np.linalg.inv(normal)[:3, :3]
        errors = np.hypot(off[:, 0], off[:, 1]).reshape(-1, 4).max(axis=1)
        return turn, centre, covariance, errors


def _turned(turn: Matrix) -> Matrix:
    """Return the rotation matrix of a rotation vector."""
    w, x, y, z = turns.exp(turn.tolist())
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion(turn: Matrix) -> Quaternion:
    """Return the quaternion (w, x, y, z) of a rotation matrix."""
    # The column of the largest element of the matrix 4 q q^T is 4 q times this element.
    t = turn
    k = np.array(
        [
            [1 + t[0, 0] + t[1, 1] + t[2, 2], 0, 0, 0],
            [t[2, 1] - t[1, 2], 1 + t[0, 0] - t[1, 1] - t[2, 2], 0, 0],
            [t[0, 2] - t[2, 0], t[1, 0] + t[0, 1], 1 - t[0, 0] + t[1, 1] - t[2, 2], 0],
            [
                t[1, 0] - t[0, 1],
                t[2, 0] + t[0, 2],
                t[2, 1] + t[1, 2],
                1 - t[0, 0] - t[1, 1] + t[2, 2],
            ],
        ]
    )
    k = k + np.tril(k, -1).T
    column = k[:, int(np.argmax(np.diag(k)))]
    w, x, y, z = (column / np.linalg.norm(column)).tolist()
    return (w, x, y, z)


def _axes(right: Any, down: Any) -> Matrix:
    """Return the axes right, down and forward as columns. `right` gives way where they differ."""
    y = np.asarray(down, dtype=float)
    x = np.asarray(right, dtype=float)
    if x.shape != (3,) or y.shape != (3,) or not np.linalg.norm(np.cross(x, y)) > 1e-6:
        raise ValueError("directions of 3 numbers that are not parallel")
    y = y / np.linalg.norm(y)
    x = x - y * (x @ y)
    x = x / np.linalg.norm(x)
    return np.column_stack([x, y, np.cross(x, y)])


def _tag(table: Mapping[str, Any], radius: float) -> Tag:
    inward = -np.asarray(table["normal"], dtype=float)
    down = -np.asarray(table["up"], dtype=float)
    # A normal is easier to measure than a direction on the sphere, so `up` gives way.
    axes = _axes(down, inward)
    axes = np.column_stack([np.cross(axes[:, 0], axes[:, 1]), axes[:, 0], axes[:, 1]])
    size = float(table["size"])
    return Tag(size, axes, size * CORNERS @ axes.T - radius * axes[:, 2])
