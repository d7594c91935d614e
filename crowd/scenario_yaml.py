"""YAML text to plain data with a line for every key path, refusing what could not be an honest scenario.

Only mappings with text keys, lists, text, numbers, booleans and null come through. Size, depth, node and alias counts
are limited while reading, so that a hostile file costs neither memory nor time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from crowd.errors import InputError, Problem, fail

MAX_BYTES = 1_000_000
MAX_DEPTH = 40
MAX_NODES = 100_000  # after expanding aliases
MAX_ALIASES = 1_000

_COLLECTIONS = ("tag:yaml.org,2002:map", "tag:yaml.org,2002:seq")
KeyPath = tuple[str | int, ...]


@dataclass(frozen=True)
class Document:
    """Plain data of one file and where each key path stands in it."""

    label: str  # file name for messages
    data: Any
    lines: dict[KeyPath, int] = field(default_factory=dict)  # 1-based
    overridden: dict[KeyPath, str] = field(default_factory=dict)  # key path -> the "--set" that wrote it

    def where(self, path: KeyPath) -> str:
        """Place of a key path for messages: "wade.yaml:12 herds[0].count"; the nearest parent's line when new."""
        keys = key_text(path)
        for length in range(len(path), -1, -1):
            if path[:length] in self.overridden:
                return f"{self.overridden[path[:length]]} ({keys})"
            if path[:length] in self.lines:
                return f"{self.label}:{self.lines[path[:length]]} {keys}".rstrip()
        return f"{self.label} {keys}".rstrip()

    def part(self, key: str) -> Document:
        """The document under a top-level key, with its lines."""

        def below(places: dict[KeyPath, Any]) -> dict[KeyPath, Any]:
            return {path[1:]: place for path, place in places.items() if path[:1] == (key,)}

        return Document(self.label, self.data[key], below(self.lines), below(self.overridden))


@dataclass
class _Node:
    value: Any  # scalar | list[_Node] | dict[str, _Node]
    line: int
    size: int = 1


def key_text(path: KeyPath) -> str:
    """`("herds", 0, "count")` as "herds[0].count"."""
    text = ""
    for key in path:
        text += f"[{key}]" if isinstance(key, int) else f".{key}" if text else str(key)
    return text


def read_file(path: Path) -> Document:
    """The document in a file; `InputError` when it is missing, too large, not text or not acceptable YAML."""
    if not path.exists():
        raise fail(str(path), "no such file")
    if path.is_dir():
        raise fail(str(path), "is a folder, not a YAML file")
    try:
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise fail(str(path), f"{size:,} bytes; at most {MAX_BYTES:,} are read")
        text = path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise fail(str(path), f"not UTF-8 text (byte {error.start}); a YAML text file is needed") from None
    except OSError as error:
        raise fail(str(path), f"cannot be read: {error.strerror}") from None
    return read_text(text, path.name)


def read_text(text: str, label: str) -> Document:
    """The document in YAML text. An empty one has `data` None."""
    from ruamel.yaml import YAML
    from ruamel.yaml.error import MarkedYAMLError, YAMLError

    if len(text.encode()) > MAX_BYTES:
        raise fail(label, f"{len(text.encode()):,} bytes; at most {MAX_BYTES:,} are read")
    reader = _Reader(YAML(typ="safe", pure=True), text, label)
    try:
        node = reader.document()
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = f"{label}:{mark.line + 1}" if mark is not None else label
        raise fail(place, f"not valid YAML: {error.problem or error.context}") from None
    except YAMLError as error:
        raise fail(label, f"not valid YAML: {str(error).splitlines()[0]}") from None
    if reader.problems:
        raise InputError(reader.problems)
    lines: dict[KeyPath, int] = {}
    return Document(label, None if node is None else _plain(node, (), lines), lines)


def _plain(node: _Node, path: KeyPath, lines: dict[KeyPath, int]) -> Any:
    lines[path] = node.line
    if isinstance(node.value, dict):
        return {key: _plain(child, (*path, key), lines) for key, child in node.value.items()}
    if isinstance(node.value, list):
        return [_plain(child, (*path, index), lines) for index, child in enumerate(node.value)]
    return node.value


