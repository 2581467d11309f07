from tasuki.language import f32, module, record, same_lanes, select, vec3


@record
class Hit:
    t: f32


@module
def agree(hit: Hit, v: vec3) -> bool:
    first = same_lanes(hit)
    return select(v, hit, hit) == first
