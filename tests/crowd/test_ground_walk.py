"""Notes about walks that leave a map or cross its gaps: one of each at most, none for what is fine."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from crowd.check import needs
from crowd.ground_walk import walk_notes
from crowd.scene import load
from tests.crowd.grounds import made

MAP = {"kind": "heightmap", "file": "map.npy", "cell_m": 1.0}  # 9 x 7 posts: x -4 to 4, z -3 to 3


def walk(*corners: tuple[float, float]) -> np.ndarray:
    return np.array([corners], float)


def test_walk_off_the_map(tmp_path: Path) -> None:
    ground = made(MAP, tmp_path)
    assert walk_notes(ground, {"people": walk((0, 0), (0, 2.9))}) == []
    (note,) = walk_notes(ground, {"dogs": walk((0, 0)), "people": walk((0, 0), (0, 9)), "cats": walk((9, 9))})
    for part in (
        "terrain smaller than the walk",
        "1 of 'people' go off map.npy",
        "[0.0, 9.0]",
        "x -4.0 to 4.0",
    ):
        assert part in note


def test_what_has_no_border_has_no_note(tmp_path: Path) -> None:
    far = {"people": walk((0, 0), (0, 900))}
    for kind in ("flat", "sines", "stairs", "bridge"):
        assert walk_notes(made(kind, tmp_path), far) == []
    assert "the rubble" in walk_notes(made("rubble", tmp_path), far)[0]


def test_walk_over_gaps(tmp_path: Path) -> None:
    heights = np.zeros((7, 9))
    heights[3, 6] = np.nan  # x -2, z 0
    np.save(tmp_path / "gap.npy", heights)
    ground = made(MAP | {"file": "gap.npy"}, tmp_path)
    assert walk_notes(ground, {"people": walk((3, 2), (-3, 2))}) == []
    (note,) = walk_notes(ground, {"people": walk((3, 0), (-3, 0)), "dogs": walk((3, 0), (-3, 0))})
    assert "'people' walk where gap.npy has no height (first at [-1." in note


def scenario(**herd: Any) -> dict[str, Any]:
    place = {"kind": "list", "points_m": [[0, 0], [1, 0]]}
    file = "package:matplotlib/mpl-data/sample_data/jacksboro_fault_dem.npz"
    ground = {"kind": "heightmap", "file": file, "cell_m": 0.05, "height_scale_m": 0.0}  # 20 m by 17 m
    herds = [{"name": "people", "archetype": "human", "count": 2, "place": place, **herd}]
    return {"name": "x", "duration_s": 10, "world": {"ground": ground}, "herds": herds}


def off(**herd: Any) -> bool:
    return any("terrain smaller than the walk" in note for note in needs(load(scenario(**herd))).notes)


def test_ways_of_every_kind() -> None:
    assert off(speed_m_s=1.3)
    assert not off(speed_m_s=0.8)
    assert not off(speed_m_s=1.3, heading_deg=0.0, place={"kind": "list", "points_m": [[0, -7], [1, -7]]})
    assert off(velocity_m_s=[1.2, 0.0])
    assert not off(velocity_m_s=[0.8, 0.0])
    assert off(waypoints={"points_m": [[0, 5], [9, 5], [12, 5]], "speed_m_s": 2.0})
    assert not off(waypoints={"points_m": [[0, 5], [9, 5]], "speed_m_s": 2.0})
    assert not off(waypoints={"points_m": [[0, 5], [9, 5], [12, 5]], "speed_m_s": 0.5})  # does not get that far
