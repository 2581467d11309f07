from tasuki.language import f32, module, record, vec3


@record
class Hit:
    t: float
    points: tuple[f32, f32]
    normal: vec3


@module
def nearest(hit: Hit) -> f32:
    return hit.t
