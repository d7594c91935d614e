"""What a frame has to compute and to move at least, counted by hand, and how near the measured time comes to that.

A flop is one addition, multiplication, division, root, comparison, choice or minimum of floats, for one character; a
product and its sum are two. Index arithmetic, gathers and copies are none. What depends on the mesh alone is shared by
the characters of a tile and counts as none; what a kernel computes twice counts once; padding and dry groups of
triangles count as none. So flops are the least this algorithm needs, not what the processor executes.

Bytes are what must cross between memory and the core at least: every number of a character's state read and written
once a frame, its parameters read, what it shows written. Clips and meshes stay in the cache and count as none, and so
do arrays inside a frame: that is what tiles are for.

The limit of a case is the longer of flops at the peak of matrix products and bytes at the peak of streaming, both
measured through JAX on one core in the same run (`benchmarks.peaks`). No kernel here is a matrix product throughout:
comparisons and choices do not pair with multiplications, so a half of the limit is about all there is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

Line = dict[str, Any]

# What `kernels` and `crowd/components` do, operation by operation.
MULTIPLY = 28  # quat.multiply: 4 x (4 products, 3 sums)
ROTATE = 30  # quat.rotate: t is 3 x (2 products, difference, doubling); v + w t + u x t is 3 x 6
NORMALIZE = 13  # quat.normalize: 4 squares, 4 sums, root, 4 divisions
UNIT = 10  # vec.unit: dot 5, sum, root, 3 divisions
BETWEEN = 29  # quat.between: w 8 (dot 5, 2 sums, maximum), cross 9, length 8, 4 divisions
SIN_COS = 43  # trig.sin_cos: reduction 10, two polynomials 20, choices and signs 13
TWO_BONE = 80  # ik.two_bone: line 13, reach 8, law of cosines 12, bend direction 21, knee and foot 21, rest 5


@dataclass(frozen=True)
class Sizes:
    """What the work of one archetype's character goes with."""

    archetype: str
    count: int  # characters
    joints: int
    legs: int
    arms: int
    leg_joints: int  # that inverse kinematics carries along
    arm_joints: int
    triangles: float  # of groups that some character of their tile has in the water, mean over tiles
    blocks: float  # of those triangles, on one bone each (rigid)
    vertices: int
    influences: int
    gaits: int  # clips of locomotion
    clips: int  # sampled and blended in a frame
    moving: int  # joints whose translation is animated


def flops(sizes: Sizes, mesh: str, gait: str) -> dict[str, float]:
    """Flops of a character-frame by stage (`benchmarks.stages`), with gait "footsteps" or "clip" on flat ground."""
    joints, legs, arms = sizes.joints, sizes.legs, sizes.arms
    steps = gait == "footsteps"
    return {
        "sense": 100,  # sin_cos 43, four points about the character 30, fluid of one region 12, differences 16
        "steer": 95,  # sin_cos 43, arc tangent 29, wrap 5, turn 8, course 10
        "forces": 7,  # a sum of wrenches
        # two exact first-order controllers 35 each and their axes 30 with sin_cos 43; two of second order 95 each,
        # with sin_cos and three exponentials; finite or not 30
        "body": 365,
        "gait": _gait(legs, sizes.gaits, steps),
        # blend: 4 components, two table columns of each clip: product and sum; offsets 3; normalise; one level of FK
        "pose": joints * (4 * (4 * sizes.clips - 1) + 3 + NORMALIZE + ROTATE + 3 + MULTIPLY)
        + 3 * sizes.moving * (4 * sizes.clips - 1)
        + 2 * SIN_COS + MULTIPLY + 2 * ROTATE,
        "feet": legs * _leg(sizes.gaits) + 100 if steps else legs * (ROTATE + 12),
        "arms": arms * _arm() + (sizes.arm_joints + sizes.leg_joints * steps) * (MULTIPLY + ROTATE + 6),
        "skin": _skin(sizes) if mesh == "skinned" else 0,
        "drag": drag_skinned(sizes) if mesh == "skinned" else drag_rigid(sizes),
        "record": 15 + 9 * legs,  # places moved to the world: three of each leg, centre of pressure, body
    }  # fmt: skip


def _gait(legs: int, gaits: int, steps: bool) -> float:
    """Clock, and where there are steps their targets and handles (components/footsteps.py)."""
    mix = legs * (4 * (2 * gaits - 1) + 2) + 24 * gaits + 20  # lift, duty and rest of each leg; shares, periods
    clock = 20 + 70 + 27  # followed speeds; pace with sin_cos; table columns
    if not steps:
        return mix + clock
    # of a leg: rest and its turn 14, haste 14, swing with lift-off and closing step 44, aim 12, kept apart 30,
    # handle and yaw 40; of all: three times sin_cos less what the clock had
    return mix + clock + legs * 154 + 92


def _leg(gaits: int) -> float:
    """Inverse kinematics of a leg (components/feet.py)."""
    height = 6 + 6 * gaits  # of the swing: two samples of every clip
    level = SIN_COS + 2 + MULTIPLY + UNIT + 2 + BETWEEN + MULTIPLY  # of the foot: yaw, un-pitched, onto the slope
    goal = 2 * ROTATE + 19  # contact point, ankle over it, differences
    drop = 40  # of the hips: two lengths 15, what the leg spans 16, need 9
    pole = 14 + ROTATE + 26  # lengths; the clip's knee off its line 19, usual bend 7
    segments = 4 * UNIT + 2 * BETWEEN + 18
    return height + level + goal + drop + pole + TWO_BONE + 6 + segments


