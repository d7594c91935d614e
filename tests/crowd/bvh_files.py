"""Synthetic BVH text for tests: a walker whose speed and stride are known, and a minimal file to break."""

from __future__ import annotations

import numpy as np

from crowd.posing import matrix
from crowd.resampling import resample, resample_rotation
from crowd.types import Archetype, Clip

MINIMAL = """HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Leg
  {
    OFFSET 1 -2 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0 -3 0
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.1
0 10 0 0 0 0 0 0 0
1 10 0 0 0 0 90 0 0
"""

# name, parent, offset (m, y up, +z forward), end site
WALKER: tuple[tuple[str, str, tuple[float, float, float], tuple[float, float, float] | None], ...] = (
    ("hips", "", (0, 0.9, 0), None),
    ("l_thigh", "hips", (0.1, 0, 0), None),
    ("l_shin", "l_thigh", (0, -0.45, 0), None),
    ("l_foot", "l_shin", (0, -0.4, 0), None),
    ("l_toe", "l_foot", (0, -0.05, 0.15), (0, 0, 0.06)),
    ("r_thigh", "hips", (-0.1, 0, 0), None),
    ("r_shin", "r_thigh", (0, -0.45, 0), None),
    ("r_foot", "r_shin", (0, -0.4, 0), None),
    ("r_toe", "r_foot", (0, -0.05, 0.15), (0, 0, 0.06)),
    ("spine", "hips", (0, 0.2, 0), None),
    ("chest", "spine", (0, 0.25, 0), None),
    ("head", "chest", (0, 0.2, 0), (0, 0.2, 0)),
    ("l_arm", "chest", (0.2, 0.1, 0), None),
    ("l_forearm", "l_arm", (0.05, -0.28, 0), None),
    ("l_hand", "l_forearm", (0, -0.25, 0.02), (0, -0.15, 0)),
    ("r_arm", "chest", (-0.2, 0.1, 0), None),
    ("r_forearm", "r_arm", (-0.05, -0.28, 0), None),
    ("r_hand", "r_forearm", (0, -0.25, 0.02), (0, -0.15, 0)),
)


DUTY = 0.6  # of the walker's feet
DROP = -0.06  # m, its hips against the straight leg


def _foot(share: np.ndarray, stride: float) -> tuple[np.ndarray, np.ndarray]:
    """Place of the ankle ahead of the hip and above the ground: planted for DUTY of the cycle, then swung forward."""
    half = 0.5 * DUTY * stride
    swing = np.clip((share - DUTY) / (1 - DUTY), 0, 1)
    ahead = np.where(share < DUTY, half - stride * share, -half * np.cos(np.pi * swing))
    return ahead, 0.05 * (1 - np.cos(2 * np.pi * swing))


def _leg(ahead: np.ndarray, down: np.ndarray, upper: float = 0.45, lower: float = 0.4) -> tuple[np.ndarray, np.ndarray]:
    """Rotation of thigh and shin about x (rad) that bring the ankle there, knee forward."""
    away = np.minimum(np.hypot(ahead, down), upper + lower - 1e-6)
    knee = np.pi - np.arccos((upper**2 + lower**2 - away**2) / (2 * upper * lower))
    inner = np.arccos((upper**2 + away**2 - lower**2) / (2 * upper * away))
    return -np.arctan2(ahead, down) - inner, knee


def walker(
    speed: float = 1.2,
    period: float = 1.1,
    seconds: float = 4.0,
    rate: float = 60.0,
    unit: float = 1.0,
    up: str = "y",
    turn_deg_s: float = 0.0,
    climb: float = 0.0,
    heading_deg: float = 0.0,
    tpose: bool = False,
    tabs: bool = False,
) -> str:
    """A person walking at `speed` m/s with a stride of `period` s; unit: metres per file unit, turn: to the left."""
    frames = round(seconds * rate) + 1
    t = np.arange(frames) / rate
    yaw = np.radians(heading_deg + turn_deg_s * t)
    path = np.zeros((frames, 3))
    step = speed / rate
    path[1:, 0] = np.cumsum(step * np.sin((yaw[1:] + yaw[:-1]) / 2))
    path[1:, 2] = np.cumsum(step * np.cos((yaw[1:] + yaw[:-1]) / 2))
    path[:, 1] = climb * t + DROP
    angles = {name: np.zeros(frames) for name, *_ in WALKER}
    for side, shift in (("l", 0.0), ("r", 0.5)):
        share = np.mod(t / period + shift, 1.0)
        ahead, raised = _foot(share, speed * period)
        thigh, shin = _leg(ahead, 0.85 + DROP - raised)
        angles[f"{side}_thigh"], angles[f"{side}_shin"] = np.degrees(thigh), np.degrees(shin)
        angles[f"{side}_foot"] = -angles[f"{side}_thigh"] - angles[f"{side}_shin"]  # flat at all times
        angles[f"{side}_arm"] = np.degrees(0.3 * np.cos(2 * np.pi * (t / period + shift)))
    rows = []
    for f in range(frames):
        row = [*(path[f] / unit), np.degrees(yaw[f])]
        row[0], row[1], row[2] = row[0], row[1] + 0.9 / unit, row[2]
        row += [angles[name][f] for name, *_ in WALKER[1:]]
        rows.append(row)
    if tpose:
        rows.insert(0, [0.0, 0.9 / unit, 0.0, 0.0] + [0.0] * (len(WALKER) - 1))
    return _text(rows, rate, unit, up, tabs, tpose)


