"""Facts about the structure of a program that lowering asks for: jumps out of blocks, tables in use."""

from __future__ import annotations

from tasuki.ir import nodes as ir
from tasuki.ir.types import Record


def has_jump(statement: ir.Statement) -> bool:
    """Whether lanes may leave the block around a statement from inside it. A loop keeps its own jumps to itself."""
    match statement:
        case ir.Break() | ir.Continue() | ir.Return():
            return True
        case ir.If(_, then, orelse):
            return any(map(has_jump, (*then, *orelse)))
        case ir.Loop():
            return has_return(statement)
    return False


def has_return(statement: ir.Statement) -> bool:
    match statement:
        case ir.Return():
            return True
        case ir.If(_, then, orelse):
            return any(map(has_return, (*then, *orelse)))
        case ir.Loop(_, body, setup, step):
            return any(map(has_return, (*body, *setup, *step)))
    return False


def named_tables(program: ir.Program) -> dict[str, dict[str, Record]]:
    """For every function the named tables that it or a callee touches, in a fixed order."""
    found: dict[str, dict[str, Record]] = {}

    def visit(name: str) -> dict[str, Record]:
        if name not in found:
            direct, callees = direct_uses(program.functions[name])
            names = set(direct).union(*(visit(callee) for callee in callees))
            found[name] = {table: program.tables[table] for table in sorted(names)}
        return found[name]

    for name in program.functions:
        visit(name)
    return found


def direct_uses(function: ir.Function) -> tuple[set[str], set[str]]:
    """Named tables and functions that a function itself mentions."""
    tables: set[str] = set()
    callees: set[str] = set()

    def walk(node: object) -> None:
        if isinstance(node, ir.NamedTable):
            tables.add(node.name)
        elif isinstance(node, ir.Call):
            callees.add(node.function)
        if isinstance(node, ir.Node):
            for value in vars(node).values():
                walk(value)
        elif isinstance(node, tuple):
            for item in node:
                walk(item)

    walk(function.body)
    return tables, callees
