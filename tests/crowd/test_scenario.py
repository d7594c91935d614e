"""What a scenario file may say and how it arrives: defaults, units, aliases, overrides, schema."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import crowd.scenario as scenario
from crowd.errors import InputError
from crowd.scenario_ground import HeightMap, Ramp
from crowd.scenario_herd import Grid, Places
from crowd.scenario_types import Model
from crowd.scenario_world import FluidRegion
from crowd.scenario_yaml import key_text, read_text

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
SCENARIOS = sorted(path for path in CONFIGS.glob("*.yaml") if not path.name.startswith(("fluids", "tune_")))
EDITOR_LINE = "# yaml-language-server: $schema=schema/scenario.json"

MINIMAL = """
name: small
duration_s: 2
herds:
- name: people
  archetype: human
  count: 3
  place: {kind: grid, spacing_m: 1}
  speed_m_s: 1.3
"""


def load(tmp_path: Path, text: str, *overrides: str) -> scenario.Scenario:
    path = tmp_path / "scene.yaml"
    path.write_text(text)
    return scenario.load(path, overrides)


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_config_is_valid_and_points_its_editor_at_the_schema(path: Path) -> None:
    loaded = scenario.load(path)
    assert loaded.name == path.stem
    assert path.read_text().splitlines()[0] == EDITOR_LINE
    assert f"`{path.name}`" in (CONFIGS / "README.md").read_text()


def test_wade_is_a_mixed_crowd_of_ten_seconds() -> None:
    loaded = scenario.load(CONFIGS / "wade.yaml")
    assert loaded.character_count >= 256
    assert len({herd.archetype for herd in loaded.herds}) >= 2
    assert loaded.frame_count >= 10 * loaded.rate_hz
    assert loaded.rate_hz == 60


def test_committed_schema_is_the_models() -> None:
    committed = json.loads((CONFIGS / "schema" / "scenario.json").read_text())
    assert committed == scenario.schema(), "crowd schema --out configs/schema/scenario.json"


def test_defaults(tmp_path: Path) -> None:
    loaded = load(tmp_path, MINIMAL)
    assert (loaded.rate_hz, loaded.seed, loaded.gait, loaded.schedule) == (60, 0, "semi_procedural", "mixed")
    assert (loaded.drag.mesh, loaded.drag.submersion, loaded.drag.b_mode) == ("skinned", "clipped", "area")
    assert loaded.frame_count == 120
    assert loaded.character_count == 3
    assert loaded.herds[0].arms_up
    assert loaded.folder == tmp_path
    assert loaded.where("herds", 0, "count") == "scene.yaml:7 herds[0].count"
    assert loaded.where("drag", "mesh") == "scene.yaml:2 drag.mesh"


def test_name_left_out_is_the_files(tmp_path: Path) -> None:
    assert load(tmp_path, MINIMAL.replace("name: small\n", "", 1)).name == "scene"


def test_mapping_with_numpy_values_loads_like_yaml() -> None:
    loaded = scenario.load(
        {
            "name": "from_python",
            "frames": np.int64(30),
            "herds": [
                {
                    "name": "people",
                    "archetype": "human",
                    "count": 2,
                    "place": {"kind": "list", "points_m": np.array([[0.0, 1.0], [2.0, 3.0]])},
                    "velocity_m_s": (0.0, np.float32(1.0)),
                }
            ],
        }
    )
    assert loaded.frame_count == 30
    place = loaded.herds[0].place
    assert isinstance(place, Places)
    assert place.points_m == ((0.0, 1.0), (2.0, 3.0))
    assert loaded.path is None


def test_units_in_keys_are_converted(tmp_path: Path) -> None:
    text = MINIMAL.replace("spacing_m: 1", "spacing_cm: 120, center_mm: [500, -250]") + "  heading_rad: 0.5\n"
    text += "world:\n  fluids:\n  - {fluid: water, surface_cm: 30, area_m: {x: [0, 1], z: [0, 1]}}\n"
    loaded = load(tmp_path, text)
    place = loaded.herds[0].place
    assert isinstance(place, Grid)
    assert place.spacing_m == pytest.approx(1.2)
    assert place.center_m == pytest.approx((0.5, -0.25))
    assert loaded.herds[0].heading_deg == pytest.approx(28.6478898)
    assert loaded.world.fluids[0].surface_m == pytest.approx(0.3)


def test_anchors_aliases_and_merges(tmp_path: Path) -> None:
    text = """
name: anchors
frames: 10
herds:
- &people
  name: a
  archetype: human
  count: 1
  place: {kind: grid, spacing_m: 1}
  speed_m_s: 1
- <<: *people
  name: b
  count: 2
"""
    assert [(herd.name, herd.count) for herd in load(tmp_path, text).herds] == [("a", 1), ("b", 2)]


def test_events_grounds_and_pictures(tmp_path: Path) -> None:
    text = (
        MINIMAL
        + """
