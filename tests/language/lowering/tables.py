from tasuki.language import Table, f32, i32, module, record, vec3


@record
class Light:
    position: vec3
    kind: i32


lights = Table(Light)


@module
def total(table: Table[Light], scale: f32) -> vec3:
    sum = vec3(0.0)
    for i in range(len(table)):
        light = table[i]
        sum += light.position * scale
    return sum


@module
def tables(i: i32) -> vec3:
    lights[i].position = total(lights, 2) + lights[lights[i].kind].position.zyx
    lights[i].position.x = 1
    lights[i] = Light(vec3(1), 2)
    return total(scale=3, table=lights)
