from tasuki.language import f32, i32, module


@module
def loops(n: i32, x: f32) -> f32:
    for i in range(0, n, n):
        x += 1.0
    for i in range(x):
        x += 1.0
    for i in [1, 2]:
        x += 1.0
    for a, b in range(3):
        x += 1.0
    for i in range(n):
        i = 3
        i += 1
    while x > 0.0:
        x -= 1.0
    else:
        x = 0.0
    return x
