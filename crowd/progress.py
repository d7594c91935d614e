"""How far a run is: a bar in a terminal, one line per chunk elsewhere."""

from __future__ import annotations

import sys
import time
from types import TracebackType
from typing import Any


class Progress:
    """Counts frames between `with Progress(...) as progress` and its end.

    frames: to step; rate: frames per second of simulated time; characters: of all herds; stream: a text file (default
    standard error).
    """

    def __init__(self, frames: int, rate: float, characters: int, stream: Any = None):
        self.frames, self.rate, self.characters = frames, rate, characters
        self.stream = sys.stderr if stream is None else stream
        self.done = 0
        self.started = self.first = time.perf_counter()  # first: when the first chunk was there (compiling is over)
        self.first_done = 0
        self._bar: Any = None

    def __enter__(self) -> Progress:
        self.started = time.perf_counter()
        if self.stream.isatty():
            self._bar = _bar(self.stream)
            self._bar.__enter__()
            self._task = self._bar.add_task("compiling", total=self.frames, speed="")
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if self._bar is not None:
            self._bar.__exit__(kind, error, at)

    def advance(self, done: int) -> None:
        """Tell that `done` frames have been stepped in all."""
        now = time.perf_counter()
        if self.done == 0:
            self.first, self.first_done = now, done
        self.done = done
        speed = self.speed(now)
        if self._bar is not None:
            self._bar.update(self._task, completed=done, description="stepping", speed=speed)
            return
        percent = 100.0 * done / max(self.frames, 1)
        self.stream.write(f"frame {done}/{self.frames} ({percent:.0f} %)  {speed}\n")
        self.stream.flush()

    def speed(self, now: float | None = None) -> str:
        """Frames per second, characters at real time and the time left, without the time before the first chunk."""
        now = time.perf_counter() if now is None else now
        frames, seconds = self.done - self.first_done, now - self.first
        if frames <= 0 or seconds <= 0:
            return f"first frames after {self.first - self.started:.1f} s"
        per_second = frames / seconds
        real_time = self.characters * per_second / self.rate
        left = (self.frames - self.done) / per_second
        return f"{per_second:,.0f} frames/s  {real_time:,.0f} characters at real time  {_clock(left)} left"


def _clock(seconds: float) -> str:
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    minutes, rest = divmod(whole, 60)
    return f"{minutes // 60}:{minutes % 60:02d}:{rest:02d}" if minutes >= 60 else f"{minutes}:{rest:02d} min"


def _bar(stream: Any) -> Any:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn
    from rich.progress import Progress as Bar

    return Bar(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[speed]}"),
        console=Console(file=stream),
    )
