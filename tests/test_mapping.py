"""`module.map`: arguments of every kind, on every machine; and what does not fit."""

import re

import numpy as np
import pytest

from tasuki.diagnostics import TasukiError
from tasuki.language import Table, dot, f32, i32, mat4, module, record, socket, vec3, vec4

MACHINES = ["cpu", "interpreter", "python"]


@record
class Particle:
    mass: f32
    speed: vec3
    count: i32


@record
class Word:
    number: i32


particles = Table(Particle)


@socket
def law(x: f32) -> f32: ...


@module
def doubled(x: f32) -> f32:
    return 2.0 * x


@module
def plus(x: f32, y: f32) -> f32:
    return x + y


@module
def following(n: i32) -> i32:
    return n + 1


@module
def faster(particle: Particle, factor: f32) -> Particle:
    return Particle(particle.mass, factor * particle.speed, particle.count + 1)


@module
def energy(particle: Particle) -> f32:
    return 0.5 * particle.mass * dot(particle.speed, particle.speed)


@module
def transformed(v: vec4, m: mat4) -> vec4:
    return v @ m


@module
def both(x: f32, n: i32) -> tuple[i32, f32]:
    return n, x


@module
def mass_of(i: i32) -> f32:
    return particles[i].mass


@module
def mass_in(table: Table[Particle], i: i32) -> f32:
    return table[i].mass


@module
def weigh(i: i32, mass: f32):
    particles[i].mass = mass


@module
def by_law(x: f32) -> f32:
    return law(x) + 1.0


def some_particles(count):
    array = np.zeros(count, Particle.numpy_dtype())
    array["mass"] = np.arange(count)
    array["speed"] = np.arange(3 * count).reshape(count, 3)
    return array


@pytest.fixture(params=MACHINES)
def machine(request):
    return request.param


def test_scalars_and_arrays_go_together(machine):
    np.testing.assert_array_equal(plus.map([1, 2, 3], 0.5, machine=machine), np.float32([1.5, 2.5, 3.5]))
    np.testing.assert_array_equal(plus.map(y=np.arange(40), x=1, machine=machine), np.arange(1, 41, dtype=np.float32))
    np.testing.assert_array_equal(plus.map(1, 2, machine=machine), np.float32([3.0]))


def test_nothing_maps_to_nothing(machine):
    assert plus.map([], 1, machine=machine).shape == (0,)
    assert following.map([], machine=machine).dtype == np.int32
    assert transformed.map(np.zeros((0, 4)), np.eye(4), machine=machine).shape == (0, 4)
    assert faster.map(some_particles(0), 2, machine=machine).shape == (0,)
    assert [part.shape for part in both.map([], [], machine=machine)] == [(0,), (0,)]


def test_records_as_arrays_as_mappings_and_as_values(machine):
    array = some_particles(5)
    of_mapping = energy.map({"mass": array["mass"], "speed": array["speed"], "count": 0}, machine=machine)
    np.testing.assert_array_equal(energy.map(array, machine=machine), of_mapping)
    one = Particle(2.0, vec3(1.0, 2.0, 3.0), 4)
    np.testing.assert_array_equal(energy.map(one, machine=machine), np.float32([14.0]))
    np.testing.assert_array_equal(faster.map(array, 2, machine=machine)["speed"], 2 * array["speed"])


def test_matrices_are_rows_and_columns_as_in_numpy(machine):
    m = np.arange(16, dtype=np.float32).reshape(4, 4)
    v = np.float32([[1, 2, 3, 4], [5, 6, 7, 8]])
    np.testing.assert_array_equal(transformed.map(v, m, machine=machine), v @ m)
    np.testing.assert_array_equal(transformed.map(v, [m, m.T], machine=machine), [v[0] @ m, v[1] @ m.T])


def test_tables_are_read_and_written_wherever_they_lie(machine):
    array = some_particles(20)
    reversed_ = array[::-1]
    options = {"machine": machine, "tables": {"particles": reversed_}}
    np.testing.assert_array_equal(mass_of.map([0, 19], **options), np.float32([19.0, 0.0]))
    assert weigh.map(np.arange(20), np.arange(20) + 0.5, **options) is None
    np.testing.assert_array_equal(array["mass"], np.arange(20)[::-1] + 0.5)
    np.testing.assert_array_equal(mass_in.map(array, [3], machine=machine), np.float32([16.5]))


