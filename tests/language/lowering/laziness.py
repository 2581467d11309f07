from tasuki.language import Table, any_lane, f32, i32, module, record, vec3


@record
class Light:
    position: vec3
    shines: bool


lights = Table(Light)


@module
def expensive(x: f32) -> bool:
    return x > 0.0


@module
def laziness(x: f32, y: f32, i: i32) -> bool:
    """What cannot be noticed is evaluated at once; a load, a call or a lane operation waits for its turn."""
    eager = (x > 0.0 and y > 0.0) or not x < y
    load = i < len(lights) and lights[i].shines
    call = x > 1.0 or expensive(x) or y > 1.0
    lane = x > 0.0 and any_lane(y > 0.0)
    return eager and load and call and lane
