"""Levels of detail: what each costs and how far it is from the exact run. `python -m benchmarks.detail [--plot PNG]`.

People wade through 0.9 m of water for ten seconds, in the exact run and in each level, recorded in every frame with
their poses; then the same programs are timed, in turns. Errors are root mean squares over characters and the last
second, against the exact run. One core.
"""

from __future__ import annotations

import argparse
import time
from typing import Any, NamedTuple

from benchmarks.machine import machine, pin

COUNT, SECONDS, RATE = 384, 10, 60
CHUNK = 32  # recorded frames of a call, as in a run
EXACT: dict[str, Any] = {}
LEVELS: list[dict[str, Any]] = [
    EXACT,
    {"every": 2},
    {"every": 4},
    {"mesh": "rigid"},
    *({"triangles": 200, "mesh": "rigid", "every": every} for every in (1, 2, 4)),
    *({"triangles": count} for count in (400, 200, 100)),
    *({"triangles": count, "mesh": "rigid"} for count in (400, 100)),
]


class Line(NamedTuple):
    """One level."""

    level: dict[str, Any]
    us: float  # per character and frame
    drag: float  # %, relative RMS error of the force over poses, directions, speeds and depths
    position: float  # m
    yaw: float  # degrees
    pose: float  # degrees, of joints
    speed: float  # m/s
    slide: float  # mm, mean over stances, of the sole (not against the exact run)
    foot: float  # mm, of the posed sole from where the run says it is (between steps: what pictures slip)


def scenario(level: dict[str, Any], gait: str) -> dict[str, Any]:
    """People in a pool, the level of detail theirs."""
    place = {"kind": "grid", "spacing_m": 1.5}
    herd: dict[str, Any] = {"name": "people", "archetype": "human", "count": COUNT, "place": place, "speed_m_s": 1.2}
    return {
        "name": "detail",
        "seed": 1,
        "duration_s": SECONDS,
        "rate_hz": RATE,
        "gait": gait,
        "world": {"fluids": [{"fluid": "water", "surface_m": 0.9}]},
        "record": {"rate_hz": RATE},
        "herds": [herd | ({"detail": level} if level else {})],
    }


def measured(level: dict[str, Any], gait: str, exact: Any | None) -> tuple[Line, dict[str, Any], Any]:
    """The line of a level, not yet with its cost, what of its run others are compared with, and its program.

    exact: that of the exact run; None: this is it.
    """
    import numpy as np

    from crowd import metrics
    from crowd.build import build
    from crowd.drag_error import drag_error
    from crowd.scene import load
    from crowd.simulate import simulate

    scene = load(scenario(level, gait))
    program = build(scene, 1)
    result = simulate(scene, devices=1, program=program)
    arrays = result.herds["people"]
    names = ("position", "velocity", "yaw", "joint_rotation")
    last = {name: np.array(arrays[name][-RATE:], float) for name in names}
    other = last if exact is None else exact
    slides = [row.mean for row in metrics.measure(result, most=128) if row.quantity == "foot_slide_sole"]
    herd = scene.herds[0]
    drag = drag_error(scene, herd, herd.drag_mesh, herd.drag_kind(scene.scenario) == "rigid")
    apart = [np.linalg.norm(last["joint_rotation"] + sign * other["joint_rotation"], axis=-1) for sign in (-1.0, 1.0)]
    turn = (last["yaw"] - other["yaw"] + np.pi) % (2 * np.pi) - np.pi
    speeds = [np.linalg.norm(one["velocity"], axis=-1) for one in (last, other)]
    line = Line(
        level,
        float("nan"),
        100.0 * drag.rms_force,
        _rms(np.linalg.norm(last["position"] - other["position"], axis=-1)),
        float(np.degrees(_rms(turn))),
        float(np.degrees(_rms(4.0 * np.arcsin(0.5 * np.minimum(*apart))))),
        _rms(speeds[0] - speeds[1]),
        slides[0] if slides else float("nan"),
        1000.0 * _rms(_slips(herd, arrays)),
    )
    return line, last, program


def _rms(values: Any) -> float:
    import numpy as np

    return float(np.sqrt(np.mean(np.square(values))))


def costs(programs: list[Any]) -> list[float]:
    """us of processor time per character and frame of each program: medians of 7 rounds of calls in turns.

    In turns, because a shared machine is faster at one time than at another.
    """
    import jax
    import numpy as np

    from crowd.simulate import compiled, dealt

    shares = [dealt(program, 1)[0] for program in programs]
    taken: list[list[float]] = [[] for _ in programs]
    for _ in range(8):
        for number, (program, (assets, params, states)) in enumerate(zip(programs, shares, strict=True)):
            frames = CHUNK * program[0].record_every
            begin = time.process_time()
            run = compiled(program[0], CHUNK)
            states, _ = jax.block_until_ready(run(assets, params, states, np.int32(frames)))
            taken[number].append((time.process_time() - begin) / (frames * COUNT))
            shares[number] = (assets, params, states)
    return [1e6 * float(np.median(each[1:])) for each in taken]


