"""The benchmarks: their case list, their arithmetic, and one tiny case from end to end. Nothing here is about speed."""

from __future__ import annotations

import io
import itertools
import json
import time
from pathlib import Path
from threading import Thread

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import typer
from jax import core
from rich.console import Console

import crowd
from benchmarks import alone, record, reference
from benchmarks.cases import CASES, GPU_CASES, Case, named, scenario
from benchmarks.figures import alone_name, figures
from benchmarks.gradient import measured
from benchmarks.measure import Job, frames_for
from benchmarks.run import chosen, main, run_case
from benchmarks.stages import LOOPS, STAGES, Event, instruction_stages, own_times, stage_of
from benchmarks.start import first_frames
from benchmarks.table import told
from crowd.build import build
from crowd.layout import TILE
from crowd.scenario import load

NAMES = [case.name for case in CASES]
STEP = "jit(rollout)/while/body/closed_call/while/body/while/body/closed_call"


def test_names_are_unique_and_say_what_is_measured() -> None:
    assert len(set(NAMES)) == len(NAMES)
    for case in (*CASES, *GPU_CASES):
        assert case.name == named(case)


@pytest.mark.parametrize("case", CASES, ids=NAMES)
def test_cases_are_scenarios_without_padding(case: Case) -> None:
    model = load(scenario(case))
    assert [herd.count for herd in model.herds] == [count for _, count in case.herds]
    assert bool(model.world.fluids) == case.water and model.drag.mesh == case.mesh
    assert model.rate_hz % model.record.rate_hz == 0 and not model.record.pose
    padding = sum(-count % (TILE * case.devices) for _, count in case.herds)
    assert padding < 0.002 * case.count or case.count < TILE


def test_cases_of_ratios_differ_in_one_thing() -> None:
    by_name = {case.name: case for case in CASES}
    for case in CASES:
        for archetype, _ in case.herds:
            if len(case.herds) > 1:
                alone = by_name[alone_name(case, archetype)]
                assert (alone.mesh, alone.depth, alone.count) == (case.mesh, case.depth, case.count)
        if case.devices > 1:
            one = by_name[case.name.removesuffix("-2dev")]
            assert (one.herds, one.mesh, one.depth, one.devices) == (case.herds, case.mesh, case.depth, 1)


def test_largest_mixed_case_builds() -> None:
    case = max(CASES, key=lambda case: len(case.herds))
    layout, _, _, states = build(crowd.load(scenario(case)))
    assert len(layout.herds) == len(case.herds) and layout.regions == 1
    assert [state.position.shape[0] * TILE for state in states] == [count for _, count in case.herds]


def test_job_survives_the_command_line() -> None:
    for case in CASES:
        job = Job(case, frames=3, runs=2, profile=False)
        assert Job.read(job.text()) == job


def test_a_gradient_is_held_against_its_run() -> None:
    line = measured(Case("few", (("hexapod", 2),), depth=0, gradient=2), runs=1)
    assert line["us"] > 0 and line["over_forward"] == pytest.approx(line["us"] / line["forward_us"], abs=0.01)
    assert line["frames"] == 2 and line["temp_bytes_per_character"] > 0


def test_the_fewer_characters_the_longer_the_run() -> None:
    assert frames_for(102400) < frames_for(16384) == frames_for(2048) == 60 < frames_for(64)


@pytest.mark.parametrize(
    ("path", "stage"),
    [
        (f"{STEP}/skin/cond/branch_1_fun/mul", "skin"),
        (f"{STEP}/skin/drag/cond", "drag"),
        (f"{STEP}/body/cond/branch_1_fun/add", "body"),
        (f"{STEP}/pose/cond/branch_1_fun/while/body/closed_call/mul", "pose"),
        (f"{STEP}/while/body/body/jit(wall)", "body"),
        (f"{STEP}/record/cond", "record"),
        (f"{STEP}/sub", LOOPS),
        ("jit(rollout)/while/body/closed_call/while/body/while", LOOPS),
        ("jit(rollout)/shard_map/while/body/closed_call/while/body/while/body/dynamic_slice", LOOPS),
        ("", LOOPS),
        (f"{STEP.replace('closed_call', 'eval_jaxpr')}/skin/cond/branch_1_fun/mul", "skin"),
        ("jit(rollout)/while/body/eval_jaxpr/while/body/vmap(body)/mul", "body"),
        ("jit(rollout)/while/body/eval_jaxpr/while/body/vmap(skin)/vmap(drag)/jit(_where)/select_n", "drag"),
        ("jit(rollout)/while/body/eval_jaxpr/while/body/dynamic_slice", LOOPS),
    ],
)
def test_stage_of(path: str, stage: str) -> None:
    assert stage_of(path) == stage