def _text(rows: list[list[float]], rate: float, unit: float, up: str, tabs: bool, tpose: bool) -> str:
    lines: list[str] = ["HIERARCHY"]
    order: list[int] = []
    indent = "\t" if tabs else "  "

    def along(v: tuple[float, float, float]) -> str:
        x, y, z = (c / unit for c in v)
        return f"{x:.6f} {y:.6f} {z:.6f}" if up == "y" else f"{x:.6f} {-z:.6f} {y:.6f}"

    def write(index: int, depth: int) -> None:
        name, parent, offset, end = WALKER[index]
        pad = indent * depth
        yaw = "Yrotation" if up == "y" else "Zrotation"
        lines.append(f"{pad}{'JOINT' if parent else 'ROOT'} {name}")
        lines.append(pad + "{")
        lines.append(f"{pad}{indent}OFFSET {along(offset) if parent else along((0, 0, 0))}")
        if parent:
            channels = "Zrotation Xrotation Yrotation" if "arm" in name else "Xrotation"
        else:
            channels = f"{yaw} Xposition Yposition Zposition"
        lines.append(f"{pad}{indent}CHANNELS {len(channels.split())} {channels}")
        order.append(index)
        for child in range(len(WALKER)):
            if WALKER[child][1] == name:
                write(child, depth + 1)
        if end:
            lines.append(f"{pad}{indent}End Site")
            lines.append(f"{pad}{indent}" + "{")
            lines.append(f"{pad}{indent}{indent}OFFSET {along(end)}")
            lines.append(f"{pad}{indent}" + "}")
        lines.append(pad + "}")

    write(0, 0)
    lines += ["MOTION", f"Frames:{indent}{len(rows)}", f"Frame Time: {1 / rate:.7f}"]
    for number, row in enumerate(rows):
        x, y, z, yaw, *rest = row
        values = [yaw, x, y, z] if up == "y" else [yaw, x, -z, y]
        for index in order[1:]:
            name = WALKER[index][0]
            if "arm" in name:
                raised = (
                    (90.0 if name == "l_arm" else -90.0 if name == "r_arm" else 0.0) if tpose and number == 0 else 0.0
                )
                values += [raised if up == "y" else 0.0, rest[index - 1], 0.0 if up == "y" else -raised]
            else:
                values.append(rest[index - 1])
        lines.append(" ".join(f"{value:.6f}" for value in values))
    return ("\r\n" if tabs else "\n").join(lines) + "\n"


def euler_zxy(q: np.ndarray) -> np.ndarray:
    """Angles [..., 3] in degrees (z, x, y) with Rz Rx Ry equal to the rotation of quaternions [..., 4]."""
    m = matrix(q)
    x = np.arcsin(np.clip(m[..., 2, 1], -1, 1))
    z = np.arctan2(-m[..., 0, 1], m[..., 1, 1])
    y = np.arctan2(-m[..., 2, 0], m[..., 2, 2])
    return np.degrees(np.stack([z, x, y], -1))


def exported(archetype: Archetype, clip: Clip, seconds: float, rate: float = 60.0, unit: float = 0.01) -> str:
    """A character's clip as a capture that travels at the clip's speed; every joint has position channels."""
    skeleton = archetype.skeleton
    count = round(seconds * rate) + 1
    time = np.arange(count) / rate
    at = time / clip.duration * len(clip.rotation)
    rotation, translation = resample_rotation(clip.rotation, at, True), resample(clip.translation, at, True).copy()
    translation[:, 0, 2] += (clip.speed or 0.0) * time
    angles = euler_zxy(rotation)
    lines, order = ["HIERARCHY"], []

    def write(joint: int) -> None:
        order.append(joint)
        offset = skeleton.rest_translation[joint] / unit
        lines.append(f"{'ROOT' if skeleton.parents[joint] < 0 else 'JOINT'} {skeleton.names[joint]}\n{{")
        lines.append("OFFSET " + " ".join(f"{v:.5f}" for v in offset))
        lines.append("CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation")
        children = [k for k, parent in enumerate(skeleton.parents) if parent == joint]
        for child in children:
            write(child)
        ends = [leg.ball_offset for leg in archetype.legs if leg.ball == joint and not children]
        for end in ends:
            lines.append("End Site\n{\nOFFSET " + " ".join(f"{v / unit:.5f}" for v in end) + "\n}")
        lines.append("}")

    write(0)
    lines += ["MOTION", f"Frames: {count}", f"Frame Time: {1 / rate:.7f}"]
    values = np.concatenate([translation / unit, angles], -1)[:, order].reshape(count, -1)
    lines += [" ".join(f"{v:.5f}" for v in row) for row in values]
    return "\n".join(lines) + "\n"
