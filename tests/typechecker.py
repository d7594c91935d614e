"""How annotations are read under pytest: as people read them.

An int passes for a float, a NumPy scalar for an array without axes.
"""

import numpy as np
from beartype import BeartypeConf, FrozenDict, beartype

check = beartype(
    conf=BeartypeConf(
        is_pep484_tower=True,
        hint_overrides=FrozenDict({np.ndarray: np.ndarray | np.generic}),
    )
)
