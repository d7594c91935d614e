"""Bad scenarios: each is refused with one clear message per problem that names the file, the line and the key."""

from __future__ import annotations

from pathlib import Path

import pytest

from crowd.errors import InputError
from crowd.scenario import load
from tests.crowd.bad_scenarios import GOOD, TABLE, Bad


def refused(path: Path, *overrides: str) -> str:
    with pytest.raises(InputError) as caught:
        load(path, overrides)
    return str(caught.value)


@pytest.mark.parametrize("bad", TABLE, ids=lambda bad: bad.id)
def test_bad_scenario(bad: Bad, tmp_path: Path) -> None:
    text = bad.new if bad.old is None else GOOD.replace(bad.old, bad.new, 1)
    assert bad.old is None or bad.old in GOOD
    path = tmp_path / "scene.yaml"
    path.write_text(text)
    message = refused(path)
    for part in bad.says:
        assert part in message
    assert all(line.startswith("scene.yaml") or str(path) in line for line in message.splitlines())
    assert list(tmp_path.iterdir()) == [path]


def test_the_good_one_is_good(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(GOOD)
    assert load(path).character_count == 3


def test_every_problem_at_once_in_the_order_of_lines(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text("nam: x\n" + GOOD.replace("count: 3", "count: -1").replace("human", "humann") + "seed: -1\n")
    lines = refused(path).splitlines()
    assert [line.split(" ")[0] for line in lines] == [f"scene.yaml:{number}" for number in (1, 6, 7, 10)]


def test_missing_file_names_the_nearest_scenario(tmp_path: Path) -> None:
    assert "no such file (did you mean 'wade'?)" in refused(tmp_path / "wad.yaml")


def test_folder_and_binary_file(tmp_path: Path) -> None:
    assert "is a folder" in refused(tmp_path)
    binary = tmp_path / "binary.yaml"
    binary.write_bytes(bytes(range(256)) * 10)
    assert "binary.yaml: not UTF-8 text" in refused(binary)


@pytest.mark.parametrize(
    ("override", "says"),
    [
        ("count", "must be key.path=value"),
        ("=3", "must be key.path=value"),
        ("herds[x].count=3", "must be key.path=value"),
        ("herds[7].count=3", "herds has 1 items; there is no [7]"),
        ("herds.peple.count=3", "herds has no 'peple' (did you mean 'people'?)"),
        ("herds.people.cuont=3", "unknown key 'cuont' (did you mean 'count'?)"),
        ("name.first=x", "neither a mapping nor a list"),
        ("sped=3", "no key 'sped'"),
        ("duration_s=[1", "not valid YAML"),
        ("kind=grid", "is in several places"),
    ],
)
def test_bad_override(override: str, says: str, tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(GOOD + "world: {ground: {kind: flat}}\n")
    message = refused(path, override)
    assert f"--set {override}" in message
    assert says in message


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "table of fluids is a mapping"),
        (
            "base_drag: {a: 1, b: 1}\noffset_force_n: {a: 1, b: 1, c: 1}\nfluids: {}\n",
            "mine.yaml:1 base_drag.c: missing",
        ),
        ("base_drag: {a: 1, b: 1, c: 0}\noffset_force_n: {a: 1, b: 1, c: 1}\nfluids: {}\n", "mine.yaml:3 fluids"),
        (
            "base_drag: {a: 1, b: 1, c: 0}\noffset_force_n: {a: 1, b: 1, c: 1}\nfluids: {x: {density: 3}}\n",
            "mine.yaml:3 fluids.x.density: unknown key 'density' (did you mean 'density_kg_m3'?",
        ),
    ],
)
def test_bad_fluid_table(text: str, says: str, tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text(text)
    path = tmp_path / "scene.yaml"
    path.write_text(GOOD + "fluids: mine.yaml\n")
    assert says in refused(path)
