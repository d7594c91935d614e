"""A crowd that another program steers: a few frames per call, velocities and headings from outside.

stepper = crowd.stepper(scene)
while playing:
    people = stepper.step(velocity={"people": wanted})["people"]
    draw(people["position"], people["joint_rotation"])
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import jax
import numpy as np

from crowd.build import build, tiled
from crowd.errors import fail, nearest
from crowd.layout import Layout
from crowd.pace import between
from crowd.scene import HerdScene, Scene
from crowd.simulate import compiled
from crowd.state import State
from crowd.unpack import unpacked
from kernels.wall import no_wall

MOST_FRAMES = 1_000_000  # of one call
FASTEST = 15.0  # m/s, as in scenarios
STEERED = ("desired", "waypoint", "follows", "looks", "facing")  # fields of the state that a call may write

Steering = Mapping[str, Any]  # herd -> array


class HerdFrame(Mapping[str, np.ndarray]):
    """What a herd's characters did in the last frame: arrays [n, ...] named as in a `Result`, unpacked when read."""

    def __init__(self, herd: HerdScene, layout: Layout, which: int, shown: Sequence[Any]):
        self._make = (herd, layout, which, shown)
        self._arrays: dict[str, np.ndarray] | None = None

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """All of them."""
        if self._arrays is None:
            self._arrays = {name: values[0] for name, values in unpacked(*self._make, 1).items()}
        return self._arrays

    def __getitem__(self, name: str) -> np.ndarray:
        return self.arrays[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.arrays)

    def __len__(self) -> int:
        return len(self.arrays)


