"""What else takes for a body in fluid, on the same core in the same run: `python -m benchmarks.peers`.

MuJoCo and MJX do other work: generalized dynamics of 27 degrees of freedom with contacts, driven by nothing, and a
fluid model of a box for each body instead of drag on every triangle; this simulator does kinematics on an abstract
body, a footstep controller, inverse kinematics and drag on the skin. So the ratio says what a character in fluid costs
here and there, not how well anything is programmed. The third peer is this simulator's own step the way one
would first write it: a function of one character under `jax.vmap`, and it has to give the same positions.

Packages that are not installed (`pip install '.[peers]'`) are named as not measured.
"""

from __future__ import annotations

import dataclasses
import functools
import importlib
import importlib.util
import json
import sys
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from benchmarks.cases import RATE, Case, scenario
from benchmarks.gradient import in_turns
from benchmarks.machine import machine, pin

Line = dict[str, Any]
Call = tuple[Callable[[], Any], float]  # what is timed, and how many character-seconds it simulates
CROWD = Case("human-rigid-256", (("human", 256),))
FRAMES = 60  # of our own step in a timed call
SAME = 1e-4  # m, between positions of the two versions of our step after FRAMES
WATER = {"density": 1000.0, "viscosity": 1e-3}  # kg/m3, Pa s
BATCH = 256  # of MJX
MJX_STEPS = 40


def programs(case: Case = CROWD) -> tuple[Any, Any]:
    """(layout, assets, params, states) as the product runs it, and with a tile of its own for every character."""
    import jax
    import numpy as np

    import crowd
    from crowd.build import build

    layout, assets, params, states = build(crowd.load(scenario(case)))

    def structs(leaf: Any) -> Any:
        """[tiles, ..., n] to [characters, ..., 1]: each character's numbers together; padding left out."""
        apart = np.moveaxis(np.asarray(leaf), -1, 1)
        flat = apart.reshape(apart.shape[0] * apart.shape[1], *apart.shape[2:])
        return jax.numpy.asarray(flat[: case.count, ..., None])

    alone = dataclasses.replace(params, characters=jax.tree.map(structs, params.characters))
    plain = dataclasses.replace(layout, walls=False)  # then `one_frame` maps tiles by vmap
    return (layout, assets, params, states), (plain, assets, alone, jax.tree.map(structs, states))


def stepped(program: Any, frames: int) -> Callable[[], Any]:
    """Compiles `frames` frames in one scan; calling steps from the start on and returns the states."""
    import jax

    from crowd.advance import one_frame
    from crowd.compiler_options import options

    layout, assets, params, states = program

    def run(assets: Any, params: Any, states: Any) -> Any:
        def frame(states: Any, _: Any) -> tuple[Any, None]:
            return one_frame(layout, assets, params, states)[0], None

        return jax.lax.scan(frame, states, None, length=frames)[0]

    given = assets, params, states
    executable = jax.jit(run, compiler_options=options()).lower(*given).compile()
    return lambda: executable(*given)


def positions(states: Any) -> Any:
    """[characters, 3] m, of states with any width of tiles, with their padding."""
    import numpy as np

    place = np.asarray(states[0].position)  # [tiles, 3, n]
    return np.moveaxis(place, 1, -1).reshape(-1, 3)


@functools.cache
def _own(case: Case) -> Call:
    """This simulator as it is."""
    return stepped(programs(case)[0], FRAMES), case.count * FRAMES / RATE


def _naive(case: Case) -> Call:
    """Our step of one character under vmap. Raises RuntimeError where it is not the same step."""
    import numpy as np

    alone = stepped(programs(case)[1], FRAMES)
    own = positions(_own(case)[0]())[: case.count]
    if not (apart := float(np.abs(own - positions(alone())).max())) < SAME:
        raise RuntimeError(f"its positions differ from ours by {apart:.2g} m after {FRAMES} frames")
    return alone, case.count * FRAMES / RATE


def humanoid() -> Any:
    """MuJoCo's humanoid, whole, in water."""
    mujoco = importlib.import_module("mujoco")
    found = importlib.util.find_spec("mujoco.mjx")
    assert found is not None and found.origin is not None
    path = Path(found.origin).parent / "test_data" / "humanoid" / "humanoid.xml"
    model = mujoco.MjModel.from_xml_path(str(path))
    for name, value in WATER.items():
        setattr(model.opt, name, value)
    return model


def _mujoco(case: Case) -> Call:
    """A second of MuJoCo in C, one thread, from standing."""
    del case
    mujoco, model = importlib.import_module("mujoco"), humanoid()
    data = mujoco.MjData(model)
    steps = round(1.0 / model.opt.timestep)

    def run() -> None:
        mujoco.mj_resetData(model, data)
        mujoco.mj_step(model, data, nstep=steps)

    return run, steps * model.opt.timestep


