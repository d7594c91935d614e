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

# Of LLVM, in the same list: one vector a turn. With four, a loop over the 64 characters of a narrow tile has one turn
# and is a loop no longer: a product that it stores then meets the sum that the next loop makes of it, the two are
# rounded once, and a character's bits depend on its tile. Takes a seventh off compiling, and nothing off the speed.
ONE_VECTOR = "-force-vector-interleave=1"

# XLA runs a program kernel by kernel, and starting one costs as much as 128 characters' arithmetic in it. A run's steps
# are marked to be one function each (`kernels.one_function`). In other programs, gradients above all, whole loops are:
# a loop that XLA thinks small becomes one function with all that it calls, so every loop is small here. What has no
# place in such a function keeps its loop out of it: matrix products, scatters, sorts, custom calls.
# `tests/crowd/test_one_function.py` holds steps and gradients to that.
ONE_FUNCTION = f"xla_cpu_small_while_loop_byte_threshold={2**62}"

# Threads among which XLA splits the work of one kernel. The arrays of a tile are small: handing them over costs more
# than it saves (2048 people on two free cores: 4.2 us per character-frame, 3.1 with one), and a core that waits for
# work cannot write recordings. Devices run beside each other all the same, and so do the compiler's threads.
ONE_THREAD = "1"

# Passes that would put into a loop what has no place in a function: kernels split among threads (with several devices
# there are as many threads, whatever `ONE_THREAD` says), and reductions that are handed to a library.
WITHOUT = ("cpu-parallel-task-assigner", "dot-library-rewriter")
HOISTING = "small-while-loop-hoisting"


def options(one_function: bool = True) -> dict[str, int | str]:
    """XLA's options on this backend, for `jax.jit(..., compiler_options=options())`.

    Vectors of 512 bits: XLA asks for 256 where a processor has wider ones (a frame of 2048 people takes a third less
    on an AMD EPYC of family 26); processors without them ignore it. Copies that are not needed are looked for harder:
    the mesh of the frame before is copied once, not twice.

    one_function: of every loop. Otherwise only what is marked is one function, as steps of a run are, and the rest runs
    kernel by kernel. That compiles faster where a loop is long, above all backwards (a gradient in 25 s instead of 60,
    and runs for 1.6 times as long).
    """
    if jax.default_backend() != "cpu":
        return {}
    chosen: dict[str, int | str] = {
        "xla_cpu_prefer_vector_width": 512,
        "xla_cpu_copy_insertion_use_region_analysis": True,
    }
    return chosen if one_function else chosen | {"xla_disable_hlo_passes": ",".join((*WITHOUT, HOISTING))}


def prepare() -> None:
    """Options of the whole process, which XLA reads once: call before JAX's first array. Leaves alone what is set.

    With passes of the caller's own choice left out, loops stay loops: XLA would not find a split kernel's runtime.
    """
    os.environ.setdefault("PJRT_NPROC", ONE_THREAD)
    flags = os.environ.get("XLA_FLAGS", "")
    extra = (*EXTRA, ONE_VECTOR)
    if "xla_disable_hlo_passes" not in flags:
        flags, extra = f"{flags} --xla_disable_hlo_passes={','.join(WITHOUT)}", (*extra, ONE_FUNCTION)
    if "xla_backend_extra_options" not in flags:
        flags = f"{flags} --xla_backend_extra_options={','.join(extra)}"
    os.environ["XLA_FLAGS"] = flags.strip()
