"""Scene to the four trees: layout, assets, params and the initial state."""

from __future__ import annotations

import dataclasses
import hashlib
from typing import Any

import jax
import numpy as np

from crowd.assets import Assets, GroundLayer, World
from crowd.courses import formation
from crowd.fluid_build import fluid_layout, fluids
from crowd.ground import Ground
from crowd.ground_layer import Layer
from crowd.herd_assets import extent, herd_assets, herd_layout
from crowd.herd_responses import load_events, remembered, responses, short_arms
from crowd.host_arrays import f32, i32
from crowd.initial import initial_state
from crowd.layout import TILE, WIDE, GroundLayout, Layout, tile_width
from crowd.params import Character, Control, Events, Pace, Params, Showers, StyleEvents
from crowd.scenario_control import turn_rate
from crowd.scenario_herd import Event
from crowd.scene import HerdScene, Scene
from crowd.state import Footsteps, State, Strides, begun
from crowd.stride_assets import stride_control
from crowd.water_assets import still_water, water_assets, water_layout, water_params

Program = tuple[Layout, Assets, Params, tuple[Any, ...]]  # a `State` per herd, then the `Water` where there is one

AT_ONCE = 1e6  # m/s2, where one of two limits is left out
# Gains that behaved for a person of 70 kg and 1.70 m; others are scaled with mass and size (Froude similarity).
PERSON_MASS, PERSON_SIZE = 70.0, 1.70
GAINS = dict(gain_forward=900.0, gain_side=250.0, damping=70.0)
MEASURED = dict(gain_forward=165.0)  # preset `measured`: configs/tune_measured_wading.yaml, at C_D0 = 1.08
YAW = dict(yaw_inertia=4.0, yaw_gain=500.0, yaw_damping=100.0)
PITCH = dict(pitch_inertia=12.0, pitch_gain=1500.0, pitch_damping=250.0)
KEYS = dict(
    gain_forward="velocity_n_s_m",
    gain_side="lateral_n_s_m",
    damping="damping_kg",
    yaw_inertia="yaw_inertia_kg_m2",
    yaw_gain="yaw_n_m_rad",
    yaw_damping="yaw_damping_n_m_s",
    pitch_inertia="pitch_inertia_kg_m2",
    pitch_gain="pitch_n_m_rad",
    pitch_damping="pitch_damping_n_m_s",
)


def build(scene: Scene, devices: int = 1, walls: bool | None = None, tile: int | None = None) -> Program:
    """The program of a scene. Characters are padded to whole tiles, tiles to a multiple of `devices`.

    walls, tile: left out, what suits the devices. Processors want tiles of `TILE` characters (fewer for small herds)
    behind walls; on other devices kernels are better large: no walls, and one tile on each, as wide as its share of the
    herd.
    """
    small = jax.default_backend() == "cpu"
    widths = {h.name: tile or (tile_width(h.count) if small else WIDE) for h in scene.herds}
    layout = _layout(scene, small if walls is None else walls)
    assets = Assets(tuple(herd_assets(herd) for herd in scene.herds), ground_world(scene.terrain), water_assets(scene))
    params = Params(
        fluids=fluids(scene),
        control=_control(),
        events=_events(scene),
        strides=tuple(stride_control(herd, layout.compat) for herd in scene.herds)
        if layout.gait == "semi_procedural"
        else (),
        characters=tuple(_characters(scene, herd, devices, widths[herd.name]) for herd in scene.herds),
        styles=tuple(_styles(scene, herd) for herd in scene.herds),
        water=water_params(scene),
    )
    states = tuple(
        _state(scene, herd, layout, which, devices, widths[herd.name]) for which, herd in enumerate(scene.herds)
    )
    states = (*states, *still_water(scene))
    assets, params, states = jax.device_put((assets, params, states))
    return layout, assets, params, states


def _characters(scene: Scene, herd: HerdScene, devices: int, tile: int) -> Character:
    size = herd.scale * extent(herd) / PERSON_SIZE
    own = jax.tree.map(lambda values: tiled(values, devices, tile), responses(scene, herd, size))
    pace = None if herd.model.detail is None or herd.model.detail.every == 1 else _pace(herd, devices, tile)
    return Character(**_tiled(_character(scene, herd), devices, tile), responses=own, pace=pace)


