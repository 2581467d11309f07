from tasuki.language import f32, module, vec3


@module
def length(v: vec3) -> f32:
    print(v.x)
    return nrom(v)