def _arm() -> float:
    """Raising of an arm (components/arms.py)."""
    goal = 16 + ROTATE + 60  # depth and response; outward; rise 8, hand 8, bend 18, pole 26
    bent = 14 + TWO_BONE
    turns = 4 * UNIT + 6 + 2 * BETWEEN + 24 + 2 * NORMALIZE
    return goal + bent + turns + 2 * ROTATE + 24


def _skin(sizes: Sizes) -> float:
    """Linear blend skinning (kernels/skinning.py): 4 columns of each bone, product and sum for 3 components."""
    matrix = 3 * 5 + 6 * 4 + 9  # diagonal, the rest, scale
    return sizes.joints * matrix + sizes.vertices * (24 * sizes.influences - 3)


def drag_skinned(sizes: Sizes) -> float:
    """Drag on triangles of moving vertices (kernels/drag_skinned.py)."""
    corner = 34  # wet_corner: signs 7, ordering 5, two ratios 9, shares of both kinds 10, sign 3
    weights = 3 + 3 * corner
    means = 2 * 15  # velocity and place of the wet centroid: 3 components of 3 products, 2 sums
    factor = 6 + 15 + 4 + 7 + 11  # edges, area vector times slip, wet share, speed squared, factor_of
    magnitude = 10  # speed 7, product, division by the wet share 2
    sums = 3 + 3 + 5 + 8  # force with its sign, moment, magnitude and slope; eight sums
    return sizes.triangles * (weights + means + factor + magnitude + sums) + 12 * sizes.vertices + APPLIED


def drag_rigid(sizes: Sizes) -> float:
    """Drag on triangles that ride on bones (kernels/drag_rigid.py, drag_moments.py)."""
    depths = 3 * 6  # of the corners: a product and a difference for each component
    share = 22  # wet_share: order 8, which corner 5, cut 7, complement 2
    through = 12 + 5 + 5  # slip v + w x c, N.slip, its square
    factor = 2 + 11  # wet times through, scale; factor_of
    magnitude = 3  # root, sum, product
    moments = 2 * 4 * 2  # four rows for forces and four for magnitudes: product and sum
    triangle = depths + share + through + factor + magnitude + moments
    # a block: whether it is near the water 16; force 21, magnitude 2, moment 36, slope 1, turned to the world; sums 8
    block = 16 + 21 + 2 + 36 + 1 + ROTATE + 8
    # a joint: velocity 12 and spin 36 by difference; both and the vertical turned into its frame 68
    return sizes.triangles * triangle + sizes.blocks * block + sizes.joints * (12 + 36 + 68) + APPLIED


APPLIED = 110  # of a character: centre of pressure, torque with sin_cos 43, slopes (components/skin.py)


def moved(sizes: Sizes, mesh: str) -> dict[str, float]:
    """Bytes of a character-frame by stage: float32, read and written, as in `crowd.state` and `crowd.params`."""
    mesh_numbers = 3 * sizes.vertices if mesh == "skinned" else 7 * sizes.joints  # of the frame before
    return {
        "body": 4 * (2 * 16 + 15),  # body and what is commanded; mass, inertia, gains, damping, size
        "gait": 4 * 2 * (7 + 7 * sizes.legs),  # clock, followed speeds; progress, target, handle, yaw of each foot
        "drag": 4 * 2 * (mesh_numbers + 9),  # and force, torque, slopes
        "record": 4 * (25 + 11 * sizes.legs),  # three places of each leg, planted, out of reach
    }


@dataclass(frozen=True)
class Roof:
    """A case against the limits of its machine."""

    case: str
    us: float  # of a character-frame, all its cores together
    flops: float  # of a character-frame
    bytes: float
    peak_gflops: float  # of one core
    peak_gbytes: float  # 1e9 bytes a second

    @property
    def gflops(self) -> float:
        """Attained."""
        return self.flops / self.us / 1e3

    @property
    def gbytes(self) -> float:
        """Attained, 1e9 bytes a second."""
        return self.bytes / self.us / 1e3

    @property
    def limit_us(self) -> float:
        """The least time that computing and moving allow."""
        return max(self.flops / self.peak_gflops, self.bytes / self.peak_gbytes) / 1e3

    @property
    def share(self) -> float:
        """Of the limit's speed that is attained; 1 cannot be passed."""
        return self.limit_us / self.us


def counted(line: Line) -> dict[str, tuple[float, float]] | None:
    """(flops, bytes) of the mean character-frame of a line of results by stage; None where nothing is counted:
    other gaits than footsteps and clips, uneven ground, gradients."""
    if not line.get("sizes") or line.get("gait") not in ("footsteps", "clip") or line.get("rubble"):
        return None
    total: dict[str, tuple[float, float]] = {}
    herds = [Sizes(**each) for each in line["sizes"]]
    for herd in herds:
        share = herd.count / sum(each.count for each in herds)
        work, size = flops(herd, line["mesh"], line["gait"]), moved(herd, line["mesh"])
        if not line["water"]:
            work |= dict.fromkeys(("skin", "drag"), 0.0)
            size["drag"] = 0.0
        for stage in work:
            before = total.get(stage, (0.0, 0.0))
            total[stage] = before[0] + share * work[stage], before[1] + share * size.get(stage, 0.0)
    return total


def roofs(lines: list[Line]) -> list[Roof]:
    """Every counted case of a run that also measured its machine's peaks; empty without those."""
    peaks = next((line for line in lines if line["kind"] == "peaks" and "error" not in line), None)
    found = []
    for line in lines if peaks else ():
        count = counted(line) if line["kind"] == "case" and "us" in line else None
        if count and peaks:
            flop, byte = (sum(each[k] for each in count.values()) for k in (0, 1))
            us = line["us"] * line["devices"]
            found.append(Roof(line["case"], us, flop, byte, peaks["gflops"], peaks["gbytes"]))
    return found