def _pace(herd: HerdScene, devices: int, tile: int) -> Pace:
    """Turns of the tiles, one after the other."""
    detail = herd.model.detail
    assert detail is not None
    fields = dict(
        turn=np.zeros(herd.count, np.int32),
        far=np.full(herd.count, detail.far_m or 0.0),
        viewpoint=np.tile(np.array(detail.from_m or (0.0, 0.0))[:, None], herd.count),
        calm=np.full(herd.count, detail.calm_m_s2 or 0.0),
        padding=np.zeros(herd.count, bool),
    )
    pace = Pace(**_tiled(fields, devices, tile))
    padding = (np.arange(pace.turn.size) >= herd.count).reshape(pace.turn.shape)
    turns = np.arange(len(pace.turn), dtype=np.int32) % detail.every
    turn = np.ascontiguousarray(np.broadcast_to(turns[:, None], pace.turn.shape))
    return dataclasses.replace(pace, turn=turn, padding=padding)


def _state(scene: Scene, herd: HerdScene, layout: Layout, which: int, devices: int, tile: int) -> State:
    layout = layout.of(which)
    fields = initial_state(scene, herd, layout)
    gait = _tiled(fields.pop("gait"), devices, tile)
    kind = Strides if layout.gait == "semi_procedural" else Footsteps
    responded = jax.tree.map(lambda values: tiled(values, devices, tile), remembered(herd))
    state = State(gait=kind(**gait), **_tiled(fields, devices, tile), responded=responded)
    return state if layout.herds[which].pace is None else begun(layout, layout.herds[which], state)


