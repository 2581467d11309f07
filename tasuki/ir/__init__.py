"""The intermediate representation: where the language and the machines meet. It knows no machine.

Meaning
=======
This page and `interpret`, which *is* this page as code, define what a program does. A machine is right when it agrees
with
the interpreter bit for bit (the PU: under its stated arithmetic).

**Numbers.** `f32` is IEEE 754 binary32, rounded to nearest even, subnormals kept. `+ - * /`, `sqrt`, comparisons and
conversions round once; nothing is contracted or reassociated; `fma` is an operation of its own. `i32` wraps. `//` and
`%` floor as in Python, and are 0 for a zero divisor. Shift counts are taken mod 32. f32 to i32 truncates and saturates;
NaN gives 0. `minimum(a, b)` is `a if a < b else b`, `maximum(a, b)` is `a if a > b else b`. Which NaN an operation
returns is not defined; whether it returns one is. Composite operations have the fixed order that `expansions` states.

**Values** flatten to leaves (`types.Type.leaves`). Assignment copies. Expressions change nothing, so the order in which
a statement evaluates them cannot be seen; memory as a statement's expressions see it is memory before the statement.
The language's lazy forms (`and`, `or`, conditional expression) arrive here as `If` wherever laziness could be seen.

**Lanes.** A function is written for one lane; a machine may run many together (a *packet*). Control flow applies to the
*active* lanes. A branch is entered when any active lane wants it, by those lanes; they rejoin at its end. A lane that
met `Break`, `Continue` or `Return` is inactive until the loop's end, the loop's step, or the function's end. Nothing is
executed with no lane active. An assignment reaches the active lanes only. `any_lane`, `all_lanes`, `count_lanes` see
the active lanes of the packet; `same_lanes(x)` is x, and an error where active lanes differ. **Law:** apart from
`same_lanes`, and `Atomic`'s returned value, a lane's results must not depend on which lanes travel with it; programs
that use the lane operations owe this to their users, and the tests regroup lanes to see that they pay.

**Memory** is one image of rows of four 32-bit words. A table is a base row and a count of records, laid out by
`types.Record.layout`; a bool is stored as 0 or 1 and read as "not 0". An index outside a table is an error that names
table and function (checked access) or not defined (unchecked). Lanes never store to one row in one call, nor load what
another stored; `Atomic` is the exception. Local arrays are zero when their life begins, and their indices are clamped.
"""
