"""Numbers one may sweep or tune: traced, never a reason to recompile."""

from __future__ import annotations

from jax import Array

from crowd.tree import pytree
from kernels.body_tilt import Tilt
from kernels.river import River
from kernels.turbulence import Eddies
from kernels.waves import Waves


@pytree
class Sigmoid:
    """a / (1 + exp(-b (density - c)))."""

    a: Array
    b: Array
    c: Array


@pytree
class WaveTrains:
    """W components of all regions, see `kernels.waves`."""

    waves: Waves
    region: Array  # [W] number of the region that each belongs to


@pytree
class Turbulence:
    """M modes of all regions, see `kernels.turbulence`."""

    eddies: Eddies
    region: Array  # [M] number of the region that each belongs to


@pytree
class Layers:
    """L fluids below the top one of R regions, from the top down."""

    density: Array  # [L, R] kg/m3
    drag_override: Array  # [L, R] as in `Fluids`
    offset_override: Array  # [L, R]
    top: Array  # [L, R] m
    flow: Array  # [3, L, R] m/s


@pytree
class Fluids:
    """Regions in order of priority, the last one that holds a character counts. R regions."""

    base_drag: Sigmoid  # C_D0
    offset_force: Sigmoid  # B, N
    density: Array  # [R] kg/m3
    drag_override: Array  # [R] C_D0 where a fluid names its own, else < 0
    offset_override: Array  # [R] N, else < 0
    surface: Array  # [R] m
    flow: Array  # [3, R] m/s
    low: Array  # [2, R] m, corner of the region (x, z)
    high: Array  # [2, R] m
    trains: WaveTrains | None = None
    layers: Layers | None = None
    tension: Array | None = None  # [R] N/m
    rivers: River | None = None  # of every region; speed 0 where there is none
    turbulence: Turbulence | None = None


@pytree
class Control:
    """How characters respond, for a character of scale 1; see crowd/components."""

    filter_time: Array  # s, low-pass of the speed that steps follow (the paper's reaction time)
    stand_ratio: Array  # of the clip's own speed: slower characters stand
    side_ratio: Array  # of the clip's own speed: sideways motion below it is ignored by steps
    close_time: Array  # s, of a closing step
    close_distance: Array  # of the leg's length: a standing foot further from its rest place steps
    foot_gap: Array  # of the feet's rest distance: lateral gap that a step must keep
    ground_time: Array  # s, low-pass of the ground height under the body
    slope_gain: Array  # share of gravity's pull along the slope that acts on the body
    arm_margin: Array  # m, of hands above the surface


@pytree
class StrideControl:
    """Constants of the semi-procedural system, for characters of scale 1 (section 7.1 of its specification)."""

    most_foot_turn: Array  # rad, a foot against the body
    most_adjustment: Array  # m, of a footbase against the clip
    least_step: Array  # m, shorter ones are not worth taking
    longest_cycle: Array  # s
    most_turn: Array  # rad, of the body in a cycle
    most_acceleration: Array  # m/s2, harder ones hurry the steps
    blend_time: Array  # s, over which weights follow the velocity
    upright: Array  # m2, how strongly the axis of the ground keeps to the vertical
    tilt: Tilt


@pytree
class Load:
    """What a character carries; see `kernels.carrying`. In the axes of the trunk, from the middle of the hips."""

    mass: Array  # [n] kg; in a frame, after `crowd.components.load.laden`: as much of it as is carried then
    ahead: Array  # [n] m
    above: Array  # [n] m
    trunk: Array  # [n] kg m, mass above the hips times its middle's height over them
    balances: Array  # [n] 1: leans so that all stands over the hips, on two legs; 0: on more the legs hold it
    size: Array  # [n] over a person's
    starts: Array  # [n] 1 where it is carried from the start
    event: Array  # [E, n] 1 where an event of `Events.loads` meets the character


@pytree
class Transitions:
    """When resistance ends a jog or a walk; see `kernels.effort`. Speeds at the character's size."""

    walk_below: Array  # [n] m/s
    stop_below: Array  # [n] m/s
    hysteresis: Array  # [n] share above them
    react_time: Array  # [n] s
    rest_time: Array  # [n] s, after which one tries again
    height: Array  # [n] m: deeper fluid than this drags no more


@pytree
class ArmResponse:
    """When and how far arms are raised; see `kernels.arm_limits`."""

    band: Array  # [n] m, of depth, between going up and coming down
    time: Array  # [n] s
    cos_bent: Array  # [n] cosine of the elbow's angle when bent most
    cos_stretched: Array  # [n] when stretched most
    tan_back: Array  # [n] of the angle behind the plane of the shoulders


