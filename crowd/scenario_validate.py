"""Plain data against a pydantic model, with every problem told in the user's words: place, value, what is allowed."""

from __future__ import annotations

import re
import types
from collections.abc import Iterator
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError

from crowd.errors import Problem, nearest
from crowd.scenario_types import Model, converted, declared_key
from crowd.scenario_yaml import Document, KeyPath

M = TypeVar("M", bound=Model)

_UNIT_ENDING = re.compile(
    r"_(m_s|km_h|kmh|kph|mph|ms|m|cm|mm|km|ft|s|sec|seconds|min|deg|degrees|rad|radians|hz|kg|n_s|ns|n|kg_m3|px)$"
)


def validate(document: Document, model: type[M]) -> tuple[M | None, dict[str, Any], list[Problem]]:
    """The model (None with any problem), the data in declared keys and units, and all problems."""
    problems: list[Problem] = []
    data = _visit(model, document.data, (), document, problems)
    try:
        valid = model.model_validate(data)
    except ValidationError as error:
        return None, data, problems + _told(error, data, document)
    return (None if problems else valid), data, problems


def show(value: Any) -> str:
    """A value as the user wrote it, cut short."""
    if isinstance(value, bool) or value is None:
        return {True: "true", False: "false", None: "null"}[value]
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


# --- keys: unknown ones, other units, exactly one of ---


def _visit(annotation: Any, data: Any, path: KeyPath, document: Document, problems: list[Problem]) -> Any:
    """Copy of `data` with declared keys only; walks the annotation and the data side by side."""
    if isinstance(data, dict):
        model = _model_for(annotation, data)
        if model is not None:
            return _visit_model(model, data, path, document, problems)
        of = next((get_args(part)[1] for part in _parts(annotation) if get_origin(part) is dict), Any)
        return {key: _visit(of, item, (*path, key), document, problems) for key, item in data.items()}
    if isinstance(data, list):
        of = next((get_args(part)[0] for part in _parts(annotation) if get_origin(part) in (tuple, list)), Any)
        return [_visit(of, item, (*path, index), document, problems) for index, item in enumerate(data)]
    return data


def _visit_model(
    model: type[Model], data: dict[Any, Any], path: KeyPath, document: Document, problems: list[Problem]
) -> dict[str, Any]:
    fields = model.model_fields
    clean: dict[str, Any] = {}
    for key, value in data.items():
        here = (*path, key)
        name = key
        if key not in fields:
            declared = declared_key(str(key))
            if declared is None or declared[0] not in fields:
                problems.append(Problem(document.where(here), _unknown(str(key), list(fields))))
                continue
            name, factor = declared
            value = converted(value, factor)
            if name in data:
                problems.append(Problem(document.where(here), f"the same as '{name}', which is given too"))
            if here in document.lines:
                document.lines.setdefault((*path, name), document.lines[here])
        clean[name] = _visit(fields[name].annotation, value, (*path, name), document, problems)
    given = [key for key in model.exactly_one if clean.get(key) is not None]
    if model.exactly_one and len(given) != 1:
        choice = ", ".join(model.exactly_one)
        found = f"both {' and '.join(given)} are given" if given else "none is given"
        problems.append(Problem(document.where(path), f"exactly one of {choice} is needed; {found}"))
    for first, *others in model.at_least_one:
        if all(clean.get(key) is None for key in (first, *others)):
            message = f"missing; '{first}' is needed (or {' or '.join(others)})"
            problems.append(Problem(document.where((*path, first)), message))
    return clean


def _unknown(key: str, known: list[str]) -> str:
    stem = _UNIT_ENDING.sub("", key.lower())
    same = [name for name in known if _UNIT_ENDING.sub("", name) == stem]
    hint = f" (did you mean '{same[0]}'? the unit is part of the key)" if same else nearest(key, known)
    return f"unknown key '{key[:60]}'{hint}; allowed: {', '.join(known)}"


def _parts(annotation: Any) -> Iterator[Any]:
    """Members of a union, without Annotated."""
    origin = get_origin(annotation)
    if origin is Annotated:
        yield from _parts(get_args(annotation)[0])
    elif origin is Union or isinstance(annotation, types.UnionType):
        for member in get_args(annotation):
            yield from _parts(member)
    else:
        yield annotation


def _model_for(annotation: Any, data: dict[Any, Any]) -> type[Model] | None:
    """The model of a mapping; among several the one of its `kind`."""
    models = [part for part in _parts(annotation) if isinstance(part, type) and issubclass(part, Model)]
    if len(models) <= 1:
        return models[0] if models else None
    return next((m for m in models if data.get("kind") in _kinds(m)), None)


def _kinds(model: type[BaseModel]) -> tuple[Any, ...]:
    annotation = model.model_fields["kind"].annotation
    return get_args(annotation) if get_origin(annotation) is Literal else ()


# --- values: pydantic's errors retold ---


def _told(error: ValidationError, data: Any, document: Document) -> list[Problem]:
    """Errors at one place (the branches of a union) become one problem."""
    messages: dict[KeyPath, list[str]] = {}
    values: dict[KeyPath, Any] = {}
    for item in error.errors(include_url=False):
        path = _data_path(tuple(item["loc"]), data, str(item["type"]))
        values[path] = item.get("input")
        if item["type"] == "union_tag_invalid":
            path = (*path, "kind")
            values[path] = item.get("ctx", {}).get("tag")
        messages.setdefault(path, [])
        if (text := _message(dict(item))) not in messages[path]:
            messages[path].append(text)
    problems = []
    for path, texts in messages.items():
        # Where a branch of a union got as far as a part of the value, the other branches are beside the point.
        if any(len(other) > len(path) and other[: len(path)] == path for other in messages):
            continue
        told = " or ".join(texts)
        missing = told.startswith("missing")
        problems.append(Problem(document.where(path), told if missing else f"{show(values[path])}: {told}"))
    return problems


def _data_path(loc: tuple[str | int, ...], data: Any, kind: str) -> KeyPath:
    """`loc` without the union tags pydantic puts into it."""
    path: list[str | int] = []
    for index, key in enumerate(loc):
        inside = range(len(data)) if isinstance(data, list) else data if isinstance(data, dict) else ()
        if key in inside:
            data = data[key]  # pyright: ignore[reportArgumentType, reportCallIssue]
            path.append(key)
        elif kind == "missing" and index == len(loc) - 1:
            path.append(key)
    return tuple(path)


def _message(item: dict[str, Any]) -> str:
    kind, context = str(item["type"]), item.get("ctx", {})
    if kind == "missing":
        last = item["loc"][-1]
        return f"missing; '{last}' is needed" if isinstance(last, str) else "missing; one more value is needed"
    if kind == "union_tag_not_found":
        return f"needs {str(context.get('discriminator', 'kind')).strip(chr(39))}: ..."
    if kind in ("literal_error", "union_tag_invalid"):
        allowed = str(context.get("expected", context.get("expected_tags", "")))
        found = context.get("tag", item.get("input"))
        names = re.findall(r"'([^']+)'", allowed)
        hint = nearest(found, names) if isinstance(found, str) else ""
        return f"must be {'one of ' if len(names) > 1 else ''}{', '.join(names)}{hint}"
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        return "must be a mapping (key: value)"
    if kind in ("tuple_type", "list_type"):
        return "must be a list"
    if kind == "string_pattern_mismatch":
        return "must be a name: letters, digits, '_', '-' and '.', at most 64"
    text = str(item["msg"])
    for said, ours in (("Input should", "must"), ("Tuple should", "must"), ("String should", "must")):
        text = text.replace(said, ours)
    return text
