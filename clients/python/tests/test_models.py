"""Local models: what is sent, what the server makes of them, and what it refuses."""

import asyncio
import math

import pytest
from serving import Server

import hbot

NOTHING = {"name": "Nothing", "effect": []}


def test_a_model_is_rendered_and_its_stiffness_softened_or_refused(server: Server) -> None:
    with hbot.connect(server.address) as rig, rig.lease():
        rig.load_scene(NOTHING)
        rig.enable()
        wall = hbot.Plane((0.0, 0.0, 1.0), 0.1, stiffness=1.0, damping=0.02)
        whole = rig.model(
            500,
            torque=(0.0, 0.0, 0.01),
            stiffness=0.5,
            damping=[0.02] * 3,
            pose=(1, 0, 0, 0),
            planes=[wall],
            blend_ms=5,
            seq=7,
        )
        assert whole == 1.0
        states = rig.states(every=1, duration=5.0)
        assert any(state.client is not None and state.client.seq == 7 for state in states)
        render = rig.info.render
        assert render is not None
        stiff = 2.0 * render.stiffness_stable
        with pytest.raises(hbot.OutOfRange, match="soften"):
            rig.model(100, stiffness=stiff, damping=render.damping)
        softer = rig.model(100, stiffness=stiff, damping=render.damping, soften=True)
        assert softer is not None
        assert 0.3 < softer < 0.5
        with pytest.raises(hbot.BadRequest, match="symmetric"):
            rig.model(100, stiffness=[[1, 1, 0], [0, 1, 0], [0, 0, 1]])
        with pytest.raises(ValueError, match="finite"):
            rig.model(100, torque=(math.nan, 0, 0))
        assert rig.model(100, wait=False) is None


def test_render_sends_models_and_asyncio_has_them_too(server: Server) -> None:
    with hbot.connect(server.address) as rig, rig.lease():
        rig.load_scene(NOTHING)
        rig.enable()
        model = hbot.Model(stiffness=1.0, damping=0.02)
        done = rig.render(lambda _state: model, every=10, valid_ms=50, duration=0.5)
        assert done.calls > 5
        assert done.refused == 0

    async def feel() -> float | None:
        async with hbot.aio.connect(server.address) as rig, rig.lease():
            await rig.enable()
            done = await rig.render(lambda _state: model, every=10, valid_ms=50, duration=0.3)
            assert done.refused == 0
            return await rig.model(50, stiffness=1.0, damping=0.02)

    assert asyncio.run(feel()) == 1.0


def test_eight_planes_with_all_digits_fit_into_a_message(server: Server) -> None:
    third = 1.0 / 3.0
    plane = hbot.Plane((third, -third, third), -third, third, third / 100)
    rows = [[third, 1e-3 * third, 0.0], [1e-3 * third, third, 0.0], [0.0, 0.0, third]]
    with hbot.connect(server.address) as rig, rig.lease():
        scale = rig.model(
            100,
            torque=(third, third, third),
            stiffness=rows,
            damping=[[third / 30, 0, 0], [0, third / 30, 0], [0, 0, third / 30]],
            pose=(third, third, third, third),
            planes=[plane] * 8,
            blend_ms=20,
            soften=True,
            seq=2**53,
        )
        assert scale is not None