def test_instruction_stages_reads_compiled_text() -> None:
    text = f"""HloModule jit_rollout
%fused {{
  %add.1 = f32[3]{{0}} add(%a, %b), metadata={{op_name="{STEP}/gait/cond/branch_1_fun/add" stack_frame_id=3}}
}}
  ROOT %cond.12.clone = (f32[3]{{0}}) conditional(%p, %x, %y), metadata={{op_name="{STEP}/feet/cond"}}
  %copy.3 = f32[3]{{0}} copy(%z)
"""
    kernels = {"add_1": "gait", "cond_12_clone": "feet"}
    assert instruction_stages(text) == {"add.1": "gait", "cond.12.clone": "feet"} | kernels


def test_own_times_add_up() -> None:
    stages = {"loop": LOOPS, "wall": "pose", "mul": "pose", "add": "gait"}
    events = [
        Event("Execute", 0.0, 105.0),  # the runtime's, around the program
        Event("loop", 0.0, 100.0),
        Event("wall", 10.0, 50.0),
        Event("Execute", 12.0, 40.0),
        Event("mul", 15.0, 30.0),
        Event("copy.1", 70.0, 10.0),
        Event("add", 80.0, 20.0),
        Event("wait", 200.0, 50.0),  # outside
    ]
    assert own_times(reversed(events), stages) == {LOOPS: 30.0, "pose": 50.0, "gait": 20.0}


def lines(**us: float) -> list[dict]:
    return [
        {"kind": "case", "case": name.replace("_", "-"), "us": value, "trace_s": 2.0, "compile_cold_s": 9.0}
        for name, value in us.items()
    ]


def verdicts(measured: list[dict]) -> dict[str, tuple[float, str]]:
    """Value and verdict of every figure that was measured."""
    found = figures(measured)
    assert all(figure.verdict == "not measured" for figure in found if figure.value is None)
    return {figure.name: (figure.value, figure.verdict) for figure in found if figure.value is not None}


def test_a_trace_is_cut_into_its_stages() -> None:
    def traced(a: jax.Array, x: jax.Array) -> tuple[jax.Array, jax.Array]:
        with jax.named_scope("sense"):
            y, b = a * x, a + 1.0
        half = 0.5 * y  # of no stage
        with jax.named_scope("drag"):
            z = jnp.sin(half) + b
        return z, y

    a, x = jnp.array(2.0), jnp.arange(3.0)
    sense, drag = alone.parts(jax.make_jaxpr(traced)(a, x).jaxpr, shared=1)
    assert [len(part.shared) for part in (sense, drag)] == [1, 1] and len(sense.own) == len(drag.own) == 1
    found = dict(zip(sense.jaxpr.outvars, core.eval_jaxpr(sense.jaxpr, (), a, x), strict=True))
    given = [found[v] for v in drag.shared], 0.5 * traced(a, x)[1]
    np.testing.assert_array_equal(core.eval_jaxpr(drag.jaxpr, (), *given[0], given[1])[0], traced(a, x)[0])


def test_stages_are_timed_alone() -> None:
    line = alone.measure(Case("few", (("human", 8),)), frames=2, runs=1)
    assert list(line["alone_us"]) == [stage for stage in STAGES if stage != "skin"]  # rigid triangles have none
    assert all(us > 0 for us in line["alone_us"].values())
    assert line["frame_over_alone"] == pytest.approx(line["us"] / sum(line["alone_us"].values()), rel=2e-3)


