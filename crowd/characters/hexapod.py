"""A six-legged walker of 1 m and 27 kg, generated: an insect's plan at the size of a dog, so that it wades with others.

Gaits: alternating tripod (front and hind leg of one side with the middle leg of the other), walking with a duty factor
of 0.6 and running with 0.45.
"""

from __future__ import annotations

from crowd.characters import arthropod
from crowd.characters.arthropod import Gait, Plan
from crowd.types import Archetype

PLAN = Plan(
    name="hexapod",
    height=0.56,
    mass=27.0,
    centre={  # name: (parent, position standing, m)
        "thorax": ("", (0.0, 0.365, 0.0)),
        "head": ("thorax", (0.0, 0.385, 0.205)),
        "abdomen": ("thorax", (0.0, 0.375, -0.185)),
        "abdomen_end": ("abdomen", (0.0, 0.375, -0.340)),
    },
    feeler="antenna",
    feeler_places=((0.035, 0.435, 0.300), (0.110, 0.520, 0.420)),
    feeler_end=(0.045, -0.035, 0.120),
    feeler_radii=(0.016, 0.010, 0.006),
    rows={
        "front": (0.135, 46.0, (0.0, 0.5)),
        "middle": (0.0, -2.0, (0.5, 0.0)),
        "hind": (-0.130, -44.0, (0.0, 0.5)),
    },
    leg={
        "coxa": (0.062, 0.350),
        "femur": (0.135, 0.345),
        "tibia": (0.310, 0.530),
        "tarsus": (0.510, 0.03),
    },
    shin_rings=(0.1, 0.97),
    gaits=(Gait("walk", 0.9, 0.50, 0.6, 0.07), Gait("run", 1.8, 0.32, 0.45, 0.09)),
    shells=(
        ("head", (0.392, 0.255), (0.380, 0.300), (0.074, 0.055), (1.15, 0.9, 1)),
        ("thorax", (0.375, 0.205), (0.375, 0.17), (0.040, 0.05), (1, 1, 1)),
        ("thorax", (0.368, 0.125), (0.362, -0.11), (0.078, 0.078), (1.1, 1, 1)),
        ("abdomen", (0.370, -0.165), (0.372, -0.20), (0.045, 0.055), (1, 1, 1)),
        ("abdomen", (0.380, -0.255), (0.385, -0.34), (0.108, 0.122), (1.15, 0.95, 1)),
        ("abdomen_end", (0.383, -0.36), (0.362, -0.49), (0.120, 0.045), (1.15, 0.95, 1)),
    ),
    eyes=(((0.058, 0.420, 0.285), (0.060, 0.415, 0.270), 0.033),),
    strips=(
        (0.380, 0.335),
        (0.388, 0.290),
        (0.390, 0.240),
        (0.378, 0.200),
        (0.370, 0.172),
        (0.367, 0.133),
        (0.366, 0.090),
        (0.366, 0.045),
        (0.365, 0.000),
        (0.364, -0.045),
        (0.363, -0.086),
        (0.363, -0.128),
        (0.368, -0.162),
        (0.372, -0.195),
        (0.380, -0.240),
        (0.384, -0.310),
        (0.382, -0.390),
        (0.370, -0.460),
    ),
    angles=(0.0, 42.0, 74.0, 106.0, 140.0, 180.0),
    ends=((0.375, 0.3), (0.365, -0.46)),
    feeler_strip=1,
    leg_strips=(4, 7, 10),
)


def build() -> Archetype:
    """The hexapod."""
    return arthropod.build(PLAN)
