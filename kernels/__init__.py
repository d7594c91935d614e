"""Pure functions over arrays, one file per idea of the papers. Components first, characters last (`[3, ..., N]`).

A vector is `[3, *b]`, a quaternion `[4, *b]` (wxyz, Hamilton, unit), for any trailing batch shape `*b`. Nothing here
knows of states, scenarios or species.
"""
