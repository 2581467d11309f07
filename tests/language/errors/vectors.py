from tasuki.language import mat4, module, vec3, vec4


@module
def colours(v: vec3, m: mat4) -> vec3:
    a = vec3(1, 2)
    b = v.xy
    c = v.w
    d = v[0]
    e = m.column(4)
    f = m @ vec4(v, 1.0)
    g = v == v
    h = vec4(v, v)
    return v @ m
