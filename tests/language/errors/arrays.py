from tasuki.language import array, f32, i32, module

SIZE = 8


@module
def stack(n: i32, x: f32) -> f32:
    a = array(f32, SIZE)
    b = array(f32, n)
    c = array(tuple, 3)
    d = a
    a[x] = 1.0
    a[0] = n
    a = 1.0
    return a
