"""What expressions read and what statements change: the questions behind evaluation order and laziness."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from tasuki.ir.nodes import (
    Atomic,
    Call,
    Constant,
    Construct,
    Element,
    Expression,
    If,
    Length,
    Load,
    Local,
    Loop,
    Member,
    NamedTable,
    Operate,
    Statement,
    Store,
)
from tasuki.ir.ops import OPERATIONS


def parts(expression: Expression) -> tuple[Expression, ...]:
    """The expressions directly under `expression`."""
    match expression:
        case Operate() | Construct():
            return expression.arguments
        case Member():
            return (expression.base,)
        case Element():
            return (expression.index,)
        case Load():
            return (expression.table, expression.index)
        case Length():
            return (expression.table,)
        case _:
            return ()


def walk(expression: Expression) -> Iterator[Expression]:
    """`expression` and everything under it."""
    yield expression
    for part in parts(expression):
        yield from walk(part)


def reads_memory(expression: Expression) -> bool:
    """Whether a store could change the value."""
    return any(isinstance(node, Load) for node in walk(expression))


def variables_read(expression: Expression) -> set[str]:
    """Names of the variables, local arrays included, on which the value depends."""
    names = {node.name for node in walk(expression) if isinstance(node, Local)}
    return names | {node.array for node in walk(expression) if isinstance(node, Element)}


def eager_safe(expression: Expression) -> bool:
    """Whether evaluating it where laziness would not have done so can neither be seen nor reach outside a table."""
    return not any(
        isinstance(node, Load | Element) or (isinstance(node, Operate) and OPERATIONS[node.operation].sort == "lanes")
        for node in walk(expression)
    )


def is_cheap(expression: Expression) -> bool:
    """Whether evaluating it twice costs nothing: a constant, a variable, a member of a variable."""
    while isinstance(expression, Member):
        expression = expression.base
    return isinstance(expression, Constant | Local | NamedTable)


def changes_memory(statements: Sequence[Statement]) -> bool:
    """Whether a load could read something else after these statements than before them."""
    for statement in statements:
        if isinstance(statement, Call | Store | Atomic):
            return True
        if isinstance(statement, If) and changes_memory((*statement.then, *statement.orelse)):
            return True
        if isinstance(statement, Loop) and changes_memory((*statement.setup, *statement.body, *statement.step)):
            return True
    return False
