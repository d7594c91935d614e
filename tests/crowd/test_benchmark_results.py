"""What benchmarks make of their results: comparison with earlier ones, limits of the machine, pictures, peers."""

from __future__ import annotations

import dataclasses
import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from rich.console import Console
from typer.testing import CliRunner

import crowd
from benchmarks import compare, peers, plots, roofline, table
from benchmarks.cases import Case, scenario
from benchmarks.figures import figures
from benchmarks.peaks import measure
from benchmarks.run import main
from benchmarks.sizes import sizes_of
from crowd.advance import one_frame
from crowd.build import build
from tests.crowd.operations import operations

MACHINE = {"cpu": "Abacus 3", "cores": 2, "jax": "0.10.2"}
SIZES = roofline.Sizes(
    archetype="human", count=2048, joints=22, legs=2, arms=2, leg_joints=6, arm_joints=8, triangles=424.0, blocks=30.0,
    vertices=388, influences=4, gaits=2, clips=3, moving=1,
)  # fmt: skip


def line(name: str, us: float, **more: Any) -> dict[str, Any]:
    base = {
        "kind": "case", "case": name, "us": us, "us_min": 0.9 * us, "us_max": 1.2 * us, "devices": 1,
        "characters": 2048, "mesh": "rigid", "water": True, "gait": "footsteps", "rubble": False,
        "compile_cold_s": 5.0, "temp_bytes_per_character": 2000.0, "machine": MACHINE,
    }  # fmt: skip
    return base | more


def printed(show: Callable[..., None], *arguments: Any) -> str:
    out = io.StringIO()
    show(*arguments, Console(width=160, file=out))
    return out.getvalue()


def test_comparison_has_the_cases_of_both() -> None:
    then = [line("a", 4.0), line("b", 1.0), line("d", 1.0, error="killed")]
    text = printed(compare.show, then, [line("a", 5.0, compile_cold_s=4.0), line("c", 1.0), line("d", 1.0)])
    (row,) = (row for row in text.splitlines() if "│" in row)
    assert [cell.strip() for cell in row.strip("│").split("│")] == [
        *("a", "4.00", "5.00", "1.25", "5.00", "4.00", "0.80", "2.00", "2.00", "1.00")
    ]
    assert "differ" not in text
    assert "no case is in both" in printed(compare.show, then, [line("c", 1.0)])


def test_figures_of_a_busy_machine_are_doubted() -> None:
    more = {"trace_s": 1.0, "compile_cpu_s": 5.0, "peak_rss_bytes": 1e9, "pinned_cores": [1]}
    for cpu, doubted in ((3.0, False), (2.0, True)):
        measured = [line("human-rigid-2048", 3.1, us_cpu=cpu, **more)]
        assert ("busy: not reliable" in printed(table.show, measured, figures(measured))) == doubted


def test_other_machines_are_told() -> None:
    text = printed(compare.show, [line("a", 4.0)], [line("a", 4.0, machine=MACHINE | {"cpu": "Pentium"})])
    assert "cpu: Abacus 3 then, Pentium now" in text and "cores" not in text


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (None, "No such file"),
        ("", "holds no results"),
        ("\n{", ":2: not JSON"),
        ("[1]", ":1: no line of results"),
        ('{"kind": "case"}', ":1: a case without a name"),
        ('{"kind": "case", "case": "a", "us": "fast"}', ":1: us: 'fast' is no number"),
        ('{"kind": "case", "case": "a", "us": 0}', ":1: us: 0 is no number above 0"),
        (b"\xff\xfe", "not text"),
    ],
)
def test_bad_files_are_refused_before_anything_is_measured(tmp_path: Path, text: Any, problem: str) -> None:
    path = tmp_path / "old.jsonl"
    if text is not None:
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(typer.BadParameter, match=problem.replace("(", r"\(")):
        main(compare=path, out=tmp_path / "new.jsonl")
    assert not (tmp_path / "new.jsonl").exists()


def test_a_bad_file_ends_with_two(tmp_path: Path) -> None:
    app = typer.Typer()
    app.command()(compare.main)
    result = CliRunner().invoke(app, [str(tmp_path / "old.jsonl"), str(tmp_path / "new.jsonl")])
    assert result.exit_code == 2 and result.exception.__class__ is SystemExit


