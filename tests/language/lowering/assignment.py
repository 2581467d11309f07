from tasuki.language import f32, i32, module, record, vec3


@record
class Edge:
    start: vec3
    end: vec3


@record
class Span:
    edge: Edge
    y: i32


@module
def assignment(span: Span, x: f32) -> tuple[f32, vec3, Span]:
    a, b = x, 1.0
    a, b = b, a
    c = d = vec3(x)
    c.x, c.y = c.y, c.x
    span.edge.start.z = a
    span.edge.end = d
    span.edge.end.x += b
    other = Span(y=2, edge=span.edge)
    other.y -= 1
    x = x + 1
    e: f32
    if x > 0.0:
        e = 1
    else:
        e = x
    return a + e, c, other