def _mjx(case: Case) -> Call:
    """MJX: a batch under vmap, jitted scan."""
    del case
    import jax

    mjx, model = importlib.import_module("mujoco.mjx"), humanoid()
    timestep = float(model.opt.timestep)
    device = mjx.put_model(model, impl="jax")
    start = mjx.make_data(model, impl="jax")
    batch = jax.tree.map(lambda x: jax.numpy.repeat(jax.numpy.asarray(x)[None], BATCH, 0), start)

    def one(data: Any) -> Any:
        return jax.lax.scan(lambda data, _: (mjx.step(device, data), None), data, None, length=MJX_STEPS)[0]

    executable = jax.jit(jax.vmap(one)).lower(batch).compile()
    return lambda: executable(batch).qpos, BATCH * MJX_STEPS * timestep


PEERS: dict[str, tuple[str, tuple[str, ...], Callable[[Case], Call]]] = {
    "mujoco": ("MuJoCo C, one humanoid", ("mujoco", "mujoco.mjx"), _mujoco),  # the model comes with MJX
    "mjx": (f"MJX, {BATCH} humanoids", ("mujoco", "mujoco.mjx"), _mjx),
    "vmap": ("own step, one character vmapped", (), _naive),
}


def measure(rounds: int, only: list[str] | None = None, case: Case = CROWD) -> Line:
    """µs of a character and simulated second of everything installed, each in turns with this simulator's own."""
    line: Line = {"kind": "peers", "peers": []}
    ours: list[float] = []
    for key, (name, packages, prepare) in PEERS.items():
        if only and key not in only:
            continue
        if missing := [package for package in packages if not _installed(package)]:
            line["peers"].append({"name": name, "not_measured": f"{missing[0]} is not installed"})
            continue
        try:
            call = prepare(case)
        except Exception as error:  # a peer that fails on this machine must not lose the others
            line["peers"].append({"name": name, "not_measured": f"{type(error).__name__}: {error}"})
            continue
        own = _own(case)
        wall, _ = in_turns([own[0], call[0]], rounds)
        here, there = ([1e6 * each[k] / seconds for each in wall] for k, seconds in ((0, own[1]), (1, call[1])))
        ours += here
        over = median(b / a for a, b in zip(here, there, strict=True))
        line["peers"].append({"name": name, "us": round(median(there), 2), "over_own": round(over, 2)})
        line[f"{key}_over_own"] = round(over, 2)
    return line | {"own_us": round(median(ours), 2) if ours else None, "characters": case.count}


def _installed(package: str) -> bool:
    try:
        return importlib.util.find_spec(package) is not None
    except ModuleNotFoundError:  # of the package it is in
        return False


def show(line: Line, console: Console) -> None:
    """A table of one line of results."""
    table = Table(title="Peers: µs of a character and simulated second, one core, in one run")
    table.add_column("what", no_wrap=True)
    for name in ("µs a second", "µs a 1/60 s", "over ours"):
        table.add_column(name, justify="right", no_wrap=True)
    own = line["own_us"]
    if own is not None:
        name = f"this simulator, {line['characters']} people in water, rigid drag"
        table.add_row(name, f"{own:.0f}", f"{own / RATE:.2f}", "1")
    for each in line["peers"]:
        if "us" in each:
            us = each["us"]
            table.add_row(each["name"], f"{us:.0f}", f"{us / RATE:.1f}", f"{each['over_own']:.1f}")
        else:
            table.add_row(each["name"], "", "", f"not measured: {each['not_measured']}")
    console.print(table)
    console.print(
        "MuJoCo and MJX do other work: generalized dynamics with contacts, and a fluid model of a box for each body; "
        "here: kinematics on an abstract body, foot placement, and drag on every triangle."
    )


def main(
    peer: Annotated[list[str] | None, typer.Option(help=f"Only this one of {', '.join(PEERS)} (repeatable).")] = None,
    rounds: Annotated[int, typer.Option(min=1, help="Timed runs of each, in turns with our own.")] = 7,
    as_json: Annotated[bool, typer.Option("--json", help="Print a line of results instead of a table.")] = False,
) -> None:
    """Time what else is installed beside this simulator, on one core."""
    for name in peer or []:
        if name not in PEERS:
            raise typer.BadParameter(f"there is no peer '{name}'; allowed: {', '.join(PEERS)}")
    pinned = pin(1)
    import jax

    jax.config.update("jax_platforms", "cpu")
    line = measure(rounds, peer) | {"pinned_cores": pinned}
    if as_json:
        print(json.dumps(line))
        return
    console = Console() if sys.stdout.isatty() else Console(width=160)
    here = machine()
    console.print(f"{here['cpu']}, one of {here['cores']} cores, load {here['load_1min']}, jax {here['jax']}")
    show(line, console)


if __name__ == "__main__":
    typer.run(main)