def test_figures_reached_and_not() -> None:
    measured = lines(
        human_rigid_2048=3.0, human_rigid_2048_2dev=1.5, human_skinned_2048=9.0, human_skinned_2048_2dev=6.0,
        dog_rigid_2048=6.0, human_dog_rigid_2048=6.5,
    )  # fmt: skip
    found = verdicts([*measured, {"kind": "start", "cold_s": 20.0, "warm_s": 4.0}])
    assert found == {
        "human, rigid, in water, N = 2048, one core": (3.0, "reached"),
        "human, skinned, in water, N = 2048, one core": (9.0, "falls short"),
        "dog against human, rigid, both in 0.5 m": (2.0, ""),
        "2 devices against 1, rigid": (2.0, "reached"),
        "2 devices against 1, skinned": (1.5, "falls short"),
        "rigid at 60 Hz in real time, two cores": (pytest.approx(1e6 / 60 / 1.5), "reached"),
        "skinned at 60 Hz in real time, two cores": (pytest.approx(1e6 / 60 / 6.0), "falls short"),
        "human-dog-rigid-2048 against its herds alone": (pytest.approx(6.5 / 4.5), "falls short"),
        "compile of one archetype, no cache, one core": (9.0, "falls short"),
        "warm start of `crowd run` to its first frames": (4.0, "reached"),
    }


def test_ratios_are_of_turns_with_the_reference() -> None:
    """Where the machine was half as fast for the second case."""
    measured = lines(human_rigid_2048=3.0, human_rigid_64=8.0, human_rigid_2048_2dev=3.0)
    for line, over in zip(measured, (1.0, 1.25, 0.5), strict=True):
        line["over_reference"] = over
    found = verdicts(measured)
    assert found["per character, human-rigid-64 against 2048"] == (1.25, "reached")
    assert found["2 devices against 1, rigid"] == (2.0, "reached")
    assert found["rigid at 60 Hz in real time, two cores"] == (pytest.approx(1e6 / 60 / 3.0), "falls short")


