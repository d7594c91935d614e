"""Constants found by differentiating through the simulation: `crowd tune`, and its parts for other losses."""

from crowd.tuning.run import Outcome, tune

__all__ = ["Outcome", "tune"]
