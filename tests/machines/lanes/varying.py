"""Modules in which `same_lanes` does not hold; what a user is told stands in varying.txt."""

from tasuki.language import Table, array, f32, i32, module, record, same_lanes, vec3


@record
class Cell:
    weight: f32
    next: i32


cells = Table(Cell)


@module
def parameter(x: f32) -> f32:
    return same_lanes(x)


@module
def halved(x: f32) -> f32:
    return x * 0.5


@module
def through_a_call(x: f32) -> f32:
    y = halved(x) + 1.0
    return same_lanes(y)


@module
def through_a_branch(x: f32) -> i32:
    steps = 0
    if x > 1.0:
        steps = 7
    return same_lanes(steps)


@module
def through_a_loop(x: f32) -> i32:
    steps = 0
    while x > f32(steps):
        steps += 1
    return same_lanes(steps)


@module
def through_a_break(x: f32) -> i32:
    steps = 0
    for i in range(10):
        if f32(i) > x:
            break
        steps = i
    return same_lanes(steps)


@module
def through_a_load(index: i32) -> f32:
    return same_lanes(cells[index].weight)


@module
def through_an_array(index: i32) -> f32:
    values = array(f32, 4)
    values[index] = 1.0
    return same_lanes(values[0])


@module
def early(x: f32) -> f32:
    if x < 0.0:
        return 0.0
    return 1.0


@module
def through_a_return(x: f32) -> f32:
    return same_lanes(early(x))


@module
def two_at_once(v: vec3) -> f32:
    first = same_lanes(v.x)
    second = same_lanes(v.y)
    return first + second