def test_the_reference_answers_every_case(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    answers = itertools.count(0.0)  # the first one is not timed
    monkeypatch.setattr(reference, "prepared", lambda job: lambda: next(answers))
    address = str(tmp_path / "socket")
    Thread(target=reference.serve, args=(address, Job(reference.CASE)), daemon=True).start()
    while not Path(address).exists():
        time.sleep(0.01)
    told = []
    for _ in range(2):
        with reference.asked(address) as ask:
            assert ask is not None
            told += [ask(), ask()]
    assert told == [1.0, 2.0, 3.0, 4.0]
    with reference.asked(None) as ask:
        assert ask is None


def test_figures_of_gaits_gradients_memory_and_peers() -> None:
    gaits = lines(
        human_rubble_strides_2048=3.0, human_rubble_clip_2048=2.0,
        dog_rubble_strides_2048=5.5, dog_rubble_clip_2048=2.5,
    )  # fmt: skip
    assert list(verdicts(gaits).values()) == [(1.0, "reached"), (3.0, "falls short")]
    gradient = {"gradient_frames": 120, "over_forward": 7.0, "temp_bytes_per_character": 120e3}
    found = verdicts([line | gradient for line in lines(human_rigid_64_gradient=30.0)])
    assert list(found.values()) == [(7.0, "falls short"), (1.0, "reached")]
    (found,) = verdicts([{"kind": "case", "case": "human-rigid-16384", "peak_rss_bytes": 1.3e9}]).items()
    assert found == ("peak memory, human-rigid-16384", (1.3, "falls short"))
    (found,) = verdicts([{"kind": "case", "case": "human-rigid-2048-recorded", "over_off": 1.1}]).values()
    assert found == (1.1, "reached")
    (found,) = verdicts([{"kind": "alone", "frame_over_alone": 1.4}]).values()
    assert found == (1.4, "falls short")
    found = verdicts([{"kind": "peers", "mujoco_over_own": 31.0, "vmap_over_own": 9.0}])
    assert list(found.values()) == [(31.0, "reached"), (9.0, "falls short")]


def test_what_is_not_mathematics_of_bodies_has_a_share() -> None:
    share = {"pose": 0.3, "skin": 0.0, "drag": 0.25, "arms": 0.05, "gait": 0.2, "body": 0.1, LOOPS: 0.1}
    found = verdicts([{"kind": "case", "case": "human-rigid-2048", "stage_share": share}])
    assert list(found.values()) == [(pytest.approx(40.0), "reached")]


def test_failed_cases_have_no_figures() -> None:
    failed = [{"kind": "case", "case": "human-rigid-2048", "error": "killed"}, {"kind": "start", "error": "killed"}]
    assert all(figure.value is None and figure.reached is None for figure in figures(failed))


def test_mixed_mean_is_weighted_with_characters() -> None:
    measured = lines(
        human_rigid_2048=4.0, dog_rigid_2048=8.0, hexapod_rigid_2048=16.0, spider_rigid_2048=20.0,
        human_dog_hexapod_spider_rigid_2048=9.0,
    )  # fmt: skip
    assert verdicts(measured)["human-dog-hexapod-spider-rigid-2048 against its herds alone"] == (0.75, "reached")


def test_unknown_case_is_refused_with_the_nearest() -> None:
    with pytest.raises(typer.BadParameter, match="did you mean 'human-dry-2048'"):
        chosen(["human-dri-2048"], quick=False)
    assert chosen([], quick=False, every=True) == list(CASES) and chosen([], False, "gpu") == list(GPU_CASES)
    assert [case.name for case in chosen(["dog-rigid-2048"], quick=False)] == ["dog-rigid-2048"]
    usual, quick = ({case.asked for case in chosen([], quick)} for quick in (False, True))
    assert usual == {"quick", "usual"} and quick == {"quick"}


def test_a_case_that_cannot_run_is_told() -> None:
    assert "cores" in run_case(Job(Case("wide", (("human", 128),), devices=4096)))["error"]
    assert "unicorn" in run_case(Job(Case("strange", (("unicorn", 4),)), frames=1, runs=1))["error"]


def test_a_run_that_ends_early_is_told(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match=r"missing\.yaml"):
        first_frames(tmp_path / "missing.yaml", tmp_path, tmp_path / "out")


def test_tiny_case_from_end_to_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tiny = Case("tiny", (("human", 4),), depth=0)
    monkeypatch.setattr("benchmarks.run.chosen", lambda names, quick, platform, every: [tiny])
    out = tmp_path / "results" / "lines.jsonl"
    main(out=out, runs=2, frames=3, start=False, roofline=False)
    (line,) = [json.loads(text) for text in out.read_text().splitlines()]
    assert "error" not in line
    assert (line["kind"], line["case"], line["characters"], line["runs"], line["frames"]) == ("case", "tiny", 4, 2, 3)
    assert 0 < line["us_min"] <= line["us"] <= line["us_max"] and line["us_cpu"] > 0
    for name in ("trace_s", "compile_cold_s", "compile_warm_s", "temp_bytes_per_character", "peak_rss_bytes"):
        assert line[name] > 0
    assert line["cache_used"] and line["frozen_by_a_fault"] == 0
    (sizes,) = line["sizes"]
    assert (sizes["archetype"], sizes["legs"], sizes["arms"], sizes["triangles"]) == ("human", 2, 0, 0.0)
    assert {"cpu", "cores", "jax", "commit", "time"} <= line["machine"].keys()
    share = line["stage_share"]
    assert set(share) <= {*STAGES, LOOPS} and {"body", "gait", "pose", "feet"} <= set(share)
    assert sum(share.values()) == pytest.approx(1.0, abs=0.01)


def test_a_recording_is_held_against_a_run_without() -> None:
    few = Case("few-recorded", (("hexapod", 2),), depth=0, gait="clip", recorded=True)
    line = run_case(Job(few, frames=70, runs=1))
    assert "error" not in line and line["us"] > 0 and line["us_off"] > 0 and line["disk_bytes_per_character"] > 0
    assert line["over_off"] == pytest.approx(line["us"] / line["us_off"], rel=0.01)
    assert "times a run without" in told(line)


def test_cost_of_recording_is_the_median_of_ratios_within_a_round() -> None:
    """A machine that is twice as slow in the second round does not show; rounds of 10 and 20 s would give 1.5."""
    spent = {"unpack": 0.1, "compress": 0.2, "files": 0.3}
    common = {"recorded": 100, "raw_bytes": 2e6, "bytes": 1e6, "spent": spent}
    rounds = [
        {
            mode.name: common | {"wall_s": slow * (11.0 if mode.written else 10.0), "cpu_s": slow * 10.0}
            for mode in record.MODES
        }
        for slow in (1.0, 2.0, 1.0)
    ]
    out = io.StringIO()
    record.show(record.PLACES[0], rounds, Console(width=160, file=out))
    rows = out.getvalue().splitlines()
    (row,) = (row for row in rows if "recorded with poses" in row)
    assert "1.100 (1.100-1.100)" in row
    assert "unpack 1.00 compress 2.00 files 3.00" in row
    assert "2.00 -> 1.00" in row
    (row,) = (row for row in rows if "not recorded" in row)
    assert "100.0" in row and "1.000 (1.000-1.000)" in row
