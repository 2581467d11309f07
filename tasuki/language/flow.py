"""What is known at one point of a module: which variables have a value there, and whether the point can be reached."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field


@dataclass
class Flow:
    """State of the path that is being checked. Branches work on copies, which are joined where they meet."""

    assigned: set[str] = field(default_factory=set)
    reachable: bool = True

    def copy(self) -> Flow:
        return Flow(set(self.assigned), self.reachable)

    def stop(self) -> None:
        """`return`, `break` or `continue`: nothing behind it is reached."""
        self.reachable = False


def join(flows: Iterable[Flow]) -> Flow:
    """Where paths meet: a variable has a value if it has one on every path that arrives."""
    arriving = [flow for flow in flows if flow.reachable]
    if not arriving:
        return Flow(reachable=False)
    return Flow(set.intersection(*(flow.assigned for flow in arriving)))
