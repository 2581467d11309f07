from tasuki.language import array, f32, i32, module, record, vec3


@record
class Task:
    node: i32
    weight: f32


DEPTH = 4


@module
def arrays(n: i32) -> f32:
    stack = array(Task, DEPTH * 2)
    values = array(vec3, 3)
    top = 0
    stack[top] = Task(n, 1)
    stack[top].weight += 2.0
    values[1].y = stack[top].weight
    values[0], values[1] = values[1], values[0]
    for i in range(len(stack)):
        stack[i + 1].node = stack[i].node // 2
    return values[0].y + f32(stack[7].node)
