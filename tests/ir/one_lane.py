"""A second interpreter, for one lane, that has nothing of the first one's masks: Python's own control flow runs the
statements, exceptions carry break, continue and return. Values are lists of leaves, as 0-dimensional arrays."""

from __future__ import annotations

from typing import Any

import numpy as np

from tasuki.ir import nodes as n
from tasuki.ir.expansions import Term
from tasuki.ir.ops import OPERATIONS
from tasuki.ir.paths import at_path
from tasuki.ir.types import BOOL, F32, I32, Array, Vector

DTYPES = {"f32": np.float32, "i32": np.int32, "bool": np.bool_}
SCALARS = {"f32": F32, "i32": I32, "bool": BOOL}


class _Break(Exception):
    pass


class _Continue(Exception):
    pass


class _Return(Exception):
    def __init__(self, value: Any) -> None:
        self.value = value


class OneLane:
    """Runs a program without tables, lane operations, and atomics."""

    def __init__(self, program: n.Program) -> None:
        self.program = program

    def call(self, name: str, arguments: list[Any]) -> Any:
        function = self.program.functions[name]
        variables = {p.name: list(a) for p, a in zip(function.parameters, arguments, strict=True)}
        for variable, kind in function.variables.items():
            if not isinstance(kind, Array):
                variables[variable] = [DTYPES[leaf](0) for leaf in kind.leaves]
        types = {p.name: p.type for p in function.parameters} | dict(function.variables)
        try:
            self.block(function.body, variables, types)
        except _Return as outcome:
            return outcome.value
        return []

    def block(self, statements: Any, variables: Any, types: Any) -> None:
        for node in statements:
            self.statement(node, variables, types)

    def statement(self, node: Any, variables: Any, types: Any) -> None:
        def value(expression: Any) -> Any:
            return self.value(expression, variables)

        match node:
            case n.Assign():
                _, place = at_path(types[node.target], node.path)
                variables[node.target][place.start : place.stop] = value(node.value)
            case n.Clear():
                array = types[node.array]
                variables[node.array] = [[DTYPES[leaf](0) for leaf in array.item.leaves] for _ in range(array.length)]
            case n.SetElement():
                rows = variables[node.array]
                index = min(max(int(value(node.index)[0]), 0), len(rows) - 1)
                _, place = at_path(types[node.array].item, node.path)
                rows[index][place.start : place.stop] = value(node.value)
            case n.Call():
                result = self.call(node.function, [value(argument) for argument in node.arguments])
                if node.target is not None:
                    variables[node.target] = list(result)
            case n.If():
                self.block(node.then if value(node.test)[0] else node.orelse, variables, types)
            case n.Loop():
                self.loop(node, variables, types)
            case n.Break():
                raise _Break
            case n.Continue():
                raise _Continue
            case n.Return():
                raise _Return(value(node.value) if node.value is not None else [])

    def loop(self, node: n.Loop, variables: Any, types: Any) -> None:
        while True:
            self.block(node.setup, variables, types)
            if not self.value(node.test, variables)[0]:
                return
            try:
                self.block(node.body, variables, types)
            except _Break:
                return
            except _Continue:
                pass
            self.block(node.step, variables, types)

    def value(self, node: Any, variables: Any) -> Any:
        match node:
            case n.Constant():
                return [DTYPES[str(node.type)](node.value)]
            case n.Local():
                return list(variables[node.name])
            case n.Member():
                place = node.base.type.leaf_range(node.name)
                return self.value(node.base, variables)[place.start : place.stop]
            case n.Element():
                rows = variables[node.array]
                return list(rows[min(max(int(self.value(node.index, variables)[0]), 0), len(rows) - 1)])
            case n.Construct():
                leaves = [leaf for argument in node.arguments for leaf in self.value(argument, variables)]
                return leaves * node.type.size if isinstance(node.type, Vector) and len(leaves) == 1 else leaves
            case n.Operate():
                return self.operate(node, [self.value(argument, variables) for argument in node.arguments])
        raise TypeError(type(node).__name__)

    def operate(self, node: n.Operate, arguments: Any) -> Any:
        operation = OPERATIONS[node.operation]
        if operation.sort == "composite":
            terms = [
                [
                    Term(leaf, kind, _apply, lambda number, kind: DTYPES[kind](number))
                    for leaf, kind in zip(a, t.type.leaves, strict=True)
                ]
                for a, t in zip(arguments, node.arguments, strict=True)
            ]
            return [term.value for term in operation.expansion(*terms)]
        return [
            _primitive(node.operation, [a[position] if len(a) > 1 else a[0] for a in arguments], leaf)
            for position, leaf in enumerate(node.type.leaves)
        ]


def _primitive(name: str, values: Any, leaf: str) -> Any:
    result = OPERATIONS[name].reference(*(np.asarray(value)[np.newaxis] for value in values))
    return DTYPES[leaf](result[0])


def _apply(name: str, values: Any, scalars: Any) -> Any:
    return _primitive(name, values, str(OPERATIONS[name].result([SCALARS[scalar] for scalar in scalars])))