@pytree
class HighStep:
    """How feet leave shallow water; see `kernels.high_step`."""

    clearance: Array  # [n] m, above the surface
    most: Array  # [n] m, depth of water up to which they do


@pytree
class LegClearance:
    """How far legs keep apart; see `kernels.leg_clearance`."""

    gap: Array  # [P, n] m, of each pair of `HerdLayout.near`


@pytree
class Responses:
    """How bodies respond beyond what all do; what a herd does not have is None."""

    load: Load | None = None
    transitions: Transitions | None = None
    arms: ArmResponse | None = None
    high_step: HighStep | None = None
    clearance: LegClearance | None = None
    reaction: Array | None = None  # [n] s, in place of the usual low-pass of the speed that steps follow


@pytree
class Pace:
    """When a tile is stepped that is not stepped every frame; but for `padding` alike for all of its characters."""

    turn: Array  # [n] int32, remainder of the frames at which it is its turn
    far: Array  # [n] m, distance from `viewpoint` beyond which it is slow
    viewpoint: Array  # [2, n] m, world (x, z)
    calm: Array  # [n] m/s2, changes of velocity below which it is slow
    padding: Array  # [n] bool: nobody, says nothing


@pytree
class Character:
    """Per character: trailing axis n, in tiles."""

    scale: Array  # [n] of lengths
    mass: Array  # [n] kg
    speed: Array  # [n] factor on desired speeds
    gain_forward: Array  # [n] N s/m (k of Eq. 1 along the heading)
    gain_side: Array  # [n] N s/m (k across it)
    damping: Array  # [n] kg (b of Eq. 1)
    yaw_inertia: Array  # [n] kg m2
    yaw_gain: Array  # [n] N m/rad
    yaw_damping: Array  # [n] N m s
    pitch_inertia: Array  # [n] kg m2
    pitch_gain: Array  # [n] N m/rad
    pitch_damping: Array  # [n] N m s
    offset: Array  # [2, n] m, from the herd's way-points or path
    way_speed: Array  # [n] m/s, along way-points or a path
    acceleration: Array  # [n] m/s2, of the command
    deceleration: Array  # [n] m/s2
    turn_rate: Array  # [n] rad/s, of the heading
    track: Array  # [5, m, n] trajectory: place (x, z) m, velocity (x, z) m/s, heading rad, from the run's start
    impulse: Array  # [E, n] 1 where an impulse event meets the character
    turn: Array  # [E, n] 1 where a velocity event meets it
    style: Array  # [E, n] 1 where an event of the herd's `StyleEvents` meets it
    number: Array | None = None  # [n] int32 of its own, for random numbers; where it rains impulses
    rain: Array | None = None  # [K, n] 1 where a rain meets the character
    displaced: Array | None = None  # [n] kg, body density times the volume of its mesh: for buoyancy
    responses: Responses = Responses()
    pace: Pace | None = None


@pytree
class Showers:
    """K rains of impulses."""

    key: Array  # [K, 2] uint32
    span: Array  # [2, K] int32, frames from and to
    rate: Array  # [K] 1/s
    size: Array  # [K] N s


@pytree
class Loads:
    """E times at which loads are picked up or put down, in their order."""

    frame: Array  # [E] int32
    carried: Array  # [E] 1 from then on, or 0


@pytree
class Events:
    """E impulses and velocity changes, by frame."""

    impulse_frame: Array  # [E] int32
    impulse: Array  # [E, 3] N s
    impulse_local: Array  # [E] 1: axes of the character
    turn_frame: Array  # [E] int32
    turn: Array  # [E, 2] m/s (x, z)
    turn_local: Array  # [E] 1: axes of the character
    turn_faces: Array  # [E] 1: the event says where to face
    turn_facing: Array  # [E] rad, where
    rain: Showers | None = None
    loads: Loads | None = None


@pytree
class StyleEvents:
    """E changes of style and plays of clips that meet one herd, by frame (spec 6.4, 6.5)."""

    frame: Array  # [E] int32, when the cross-fade begins
    target: Array  # [E] int32, channel: the herd's styles first, then its extras
    fade: Array  # [E] s, of the cross-fade there, and back from a clip; may be 0
    hold: Array  # [E] s from `frame` until the fade back to the style begins; inf for styles


@pytree
class WaterParams:
    """A water surface that the crowd moves."""

    surface: Array  # [] m, world, when still
    depth: Array  # [] m
    strength: Array  # [] factor on what bodies displace
    current: Array  # [2] m/s (x, z)


@pytree
class Params:
    fluids: Fluids
    control: Control
    events: Events
    strides: tuple[StrideControl, ...]  # per herd; empty for the other gaits
    characters: tuple[Character, ...]  # per herd, [tiles, ..., 128]
    styles: tuple[StyleEvents, ...]  # per herd
    water: WaterParams | None = None