world:
  ground: {kind: ramp, start_m: 1, end_m: 3, drop_m: 0.5}
events:
- {at_s: 1, herds: [people], characters: [0, 2], impulse_n_s: [150, 0, 0], frame: character}
- {at_s: 1.5, velocity_m_s: [0, 1]}
pictures: null
"""
    )
    loaded = load(tmp_path, text)
    assert isinstance(loaded.world.ground, Ramp)
    assert loaded.events[0].characters == (0, 2)
    assert loaded.events[1].characters == "all"
    assert loaded.events[1].herds is None
    assert loaded.pictures is None


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        (["herds[0].count=10"], 10),
        (["herds.people.count=11"], 11),
        (["count=12"], 12),
        (["herds[0].count=1", "herds.people.count=13"], 13),
    ],
)
def test_override_by_number_by_name_and_by_key(tmp_path: Path, overrides: list[str], expected: int) -> None:
    assert load(tmp_path, MINIMAL, *overrides).herds[0].count == expected


def test_override_of_absent_mappings_and_exclusive_keys(tmp_path: Path) -> None:
    loaded = load(tmp_path, MINIMAL, "drag.mesh=rigid", "frames=7", "velocity_m_s=[0.5, 0]", "herds.people.rig={}")
    assert loaded.drag.mesh == "rigid"
    assert (loaded.frames, loaded.duration_s) == (7, None)
    assert (loaded.herds[0].velocity_m_s, loaded.herds[0].speed_m_s) == ((0.5, 0.0), None)
    assert loaded.herds[0].rig == {}


def test_override_sets_a_key_in_every_herd() -> None:
    loaded = scenario.load(CONFIGS / "wade.yaml", ["archetype=hexapod", "arms_up=false"])
    assert [(herd.archetype, herd.arms_up) for herd in loaded.herds] == [("hexapod", False)] * 2


def test_run_cut_short_by_override_drops_later_events() -> None:
    assert scenario.load(CONFIGS / "push.yaml", ["duration_s=1"]).duration_s == 1.0


def test_override_is_named_as_the_place_of_a_problem(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"--set herds.people.count=-1 \(herds\[0\].count\): -1: must be greater"):
        load(tmp_path, MINIMAL, "herds.people.count=-1")


def test_loading_does_not_change_the_callers_mapping() -> None:
    mapping = read_text(MINIMAL, "x").data
    before = json.dumps(mapping)
    scenario.load(mapping, ["frames=3", "count=5"])
    assert json.dumps(mapping) == before


def test_fitted_fluid_constants() -> None:
    table = scenario.load(CONFIGS / "wade.yaml").fluid_table
    found = {name: table.fluid(FluidRegion(fluid=name, surface_m=0.0)) for name in ("water", "mud", "goo")}
    assert found["water"].drag_coefficient == pytest.approx(1.08, abs=0.005)
    for name, force in (("water", 0.572), ("mud", 47.6), ("goo", 553.0)):
        assert found[name].offset_force_n == pytest.approx(force, rel=0.01)


def test_fluid_constants_can_be_given(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text(
        "base_drag: {a: 2, b: 0, c: 0}\noffset_force_n: {a: 0, b: 1, c: 0}\n"
        "fluids:\n  soup: {density_kg_m3: 1200, drag_coefficient: 3.5}\n"
    )
    text = MINIMAL + "fluids: mine.yaml\nworld: {fluids: [{fluid: soup, surface_m: 0.2}]}\n"
    loaded = load(tmp_path, text)
    soup = loaded.fluid_table.fluid(loaded.world.fluids[0])
    assert (soup.density_kg_m3, soup.drag_coefficient, soup.offset_force_n) == (1200, 3.5, 0.0)
    plain = loaded.fluid_table.fluid(FluidRegion(density_kg_m3=900.0, surface_m=0.0))
    assert plain.drag_coefficient == pytest.approx(1.0)  # 2 / (1 + exp(0))


def test_every_key_with_a_length_has_its_unit_in_the_schema() -> None:
    body = scenario.schema()
    ramp = body["$defs"]["Ramp"]
    assert {"start_m", "start_cm", "start_mm"} <= set(ramp["properties"])
    assert {"required": ["start_m"]} in ramp["allOf"][0]["oneOf"]
    assert body["$defs"]["Herd"]["allOf"][-1]["oneOf"][0] == {"required": ["speed_m_s"]}


def test_models_forbid_unknown_keys_and_changes() -> None:
    ground = HeightMap(kind="heightmap", file="x.png")
    assert isinstance(ground, Model)
    with pytest.raises(ValueError, match="frozen"):
        ground.file = "y.png"
    with pytest.raises(ValueError, match="Extra inputs"):
        HeightMap.model_validate({"kind": "heightmap", "file": "x.png", "fiel": 1})


def test_key_text() -> None:
    assert key_text(("herds", 0, "place", "points_m", 3, 1)) == "herds[0].place.points_m[3][1]"
