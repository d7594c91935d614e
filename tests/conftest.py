"""Shared fixtures: where the real rigs are, and no surprises from the machine the tests run on."""

from __future__ import annotations

from pathlib import Path

import pytest
from jaxtyping import install_import_hook

# Shapes and types are checked under pytest only; an int passes where a float is expected.
install_import_hook(["kernels", "crowd"], "beartype.beartype(conf=beartype.BeartypeConf(is_pep484_tower=True))")

REPOSITORY = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of real characters, mocap and terrain beside the repository; tests that need it skip without it."""
    folder = REPOSITORY.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("real rigs are not beside this checkout (../shared/data)")
    return folder
