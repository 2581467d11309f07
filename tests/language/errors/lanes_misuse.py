from tasuki.language import all_lanes, any_lane, count_lanes, f32, module, same_lanes, vec3


@module
def visit(t: f32, v: vec3) -> bool:
    count = count_lanes(t)
    same = same_lanes(v)
    return any_lane(count) or all_lanes(t > 0.0, t < 1.0)