class _Reader:
    """Builds nodes from the parser's events, counting as it goes."""

    def __init__(self, yaml: Any, text: str, label: str):
        self.events: Iterator[Any] = iter(yaml.parse(text))
        self.resolver, self.constructor = yaml.resolver, yaml.constructor
        self.label = label
        self.anchors: dict[str, _Node | None] = {}  # None while it is being read
        self.nodes = self.aliases = 0
        self.problems: list[Problem] = []

    def document(self) -> _Node | None:
        root = None
        documents = 0
        for event in self.events:
            name = type(event).__name__
            if name == "DocumentStartEvent":
                documents += 1
                if documents > 1:
                    raise self.refuse(event, "a second document; one per file")
            elif name not in ("StreamStartEvent", "StreamEndEvent", "DocumentEndEvent"):
                root = self.node(event, 1)
        return root

    def refuse(self, event: Any, message: str) -> InputError:
        return InputError([*self.problems, Problem(f"{self.label}:{event.start_mark.line + 1}", message)])

    def node(self, event: Any, depth: int) -> _Node:
        if depth > MAX_DEPTH:
            raise self.refuse(event, f"nested deeper than {MAX_DEPTH} levels")
        name = type(event).__name__
        if name == "AliasEvent":
            return self.alias(event)
        anchor = None if event.anchor is None else str(event.anchor)
        if anchor is not None:
            self.anchors[anchor] = None
        self.count(event, 1)
        tag = None if event.ctag is None else str(event.ctag)
        if name != "ScalarEvent" and tag not in (None, "!", *_COLLECTIONS):
            raise self.refuse(event, f"tag {tag} is not allowed")
        if name == "ScalarEvent":
            node = _Node(self.scalar(event), event.start_mark.line + 1)
        elif name == "SequenceStartEvent":
            node = self.sequence(event, depth)
        else:
            node = self.mapping(event, depth)
        if anchor is not None:
            self.anchors[anchor] = node
        return node

    def count(self, event: Any, more: int) -> None:
        self.nodes += more
        if self.nodes > MAX_NODES:
            raise self.refuse(event, f"more than {MAX_NODES:,} values (aliases expanded)")

    def alias(self, event: Any) -> _Node:
        self.aliases += 1
        if self.aliases > MAX_ALIASES:
            raise self.refuse(event, f"more than {MAX_ALIASES:,} aliases")
        anchor = str(event.anchor)
        if anchor not in self.anchors:
            raise self.refuse(event, f"alias *{anchor} has no anchor &{anchor} before it")
        node = self.anchors[anchor]
        if node is None:
            raise self.refuse(event, f"alias *{anchor} contains itself")
        self.count(event, node.size)
        return node

    def sequence(self, start: Any, depth: int) -> _Node:
        node = _Node([], start.start_mark.line + 1)
        for event in self.events:
            if type(event).__name__ == "SequenceEndEvent":
                break
            child = self.node(event, depth + 1)
            node.value.append(child)
            node.size += child.size
        return node

    def mapping(self, start: Any, depth: int) -> _Node:
        node = _Node({}, start.start_mark.line + 1)
        merged: list[_Node] = []
        for event in self.events:
            if type(event).__name__ == "MappingEndEvent":
                break
            if type(event).__name__ != "ScalarEvent" or not isinstance(key := self.scalar(event), str):
                raise self.refuse(event, "a key must be a name (text)")
            line = event.start_mark.line + 1
            child = self.node(next(self.events), depth + 1)
            node.size += child.size
            if key == "<<":
                merged += child.value if isinstance(child.value, list) else [child]
            elif key in node.value:
                message = f"key '{key}' again; first given in line {node.value[key].line}"
                self.problems.append(Problem(f"{self.label}:{line}", message))
            else:
                node.value[key] = _Node(child.value, line, child.size)
        for source in merged:
            if not isinstance(source.value, dict):
                raise self.refuse(start, "<<: takes a mapping or a list of mappings")
            for key, child in source.value.items():
                node.value.setdefault(key, child)
        return node

    def scalar(self, event: Any) -> Any:
        """Core-schema value of a scalar; a tag outside the core schema is refused."""
        from ruamel.yaml.nodes import ScalarNode

        explicit = None if event.ctag is None else str(event.ctag)
        implicit = explicit is None or explicit == "!"
        tag = str(self.resolver.resolve(ScalarNode, event.value, event.implicit)) if implicit else explicit
        kind = str(tag).rsplit(":", 1)[-1]
        if kind in ("str", "timestamp", "merge"):
            return str(event.value)
        if kind not in ("null", "bool", "int", "float"):
            raise self.refuse(event, f"tag {explicit or tag} is not allowed")
        try:
            node = ScalarNode(tag, event.value, start_mark=event.start_mark, end_mark=event.end_mark)
            return getattr(self.constructor, f"construct_yaml_{kind}")(node)
        except (ValueError, KeyError, OverflowError):
            raise self.refuse(event, f"{str(event.value)[:40]!r} cannot be read as {kind}") from None
