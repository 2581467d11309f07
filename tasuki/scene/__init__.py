"""Scenes: what is drawn, the files it comes from, and the four-bank memory image that machines work on.

A file goes through an importer (`load_scene`) into the model: a `Scene`, whose shapes are nodes of a tree
(`tasuki.scene.tree`, `tasuki.scene.solids`). `tasuki.scene.flatten` places all of them in the scene's coordinates,
`tasuki.scene.pack` lowers them to primitives of registered kinds (`tasuki.scene.kinds`) and puts these into memory
(`tasuki.scene.memory`).
"""

from tasuki.scene.importers import load_scene, register_importer
from tasuki.scene.importers.meshes import load_mesh
from tasuki.scene.material import Material, Texture
from tasuki.scene.mesh import Mesh
from tasuki.scene.model import Camera, DirectionalLight, PointLight, Scene, ViewFrame, default_intensity
from tasuki.scene.shapes import Shape, Shapes
from tasuki.scene.solids import (
    Box,
    Cone,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hyperboloid,
    Paraboloid,
    Polygon,
    Quadric,
    RoundedBox,
    Slab,
    Solid,
    Sphere,
    Tube,
    Wedge,
)
from tasuki.scene.transforms import Transform
from tasuki.scene.tree import (
    Complement,
    Difference,
    Extent,
    Formula,
    Group,
    Instance,
    Intersection,
    Node,
    Union,
)

__all__ = [
    "Box",
    "Camera",
    "Complement",
    "Cone",
    "Cylinder",
    "Difference",
    "DirectionalLight",
    "Ellipsoid",
    "Extent",
    "Formula",
    "Group",
    "HalfSpace",
    "Hyperboloid",
    "Instance",
    "Intersection",
    "Material",
    "Mesh",
    "Node",
    "Paraboloid",
    "PointLight",
    "Polygon",
    "Quadric",
    "RoundedBox",
    "Scene",
    "Shape",
    "Shapes",
    "Slab",
    "Solid",
    "Sphere",
    "Texture",
    "Transform",
    "Tube",
    "Union",
    "ViewFrame",
    "Wedge",
    "default_intensity",
    "load_mesh",
    "load_scene",
    "register_importer",
]
