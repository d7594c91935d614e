"""BVH text files: the joint tree, its channels and its frames, every fault told with its line.

Format: Biovision hierarchy as described by Meredith and Maddock (2001). Read more widely than written there: any order
of channels, position channels on every joint, several roots, any case and spacing, names with spaces, frames broken
over lines. Angles are degrees; a joint's channels are applied in the order they are listed.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from crowd.errors import InputError, Problem, fail, nearest

CHANNELS = ("Xposition", "Yposition", "Zposition", "Xrotation", "Yrotation", "Zrotation")
MAX_BYTES = 1 << 29
MAX_JOINTS = 2000
MAX_DEPTH = 200
MAX_FRAMES = 1_000_000
MAX_NUMBERS = 20_000_000
MAX_PROBLEMS = 12  # of a kind; a broken export breaks every line
_TOKEN = re.compile(r"[{}]|[^\s{}]+")


@dataclass(frozen=True, eq=False)
class Joint:
    """One joint as the file states it."""

    name: str
    parent: int  # -1 for a root
    offset: tuple[float, float, float]
    channels: tuple[str, ...]  # of CHANNELS
    first: int  # column of its first channel
    line: int


@dataclass(frozen=True, eq=False)
class Bvh:
    """A parsed file. Lengths in file units, angles in degrees."""

    path: Path
    joints: tuple[Joint, ...]  # parents before children
    ends: tuple[tuple[int, tuple[float, float, float]], ...]  # End Sites: (joint, offset)
    frame_time: float  # s
    frames: np.ndarray  # [F, channels]
    notes: tuple[str, ...] = field(default=())

    @property
    def parents(self) -> tuple[int, ...]:
        return tuple(joint.parent for joint in self.joints)


def parse(path: Path) -> Bvh:
    """Read a file as text and check it. Raises InputError with every problem found, each with its line."""
    lines = _lines(path)
    motion = next((i for i, line in enumerate(lines) if line.split() and line.split()[0].upper() == "MOTION"), None)
    if motion is None:
        _expect_hierarchy(path, lines)
        raise fail(path.name, f"no MOTION section after {len(lines)} lines; a BVH file has HIERARCHY, then MOTION")
    tree = _Tree(path, lines[:motion])
    joints, ends = tree.read()
    width = sum(len(joint.channels) for joint in joints)
    frame_time, frames, notes = _motion(path, lines, motion, width, joints)
    return Bvh(path, tuple(joints), tuple(ends), frame_time, frames, tuple(notes))


def _lines(path: Path) -> list[str]:
    try:
        if not path.exists():
            raise fail(str(path), "file not found")
        if not path.is_file():
            raise fail(str(path), "is not a file")
        if path.stat().st_size > MAX_BYTES:
            raise fail(str(path), f"is larger than {MAX_BYTES >> 20} MiB")
        data = path.read_bytes()
    except (OSError, ValueError) as error:
        raise fail(str(path), f"cannot be read: {error}") from None
    if not data.strip():
        raise fail(path.name, "the file is empty; a BVH file starts with HIERARCHY")
    if b"\0" in data[:4096] or sum(byte < 9 or 14 <= byte < 32 for byte in data[:4096]) > 4:
        raise fail(f"{path.name}:1", "is binary, not text; a BVH file starts with the word HIERARCHY")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")  # only names can hold other characters
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def _expect_hierarchy(path: Path, lines: list[str]) -> int:
    """Index of the HIERARCHY line, which must be the first that is not blank."""
    first = next(i for i, line in enumerate(lines) if line.strip())
    if lines[first].split()[0].upper() != "HIERARCHY":
        raise fail(f"{path.name}:{first + 1}", f"starts with {lines[first].strip()[:40]!r}; expected HIERARCHY")
    return first


class _Tree:
    """The HIERARCHY section as a stream of (token, line number)."""

    def __init__(self, path: Path, lines: list[str]):
        start = _expect_hierarchy(path, lines) if any(line.strip() for line in lines) else None
        if start is None:
            raise fail(f"{path.name}:1", "MOTION without a HIERARCHY section before it")
        rest = [(i, re.sub(r"^\s*\S+", "", line) if i == start else line) for i, line in enumerate(lines)][start:]
        self.path = path
        self.tokens = [(token, i + 1) for i, line in rest for token in _TOKEN.findall(line)]
        self.position = 0
        self.last_line = len(lines)
        self.joints: list[Joint] = []
        self.ends: list[tuple[int, tuple[float, float, float]]] = []
        self.problems: list[Problem] = []
        self.columns = 0

    def read(self) -> tuple[list[Joint], list[tuple[int, tuple[float, float, float]]]]:
        while self.position < len(self.tokens):
            token, line = self._next("ROOT")
            if token.upper() != "ROOT":
                hint = "a closing brace too many" if token == "}" else f"found {token!r}"
                raise self._fault(line, f"{hint}; expected ROOT or the MOTION section{nearest(token, ['ROOT'])}")
            self._joint(-1, line)
        if not self.joints:
            raise self._fault(self.last_line, "the HIERARCHY has no ROOT; at least one is needed")
        self._check_lengths()
        if self.problems:
            raise InputError(self.problems[:MAX_PROBLEMS])
        return self.joints, self.ends

    def _joint(self, root: int, line: int) -> None:
        """One root with everything below it, without recursion: files may be nested deeply."""
        stack = [self._open(root, line)]
        while stack:
            token, line = self._next("'}'")
            word = token.upper()
            if token == "}":
                stack.pop()
            elif word == "JOINT":
                if len(stack) >= MAX_DEPTH or len(self.joints) >= MAX_JOINTS:
                    raise self._fault(line, f"more than {MAX_DEPTH} joints deep or {MAX_JOINTS} in all")
                stack.append(self._open(stack[-1], line))
            elif word == "END":
                self._end_site(stack[-1], line)
            else:
                known = ["JOINT", "End", "}", "OFFSET", "CHANNELS"]
                raise self._fault(line, f"found {token!r}; expected JOINT, End Site or '}}'{nearest(token, known)}")

    def _open(self, parent: int, line: int) -> int:
        """Name, brace, OFFSET and CHANNELS of a joint; its index."""
        words = []
        while self.position < len(self.tokens) and self.tokens[self.position][1] == line:
            if self.tokens[self.position][0] in "{}":
                break
            words.append(self._next("a name")[0])
        name = " ".join(words)
        if not name:
            raise self._fault(line, "a joint without a name")
        same = next((joint for joint in self.joints if joint.name == name), None)
        if same is not None:
            self._note(line, f"joint name {name!r} was used on line {same.line}; names must differ")
        self._expect("{")
        self._expect("OFFSET")
        offset = self._vector(name)
        channels: tuple[str, ...] = ()
        if self.position < len(self.tokens) and self.tokens[self.position][0].upper() == "CHANNELS":
            self._next("CHANNELS")
            channels = self._channels(name)
        self.joints.append(Joint(name, parent, offset, channels, self.columns, line))
        self.columns += len(channels)
        return len(self.joints) - 1

    def _end_site(self, joint: int, line: int) -> None:
        while self.position < len(self.tokens) and self.tokens[self.position][0] != "{":
            if self.tokens[self.position][1] != line:
                break
            self._next("'{'")  # "Site", and a name that some writers add
        self._expect("{")
        self._expect("OFFSET")
        self.ends.append((joint, self._vector(f"{self.joints[joint].name} End Site")))
        self._expect("}")

    def _channels(self, name: str) -> tuple[str, ...]:
        token, line = self._next("the number of channels")
        if not token.isdigit() or int(token) > len(CHANNELS):
            raise self._fault(line, f"joint '{name}': CHANNELS {token!r}; expected a number from 0 to 6")
        found = []
        for _ in range(int(token)):
            word, at = self._next("a channel name")
            channel = next((known for known in CHANNELS if known.lower() == word.lower()), None)
            if channel is None:
                stated = f"joint '{name}': CHANNELS {token}, but "
                if word in "{}" or word.upper() in ("JOINT", "END"):
                    raise self._fault(at, f"{stated}only {len(found)} names follow")
                raise self._fault(
                    at,
                    f"joint '{name}': channel {word!r} is unknown; allowed: {', '.join(CHANNELS)}"
                    f"{nearest(word, CHANNELS)}",
                )
            if channel in found:
                self._note(at, f"joint '{name}': channel {channel} is listed twice")
            found.append(channel)
        following = self.tokens[self.position] if self.position < len(self.tokens) else ("", 0)
        if following[0].lower() in [known.lower() for known in CHANNELS]:
            raise self._fault(following[1], f"joint '{name}': CHANNELS {token}, but more names follow: {following[0]}")
        return tuple(found)

    def _vector(self, name: str) -> tuple[float, float, float]:
        values = []
        for _ in range(3):
            token, line = self._next("three numbers after OFFSET")
            try:
                values.append(float(token))
            except ValueError:
                raise self._fault(line, f"'{name}': OFFSET needs three numbers; found {token!r}") from None
            if not np.isfinite(values[-1]):
                self._note(line, f"'{name}': OFFSET {token} is not a finite number")
        return values[0], values[1], values[2]

    def _check_lengths(self) -> None:
        bones = [joint.offset for joint in self.joints if joint.parent >= 0] + [offset for _, offset in self.ends]
        if not any(np.linalg.norm(offset) > 0 for offset in bones):
            self._note(self.joints[0].line, "every bone has length zero; at least the legs need OFFSETs")

    def _next(self, expected: str) -> tuple[str, int]:
        if self.position >= len(self.tokens):
            raise self._fault(self.last_line, f"the HIERARCHY ends where {expected} is expected: a brace is not closed")
        self.position += 1
        return self.tokens[self.position - 1]

    def _expect(self, word: str) -> None:
        token, line = self._next(word)
        if token.upper() != word:
            raise self._fault(line, f"found {token!r}; expected {word}")

    def _note(self, line: int, message: str) -> None:
        self.problems.append(Problem(f"{self.path.name}:{line}", message))

    def _fault(self, line: int, message: str) -> InputError:
        return InputError([*self.problems[:MAX_PROBLEMS], Problem(f"{self.path.name}:{line}", message)])


def _motion(
    path: Path, lines: list[str], start: int, width: int, joints: list[Joint]
) -> tuple[float, np.ndarray, list[str]]:
    """Frame time, frames [F, width] and notes of the MOTION section that begins at line index `start`."""
    body = [(i + 1, line) for i, line in enumerate(lines[start:], start) if line.strip()]
    body = [(body[0][0], body[0][1].split(None, 1)[1]), *body[1:]] if len(body[0][1].split()) > 1 else body[1:]
    count, at_count = _header(path, body, 0, "Frames", start + 1)
    time, at_time = _header(path, body, 1, "Frame Time", start + 1)
    problems = []
    if not 1 <= count <= MAX_FRAMES or count != int(count):
        problems.append(Problem(f"{path.name}:{at_count}", f"Frames: {count:g}; allowed: 1 to {MAX_FRAMES}"))
    if not 1e-4 <= time <= 1.0:
        problems.append(
            Problem(f"{path.name}:{at_time}", f"Frame Time: {time:g}; allowed: 0.0001 to 1 second (1/60 = 0.0166667)")
        )
    if width == 0:
        problems.append(Problem(f"{path.name}:{start + 1}", "no joint has channels, so nothing can move"))
    elif count * width > MAX_NUMBERS:
        problems.append(
            Problem(f"{path.name}:{at_count}", f"{count:g} frames of {width} channels exceed {MAX_NUMBERS} numbers")
        )
    if problems:
        raise InputError(problems)
    rows, notes = _rows(path, body[2:], int(count), at_count, width)
    frames = _numbers(path, rows, width, joints)
    return float(time), frames, notes


def _header(path: Path, body: list[tuple[int, str]], index: int, key: str, start: int) -> tuple[float, int]:
    """The number after "Frames:" or "Frame Time:" (colon optional, any spacing and case) and its line."""
    if index >= len(body):
        raise fail(f"{path.name}:{body[-1][0] if body else start}", f"the MOTION section ends before '{key}:'")
    number, line = body[index]
    pattern = r"\s*" + key.replace(" ", r"\s*") + r"\s*:?\s*(\S+)\s*$"
    match = re.match(pattern, line, re.IGNORECASE)
    if match is None:
        raise fail(f"{path.name}:{number}", f"found {line.strip()[:40]!r}; expected '{key}: <number>'")
    try:
        return float(match.group(1)), number
    except ValueError:
        raise fail(f"{path.name}:{number}", f"{key}: {match.group(1)[:40]!r} is not a number") from None


def _rows(
    path: Path, body: list[tuple[int, str]], count: int, at_count: int, width: int
) -> tuple[list[tuple[int, list[str]]], list[str]]:
    """(line, numbers as text) of every frame."""
    rows = [(number, line.split()) for number, line in body]
    uneven = [(number, len(words)) for number, words in rows if len(words) != width]
    if uneven and sum(len(words) for _, words in rows) == count * width:
        flat = [(number, word) for number, words in rows for word in words]
        frames = [flat[i * width : (i + 1) * width] for i in range(count)]
        return [(frame[0][0], [word for _, word in frame]) for frame in frames], []
    if uneven:
        raise InputError(
            Problem(f"{path.name}:{number}", f"{found} numbers; the HIERARCHY has {width} channels, so {width} belong")
            for number, found in uneven[:MAX_PROBLEMS]
        )
    if len(rows) < count:
        last = body[-1][0] if body else at_count
        raise fail(
            f"{path.name}:{last}", f"the file ends after {len(rows)} frames; Frames: on line {at_count} says {count}"
        )
    notes = [f"{len(rows)} frames follow, Frames: says {count}; the rest is left out"] if len(rows) > count else []
    return rows[:count], notes


def _numbers(path: Path, rows: list[tuple[int, list[str]]], width: int, joints: list[Joint]) -> np.ndarray:
    try:
        frames = np.array([words for _, words in rows], dtype=float).reshape(len(rows), width)
        if np.isfinite(frames).all():
            return frames
    except ValueError:
        pass
    columns = [f"{joint.name} {channel}" for joint in joints for channel in joint.channels]
    problems = []
    for line, words in rows:
        for column, word in enumerate(words):
            if not _finite(word):
                problems.append(
                    Problem(f"{path.name}:{line}", f"{columns[column]} is {word[:40]!r}; expected a finite number")
                )
        if len(problems) >= MAX_PROBLEMS:
            break
    raise InputError(problems[:MAX_PROBLEMS])


def _finite(word: str) -> bool:
    try:
        return bool(np.isfinite(float(word)))
    except ValueError:
        return False
