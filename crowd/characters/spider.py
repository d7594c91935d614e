"""An eight-legged walker of 1.1 m and 24 kg, generated: a spider's plan at the size of a dog.

Gaits: alternating tetrapod (each leg half a cycle from its opposite and its neighbours), walking with a duty factor of
0.6 and running with 0.45.
"""

from __future__ import annotations

from crowd.characters import arthropod
from crowd.characters.arthropod import Gait, Plan
from crowd.types import Archetype

PLAN = Plan(
    name="spider",
    height=0.56,
    mass=24.0,
    centre={  # name: (parent, position standing, m)
        "thorax": ("", (0.0, 0.355, 0.0)),
        "head": ("thorax", (0.0, 0.365, 0.160)),
        "abdomen": ("thorax", (0.0, 0.365, -0.185)),
        "abdomen_end": ("abdomen", (0.0, 0.385, -0.330)),
    },
    feeler="palp",
    feeler_places=((0.034, 0.345, 0.215), (0.052, 0.330, 0.290)),
    feeler_end=(-0.010, -0.060, 0.045),
    feeler_radii=(0.018, 0.016, 0.010),
    rows={
        "front": (0.115, 58.0, (0.5, 0.0)),
        "second": (0.040, 20.0, (0.0, 0.5)),
        "third": (-0.040, -18.0, (0.5, 0.0)),
        "hind": (-0.115, -54.0, (0.0, 0.5)),
    },
    leg={
        "coxa": (0.066, 0.345),
        "femur": (0.140, 0.345),
        "tibia": (0.310, 0.530),
        "tarsus": (0.520, 0.03),
    },
    shin_rings=(0.97,),
    gaits=(Gait("walk", 0.8, 0.50, 0.6, 0.07), Gait("run", 1.5, 0.32, 0.45, 0.09)),
    shells=(
        ("head", (0.368, 0.165), (0.358, 0.200), (0.070, 0.052), (1.1, 0.9, 1)),
        ("thorax", (0.360, 0.120), (0.356, -0.115), (0.082, 0.082), (1.15, 0.85, 1)),
        ("abdomen", (0.360, -0.165), (0.366, -0.200), (0.040, 0.050), (1, 1, 1)),
        ("abdomen", (0.385, -0.255), (0.392, -0.330), (0.086, 0.112), (1.1, 1, 1)),
        ("abdomen_end", (0.392, -0.345), (0.372, -0.470), (0.112, 0.050), (1.1, 1, 1)),
    ),
    eyes=(
        ((0.022, 0.402, 0.222), (0.024, 0.398, 0.212), 0.014),
        ((0.048, 0.398, 0.200), (0.050, 0.394, 0.190), 0.014),
    ),
    strips=(
        (0.352, 0.243),
        (0.356, 0.228),
        (0.360, 0.200),
        (0.362, 0.168),
        (0.361, 0.146),
        (0.360, 0.115),
        (0.360, 0.084),
        (0.359, 0.070),
        (0.359, 0.040),
        (0.358, 0.010),
        (0.358, -0.010),
        (0.357, -0.040),
        (0.357, -0.070),
        (0.357, -0.084),
        (0.356, -0.115),
        (0.357, -0.146),
        (0.362, -0.178),
        (0.368, -0.205),
        (0.382, -0.250),
        (0.390, -0.320),
        (0.388, -0.400),
        (0.376, -0.465),
    ),
    angles=(0.0, 42.0, 74.0, 106.0, 140.0, 180.0),
    ends=((0.356, 0.22), (0.372, -0.465)),
    feeler_strip=1,
    leg_strips=(4, 7, 10, 13),
)


def build() -> Archetype:
    """The spider."""
    return arthropod.build(PLAN)
