"""Vectors add and scale, and are tuples."""

from __future__ import annotations

import json

import pytest

from hbot import Vector
from hbot.axes import Axes


def test_a_vector_adds_and_scales_and_is_a_tuple() -> None:
    a = Vector((1.0, 2.0, 3.0))
    assert -0.01 * a == (-0.01, -0.02, -0.03) == a * -0.01
    ones, listed = (1, 1, 1), [1, 1, 1]
    assert a + ones == (2.0, 3.0, 4.0) == listed + a == ones + a
    assert a - listed == (0.0, 1.0, 2.0)
    assert ones - a == (0.0, -1.0, -2.0)
    assert 2 * a / 2 == +a
    assert a.norm() == 14**0.5
    assert a.dot((1, 0, 2)) == 7.0
    assert Vector((1, 0, 0)).cross((0, 1, 0)) == (0, 0, 1)
    assert isinstance(a, tuple)
    assert repr(a) == "(1.0, 2.0, 3.0)"
    x, y, z = a
    assert json.loads(json.dumps(a)) == [x, y, z]
    assert hash(a) == hash((1.0, 2.0, 3.0))


def test_what_is_no_vector_is_refused() -> None:
    with pytest.raises(ValueError, match="2 numbers"):
        Vector((1.0, 2.0))
    a = Vector((1.0, 2.0, 3.0))
    with pytest.raises(TypeError):
        a * a
    short = (1.0, 2.0)
    with pytest.raises(ValueError, match="unpack"):
        a + short
    with pytest.raises(TypeError):
        a + 1.0


def test_arrays_and_vectors_make_arrays() -> None:
    numpy = pytest.importorskip("numpy")
    a = Vector((1.0, 2.0, 3.0))
    ones = numpy.ones(3)
    for total in (a + ones, ones + a):
        assert isinstance(total, numpy.ndarray)
        assert total.tolist() == [2.0, 3.0, 4.0]
    assert (numpy.eye(3) @ a).tolist() == list(a)
    assert tuple(numpy.float64(2) * a) == (2.0, 4.0, 6.0) == a * numpy.float64(2)


def test_converted_axes_are_vectors() -> None:
    assert Axes.ROS.axial_to_n(2.0 * Axes.ROS.axial((1, 2, 3))) == (2.0, 4.0, 6.0)
