"""Analysed clips are the same from the cache, and bad caches are as none."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from crowd.analysis import clip_cache, feet_of
from crowd.analysis.clip_cache import SWITCH, analysed
from crowd.errors import InputError
from tests.crowd.test_gait import BIPED, legged, stepping


def same(a: Any, b: Any) -> bool:
    if isinstance(a, np.ndarray):
        return np.array_equal(a, b)
    if hasattr(a, "__dataclass_fields__"):
        return all(same(getattr(a, each.name), getattr(b, each.name)) for each in fields(a))
    if isinstance(a, tuple):
        return len(a) == len(b) and all(same(x, y) for x, y in zip(a, b, strict=True))
    return bool(a == b) and type(a) is type(b)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(SWITCH, str(tmp_path / "motions"))
    return tmp_path / "motions"


def computed(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the clips that are analysed rather than read, from now on."""
    names: list[str] = []
    original = clip_cache.analyse_clip

    def counted(archetype: Any, clip: Any, *args: Any, **options: Any) -> Any:
        names.append(clip.name)
        return original(archetype, clip, *args, **options)

    monkeypatch.setattr(clip_cache, "analyse_clip", counted)
    return names


@pytest.mark.parametrize("strides", [1, 3])
@pytest.mark.parametrize("compat", [False, True])
def test_the_same_from_the_cache(folder: Path, monkeypatch: pytest.MonkeyPatch, strides: int, compat: bool) -> None:
    body = legged(BIPED)
    clip, feet = stepping(body, [0.1, 0.6], [0.6, 0.6], 1.3, strides=strides, hover=0.08), feet_of(body)
    names = computed(monkeypatch)
    first, second = (analysed(body, clip, feet, compat=compat) for _ in range(2))
    assert names == ["step"] and len(list(folder.iterdir())) == 1
    assert same(first, second) and first.notes


def test_whatever_changes_is_computed_again(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    body = legged(BIPED)
    clip, feet = stepping(body, [0.1, 0.6], [0.6, 0.6], 1.3), feet_of(body)
    longer = tuple(replace(foot, length=2 * foot.length) for foot in feet)
    names = computed(monkeypatch)
    analysed(body, clip, feet)
    analysed(body, replace(clip, speed=1.0), feet)
    analysed(body, replace(clip, translation=clip.translation * 1.001), feet)
    analysed(body, clip, longer)
    analysed(body, clip, feet, grounded=True)
    analysed(replace(body, legs=body.legs[::-1]), clip, feet)
    assert len(names) == 6 and len(list(folder.iterdir())) == 6


def test_bad_files_and_folders_are_as_none(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    body = legged(BIPED)
    clip, feet = stepping(body, [0.1, 0.6], [0.6, 0.6], 1.3), feet_of(body)
    wanted = analysed(body, clip, feet)
    file = next(folder.iterdir())
    whole = file.read_bytes()
    broken = [b"", b"nothing", whole[: len(whole) // 2], whole[:200] + bytes(100) + whole[300:], whole[:-4000]]
    names = computed(monkeypatch)
    for content in broken:
        file.write_bytes(content)
        assert same(analysed(body, clip, feet), wanted)
    assert len(names) == len(broken)  # and each time written anew:
    assert same(analysed(body, clip, feet), wanted) and len(names) == len(broken)
    blocked = folder.parent / "a file"
    blocked.write_text("in the way")
    monkeypatch.setenv(SWITCH, str(blocked))
    assert same(analysed(body, clip, feet), wanted)


def test_off_and_errors_leave_nothing(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    body = legged(BIPED)
    clip, feet = stepping(body, [0.1, 0.6], [0.6, 0.6], 1.3), feet_of(body)
    with pytest.raises(InputError):
        analysed(body, replace(clip, cyclic=False), feet)
    monkeypatch.setenv(SWITCH, "0")
    analysed(body, clip, feet)
    assert not folder.exists()
    monkeypatch.delenv(SWITCH)
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder))
    assert clip_cache.cache_folder() == folder / "crowd" / "motions"
