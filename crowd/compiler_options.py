"""What the compiler is told about the programs that step a crowd."""

from __future__ import annotations

import os

import jax

# Loops over the characters of a tile are short: unrolled, they take a fifth more to compile and no less to run.
# The tiled emitter writes each 16 numbers of a plain sum or product to the stack and back: such loops take five times
# as long with it (1 ns for 16 numbers becomes 5), gradients a fifteenth longer, and compiling a tenth.
# What processors estimate, they estimate otherwise one by one than many at once (1 / sqrt(x) has other last bits in a
# vector), and whether a loop runs over vectors depends on its length: a character's bits would depend on its tile.
EXTRA = ("xla_cpu_disable_loop_unrolling", "xla_cpu_disable_tiled_emitter", "xla_cpu_disable_platform_dependent_math")

# Threads among which XLA splits the work of one kernel. The arrays of a tile are small: handing them over costs more
# than it saves (2048 people on two free cores: 4.2 us per character-frame, 3.1 with one), and a core that waits for
# work cannot write recordings. Devices run beside each other all the same, and so do the compiler's threads.
ONE_THREAD = "1"


def options() -> dict[str, int]:
    """XLA's options on this backend, for `jax.jit(..., compiler_options=options())`.

    Vectors of 512 bits: XLA asks for 256 where a processor has wider ones (a frame of 2048 people takes a tenth less
    on an Intel Xeon); processors without them ignore it.
    """
    return {"xla_cpu_prefer_vector_width": 512} if jax.default_backend() == "cpu" else {}


def prepare() -> None:
    """Options of the whole process, which XLA reads once: call before JAX's first array. Leaves alone what is set."""
    os.environ.setdefault("PJRT_NPROC", ONE_THREAD)
    flags = os.environ.get("XLA_FLAGS", "")
    if "xla_backend_extra_options" not in flags:
        os.environ["XLA_FLAGS"] = f"{flags} --xla_backend_extra_options={','.join(EXTRA)}".strip()