def _slips(herd: Any, arrays: Any) -> Any:
    """m, distances of posed contact points from those that the run tells, of some characters in the last seconds."""
    import numpy as np

    from crowd import posing
    from crowd.types import Motion

    names = ("pose_position", "pose_orientation", "joint_rotation", "joint_translation")
    some = [np.asarray(arrays[name][-90:, ::12], float) for name in names]
    turn, at = posing.world_transforms(
        herd.archetype.skeleton, Motion(some[0], some[1], some[2], some[3], herd.scale[::12])
    )
    found = []
    for number, leg in enumerate(herd.archetype.legs):
        offset = np.array(leg.ball_offset) * herd.scale[::12, None]
        point = at[..., leg.ball, :] + posing.rotate(turn[..., leg.ball, :], offset)
        found.append(np.linalg.norm(point - np.asarray(arrays["ball"][-90:, ::12, number], float), axis=-1))
    return np.stack(found)


def told(level: dict[str, Any]) -> str:
    """A level in a few words."""
    words = [str(level.get("triangles", "all")), str(level.get("mesh", "skinned")), f"every {level.get('every', 1)}"]
    return " ".join(f"{word:<8}" for word in words)


def plot(lines: list[Line], path: str) -> None:
    """Error against cost: of the drag for meshes, of the place after ten seconds for all."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(10.5, 4.2), constrained_layout=True)
    for axis, name, label in (
        (axes[0], "drag", "error of the drag force, % (relative RMS)"),
        (axes[1], "position", "error of the place after 10 s, m (RMS)"),
    ):
        for kind, colour in (("skinned", "#1f6f9f"), ("rigid", "#c4622d")):
            for every, marker in ((1, "o"), (2, "s"), (4, "^")):
                mine = [
                    line
                    for line in lines
                    if line.level.get("mesh", "skinned") == kind and line.level.get("every", 1) == every
                ]
                if name == "drag" and every > 1:
                    continue
                place = [line.us for line in mine], [getattr(line, name) for line in mine]
                if mine:
                    label_of = f"{kind}, every frame" if every == 1 else f"{kind}, every {every} frames"
                    axis.plot(*place, marker, color=colour, label=label_of, ms=7)
                for line in mine:
                    triangles = str(line.level.get("triangles", "all"))
                    axis.annotate(
                        triangles, (line.us, getattr(line, name)), (5, 4), textcoords="offset points", fontsize=8
                    )
        axis.set_xlabel("us per character and frame, one core")
        axis.set_ylabel(label)
        axis.set_xlim(left=0)
        axis.margins(y=0.12)
        axis.grid(alpha=0.3)
    axes[1].legend(fontsize=8)
    axes[0].set_title("meshes (numbers: triangles)", fontsize=10)
    axes[1].set_title("whole levels", fontsize=10)
    figure.savefig(path, dpi=110)


def main() -> None:
    """Measures all levels and prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--gait", default="footsteps", choices=("footsteps", "semi_procedural", "clip"))
    parser.add_argument("--plot", help="draw error against cost into this PNG")
    parser.add_argument("--steps-only", action="store_true", help="only levels that differ in their steps")
    asked = parser.parse_args()
    pin(1)
    import jax

    from crowd import compile_cache

    jax.config.update("jax_platforms", "cpu")
    compile_cache.enable()
    here = machine()
    print(f"{here['cpu']}, jax {here['jax']}, {COUNT} people, 0.9 m of water, {asked.gait}, one core")
    print("triangles mesh   steps        us   drag %  place m  yaw deg  pose deg  speed m/s  slide mm  foot mm")
    lines: list[Line] = []
    programs, exact = [], None
    for level in LEVELS:
        if asked.steps_only and set(level) - {"every"}:
            continue
        line, last, program = measured(level, asked.gait, exact)
        exact = last if exact is None else exact
        lines.append(line)
        programs.append(program)
    lines = [line._replace(us=us) for line, us in zip(lines, costs(programs), strict=True)]
    for line in lines:
        print(
            f"{told(line.level)} {line.us:6.2f} {line.drag:8.2f} {line.position:8.4f} {line.yaw:8.3f} "
            f"{line.pose:9.3f} {line.speed:10.4f} {line.slide:9.2f} {line.foot:8.2f}"
        )
    if asked.plot:
        plot(lines, asked.plot)


if __name__ == "__main__":
    main()
