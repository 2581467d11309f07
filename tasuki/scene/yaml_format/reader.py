"""Reading: from the text of a file to the scene."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from pydantic import ValidationError

from tasuki.diagnostics import Diagnostic, SceneError
from tasuki.scene.check import problems
from tasuki.scene.collector import collector_paused
from tasuki.scene.material import Material, Texture, Vector
from tasuki.scene.model import Camera, DirectionalLight, PointLight, Scene
from tasuki.scene.schema import CameraModel, DirectionalLightModel, MaterialModel, PointLightModel, SceneModel
from tasuki.scene.shapes import Shapes
from tasuki.scene.source import OUTSIDE, SourceText, scene_error
from tasuki.scene.textures import files, placed
from tasuki.scene.yaml_format.nodes import compose
from tasuki.scene.yaml_format.places import Places
from tasuki.scene.yaml_format.tree import Survey, build


def read(source: SourceText) -> Scene:
    """The scene in `source`; SceneError with everything that is wrong with it."""
    with collector_paused():
        return _read(source)


def _read(source: SourceText) -> Scene:
    root = compose(source)
    if root is None:
        raise SceneError(str(Diagnostic(f"{source.file!r} is empty", None, "a scene in YAML", "no document")))
    places = Places(source, root)
    wrong = []
    try:
        model = SceneModel.model_validate(root.plain)
    except ValidationError as error:
        found = error.errors(include_url=False, include_input=False)
        wrong = [places.explain(one, (), SceneModel) for one in found]
    survey = Survey(places, list(places.plain("materials", dict)))
    if wrong or survey.wrong:
        raise scene_error(wrong + survey.wrong)
    if outside := list(_outside(model.materials, places)):
        raise scene_error(outside)
    scene = _scene(model, survey)
    if found_problems := problems(scene):
        # What is wrong inside a definition is found once more with every instance.
        raise scene_error(dict.fromkeys(map(places.locate, found_problems)))
    return scene


def _outside(materials: Mapping[str, MaterialModel], places: Places) -> Iterator[Diagnostic]:
    """What is wrong with the places of textures' files."""
    message, expected = OUTSIDE
    for name, material in materials.items():
        for kind, parameters in (material.texture or {}).items():
            for parameter, file in files(Texture(kind, parameters)).items():
                if places.source.beside(file) is None:
                    path = ("materials", name, "texture", kind, parameter)
                    yield places.diagnostic(path, message, expected, repr(file))


def _scene(model: SceneModel, survey: Survey) -> Scene:
    folder = survey.places.source.folder
    materials = {name: _material(name, material, folder) for name, material in model.materials.items()}
    return Scene(
        camera=_camera(model.camera),
        shapes=Shapes.of(build(survey, materials), list(materials.values())),
        lights=[_light(light) for light in model.lights],
        background=_vector(model.background),
        warnings=survey.meshes.warnings,
    )


def _camera(model: CameraModel) -> Camera:
    width, height = model.resolution
    return Camera(
        eye=_vector(model.eye),
        at=_vector(model.at),
        up=_vector(model.up),
        angle=model.angle,
        resolution=(width, height),
        hither=model.hither,
        angle_between=model.angle_between,
    )


def _light(model: PointLightModel | DirectionalLightModel) -> PointLight | DirectionalLight:
    colour = None if model.colour is None else _vector(model.colour)
    if isinstance(model, DirectionalLightModel):
        return DirectionalLight(_vector(model.direction), colour)
    return PointLight(_vector(model.position), colour)


def _material(name: str, model: MaterialModel, folder: Path) -> Material:
    """The material; the files of its texture are named from `folder`."""
    values = dict(model)
    values |= {"colour": _vector(model.colour), "transmittance": _vector(model.transmittance)}
    if model.texture is not None:
        ((kind, parameters),) = model.texture.items()
        values["texture"] = placed(Texture(kind, parameters), folder)
    return Material(name, **values)


def _vector(values: Iterable[float]) -> Vector:
    x, y, z = map(float, values)
    return x, y, z
