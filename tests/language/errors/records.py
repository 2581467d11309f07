from tasuki.language import f32, module, norm, record, vec3


@record
class Hit:
    t: f32
    normal: vec3


@module
def nearest(hit: Hit) -> Hit:
    hit.noraml = vec3(0.0)
    hit.normal.w = 1.0
    hit.normal.xyz = vec3(1.0)
    other = Hit(1.0)
    third = Hit(t=1, normal=2.0)
    fourth = Hit(t=1.0, norm=vec3(0.0))
    fifth = Hit(1.0, vec3(0.0), 3.0)
    return hit
