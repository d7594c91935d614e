"""Scenario model of a belt: a small, densely modelled detail at the front of a body."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from crowd.scenario_types import Model


class Belt(Model):
    """A patch of many small triangles at the front of the trunk just under the hips, facing forward."""

    triangles: Annotated[int, Field(strict=True, ge=2, le=20_000, multiple_of=2)] = 2000
    """Two for each small rectangle."""
    area_m2: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=1e-6, le=0.1)] | None = None
    """Left out: 17.5 cm2 for a person, for others by the square of the hips' height."""
