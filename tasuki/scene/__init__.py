"""Scenes: what is drawn, the files it comes from, and the four-bank memory image that machines work on.

A file goes through an importer (`load_scene`) into the model (`Scene` and its parts); `tasuki.scene.pack` lowers it to
primitives of registered kinds (`tasuki.scene.kinds`) and puts them into memory (`tasuki.scene.memory`).
"""

from tasuki.scene.importers import load_scene, register_importer
from tasuki.scene.model import (
    Camera,
    Cone,
    Material,
    PointLight,
    Polygon,
    Scene,
    Shape,
    Shapes,
    Sphere,
    ViewFrame,
    default_intensity,
)

__all__ = [
    "Camera",
    "Cone",
    "Material",
    "PointLight",
    "Polygon",
    "Scene",
    "Shape",
    "Shapes",
    "Sphere",
    "ViewFrame",
    "default_intensity",
    "load_scene",
    "register_importer",
]
