"""What fills the sockets of the ray tracer: for each kind of primitive its modules, and no more than a scene needs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from tasuki.language.declare import Case
from tasuki.modules import records as rec
from tasuki.modules.light_paths import trace_mirrors, trace_tree
from tasuki.modules.local_surfaces import facet_with_local_surfaces, hit_with_local_surfaces
from tasuki.modules.media import nested_media, own_medium
from tasuki.modules.objects import facet_of_anything, hit_of_anything, object_bounds
from tasuki.modules.parts import whole_thing
from tasuki.modules.search import OBJECT, hit_of_primitive
from tasuki.modules.shading import diffuse_and_highlight
from tasuki.modules.surface import facet_of_primitive, plain_texture
from tasuki.modules.texture import material_texture
from tasuki.programs import Filler
from tasuki.renderers.accelerators import Accelerator, lookup
from tasuki.scene.kinds import PrimitiveKind
from tasuki.scene.local_surfaces import is_local_surface
from tasuki.scene.textures import TextureKind

SEEN = {"primitive_hit": "hit", "primitive_surface": "surface"}
"""Dispatch sockets, and the role of the module of each kind of primitives, standing alone, that fills them."""
BOUNDS = "primitive_bounds"
"""The same of the role "box"; those of objects were found when they were packed."""
PARTS = "primitive_part"
"""The same of the role "part", which kinds may lack; objects do."""
OPERANDS = {"solid_span": "span", "solid_normal": "normal"}
"""The same of solids as operands of set operations."""
FILLED = {**SEEN, BOUNDS: "box", PARTS: "part", **OPERANDS}


@dataclass(frozen=True)
class Traits:
    """What a scene has that asks for modules: kinds of primitives that stand alone, and of operands of objects;
    whether anything lets light through, and whether such solids meet other things; and the kinds of its textures.
    """

    standing: Sequence[PrimitiveKind]
    operands: Sequence[PrimitiveKind] = ()
    transparent: bool = True
    nested: bool = True
    textures: Sequence[TextureKind] = ()

    @classmethod
    def of_all(cls, kinds: Sequence[PrimitiveKind]) -> Traits:
        """Of a scene that has everything."""
        return cls(kinds, kinds)


def default_fillers(traits: Traits, accelerator: Accelerator | None = None) -> dict[str, Filler]:
    """What fills every socket by default."""
    search = accelerator or lookup("bvh")
    filled: dict[str, Filler] = {
        "shading": diffuse_and_highlight,
        "texture": material_texture if traits.textures else plain_texture,
        "traced_light": trace_tree if traits.transparent else trace_mirrors,
        "media_at": nested_media if traits.nested else own_medium,
        "nearest_hit": search.resolve("nearest"),
        "is_blocked": search.resolve("blocked"),
        "hit_of": hit_of_anything if traits.operands else hit_of_primitive,
        "facet_of": facet_of_anything if traits.operands else facet_of_primitive,
        BOUNDS: _cases(traits.standing, "box"),
        # The last case takes every kind that no other took. It reads nothing: any table that is never empty will do.
        PARTS: [*_cases(traits.standing, "part"), Case(OBJECT, whole_thing, rec.boxes, "boxes")],
    }
    surfaces = [kind for kind in traits.operands if is_local_surface(kind)]
    if surfaces:
        filled |= {"hit_of": hit_with_local_surfaces, "facet_of": facet_with_local_surfaces}
    filled |= {socket: _cases(_distinct([*traits.standing, *surfaces]), role) for socket, role in SEEN.items()}
    filled |= {socket: _cases(_solids(traits), role) for socket, role in OPERANDS.items()}
    if traits.textures:
        kinds = traits.textures
        filled["texture_colour"] = [Case(kind.number, kind.module, kind.table, kind.table_name) for kind in kinds]
    if traits.operands:
        objects = Case(OBJECT, object_bounds, rec.objects, "objects")
        filled[BOUNDS] = [*_cases(traits.standing, "box"), objects]
    return filled


def _solids(traits: Traits) -> list[PrimitiveKind]:
    """The kinds of operands; and those that stand alone, since a medium may be one of them."""
    alone = [kind for kind in traits.standing if kind.sort == "solid"] if traits.nested else []
    return _distinct([*alone, *traits.operands])


def _distinct(kinds: Sequence[PrimitiveKind]) -> list[PrimitiveKind]:
    """Each kind once, in the order of their numbers."""
    return sorted({kind.number: kind for kind in kinds}.values(), key=lambda kind: kind.number)


def _cases(kinds: Sequence[PrimitiveKind], role: str) -> list[Case]:
    return [
        Case(kind.number, module, kind.resolve("table"), kind.table_name)
        for kind in kinds
        if (module := kind.resolve(role)) is not None
    ]