def test_an_array_that_is_read_only_stays_as_it_is(machine):
    array = some_particles(20)
    array.flags.writeable = False
    options = {"machine": machine, "tables": {"particles": array}}
    np.testing.assert_array_equal(mass_of.map([7], **options), np.float32([7.0]))
    with pytest.raises(TasukiError, match="read-only"):
        weigh.map([3], 9.0, **options)
    np.testing.assert_array_equal(array["mass"], np.arange(20))


def test_sockets_are_filled(machine):
    np.testing.assert_array_equal(by_law.map([1, 2], fill={"law": doubled}, machine=machine), np.float32([3.0, 5.0]))


def test_float64_is_the_interpreters(machine):
    if machine == "interpreter":
        assert plus.map(1, 2.0**-30, machine=machine, precision=np.float64)[0] == 1.0 + 2.0**-30
    else:
        with pytest.raises(TasukiError, match="computes in float32"):
            plus.map(0.1, 0.2, machine=machine, precision="float64")


WRONG = {
    "lengths": (plus, ([1, 2, 3], [1, 2]), {}, "arguments of different lengths"),
    "two dimensions": (plus, (np.ones((2, 2)), 1), {}, "expected shape (n,) or () for f32, found (2, 2)"),
    "ragged": (plus, ([[1, 2], [3]], 1), {}, "rows of different lengths"),
    "text": (plus, ("1", 1), {}, "expected f32, found an array of <U1"),
    "none": (plus, (None, 1), {}, "expected f32, found an array of object"),
    "float for i32": (following, ([1.5],), {}, "expected i32, found an array of float64"),
    "too large for i32": (following, ([2**31],), {}, "expected i32, -2147483648 to 2147483647, found 2147483648"),
    "one missing": (plus, (1,), {}, "takes (x, y), each once"),
    "one too many": (plus, (1, 2, 3), {}, "takes (x, y), each once"),
    "twice": (plus, (1, 2), {"x": 3}, "takes (x, y), each once"),
    "fields missing": (energy, ({"mass": 1},), {}, "expected a record Particle with a field `speed`"),
    "fields of other lengths": (
        energy,
        ({"mass": np.ones(9), "speed": [1, 1, 1], "count": [1, 2]},),
        {},
        "fields of different lengths: [2, 9]",
    ),
    "table of others": (mass_in, (np.zeros(9, Word.numpy_dtype()), [0]), {}, "expected records of Particle"),
    "named table too small": (
        mass_of,
        ([0],),
        {"tables": {"particles": np.zeros(90, Word.numpy_dtype())}},
        "table `particles` takes rows 0 to 180 of a memory that has 90",
    ),
    "no table": (mass_of, ([0],), {"tables": {"particles": [1, 2]}}, "expected a one-dimensional array of a record's"),
    "outside": (mass_of, ([9],), {"tables": {"particles": some_particles(9)}}, "outside table `particles`"),
    "unfilled": (by_law, (1,), {}, "socket `law`, which `by_law` calls, is not filled"),
    "filled wrongly": (by_law, (1,), {"fill": {"law": plus}}, "`plus` cannot fill socket `law`"),
    "filled with a name": (by_law, (1,), {"fill": {"law": "doubled"}}, "expected a module, or a list of cases"),
    "no threads": (plus, (1, 2), {"threads": -3}, "threads: expected a whole number from 1 to"),
    "no lanes": (plus, (1, 2), {"width": 0}, "width: expected a whole number from 1 to"),
    "no precision": (plus, (1, 2), {"precision": "int8"}, "precision: expected float32 or float64"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_does_not_fit_is_told(machine, case):
    mapped, arguments, options, message = WRONG[case]
    with pytest.raises(TasukiError, match=re.escape(message)):
        mapped.map(*arguments, machine=machine, **options)


def test_there_is_no_such_machine():
    with pytest.raises(TasukiError, match="unknown machine 'gpu'"):
        plus.map(1, 2, machine="gpu")
