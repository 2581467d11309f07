"""A machine's own arithmetic: what the interpreter computes with in the place of the operations' references.

The meaning of the IR is that of `ops`: every basic operation rounds once. A machine without a divider states what it
does in its place, and is then held to the interpreter under that arithmetic, bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Arithmetic:
    """Operations by name that differ: primitives as functions on float32 arrays, composites as expansions of Terms.

    A composite that is given as a `function` takes and gives leaves, arrays of float32.
    """

    primitives: Mapping[str, Callable[..., np.ndarray]] = field(default_factory=dict)
    expansions: Mapping[str, Callable[..., Any]] = field(default_factory=dict)
    functions: Mapping[str, Callable[..., np.ndarray]] = field(default_factory=dict)


IEEE = Arithmetic()
"""No operation differs: the meaning of the IR."""
