"""The words that a running program and its host share: one layout, known to `launch` (LLVM) and `machine` (Python).

An array of 64-bit words. Arguments and results follow from word `ARGUMENTS` on, in the order that `launch` gives them.
"""

COUNTER = 0
"""Chunks of items that threads have taken; advanced atomically."""
ITEMS = 1
CHUNK = 2
"""Items in a chunk: a multiple of the width."""
STOP = 3
"""Not 0: no further chunk is begun, and loops of checked programs end."""
ERROR = 4
"""1 + the number of the access site that failed first, or 0."""
ERROR_INDEX = 5
PROFILE = 6
"""Address of the counters of a profiled program."""
ARGUMENTS = 8
