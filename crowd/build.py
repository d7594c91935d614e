"""Scene to the four trees: layout, assets, params and the initial state."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np

from crowd.assets import Assets, World
from crowd.courses import formation
from crowd.herd_assets import herd_assets, herd_layout
from crowd.initial import initial_state
from crowd.layout import TILE, Layout
from crowd.params import Character, Control, Events, Fluids, Params, Sigmoid
from crowd.scenario_control import turn_rate
from crowd.scenario_world import Sigmoid as SigmoidModel
from crowd.scene import HerdScene, Scene, by_priority
from crowd.state import State

Program = tuple[Layout, Assets, Params, tuple[State, ...]]

AT_ONCE = 1e6  # m/s2, where one of two limits is left out
# Gains that behaved for a person of 70 kg and 1.70 m; others are scaled with mass and size (Froude similarity).
PERSON_MASS, PERSON_SIZE = 70.0, 1.70
GAINS = dict(gain_forward=900.0, gain_side=250.0, damping=70.0)
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


def build(scene: Scene, devices: int = 1, walls: bool = True, tile: int = TILE) -> Program:
    """The program of a scene. Characters are padded to whole tiles, tiles to a multiple of `devices`."""
    layout = _layout(scene, walls)
    assets = Assets(tuple(herd_assets(herd) for herd in scene.herds), _world(scene))
    params = Params(
        fluids=_fluids(scene),
        control=_control(),
        events=_events(scene),
        characters=tuple(Character(**_tiled(_character(scene, herd), devices, tile)) for herd in scene.herds),
    )
    states = tuple(State(**_tiled(initial_state(scene, herd, layout), devices, tile)) for herd in scene.herds)
    assets, params, states = jax.device_put((assets, params, states))
    return layout, assets, params, states


def tiled(values: np.ndarray, devices: int, tile: int) -> np.ndarray:
    """[..., n] to [tiles, ..., tile]; the padding repeats the first character."""
    values = np.asarray(values)
    count = values.shape[-1]
    tiles = -(-count // tile)
    tiles = -(-tiles // devices) * devices
    index = np.concatenate([np.arange(count), np.zeros(tiles * tile - count, int)])
    split = values[..., index].reshape(*values.shape[:-1], tiles, tile)
    kind = values.dtype if values.dtype.kind in "ib" else np.float32
    return np.ascontiguousarray(np.moveaxis(split, -2, 0)).astype(kind)


def _tiled(fields: dict[str, np.ndarray], devices: int, tile: int) -> dict[str, Any]:
    return {name: tiled(values, devices, tile) for name, values in fields.items()}


def _layout(scene: Scene, walls: bool) -> Layout:
    scenario = scene.scenario
    impulses = sum(event.impulse_n_s is not None for event in scenario.events)
    names = ["slope"] if scene.terrain.kind in ("slope", "ramp", "grid") else []
    names += ["impulse"] if impulses else []
    names += ["drag"] if scenario.world.fluids else []
    grid = scene.terrain.grid
    return Layout(
        herds=tuple(herd_layout(herd) for herd in scene.herds),
        dt=1.0 / scenario.rate_hz,
        ground=scene.terrain.kind,
        ground_shape=grid.shape if grid is not None else (1, 1),  # pyright: ignore[reportArgumentType]
        regions=len(scenario.world.fluids),
        turns=len(scenario.events) - impulses,
        footsteps=scenario.gait == "footsteps",
        schedule=scenario.schedule,
        mesh=scenario.drag.mesh,
        submersion=scenario.drag.submersion,
        offset_mode=scenario.drag.b_mode,
        arms_up=tuple(herd.model.arms_up for herd in scene.herds),
        forces=tuple(names),
        record_pose=scenario.record.pose,
        record_every=scenario.rate_hz // scenario.record.rate_hz,
        walls=walls,
    )


def _world(scene: Scene) -> World:
    ground = scene.terrain
    grid = ground.grid if ground.grid is not None else np.zeros((1, 1))
    return World(*(_f32(v) for v in (ground.parameters, ground.axis, grid.reshape(-1), ground.origin, ground.cell)))


def _f32(values: np.ndarray | float) -> Any:
    """On the host: `build` sends everything to the device at once."""
    return np.asarray(values, np.float32)


def _sigmoid(model: SigmoidModel) -> Sigmoid:
    return Sigmoid(_f32(model.a), _f32(model.b), _f32(model.c))


def _fluids(scene: Scene) -> Fluids:
    table, regions = scene.scenario.fluid_table, by_priority(scene.scenario)
    named = [table.fluids.get(region.fluid) if region.fluid else None for region in regions]
    resolved = [table.fluid(region) for region in regions]

    def override(attribute: str) -> Any:
        values = [getattr(fluid, attribute) if fluid else None for fluid in named]
        return _f32(np.array([-1.0 if value is None else value for value in values]))

    far = 1e9
    low = [(r.area_m.x[0], r.area_m.z[0]) if r.area_m else (-far, -far) for r in regions]
    high = [(r.area_m.x[1], r.area_m.z[1]) if r.area_m else (far, far) for r in regions]
    return Fluids(
        base_drag=_sigmoid(table.base_drag),
        offset_force=_sigmoid(table.offset_force_n),
        density=_f32(np.array([fluid.density_kg_m3 for fluid in resolved])),
        drag_override=override("drag_coefficient"),
        offset_override=override("offset_force_n"),
        surface=_f32(np.array([region.surface_m for region in regions])),
        flow=_f32(np.array([region.flow_m_s for region in regions]).reshape(-1, 3).T),
        low=_f32(np.array(low).reshape(-1, 2).T),
        high=_f32(np.array(high).reshape(-1, 2).T),
    )


def _control() -> Control:
    return Control(
        filter_time=_f32(0.35),
        stand_ratio=_f32(0.115),
        side_ratio=_f32(0.115),
        close_time=_f32(0.45),
        close_distance=_f32(0.11),
        foot_gap=_f32(0.6),
        ground_time=_f32(0.12),
        slope_gain=_f32(1.0),
        arm_margin=_f32(0.08),
    )


def _events(scene: Scene) -> Events:
    events, rate = scene.scenario.events, scene.scenario.rate_hz
    pushes = [event for event in events if event.impulse_n_s is not None]
    turns = [event for event in events if event.impulse_n_s is None]

    def frames(chosen: list) -> Any:
        return np.array([round(event.at_s * rate) for event in chosen], np.int32)

    def local(chosen: list) -> Any:
        return _f32(np.array([event.frame == "character" for event in chosen]))

    return Events(
        impulse_frame=frames(pushes),
        impulse=_f32(np.array([event.impulse_n_s for event in pushes]).reshape(-1, 3)),
        impulse_local=local(pushes),
        turn_frame=frames(turns),
        turn=_f32(np.array([event.turn for event in turns]).reshape(-1, 2)),
        turn_local=local(turns),
        turn_faces=_f32(np.array([event.facing_deg is not None for event in turns])),
        turn_facing=_f32(np.radians([event.facing_deg or 0.0 for event in turns])),
    )


def _character(scene: Scene, herd: HerdScene) -> dict[str, np.ndarray]:
    """Fields of a herd's `Character`, not yet in tiles."""
    mass, scale = herd.mass, herd.scale
    heavy = mass / PERSON_MASS
    size = scale * _extent(herd) / PERSON_SIZE
    values = {name: heavy * value for name, value in GAINS.items()}
    for group in (YAW, PITCH):
        values |= {name: heavy * size**2 * value for name, value in group.items()}
    for name, key in KEYS.items():
        given = getattr(herd.model.gains, key)
        if given is not None:
            values[name] = np.full_like(mass, given)
    return dict(
        scale=scale,
        mass=mass,
        speed=herd.speed,
        **_guidance(herd),
        impulse=_chosen(scene, herd, impulses=True),
        turn=_chosen(scene, herd, impulses=False),
        **values,
    )


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


def _extent(herd: HerdScene) -> float:
    """m, the longest side of the archetype's body: what its inertia goes with."""
    return float(np.ptp(herd.archetype.mesh.vertices[:, 1:], axis=0).max())


def _chosen(scene: Scene, herd: HerdScene, impulses: bool) -> np.ndarray:
    """[E, n] 1 where an event meets a character."""
    rows = []
    for event in scene.scenario.events:
        if (event.impulse_n_s is not None) != impulses:
            continue
        row = np.zeros(herd.count)
        if event.herds is None or herd.name in event.herds:
            row[slice(None) if event.characters == "all" else list(event.characters)] = 1.0
        rows.append(row)
    return np.array(rows).reshape(-1, herd.count)
