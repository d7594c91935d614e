"""What the paper says of its figures, as checks of our walks: value, what is wanted, pass or fail."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from crowd import triangle_statistics
from crowd.figures.pools import FLUIDS, RATE, Study, Walk

PERSON = "human"  # the paper's numbers are a person's; of other bodies only its orderings are asked
TABLE = {"water": (1.08, 0.72), "mud": (38.9, 0.60), "goo": (370.0, 0.38)}  # median C_D, remaining speed (Table 1)


@dataclass(frozen=True)
class Check:
    """One statement."""

    figure: str
    statement: str
    paper: str
    ours: str
    passed: bool


def checks(study: Study) -> list[Check]:
    """All statements of an archetype."""
    found = [*_figure_4(study), *_figure_6(study), *_figure_7(study), *_table(study)]
    if study.belt is not None and study.archetype == PERSON:
        found += _belt(study.belt)
    if "arms down" in study.walks:
        found += _figure_8(study)
    if "jog" in study.walks:
        found += _jogging(study)
    return found


def pressure(walk: Walk) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Phase [k], height over the ground [k] and place to the left [k] of the centre of pressure, steady part, m."""
    part = walk.steady()
    offset = (walk.arrays["center_of_pressure"] - walk.arrays["position"])[part]
    yaw = walk.arrays["yaw"][part]
    left = offset[:, 0] * np.cos(yaw) - offset[:, 2] * np.sin(yaw)
    good = np.isfinite(left)
    return walk.arrays["phase"][part][good], offset[good, 1], left[good]


def torque(walk: Walk) -> np.ndarray:
    """[k] pitch torque of the drag, N m, steady part."""
    part, yaw = walk.steady(), walk.arrays["yaw"]
    vector = walk.arrays["drag_torque"]
    return (vector[:, 0] * np.cos(yaw) - vector[:, 2] * np.sin(yaw))[part]


def force(walk: Walk) -> np.ndarray:
    """[k] N, steady part."""
    return np.linalg.norm(walk.arrays["drag_force"], axis=-1)[walk.steady()]


def wave(phase: np.ndarray, values: np.ndarray, number: int) -> float:
    """Amplitude of the wave with so many periods a cycle."""
    return float(2.0 * abs(np.mean((values - values.mean()) * np.exp(-2j * np.pi * number * phase))))


def _figure_4(study: Study) -> list[Check]:
    deep = [study.walks[f"water {depth}"] for depth in ("knee", "thigh", "waist", "chest")]
    height = [float(pressure(walk)[1].mean()) for walk in deep]
    found = [
        Check("Fig. 4", "the centre of pressure rises with depth", "rises", _joined(height, "m"), _rises(height)),
    ]
    if study.archetype != PERSON:
        return found
    phase, up, left = pressure(study.walks["water waist"])
    twice = wave(phase, up, 2) / max(wave(phase, up, 1), 1e-9)
    once = wave(phase, left, 1) / max(wave(phase, left, 2), 1e-9)
    return [
        *found,
        Check("Fig. 4", "height: two equal waves a cycle", "twice > once", f"{twice:.1f} times", twice > 1.5),
        Check("Fig. 4", "lateral: one wave a cycle", "once > twice", f"{once:.1f} times", once > 1.5),
        *_torque(study.depth_series()[1:]),
    ]


def _torque(walks: list[Walk]) -> list[Check]:
    """From shin (0.35 m) to chest (1.21 m): the force grows, its arm about the hips shrinks."""
    torques, forces = [float(torque(walk).mean()) for walk in walks], [float(force(walk).mean()) for walk in walks]
    middle = 0.5 * (max(torques) + min(torques))
    spread, grows = max(torques) / middle - 1.0, forces[-1] / forces[0]
    label = "pitch torque hardly changes, shin to chest"
    return [
        Check("Fig. 4", label, "within 20 %", f"{100 * spread:.0f} %", spread <= 0.2),
        Check("Fig. 4", "while the force grows", "clearly (1.5 or more)", f"{grows:.2f} times", grows >= 1.5),
    ]


def _figure_6(study: Study) -> list[Check]:
    series = study.depth_series()
    speeds = [walk.remaining for walk in series]
    rhythm = max(_unsteady(walk) for walk in series)
    settled = max(_late(walk) for walk in series)
    found = [
        Check("Fig. 6", "the deeper the slower", "falls", _joined(speeds, ""), _rises([-s for s in speeds])),
        Check("Fig. 6", "steady after about 2 s", "within 3 %", f"{100 * settled:.1f} %", settled <= 0.03),
        Check(
            "Fig. 6", "the rhythm settles: cycles after 10 s vary", "below 2 %", f"{100 * rhythm:.2f} %", rhythm < 0.02
        ),
    ]
    if study.archetype == PERSON:
        waist = study.walks["water waist"]
        part = waist.steady()
        phase, speed = waist.arrays["phase"][part], waist.speed[part]
        twice = wave(phase, speed, 2) / max(wave(phase, speed, 1), 1e-9)
        found.append(Check("Fig. 6", "two ripples a cycle", "twice > once", f"{twice:.1f} times", twice > 1.5))
    return found


