from tasuki.language import abs, f32, i32, module
import math

import numpy as np

NAMES = ["a"]


@module
def functions(x: f32, n: i32) -> f32:
    a = math.sqrt(x)
    b = math.tau + math.nothing
    c = np.sin(x)
    d = float(n)
    e = NAMES
    f = x + math
    g = round(x)
    return abs(x, x)
