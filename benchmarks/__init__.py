"""Benchmarks: how long a character-frame, a compilation and a start take, and how much memory. See `run.py`."""
