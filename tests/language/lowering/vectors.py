from tasuki.language import abs, cross, dot, f32, mat4, min, module, norm, transpose, vec3, vec4


@module
def vectors(v: vec3, w: vec4, m: mat4, x: f32) -> tuple[vec3, vec4, mat4]:
    a = cross(v, v).x + dot(v, v) + norm(w.xyz)
    b = vec4(v, 1) @ m
    c = vec4(v + v, a).wzyx
    d = m @ transpose(m) * 2
    e = mat4(m.column(0), b, c, vec4(0))
    return min(v, x, 1), abs(c), d + e
