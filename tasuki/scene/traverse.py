"""What is asked of whole trees of nodes. Stacks of their own keep deep trees from overflowing Python's."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from tasuki.scene.material import PLAIN, Material
from tasuki.scene.mesh import Mesh
from tasuki.scene.tree import Formula, Many, Node


def materials_of(nodes: Iterable[Any]) -> list[Material]:
    """The materials that trees are made of, and plain white where something has none of its own nor around it.

    In order, those of a node before those inside the nodes in it.
    """
    found: dict[Material, None] = {}
    known: set[int] = set()
    stack: list[tuple[Iterable[Any], bool]] = [(nodes, False)]
    seen: set[tuple[int, bool]] = set()
    while stack:
        inside, is_given = stack.pop()
        ahead = []
        for node in inside:
            if isinstance(node, Many):
                found.update(dict.fromkeys(node.materials))
                ahead.append((node.nodes, True))
                continue
            material = node.material
            # By identity first: to compare the values of materials takes longer than all else here.
            if material is not None and id(material) not in known:
                known.add(id(material))
                found[material] = None
            if node.holds:
                given = is_given or material is not None
                if (id(node), given) not in seen:
                    seen.add((id(node), given))
                    ahead.append((node.inner, given))
            elif material is None and not is_given:
                found[PLAIN] = None
        stack += ahead[::-1]
    return list(found)


def is_empty(nodes: Iterable[Any]) -> bool:
    """Whether there is nothing but empty groups in the trees of `nodes`."""
    stack, seen = list(nodes), set()
    while stack:
        node = stack.pop()
        if not node.holds or (isinstance(node, Many) and len(node) > len(node.nodes)):
            return False
        if id(node) not in seen:
            seen.add(id(node))
            stack += node.nodes if isinstance(node, Many) else node.inner
    return True


def with_materials(nodes: Sequence[Node], changed: Mapping[Material, Material]) -> list[Node]:
    """The trees of `nodes` with each material changed, that which is there by default too. Sharing is kept."""
    done: dict[int, Any] = {}
    stack: list[Any] = list(nodes)
    while stack:
        node = stack.pop()
        if id(node) in done:
            continue
        if isinstance(node, Many):
            done[id(node)] = node.of_materials([changed[material] for material in node.materials])
            continue
        missing = [inner for inner in node.inner if id(inner) not in done]
        if missing:
            stack += [node, *missing]
            continue
        made = node.of_inner([done[id(inner)] for inner in node.inner])
        done[id(node)] = made if made.material is None else replace(made, material=changed[made.material])
    default = changed.get(PLAIN)
    made_nodes = [done[id(node)] for node in nodes]
    if default is None:
        return made_nodes
    # What is in a mesh has its material already.
    keeps = [node.material is not None or isinstance(node, Mesh) for node in made_nodes]
    return [node if kept else replace(node, material=default) for node, kept in zip(made_nodes, keeps, strict=True)]


def measure(nodes: Iterable[Node]) -> list[tuple[int, int]]:
    """Of each tree of `nodes`: how deep it is, in levels, and how many nodes it has with every instance apart."""
    done: dict[int, tuple[int, int]] = {}
    found = []
    for root in nodes:
        stack: list[Any] = [root]
        while stack:
            node = stack.pop()
            inside = node.nodes if isinstance(node, Many) else node.inner
            holders = [inner for inner in inside if inner.holds]
            missing = [inner for inner in holders if id(inner) not in done]
            if missing:
                stack += [node, *missing]
                continue
            levels = 1 + max((done[id(inner)][0] for inner in holders), default=1 if len(inside) else 0)
            done[id(node)] = (levels, _count(node, inside, holders, done))
        found.append(done[id(root)])
    return found


def _count(node: Any, inside: Sequence[Any], holders: Sequence[Any], done: Mapping[int, tuple[int, int]]) -> int:
    """How many nodes there are in `node`, itself included, given those of the `holders` of nodes `inside` it."""
    if isinstance(node, Formula):
        sizes = [done[id(part)][1] if part.holds else 1 for part in inside]
        return 1 + sum(times * size for times, size in zip(node.uses, sizes, strict=True))
    single = len(node) if isinstance(node, Many) else 1 + len(inside)
    return single - len(holders) + sum(done[id(inner)][1] for inner in holders)
