"""Writing a recording in a thread of its own, while the next frames are stepped."""

from __future__ import annotations

from queue import Queue
from threading import Thread
from types import TracebackType

from crowd.recording import ChunkLike, Recorder


class Writing:
    """Chunks written behind the caller's back, in order. Use as a context manager, inside that of the recorder.

    One chunk is written and one waits; `append` waits for room, so memory stays bounded where the disk is slow. Leaving
    the context writes what waits, also after an exception (Ctrl-C), and then tells what went wrong with it, if
    nothing else did.
    A write that fails ends the recording with the last whole chunk: later chunks are dropped, and the next `append`
    or the end raises: `OSError` with the recording's path and its readable frames where the disk is to blame.
    """

    def __init__(self, recorder: Recorder):
        self.recorder = recorder
        self._error: BaseException | None = None
        self._queue: Queue[ChunkLike | None] = Queue(1)
        # a daemon: where a second Ctrl-C ends the wait for it, it does not keep the program
        self._thread = Thread(target=self._run, name="recording", daemon=True)

    def __enter__(self) -> Writing:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._queue.put(None)
        self._thread.join()
        if kind is None:
            self._tell()

    def append(self, chunk: ChunkLike) -> None:
        """Hand over recorded frames; the arrays must not change any more."""
        self._tell()
        self._queue.put(chunk)

    def _run(self) -> None:
        while (chunk := self._queue.get()) is not None:
            if self._error is None:
                try:
                    self.recorder.append(chunk)
                except BaseException as error:  # raised again where the chunks come from
                    self._error = error

    def _tell(self) -> None:
        error = self._error
        if isinstance(error, OSError):
            kept = f"the first {self.recorder.frames} recorded frames stay readable"
            raise OSError(error.errno, f"{error.strerror or error}; {kept}", str(self.recorder.path)) from error
        if error is not None:
            raise error
