"""Lines of textual LLVM: values with their types, fresh names, variables that are read once and written at the end."""

from __future__ import annotations

from dataclasses import dataclass

from tasuki.machines.pu.simulate.layout import SLOTS


@dataclass(frozen=True)
class Value:
    """An LLVM value: its type (float, i32 or i1) and its name or constant."""

    type: str
    text: str

    def __str__(self) -> str:
        return f"{self.type} {self.text}"


def constant(word: int) -> Value:
    return Value("i32", str(word))


TRUE = Value("i1", "true")


class Emitter:
    """Collects the lines of one function.

    Within a block `current` holds the values of slots of the state that were read or written, and `changed` names those
    that have not been stored yet.
    """

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.current: dict[str, Value] = {}
        self.changed: dict[str, None] = {}
        self._converted: dict[tuple[str, Value], Value] = {}
        self._count = 0

    def line(self, text: str) -> None:
        self.lines.append(f"  {text}")

    def block(self, label: str) -> None:
        """Begin a block in which nothing has been read yet."""
        self.lines.append(f"{label}:")
        self.current.clear()
        self.changed.clear()
        self._converted.clear()

    def name(self) -> str:
        self._count += 1
        return f"%v{self._count}"

    def value(self, type_: str, text: str) -> Value:
        """The result of an instruction."""
        name = self.name()
        self.line(f"{name} = {text}")
        return Value(type_, name)

    def converted(self, value: Value, type_: str) -> Value:
        """The same bits as another type."""
        if value.type == type_:
            return value
        known = self._converted.get((type_, value))
        if known is None:
            if value.text.startswith("%"):
                known = self.value(type_, f"bitcast {value} to {type_}")
            else:
                known = Value(type_, f"bitcast ({value} to {type_})")
            self._converted[type_, value] = known
        return known

    def floating(self, value: Value) -> Value:
        return self.converted(value, "float")

    def integer(self, value: Value) -> Value:
        return self.converted(value, "i32")

    def select(self, condition: Value, chosen: Value, other: Value) -> Value:
        return self.value(chosen.type, f"select {condition}, {chosen}, {other}")

    def either(self, a: Value, b: Value) -> Value:
        return self.value("i1", f"or i1 {a.text}, {b.text}")

    def not_(self, a: Value) -> Value:
        return self.value("i1", f"xor i1 {a.text}, true")

    def read(self, slot: str) -> Value:
        """What a slot holds now."""
        found = self.current.get(slot)
        if found is None:
            type_ = SLOTS[slot].type
            found = self.value(type_, f"load {type_}, {self.place(slot)}")
            self.current[slot] = found
        return found

    def write(self, slot: str, value: Value) -> None:
        """A slot takes a value; `flush` stores it."""
        type_ = SLOTS[slot].type
        self.current[slot] = value if type_ == "i1" else self.converted(value, type_)
        self.changed[slot] = None

    def flush(self) -> None:
        """Store what has changed; afterwards the block must end."""
        for slot in self.changed:
            self.store(slot, self.current[slot])

    def place(self, slot: str) -> Value:
        """Where a slot stands in memory. (One pointer for the whole function would make LLVM slow.)"""
        return self.value("ptr", f"getelementptr i32, ptr %state, i32 {SLOTS[slot].place}")

    def store(self, slot: str, value: Value) -> None:
        """Store into a slot at once."""
        self.line(f"store {value}, {self.place(slot)}")