def _figure_7(study: Study) -> list[Check]:
    found = []
    for depth in ("knee", "waist"):
        speeds = [study.walks[f"{fluid} {depth}"].remaining for fluid in FLUIDS]
        label = f"the denser the slower, {depth}-deep"
        found.append(Check("Fig. 7", label, "falls", _joined(speeds, ""), _rises([-s for s in speeds])))
    return found


def _figure_8(study: Study) -> list[Check]:
    gain = 100 * (study.walks["water chest"].remaining - study.walks["arms down"].remaining)
    return [Check("Fig. 8", "arms up are faster, chest-deep", "1.5 points or more", f"{gain:.1f} points", gain >= 1.5)]


def _jogging(study: Study) -> list[Check]:
    walk, jog = study.walks["water knee"].remaining, study.walks["jog"].remaining
    speeds = [float(one.speed[one.steady()].mean()) for one in (study.walks["jog"], study.walks["water knee"])]
    faster = speeds[0] / speeds[1]
    found = [Check("Section 6", "jogging stays faster than walking", "faster", f"{faster:.2f} times", faster > 1.0)]
    if study.archetype == PERSON:
        both = min(walk, jog) >= 0.74 and max(walk, jog) <= 0.84
        ours = f"{walk:.3f}, {jog:.3f}"
        found.append(
            Check("Section 6", "knee-deep about a fourth is lost, walking and jogging", "0.74 to 0.84", ours, both)
        )
        close = abs(walk - jog) < 0.06
        found.append(Check("Section 6", "by about the same share", "within 0.06", f"{abs(walk - jog):.3f}", close))
    return found


def _table(study: Study) -> list[Check]:
    found = []
    for fluid in FLUIDS:
        walk = study.walks[f"{fluid} waist"]
        if study.archetype == PERSON:
            wanted = TABLE[fluid][1]
            good = abs(walk.remaining - wanted) <= 0.01
            found.append(
                Check(
                    "Table 1",
                    f"remaining speed in {fluid}",
                    f"{100 * wanted:.0f} %",
                    f"{100 * walk.remaining:.1f} %",
                    good,
                )
            )
    if study.archetype == PERSON:
        median = medians(study, "water").median
        good = abs(median / TABLE["water"][0] - 1.0) <= 0.02
        found.append(Check("Table 1", "median C_D of water", f"{TABLE['water'][0]}", f"{median:.3f}", good))
    return found


def _belt(study: Study) -> list[Check]:
    """The table's medians where they belong: B for every triangle, most triangles in a small detail at the front."""
    found = []
    for fluid in FLUIDS:
        wanted_median, wanted = TABLE[fluid]
        left, one = study.walks[f"{fluid} waist"].remaining, medians(study, fluid)
        good = abs(left - wanted) <= 0.01
        found.append(Check("Belt", f"remaining speed in {fluid}", f"{100 * wanted:.0f} %", f"{100 * left:.1f} %", good))
        near = 0.02 if fluid == "water" else 0.1
        ours = f"{one.median:.3g} (skew 1/{1 / one.skew:.0f})"
        good = abs(one.median / wanted_median - 1.0) <= near
        found.append(
            Check("Belt", f"median C_D of {fluid}", f"{wanted_median:g} within {100 * near:.0f} %", ours, good)
        )
    return found


def medians(study: Study, fluid: str) -> triangle_statistics.Statistics:
    """Statistics of C_D over the triangles of the waist-deep walk."""
    walk = study.walks[f"{fluid} waist"]
    table = study.scene.scenario.fluid_table
    known = table.fluids[fluid]
    density = known.density_kg_m3
    base = table.base_drag.at(density) if known.drag_coefficient is None else known.drag_coefficient
    offset = table.offset_force_n.at(density) if known.offset_force_n is None else known.offset_force_n
    one = {name: values[:, None] for name, values in walk.arrays.items()}
    herd = study.scene.herds[0]
    part = walk.steady(4.0)
    cut = {name: values[part] for name, values in one.items()}
    found = triangle_statistics.relevant(herd, cut, 0, walk.depth, np.zeros(3), RATE)
    return triangle_statistics.statistics(found, density, base, offset, study.scene.scenario.drag.b_mode)


def _unsteady(walk: Walk) -> float:
    """Largest change from one cycle to the next after 10 s, as a share."""
    starts = np.flatnonzero(np.diff(walk.arrays["phase"]) < -0.5)
    phase = walk.arrays["phase"]
    at = starts + (1.0 - phase[starts]) / (phase[starts + 1] + 1.0 - phase[starts])  # frames, where the cycle begins
    lengths = np.diff(at[at >= 10 * RATE])
    return float(max((abs(b / a - 1.0) for a, b in pairwise(lengths)), default=0.0))


def _late(walk: Walk) -> float:
    """How far the mean speed from 2 s to 6 s is from that of the end, as a share."""
    early = slice(2 * RATE, 6 * RATE)
    return float(abs(walk.speed[early].mean() / walk.speed[walk.steady()].mean() - 1.0))


def _rises(values: list[float]) -> bool:
    return all(a < b for a, b in pairwise(values))


def _joined(values: list[float], unit: str) -> str:
    return ", ".join(f"{value:.3f}" for value in values) + (f" {unit}" if unit else "")