def tiled(values: np.ndarray, devices: int, tile: int) -> np.ndarray:
    """[..., n] to [tiles, ..., tile]; the padding repeats the first character. tile `WIDE`: one for each device."""
    values = np.asarray(values)
    count = values.shape[-1]
    if tile == WIDE:
        tile = TILE * -(-count // (TILE * devices))
    tiles = -(-count // tile)
    tiles = -(-tiles // devices) * devices
    index = np.concatenate([np.arange(count), np.zeros(tiles * tile - count, int)])
    split = values[..., index].reshape(*values.shape[:-1], tiles, tile)
    kind = values.dtype if values.dtype.kind in "ib" else np.float32
    return np.ascontiguousarray(np.moveaxis(split, -2, 0)).astype(kind)


def _tiled(fields: dict[str, Any], devices: int, tile: int) -> dict[str, Any]:
    return {name: None if values is None else tiled(values, devices, tile) for name, values in fields.items()}


def _layout(scene: Scene, walls: bool) -> Layout:
    scenario = scene.scenario
    moving = [event for event in scenario.events if event.moves]
    impulses = sum(event.impulse_n_s is not None for event in moving)
    names = ["slope"] if any(layer.kind not in ("flat", "steps") for layer in scene.terrain.layers) else []
    names += ["impulse"] if impulses else []
    names += ["rain"] if any(event.rain for event in scenario.events) else []
    names += ["load"] if any(herd.model.load for herd in scene.herds) else []
    names += ["drag"] if scenario.world.fluids else []
    return Layout(
        herds=tuple(herd_layout(herd) for herd in scene.herds),
        dt=1.0 / scenario.rate_hz,
        ground=ground_layout(scene.terrain),
        regions=len(scenario.world.fluids),
        turns=len(moving) - impulses,
        gait=scenario.gait,
        bands=scenario.bands,
        compat=scenario.compat,
        schedule=scenario.schedule,
        mesh=scenario.drag.mesh,
        submersion=scenario.drag.submersion,
        offset_mode=scenario.drag.b_mode,
        arms_up=tuple(
            herd.model.arms_up and not (herd.model.responses.arms and short_arms(herd)) for herd in scene.herds
        ),
        forces=tuple(names),
        record_pose=scenario.record.pose,
        record_every=scenario.rate_hz // scenario.record.rate_hz,
        walls=walls,
        fluid=fluid_layout(scene),
        water=water_layout(scene),
    )


def ground_world(ground: Ground) -> World:
    """The ground's arrays, on the host."""
    layers = tuple(_ground_layer(layer) for layer in ground.layers)
    return World(layers, f32(ground.max_step_height), f32(ground.min_normal_y))


def ground_layout(ground: Ground) -> tuple[GroundLayout, ...]:
    """What the program has to know of each level of the ground."""
    return tuple(
        GroundLayout(
            kind=layer.kind,
            shape=(1, 1) if layer.grid is None else (layer.grid.shape[0], layer.grid.shape[1]),
            post=layer.post,
            gaps=layer.gap is not None,
            bounded=layer.area is not None,
        )
        for layer in ground.layers
    )


def _ground_layer(layer: Layer) -> GroundLayer:
    low, high = layer.area if layer.area is not None else (np.zeros(2), np.zeros(2))
    grid = layer.grid if layer.grid is not None else np.zeros(0)
    post = np.array(layer.post, float)[::-1]  # column, row
    return GroundLayer(
        parameters=f32(layer.parameters),
        base=f32(layer.base),
        axis=f32(layer.axis),
        grid=f32(grid.reshape(-1)),
        gap=f32(0.0 if layer.gap is None else layer.gap),
        origin=f32(layer.origin + post * layer.cell),
        cell=f32(layer.cell),
        low=f32(low),
        high=f32(high),
    )


def _control() -> Control:
    return Control(
        filter_time=f32(0.35),
        stand_ratio=f32(0.115),
        side_ratio=f32(0.115),
        close_time=f32(0.45),
        close_distance=f32(0.11),
        foot_gap=f32(0.6),
        ground_time=f32(0.12),
        slope_gain=f32(1.0),
        arm_margin=f32(0.08),
    )


def _events(scene: Scene) -> Events:
    events, rate = [event for event in scene.scenario.events if event.moves], scene.scenario.rate_hz
    pushes = [event for event in events if event.impulse_n_s is not None]
    turns = [event for event in events if event.impulse_n_s is None]

    def frames(chosen: list) -> Any:
        return np.array([round(event.at_s * rate) for event in chosen], np.int32)

    def local(chosen: list) -> Any:
        return f32(np.array([event.frame == "character" for event in chosen]))

    return Events(
        impulse_frame=frames(pushes),
        impulse=f32(np.array([event.impulse_n_s for event in pushes]).reshape(-1, 3)),
        impulse_local=local(pushes),
        turn_frame=frames(turns),
        turn=f32(np.array([event.turn for event in turns]).reshape(-1, 2)),
        turn_local=local(turns),
        turn_faces=f32(np.array([event.facing_deg is not None for event in turns])),
        turn_facing=f32(np.radians([event.facing_deg or 0.0 for event in turns])),
        rain=_rain(scene),
        loads=load_events(scene),
    )


def _rain(scene: Scene) -> Showers | None:
    """Rains of impulses; None without any."""
    rate, seed = scene.scenario.rate_hz, scene.scenario.seed
    showers = [(event.at_s, event.rain) for event in scene.scenario.events if event.rain is not None]
    if not showers:
        return None
    spans = [(at, at + (rain.for_s or 1e6)) for at, rain in showers]
    return Showers(
        key=np.stack([np.array([seed, 0x7A1 + k], np.uint32) for k in range(len(showers))]),  # pyright: ignore[reportArgumentType]
        span=i32(np.array([[round(min(time * rate, 2e9)) for time in span] for span in spans]).T),
        rate=f32(np.array([rain.rate_hz for _, rain in showers])),
        size=f32(np.array([rain.impulse_n_s for _, rain in showers])),
    )


def _rained(scene: Scene, herd: HerdScene) -> dict[str, np.ndarray | None]:
    """A number for every character, whatever other herds and however many there are, and whom rain meets."""
    events = [event for event in scene.scenario.events if event.rain is not None]
    if not events:
        return dict(number=None, rain=None)
    rows = np.zeros((len(events), herd.count))
    for row, event in zip(rows, events, strict=True):
        if event.herds is None or herd.name in event.herds:
            row[_who(event)] = 1.0
    first = int.from_bytes(hashlib.blake2b(herd.name.encode(), digest_size=4).digest(), "little")
    return dict(number=((first + np.arange(herd.count)) % 2**31).astype(np.int32), rain=rows)


def gains(herd: HerdScene) -> dict[str, np.ndarray]:
    """Controller gains [n] by their names in `Character`: those given, others by mass and size (Froude similarity)."""
    heavy = herd.mass / PERSON_MASS
    size = herd.scale * extent(herd) / PERSON_SIZE
    usual = GAINS | (MEASURED if herd.model.gains.preset == "measured" else {})
    values = {name: heavy * value for name, value in usual.items()}
    for group in (YAW, PITCH):
        values |= {name: heavy * size**2 * value for name, value in group.items()}
    for name, key in KEYS.items():
        given = getattr(herd.model.gains, key)
        if given is not None:
            values[name] = np.full_like(herd.mass, given)
    return values


def _character(scene: Scene, herd: HerdScene) -> dict[str, Any]:
    """Fields of a herd's `Character`, not yet in tiles."""
    return dict(
        scale=herd.scale,
        mass=herd.mass,
        speed=herd.speed,
        **_guidance(herd),
        impulse=_chosen(scene, herd, impulses=True),
        turn=_chosen(scene, herd, impulses=False),
        style=_playing(scene, herd),
        **_rained(scene, herd),
        displaced=_displaced(herd) if scene.scenario.world.buoyancy else None,
        **gains(herd),
    )


def _styles(scene: Scene, herd: HerdScene) -> StyleEvents:
    events, rate, plays = scene.scenario.events, scene.scenario.rate_hz, herd.plays
    return StyleEvents(
        frame=i32([round(events[play.event].at_s * rate) for play in plays]),
        target=i32([play.channel for play in plays]),
        fade=f32(np.array([play.fade for play in plays])),
        hold=f32(np.array([play.hold for play in plays])),
    )


def _playing(scene: Scene, herd: HerdScene) -> np.ndarray:
    """[E, n] 1 where a style or clip event of the herd meets a character."""
    rows = np.zeros((len(herd.plays), herd.count))
    for row, play in zip(rows, herd.plays, strict=True):
        row[_who(scene.scenario.events[play.event])] = 1.0
    return rows


def _who(event: Event) -> slice | list[int]:
    return slice(None) if event.characters == "all" else list(event.characters)


def _guidance(herd: HerdScene) -> dict[str, np.ndarray]:
    """Fields of a herd's `Character` that steer it."""
    count, model, limits = herd.count, herd.model, herd.model.limits
    way = model.waypoints or model.path
    kept = formation(model.path) if model.path else bool(way and way.keep_formation)
    quicken, slow = limits.acceleration_m_s2, limits.deceleration_m_s2
    track, table = herd.track, np.zeros((5, 0, count))
    if track is not None:
        table = np.concatenate([track.place.T, track.velocity.T, track.heading.T[None]]).transpose(0, 2, 1)
    return dict(
        offset=(herd.points - herd.points.mean(0)).T if kept else np.zeros((2, count)),
        way_speed=(way.speed_m_s if way else 0.0) * herd.speed,
        acceleration=np.full(count, AT_ONCE if quicken is None else quicken),
        deceleration=np.full(count, slow or quicken or AT_ONCE),
        turn_rate=np.full(count, turn_rate(limits)),
        track=table,
    )


def _displaced(herd: HerdScene) -> np.ndarray:
    """[n] kg: mass the mesh would have at the body's density."""
    mesh = herd.drag_mesh
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles], 1, 0)
    volume = max(float((np.cross(a, b) * c).sum() / 6.0), 1e-12)
    return herd.model.body_density_kg_m3 * volume * herd.scale**3


def _chosen(scene: Scene, herd: HerdScene, impulses: bool) -> np.ndarray:
    """[E, n] 1 where an event meets a character."""
    rows = []
    for event in scene.scenario.events:
        if not event.moves or (event.impulse_n_s is not None) != impulses:
            continue
        row = np.zeros(herd.count)
        if event.herds is None or herd.name in event.herds:
            row[_who(event)] = 1.0
        rows.append(row)
    return np.array(rows).reshape(-1, herd.count)