class Stepper:
    """A scene stepped call by call on one device, by the same program as `simulate`: nothing is compiled twice."""

    def __init__(self, scene: Scene, state: Sequence[Any] | None = None):
        layout, assets, params, self._first = build(scene)
        self.scene = scene
        self._names = [*(herd.name for herd in scene.herds), *(["world.water"] if scene.water is not None else [])]
        # every step of a call belongs to one recorded frame: the last one is shown
        self._layout = dataclasses.replace(layout, record_every=MOST_FRAMES)
        self._device = jax.devices()[0]
        self._shared = jax.device_put((assets, params), self._device)
        self._run = compiled(self._layout, 1)
        self.reset(state)

    def reset(self, state: Sequence[Any] | None = None) -> None:
        """Back to the scene's start, or to a state that `state` or a `Result` gave. Commands from outside are gone."""
        states = self._first if state is None else self._checked(state)
        # copies: the program overwrites its states
        self._states = jax.device_put(jax.tree.map(lambda leaf: np.array(leaf), tuple(states)), self._device)
        self._faced = [np.zeros(herd.count, bool) for herd in self.scene.herds]

    @property
    def state(self) -> tuple[Any, ...]:
        """Everything needed to go on from here, on the host: for `reset` or `crowd.stepper(scene, state)`."""
        return jax.tree.map(lambda leaf: np.array(leaf), self._states)

    @property
    def water(self) -> np.ndarray | None:
        """Height [rows, columns] m of the water surface that the crowd moves (`scene.water` is its grid)."""
        return None if self.scene.water is None else np.array(self._states[-1].height)

    @property
    def frame(self) -> int:
        """Frames stepped since the start of the scene."""
        state = self._states[0]
        return int(np.asarray(state.frame if state.paced is None else state.paced.frame)[0, 0])

    @property
    def time(self) -> float:
        """s since the start of the scene."""
        return self.frame * self._layout.dt

    @property
    def position(self) -> dict[str, np.ndarray]:
        """Places [n, 3] m of every herd, world."""
        pairs = zip(self.scene.herds, self._states, strict=False)
        return {herd.name: _untiled(_place(self._layout, state), herd.count).T for herd, state in pairs}

    def step(
        self, velocity: Steering | None = None, facing: Steering | None = None, frames: int = 1
    ) -> dict[str, HerdFrame]:
        """`frames` frames on, with new commands; returns what the last of them looks like, by herd.

        velocity: herd -> desired velocities [n, 2] (x, z) or [n, 3] (x, y, z; y is ignored), m/s, world. It ends a walk
        along way-points, paths and trajectories. facing: herd -> headings [n] rad to keep from then on (0 looks along
        +z, positive turns left). Herds not given and rows of NaN keep their last command; a NaN heading gives
        the facing back to the scenario (along the way they walk, unless the herd's `facing` says otherwise).
        """
        if not isinstance(frames, int | np.integer) or isinstance(frames, bool) or not 1 <= frames <= MOST_FRAMES:
            raise fail("frames", f"{frames!r}: must be a whole number from 1 to {MOST_FRAMES:,}")
        wanted = self._read("velocity", velocity, ((2,), (3,)))
        faced = self._read("facing", facing, ((),))
        states = list(self._states)
        for which in sorted(wanted.keys() | faced.keys()):
            states[which] = self._steered(which, states[which], wanted.get(which), faced.get(which))
        count = jax.device_put(np.int32(frames), self._device)
        self._states, shown = self._run(*self._shared, tuple(states), count)
        return {
            herd.name: HerdFrame(herd, self._layout, which, [shown[which]])
            for which, herd in enumerate(self.scene.herds)
        }

    def _read(self, what: str, given: Steering | None, shapes: tuple[tuple[int, ...], ...]) -> dict[int, np.ndarray]:
        """Arrays by number of herd; `InputError` for a name or shape that does not fit."""
        names = [herd.name for herd in self.scene.herds]
        if given is not None and not isinstance(given, Mapping):
            raise fail(what, f"a {type(given).__name__}: must be a mapping of herd to array; herds: {', '.join(names)}")
        out: dict[int, np.ndarray] = {}
        for name, values in (given or {}).items():
            if name not in names:
                raise fail(f"{what}[{name!r}]", f"no such herd{nearest(str(name), names)}; herds: {', '.join(names)}")
            which = names.index(name)
            count = self.scene.herds[which].count
            try:
                array = np.asarray(values, np.float32)
            except (TypeError, ValueError):
                raise fail(f"{what}[{name!r}]", "must be an array of numbers") from None
            if array.shape not in [(count, *shape) for shape in shapes]:
                allowed = " or ".join(str((count, *shape)) for shape in shapes)
                raise fail(f"{what}[{name!r}]", f"shape {array.shape}: must be {allowed} for {count} characters")
            if np.isinf(array).any() or (what == "velocity" and np.nanmax(np.abs(array), initial=0.0) > FASTEST):
                raise fail(f"{what}[{name!r}]", f"must be finite{'' if shapes == ((),) else ', at most 15 m/s'}")
            out[which] = array
        return out

    def _steered(self, which: int, state: State, velocity: np.ndarray | None, facing: np.ndarray | None) -> State:
        """The state with new commands; the padding of the last tile does as the first character."""
        herd, faces = self.scene.herds[which], self._layout.herds[which].faces
        now = {name: _untiled(np.array(getattr(state, name)), herd.count) for name in STEERED}
        if facing is not None:
            self._faced[which] = np.isfinite(facing)
            now["facing"] = np.where(self._faced[which], facing, now["facing"])
        free = np.full(herd.count, facing is not None)
        if velocity is not None:
            flat = velocity[:, [0, -1]].T
            given = np.isfinite(flat).all(0)
            now["desired"] = np.where(given, flat, now["desired"])
            now["waypoint"] = np.where(given, -1, now["waypoint"])
            free = free | given
        guided = now["waypoint"] >= 0
        follows = ~self._faced[which] & ((faces == "along") | ((faces == "track") & ~guided))
        looks = ~self._faced[which] & ((faces == "point") | ((faces == "track") & guided))
        now["follows"] = np.where(free, follows, now["follows"])
        now["looks"] = np.where(free, looks, now["looks"])
        tiles = {name: tiled(values, 1, state.phase.shape[-1]) for name, values in now.items()}
        return dataclasses.replace(state, **jax.device_put(tiles, self._device))

    def _checked(self, state: Sequence[Any]) -> tuple[Any, ...]:
        """A state of this scene; tiles that were added for several devices are left out."""
        if len(state) != len(self._first):
            raise fail("state", f"of {len(state)} herds; the scene has {len(self._first)}: {', '.join(self._names)}")

        def fitting(name: str, mine: Any, given: Any) -> np.ndarray:
            given = np.asarray(given)[: mine.shape[0]]
            if given.shape != mine.shape:
                who = name if name == "world.water" else f"herd '{name}'"
                raise fail("state", f"{who} is of another scene: shape {given.shape} instead of {mine.shape}")
            return given

        return tuple(
            jax.tree.map(lambda mine, given, name=name: fitting(name, mine, given), own, new)
            for name, own, new in zip(self._names, self._first, state, strict=True)
        )


def _place(layout: Layout, state: State) -> np.ndarray:
    """[tiles, 3, n] m, where characters are shown: those that are not stepped every frame are ahead of that."""
    return np.array(state.position if state.paced is None else between(layout, state, no_wall)[0]["position"])


def _untiled(values: np.ndarray, count: int) -> np.ndarray:
    """[tiles, ..., tile] to [..., n], padding removed."""
    moved = np.moveaxis(values, 0, -2)
    return moved.reshape(*moved.shape[:-2], -1)[..., :count]


def stepper(scene: Scene, state: Sequence[Any] | None = None) -> Stepper:
    """A crowd to step call by call, from the scene's start or from an earlier state."""
    return Stepper(scene, state)
