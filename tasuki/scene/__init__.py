"""Scenes: what is drawn, the files it comes from, and the four-bank memory image that machines work on."""

from tasuki.scene.importers import load_scene, register_importer
from tasuki.scene.model import (
    Camera,
    Cone,
    Material,
    PointLight,
    Polygon,
    Scene,
    Shape,
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
    "Sphere",
    "ViewFrame",
    "default_intensity",
    "load_scene",
    "register_importer",
]
