"""Scenario model of a herd's level of detail: what drag and steps may leave out, and what has to hold."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field

from crowd.scenario_types import Model, Point, Positive
from crowd.scenario_yaml import KeyPath

if TYPE_CHECKING:
    from crowd.scenario_herd import Herd

SLOWEST_HZ = 15  # steps per second, as of a scenario's rate


class Detail(Model):
    """Less work for characters that need not be exact; `crowd check` tells what it costs (docs/detail.md)."""

    at_least_one: ClassVar[tuple[tuple[str, ...], ...]] = (("triangles", "mesh", "every"),)

    triangles: Annotated[int, Field(strict=True, ge=40, le=100_000)] | None = None
    """The fluid drags on a mesh of about so many; pictures keep the skin. Left out: on the whole skin."""
    mesh: Literal["skinned", "rigid"] | None = None
    """As `drag.mesh`, for this herd; left out: as that says."""
    every: Annotated[int, Field(strict=True, ge=1, le=16)] = 1
    """Characters are stepped every so many frames, a step as long as all of them; frames between are interpolated."""
    far_m: Positive | None = None
    """Only tiles of 128 characters that are all further than this from `from_m`; others are stepped every frame."""
    from_m: Point | None = None
    """Where one looks from, (x, z) in the world."""
    calm_m_s2: Positive | None = None
    """Only tiles of which no character's velocity changes faster than this, and that no event is about to meet."""


Found = Iterator[tuple[KeyPath, str]]


def detail_problems(herds: Mapping[int, Herd], rate: int | None, water: bool) -> Found:
    """Problems of levels of detail, by key path. rate: steps per second; water: whether there is a `world.water`."""
    for index, herd in herds.items():
        detail, path = herd.detail, ("herds", index, "detail")
        if detail is None:
            continue
        if detail.triangles is not None and herd.belt is not False:
            yield (*path, "triangles"), f"{detail.triangles}: a belt is all triangles; leave one of the two out"
        if rate is not None and rate < SLOWEST_HZ * detail.every:
            most = max(1, rate // SLOWEST_HZ)
            text = f"{detail.every}: of {rate} frames per second; at least {SLOWEST_HZ} steps are needed"
            yield (*path, "every"), f"{text} (at most {most})"
        if water and detail.every > 1:
            yield (*path, "every"), f"{detail.every}: characters meet in `world.water` every frame; leave one out"
        for one, other in (("far_m", "from_m"), ("from_m", "far_m")):
            if getattr(detail, one) is not None and getattr(detail, other) is None:
                yield (*path, one), f"'{other}' is needed too: how far, and from where"
        for key in ("far_m", "calm_m_s2"):
            if getattr(detail, key) is not None and detail.every == 1:
                yield (*path, key), "says which characters `every` slows down; give `every: 2` or more"
