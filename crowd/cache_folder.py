"""Where results that can be had again are kept between runs."""

from __future__ import annotations

import os
from pathlib import Path


def user_cache(name: str) -> Path:
    """crowd/NAME in the user's cache folder (`XDG_CACHE_HOME`, else ~/.cache); it need not exist."""
    cache = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    return Path(cache) / "crowd" / name