@pytest.mark.parametrize(("archetype", "mesh"), [("human", "rigid"), ("spider", "skinned")])
def test_counts_by_hand_are_those_of_the_program(archetype: str, mesh: Any) -> None:
    """Every stage that matters, against its operations in the jaxpr, where triangles all count, padding too."""
    case = Case("counted", ((archetype, 64),), mesh=mesh)
    layout, assets, params, states = build(crowd.load(scenario(case)))
    plain = dataclasses.replace(layout, walls=False)
    found = operations(lambda states: one_frame(plain, assets, params, states), states)
    herd, own = layout.herds[0], assets.herds[0]
    slots = own.rigid_mesh.area.shape[1:3] if mesh == "rigid" else (0, 0)
    (sizes,) = sizes_of((layout, assets, params, states), case.herds, case.depth)
    triangles = slots[0] * slots[1] if mesh == "rigid" else len(herd.triangles.values)
    sizes = dataclasses.replace(sizes, triangles=triangles, blocks=slots[0])
    counted = roofline.flops(sizes, mesh, "footsteps")
    for stage in ("body", "gait", "pose", "feet", "arms", "skin", "drag"):
        program = found[f"vmap({stage})"] / 64
        assert counted[stage] / 1.3 <= program <= 1.3 * counted[stage], stage


def test_bytes_are_those_of_state_and_parameters() -> None:
    case = Case("counted", (("dog", 64),), mesh="skinned")
    layout, assets, params, states = build(crowd.load(scenario(case)))
    (sizes,) = sizes_of((layout, assets, params, states), case.herds, case.depth)
    held = {"state": 0.0, "character": 0.0}
    import jax

    for name, tree in (("state", states), ("character", params.characters)):
        held[name] = sum(leaf.nbytes for leaf in jax.tree.leaves(tree)) / 64
    moved = roofline.moved(sizes, "skinned")
    assert sum(moved.values()) - moved["record"] == pytest.approx(2 * held["state"] + held["character"], rel=0.1)


def test_limits_of_a_case() -> None:
    peaks = {"kind": "peaks", "gflops": 100.0, "gbytes": 10.0}
    measured = line("human-rigid-2048", 4.0, sizes=[dataclasses.asdict(SIZES)])
    (roof,) = roofline.roofs([measured, peaks, line("gradient", 4.0)])
    flop = sum(roofline.flops(SIZES, "rigid", "footsteps").values())
    assert roof.flops == pytest.approx(flop) and roof.gflops == pytest.approx(flop / 4000)
    assert roof.limit_us == pytest.approx(max(flop / 100e3, roof.bytes / 10e3)) and roof.share == roof.limit_us / 4.0
    two = roofline.roofs([measured | {"devices": 2}, peaks])[0]
    assert two.share == pytest.approx(roof.share / 2)
    assert not roofline.roofs([measured]) and not roofline.roofs([peaks, measured | {"gait": "semi_procedural"}])


def test_peaks_are_measured() -> None:
    found = measure(side=32, length=1024)
    assert found["kind"] == "peaks" and found["gflops"] > 0 and found["gbytes"] > 0


def test_pictures_are_drawn_of_what_there_is(tmp_path: Path) -> None:
    share = {"pose": 0.5, "drag": 0.5}
    lines = [
        line("human-rigid-64", 5.0, characters=64),
        line("human-rigid-2048", 4.0, sizes=[dataclasses.asdict(SIZES)], stage_share=share),
        line("human-rigid-2048-2dev", 2.2, devices=2),
        line("human-rigid-64-gradient", 30.0, over_forward=6.0, gradient_frames=120),
        {"kind": "peaks", "gflops": 100.0, "gbytes": 10.0},
        {"kind": "peers", "own_us": 200.0, "peers": [{"name": "other", "us": 8e3, "over_own": 40.0}]},
    ]
    made = plots.drawn(lines, tmp_path / "now.jsonl")
    assert [path.name for path in made] == [f"now-{name}.png" for name in plots.PLOTS]
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in made)
    assert plots.drawn(lines[:1], tmp_path / "now.jsonl") == []


FEW = Case("few", (("human", 4),))


@pytest.fixture(scope="module")
def walked() -> tuple[Any, Any, Any]:
    """The product's program, and the states after 8 frames of it and of its step for one character."""
    own, alone = peers.programs(FEW)
    return own, peers.stepped(own, 8)(), peers.stepped(alone, 8)()


def test_own_step_of_one_character_is_the_same_step(walked: tuple[Any, Any, Any]) -> None:
    _, own, alone = walked
    assert peers.positions(alone).shape == (4, 3)
    apart = np.abs(peers.positions(own)[:4] - peers.positions(alone))
    assert apart.max() < 1e-5 and np.ptp(peers.positions(alone)[:, 0]) > 1


def test_triangles_above_the_water_do_not_count(walked: tuple[Any, Any, Any]) -> None:
    program, states, _ = walked
    every, some, none = (
        sizes_of((*program[:3], states), FEW.herds, depth)[0].triangles for depth in (5.0, FEW.depth, -1.0)
    )
    assert every == len(program[0].herds[0].triangles.values) > some > 0.2 * every and none == 0


def test_peers_that_are_not_there_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(peers, "_installed", lambda package: False)
    found = peers.measure(1, only=["mujoco", "mjx"], case=FEW)
    assert [each["not_measured"] for each in found["peers"]] == ["mujoco is not installed"] * 2
    text = printed(peers.show, found)
    assert text.count("not measured: mujoco is not installed") == 2 and json.dumps(found)
