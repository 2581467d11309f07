"""Checking of a module: from its Python source to a typed function of the IR, or all that is wrong with it."""

from __future__ import annotations

import builtins
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from tasuki.diagnostics import Diagnostic, SourceError
from tasuki.ir.nodes import Function, Parameter
from tasuki.ir.types import VOID, Record
from tasuki.language.context import MISSING, Variable, describe
from tasuki.language.source import source_order
from tasuki.language.statements import Statements

if TYPE_CHECKING:
    from tasuki.language.declare import Module, Socket
    from tasuki.language.tables import Table


@dataclass(frozen=True)
class Checked:
    """A module after checking.

    `function.name` is the module's qualified name; `Call.function` in it is a key of `calls`. `constants` are the
    global numbers whose values went into the function, by file and name; `resolved`, what every global name stood for.
    With `diagnostics`, the function is not to be used.
    """

    function: Function
    calls: Mapping[str, Module | Socket] = field(default_factory=dict)
    named_tables: Mapping[str, Table] = field(default_factory=dict)
    constants: Mapping[tuple[str, str], float | int | bool] = field(default_factory=dict)
    resolved: Mapping[str, Any] = field(default_factory=dict)
    diagnostics: tuple[Diagnostic, ...] = ()

    @property
    def tables(self) -> dict[str, Record]:
        """Named tables that the module itself uses."""
        return {name: table.record.ir for name, table in self.named_tables.items()}

    def still_holds(self, names: Mapping[str, Any]) -> bool:
        """Whether every global name means what it meant: in a notebook, cells are run again."""
        return all(names.get(name, getattr(builtins, name, MISSING)) is value for name, value in self.resolved.items())


def check_module(module: Module) -> Checked:
    """Check `module`; what is wrong is in the result's diagnostics, in source order."""
    try:
        checker = Checker(module)
        signature = module.signature
    except SourceError as error:
        return Checked(Function(module.qualified_name, (), VOID, {}, ()), diagnostics=error.diagnostics)
    try:
        return checker.check(signature.parameters, signature.result)
    except RecursionError:
        message, hint = f"`{module.name}` is nested too deeply", "give names to parts of its expressions"
        nested = Diagnostic(message, module.place, hint=hint, source=checker.source.text)
        return Checked(Function(module.qualified_name, (), VOID, {}, ()), diagnostics=(nested,))


class Checker(Statements):
    """One module being checked."""

    def check(self, types: tuple[Any, ...], result: Any) -> Checked:
        arguments = [*self.definition.args.posonlyargs, *self.definition.args.args]
        parameters = []
        for argument, type in zip(arguments, types, strict=True):
            span = self.span(argument)
            parameters.append(Parameter(argument.arg, type, span=span))
            self.variables[argument.arg] = Variable(type, span)
            self.flow.assigned.add(argument.arg)
        self.result = result
        body = self.suite(self.definition.body)
        if self.flow.reachable and result != VOID:
            self._miss_return()
        names = {parameter.name for parameter in parameters}
        variables = {name: variable.type for name, variable in self.variables.items() if name not in names}
        function = Function(
            self.module.qualified_name,
            tuple(parameters),
            result,
            variables | self.temporaries,
            body,
            span=self.span(self.definition),
        )
        diagnostics = sorted(dict.fromkeys(self.diagnostics), key=source_order)
        return Checked(function, self.calls, self.tables, self.constants, self.resolved, tuple(diagnostics))

    def _miss_return(self) -> None:
        name = self.module.name
        last = self.definition.body[-1]
        self.error(
            self.definition.returns or self.definition,
            f"`{name}` can end without a result",
            expected=f"{describe(self.result)} on every path",
            found=f"the end of line {last.end_lineno} can be reached",
        )
