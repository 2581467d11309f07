from tasuki.language import Table, atomic_add, atomic_max, f32, i32, module, record


@record
class Counter:
    count: i32
    value: f32


counters = Table(Counter)


@module
def bump(i: i32) -> f32:
    counters[i].value = counters[i].value + 1.0
    return counters[i].value


@module
def order(i: i32) -> f32:
    """What was read before a call keeps its value, although the call stands first in the IR."""
    a = counters[i].value + bump(i)
    before = atomic_add(counters[i].count, 2)
    atomic_max(counters[i].count, before)
    counters[i].value += bump(i)
    counters[i + 1].value = counters[i].value * bump(i)
    return a
