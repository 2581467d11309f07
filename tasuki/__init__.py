"""Tasuki: a laboratory for image generation.

    import tasuki

    picture = tasuki.render("scene.yaml", size=(640, 480), samples=4)
    picture.save("scene.png")

The names below are imported when they are first used, so that `import tasuki` costs nothing. What modules are written
with stands in `tasuki.language`, the modules that come with the package in `tasuki.modules`.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from tasuki.version import __version__

if TYPE_CHECKING:
    from tasuki.diagnostics import (
        LinkError,
        MachineError,
        OutputError,
        SceneError,
        SourceError,
        TasukiError,
        VerifyError,
    )
    from tasuki.language import Module, Table, module, record, socket
    from tasuki.renderers.picture import Picture
    from tasuki.renderers.render import render
    from tasuki.scene import (
        Box,
        Camera,
        Complement,
        Cone,
        Cylinder,
        Difference,
        DirectionalLight,
        Ellipsoid,
        Extent,
        Formula,
        Group,
        HalfSpace,
        Hyperboloid,
        Instance,
        Intersection,
        Material,
        Mesh,
        Paraboloid,
        PointLight,
        Polygon,
        Quadric,
        RoundedBox,
        Scene,
        Slab,
        Solid,
        Sphere,
        Texture,
        Transform,
        Tube,
        Union,
        Wedge,
        load_mesh,
        load_scene,
    )

# In the order in which data meets them: scenes, modules, rendering, what goes wrong.
__all__ = [  # noqa: RUF022
    "Scene",
    "Camera",
    "PointLight",
    "DirectionalLight",
    "Material",
    "Texture",
    "Sphere",
    "Ellipsoid",
    "Box",
    "Cylinder",
    "Cone",
    "Hyperboloid",
    "Paraboloid",
    "HalfSpace",
    "Slab",
    "Wedge",
    "Quadric",
    "RoundedBox",
    "Tube",
    "Solid",
    "Polygon",
    "Mesh",
    "Union",
    "Intersection",
    "Difference",
    "Complement",
    "Formula",
    "Group",
    "Instance",
    "Extent",
    "Transform",
    "load_scene",
    "load_mesh",
    "Module",
    "Table",
    "module",
    "record",
    "socket",
    "render",
    "Picture",
    "TasukiError",
    "SourceError",
    "LinkError",
    "SceneError",
    "OutputError",
    "MachineError",
    "VerifyError",
    "__version__",
]

_HOMES = {
    "tasuki.scene": [
        "Scene",
        "Camera",
        "PointLight",
        "DirectionalLight",
        "Material",
        "Texture",
        "Sphere",
        "Ellipsoid",
        "Box",
        "Cylinder",
        "Cone",
        "Hyperboloid",
        "Paraboloid",
        "HalfSpace",
        "Slab",
        "Wedge",
        "Quadric",
        "RoundedBox",
        "Tube",
        "Solid",
        "Polygon",
        "Mesh",
        "Union",
        "Intersection",
        "Difference",
        "Complement",
        "Formula",
        "Group",
        "Instance",
        "Extent",
        "Transform",
        "load_scene",
        "load_mesh",
    ],
    "tasuki.language": ["Module", "Table", "module", "record", "socket"],
    "tasuki.renderers.render": ["render"],
    "tasuki.renderers.picture": ["Picture"],
    "tasuki.diagnostics": [
        "TasukiError",
        "SourceError",
        "LinkError",
        "SceneError",
        "OutputError",
        "MachineError",
        "VerifyError",
    ],
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'tasuki' has no attribute {name!r}")
    value = getattr(importlib.import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
