"""What `import tasuki` gives, and what it costs."""

import subprocess
import sys

import numpy as np
import pytest

import tasuki


def test_exported_names():
    assert sorted(tasuki.__all__) == [
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
        "LinkError",
        "MachineError",
        "Material",
        "Mesh",
        "Module",
        "OutputError",
        "Paraboloid",
        "Picture",
        "PointLight",
        "Polygon",
        "Quadric",
        "RoundedBox",
        "Scene",
        "SceneError",
        "Slab",
        "Solid",
        "SourceError",
        "Sphere",
        "Table",
        "TasukiError",
        "Texture",
        "Transform",
        "Tube",
        "Union",
        "VerifyError",
        "Wedge",
        "__version__",
        "load_mesh",
        "load_scene",
        "module",
        "record",
        "render",
        "socket",
    ]


@pytest.mark.parametrize("name", tasuki.__all__)
def test_every_name_can_be_had(name: str):
    assert getattr(tasuki, name) is not None
    assert name in dir(tasuki)


def test_unknown_names_are_attribute_errors():
    with pytest.raises(AttributeError, match="no attribute 'Sprite'"):
        tasuki.Sprite  # noqa: B018


def test_every_error_is_a_tasuki_error():
    errors = [getattr(tasuki, name) for name in tasuki.__all__ if name.endswith("Error")]
    assert len(errors) == 7
    assert all(issubclass(error, tasuki.TasukiError) for error in errors)


def test_import_is_cheap():
    code = "import sys, tasuki; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert not {"numpy", "llvmlite", "typer", "rich", "tasuki.language", "tasuki.scene"} & set(loaded)


def test_modules_map_over_arrays():
    from tasuki.modules.directions import reflection_direction

    directions = np.array([[0.0, 0.0, -1.0], [0.6, 0.0, -0.8]])
    mirrored = reflection_direction.map(directions, [0.0, 0.0, 1.0])
    np.testing.assert_allclose(mirrored, [[0.0, 0.0, 1.0], [0.6, 0.0, 0.8]], rtol=1e-6)
