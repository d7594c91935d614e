"""What one core of this machine can do at most, through JAX: `python -m benchmarks.peaks` prints it as JSON.

The peaks of `benchmarks.roofline`. A product of matrices that fit the cache for arithmetic; for memory, arrays larger
than caches added in place inside a scan. Fresh buffers would count twice: pages are mapped in, and copied into first.
"""

from __future__ import annotations

import json
import time
from typing import Any

from benchmarks.machine import pin

SIDE = 1024  # of the matrices
LENGTH = 64 * 2**20  # floats of each array
TIMES = 8  # in a scan
RUNS = 5  # the best counts: a peak is what is possible


def measure(side: int = SIDE, length: int = LENGTH) -> dict[str, Any]:
    """GFLOP/s of float32 matrix products, and 1e9 bytes a second of x <- a x + y (reads two, writes one)."""
    import jax
    import jax.numpy as jnp

    def products(a: Any, b: Any) -> Any:
        return jax.lax.scan(lambda x, _: (x @ b, None), a, None, length=TIMES)[0]

    def streamed(x: Any, y: Any) -> Any:
        return jax.lax.scan(lambda x, _: (0.5 * x + y, None), x, None, length=TIMES)[0]

    square = jnp.full((side, side), 1.0 / side, jnp.float32)
    long = jnp.ones(length, jnp.float32)
    gflops = 2e-9 * TIMES * side**3 / _best(jax.jit(products, donate_argnums=0), square + 0, square)
    gbytes = 12e-9 * TIMES * length / _best(jax.jit(streamed, donate_argnums=0), long + 0, long)
    return {"kind": "peaks", "gflops": round(gflops, 2), "gbytes": round(gbytes, 2)}


def _best(run: Any, x: Any, y: Any) -> float:
    """Least seconds of x <- run(x, y), compiled before."""
    import jax

    x = jax.block_until_ready(run(x, y))
    seconds = []
    for _ in range(RUNS):
        began = time.perf_counter()
        x = jax.block_until_ready(run(x, y))
        seconds.append(time.perf_counter() - began)
    return min(seconds)


def main() -> None:
    """Measures on one core, in this process."""
    pinned = pin(1)
    import jax

    jax.config.update("jax_platforms", "cpu")
    print(json.dumps(measure() | {"pinned_cores": pinned}))


if __name__ == "__main__":
    main()
