from tasuki.language import Table, f32, i32, module, record, vec3


@record
class Light:
    position: vec3


lights = Table(Light)


@module
def choose(p: bool, x: f32, i: i32) -> tuple[f32, vec3, vec3]:
    a = 0 if p else x
    b = vec3(x) if p else vec3(0)
    c = lights[i].position if p else vec3(0)
    d: f32 = 1 if p else 2
    e, f = (x, 1) if p else (2.0, 3)
    return a + d + e + f32(f), b, c
