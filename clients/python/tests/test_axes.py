"""The conversions of axes agree with docs/axes.md, and with each other."""

from __future__ import annotations

import re
from collections.abc import Sequence

import pytest
from serving import REPOSITORY

from hbot.axes import Axes

PAGE = (REPOSITORY / "docs" / "axes.md").read_text(encoding="utf-8")
VECTORS = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.3, -0.5, 0.7)]
TURNS = [(0.5**0.5, 0.0, 0.0, 0.5**0.5), (0.5, 0.5, -0.5, 0.5), (0.8, 0.0, 0.6, 0.0)]


def row(heading: str, program: str) -> list[str]:
    """Return the cells of a program in the table under a heading."""
    section = PAGE.split(f"\n## {heading}\n")[1].split("\n## ")[0]
    (line,) = (line for line in section.splitlines() if line.lower().startswith(f"| {program} |"))
    return [cell.strip() for cell in line.strip("|").split("|")]


def by_the_page(cell: str, values: dict[str, float]) -> list[float]:
    """Compute a cell such as `-n2, n1, n3`."""
    return [
        -values[text[1:]] if text.startswith("-") else values[text] for text in cell.split(", ")
    ]


def turned(q: Sequence[float], v: Sequence[float]) -> list[float]:
    """Return `q v q*` for `(w, x, y, z)`, the formula of right- and left-handed axes alike."""
    w, u = q[0], q[1:]
    t = [2 * c for c in cross(u, v)]
    return [a + w * b + c for a, b, c in zip(v, t, cross(u, t), strict=True)]


def cross(a: Sequence[float], b: Sequence[float]) -> list[float]:
    return [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]


@pytest.mark.parametrize("axes", Axes)
def test_the_table_of_the_page(axes: Axes) -> None:
    cells = row("The table", axes.value)
    assert cells[7] == f"`{axes.value}`"
    for v in VECTORS:
        named = dict(zip(("n1", "n2", "n3"), v, strict=True))
        assert list(axes.vector(v)) == by_the_page(cells[4], named)
        assert list(axes.axial(v)) == by_the_page(cells[5], named)
    for q in TURNS:
        named = dict(zip(("w", "q1", "q2", "q3"), q, strict=True))
        assert list(axes.quaternion(q)) == by_the_page(cells[6], named)


@pytest.mark.parametrize("axes", Axes)
def test_the_known_vectors_of_the_page(axes: Axes) -> None:
    cells = row("Known vectors", axes.value)[1:]
    found = [axes.vector(VECTORS[0]), axes.vector(VECTORS[1]), axes.quaternion(TURNS[0])]
    for cell, numbers in zip(cells, found, strict=True):
        # The page has four digits.
        assert [float(text) for text in cell.split(", ")] == pytest.approx(numbers, abs=5e-5)


@pytest.mark.parametrize("axes", Axes)
def test_a_converted_quaternion_turns_converted_vectors(axes: Axes) -> None:
    for q in TURNS:
        there = axes.quaternion(q)
        scalar_first = there if axes is Axes.CHAI3D else (there[3], *there[:3])
        for v in VECTORS:
            # Rounding of a few products of numbers of about 1.
            expected = pytest.approx(axes.vector(turned(q, v)), abs=1e-15)
            assert turned(scalar_first, axes.vector(v)) == expected
        assert axes.quaternion_to_n(there) == q
    for v in VECTORS:
        assert axes.vector_to_n(axes.vector(v)) == v
        assert axes.axial_to_n(axes.axial(v)) == v


def test_the_functions_of_the_page_exist() -> None:
    cells = row("The functions", "python, `hbot.axes.axes`")
    names = re.findall(r"`([a-z_]+)`", "".join(cells[1:]))
    assert len(names) == 6
    assert all(callable(getattr(Axes, name)) for name in names)
