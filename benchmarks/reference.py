"""A crowd that stands ready all through a benchmark, so that every case can be timed in turns with the same one.

A shared machine gets faster and slower by half within minutes, and cases are minutes apart: only what is timed in turns
can be compared. `python -m benchmarks.reference SOCKET JOB` runs the job once for everything it is sent, and answers
with the microseconds of a character-frame.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.connection import Client, Connection, Listener
from pathlib import Path

from benchmarks.cases import CASES
from benchmarks.machine import ROOT
from benchmarks.measure import Job, prepared

CASE = next(case for case in CASES if case.name == "human-rigid-2048")
PATIENCE = 300.0  # s


@contextmanager
def standing() -> Iterator[str | None]:
    """Address of the reference while it stands ready; None where it does not start."""
    with tempfile.TemporaryDirectory(prefix="crowd-reference-") as folder:
        path = Path(folder) / "socket"
        command = [sys.executable, "-m", "benchmarks.reference", str(path), Job(CASE).text()]
        quiet = subprocess.DEVNULL
        process = subprocess.Popen(command, cwd=ROOT, stdin=quiet, stdout=quiet, stderr=quiet, env=os.environ)
        try:
            began = time.monotonic()
            while not path.exists() and process.poll() is None and time.monotonic() - began < PATIENCE:
                time.sleep(0.1)
            yield str(path) if path.exists() else None
        finally:
            process.terminate()
            process.wait()


@contextmanager
def asked(address: str | None) -> Iterator[Callable[[], float] | None]:
    """What times the reference once, in microseconds per character-frame."""
    if address is None:
        yield None
        return
    with Client(address) as connection:

        def once() -> float:
            connection.send(None)
            return connection.recv()

        yield once


def serve(address: str, job: Job) -> None:
    """Stands ready at an address until killed."""
    run = prepared(job)
    run()  # pages, and the crowd walks in
    with Listener(address) as listener:
        while True:
            with listener.accept() as connection:
                _answer(connection, run)


def _answer(connection: Connection, run: Callable[[], float]) -> None:
    try:
        while True:
            connection.recv()
            connection.send(run())
    except EOFError:
        return


if __name__ == "__main__":
    serve(sys.argv[1], Job.read(sys.argv[2]))
