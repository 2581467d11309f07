from tasuki.language import Table, atomic_add, atomic_max, f32, i32, module, record, vec3


@record
class Light:
    position: vec3
    count: i32


lights = Table(Light)


@module
def sum(table: Table[Light], i: i32, x: f32) -> f32:
    a = lights
    b = lights.position
    c = lights[x].position
    lights[i].position = x
    lights[i] = lights[i].position
    atomic_add(x, 1)
    atomic_add(lights[i].position, 1)
    atomic_max(lights[i].count, 1.0)
    lights[i].position.xyz = vec3(0.0)
    table = lights
    return len(x)
