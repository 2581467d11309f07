from tasuki.language import f32, i32, module


@module
def loops(n: i32, x: f32) -> f32:
    sum = 0.0
    for i in range(n):
        if i == 3:
            continue
        sum += x
    for i in range(n, 0, -2):
        sum += f32(i)
    for k in range(1, n + 1):
        for i in range(k):
            if sum > 100.0:
                break
            sum += f32(i * k)
    while True:
        sum = sum * 0.5
        if sum < 1.0:
            return sum
