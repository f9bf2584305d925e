#!/usr/bin/env python3
"""Write flat Fortran procedures for f2py, and the Python functions that call them, from the rows of a table.

    generate.py procedures.toml flat.f90 flat.py

A row of the table,

    [procedures.mindlin_traction]
    does = "Compute the shear traction between spheres under a first tangential load."
    takes = "mindlin spheres; r(*) [m]; load [N]"
    gives = "traction(*) [Pa]"
    calls = "traction = spheres%traction(r, load)"

becomes a Fortran procedure, whose arguments f2py can wrap and of which it counts the points,

    subroutine mindlin_traction(n_any, spheres_numbers, r, load, traction)
      ... declarations ...
      spheres%friction_coefficient = spheres_numbers(1)   ! and so on: numbers of a record, by name
      traction = spheres%traction(r, load)
    end subroutine mindlin_traction

and a Python function `mindlin_traction(spheres, r, load)` with this sentence and these units as docstring.

An argument is `kind name(shape) [unit] = default`. The kind is real (if left out), int, long, single, flag
(with a shape a mask), text, a record of [records], or one of [kinds]: an object of several flat arguments.
Python has the axes of Fortran in reverse order; `*` stands for points of any shape. An array that is taken
and given changes in place; a record that is given under the name of an object is read from it. A procedure
with an `error` ends with a status, which becomes an exception. `gil = true` holds the interpreter's lock.
"""

import re
import sys
import textwrap
import tomllib
from pathlib import Path
from typing import Any, NamedTuple

DECLARED = {
    "real": "real(c_double)",
    "int": "integer(c_int)",
    "long": "integer(c_int64_t)",
    "single": "real(c_float)",
    "flag": "integer(c_int)",
    "text": "character(len=*)",
}
ZERO = {"real": "0.0_c_double", "text": "''"}
# A number of a record: from the array, into it, and its Python type.
NUMBER = {
    "real": ("{}", "{}", "float"),
    "int": ("nint({})", "real({}, c_double)", "int"),
    "flag": ("{} > 0.5_c_double", "merge(1.0_c_double, 0.0_c_double, {})", "bool"),
}
ARGUMENT = re.compile(r"(?:(\w+) )?(\w+)(?:\((.*?)\))?(?: \[(.*)\])?(?: = (.*))?", re.DOTALL)


class Argument(NamedTuple):
    """An argument of a procedure, or a number of a record."""

    kind: str
    name: str
    shape: list[str]
    unit: str
    default: str


def parsed(text: str) -> list[Argument]:
    """Return the arguments of a text such as `lattice lattice; pressure(n_col, n_row) [Pa]`."""
    found = []
    for part in filter(str.strip, text.split(";")):
        match = ARGUMENT.fullmatch(part.strip()) or sys.exit(f"{part}: expected kind name(shape) [unit]")
        axes = ["n_any" if axis == "*" else axis for axis in re.findall(r"[^, ]+", match[3] or "")]
        found.append(Argument(match[1] or "real", match[2], axes, match[4] or "-", match[5] or ""))
    return found


def listed(start: str, words: list[str], end: str) -> str:
    """Return a list of words over lines of Fortran."""
    return " &\n".join(textwrap.wrap(f"{start}{', '.join(words)}{end}", 118, subsequent_indent="    "))


def class_of(kind: str) -> str:
    """Return the name of the Python class of a record."""
    return kind.title().replace("_", "")


class Procedure:
    """A row of the table."""

    def __init__(self, name: str, row: dict[str, Any], table: dict[str, Any]) -> None:
        self.name, self.row = name, row
        self.records, self.kinds = table["records"], table["kinds"]
        self.takes, gives = parsed(row.get("takes", "")), parsed(row.get("gives", ""))
        taken = {argument.name for argument in self.takes}
        self.changed = {g.name for g in gives if g.name in taken and g.kind not in self.records}
        self.gives = [given for given in gives if given.name not in self.changed]
        self.counts = {
            name: text.format(argument.name)
            for argument in self.takes
            for name, text in self.kinds.get(argument.kind, {}).get("counts", {}).items()
        }
        sets = [self.kinds[taken.kind]["set"] for taken in self.takes if taken.kind in self.kinds]
        self.guarded = any("error" in text for text in sets)
        self.fails = self.guarded or bool(re.search(r"\berror\b", row["calls"]))

    def flat(self, argument: Argument, ending: str) -> list[Argument]:
        """Return what stands for an argument in the flat procedure."""
        if argument.kind in self.records:
            size = len(parsed(self.records[argument.kind]["numbers"]))
            return [Argument("real", argument.name + ending, [f"{size}"], "", "")]
        parts = parsed(self.kinds[argument.kind]["flat"]) if argument.kind in self.kinds else []
        return [part._replace(name=f"{argument.name}_{part.name}") for part in parts] or [argument]

    def fortran(self) -> str:
        """Return the flat procedure."""
        takes = [part for argument in self.takes for part in self.flat(argument, "_numbers")]
        gives = [part for argument in self.gives for part in self.flat(argument, "_found")]
        known = {part.name for part in takes if not part.shape}
        axes = [axis for part in takes for axis in part.shape if not axis.isdecimal() and axis not in known]
        counts = dict.fromkeys([*self.counts, *axes])
        takes = [Argument("int", name, [], "-", "") for name in counts] + takes
        lines = [] if self.row.get("gil") else ["!f2py threadsafe"]
        for part in sorted(takes + gives, key=lambda part: part.kind != "int" or bool(part.shape)):
            intent = "inout" if part.name in self.changed else "in" if part in takes else "out"
            kind = DECLARED[part.kind].replace("*", "*" if intent == "in" else "2048")
            shape = f"({', '.join(part.shape)})" if part.shape else ""
            lines.append(f"{kind}, intent({intent}) :: {part.name}{shape} ! [{part.unit}]")
        names = [part.name for part in takes + gives]
        if self.fails:
            names += ["code", "message"]
            lines += ["integer(c_int), intent(out) :: code", "character(len=512), intent(out) :: message"]
            lines += ["type(error_t), allocatable :: error"]
        objects = {argument.name: argument.kind for argument in [*self.gives, *self.takes]}
        for name, kind in objects.items():
            lines += [f"type({self.records[kind]['type']}) :: {name}"] if kind in self.records else []
            lines += self.kinds[kind]["local"].format(name).splitlines() if kind in self.kinds else []
        lines += [*self.row.get("local", "").splitlines(), "", *self.statements(gives)]
        text = textwrap.indent("\n".join(lines), "    ")
        return listed(f"  subroutine {self.name}(", names, ")") + f"\n{text}\n  end subroutine {self.name}\n"

    def statements(self, gives: list[Argument]) -> list[str]:
        """Return the body: objects from their arguments, calls, records to numbers, status."""
        lines = [f"{part.name} = {ZERO.get(part.kind, '0')}" for part in gives if self.fails]
        calls, after = self.row["calls"].strip(), []
        for argument in self.takes:
            name, kind = argument.name, self.kinds.get(argument.kind, {})
            for place, (number, component) in enumerate(self.numbers(argument), 1):
                lines.append(f"{component} = {NUMBER[number.kind][0].format(f'{name}_numbers({place})')}")
            for line in kind.get("set", "").format(name).splitlines():
                lines.append(f"if (.not. allocated(error)) {line}" if "error" in line else line)
            after += kind.get("after", "").format(name).splitlines()
            calls = re.sub(rf"\b{name}\b", f"({name} /= 0)", calls) if argument.kind == "flag" else calls
        for argument in self.gives:
            found = [NUMBER[n.kind][1].format(component) for n, component in self.numbers(argument)]
            after = [*([listed(f"{argument.name}_found = [", found, "]")] if found else []), *after]
        inner = "\n".join([*calls.splitlines(), *after])
        if self.guarded:
            inner = f"if (.not. allocated(error)) then\n{textwrap.indent(inner, '  ')}\nend if"
        return [*lines, inner, *(["call report(error, code, message)"] if self.fails else [])]

    def numbers(self, argument: Argument) -> list[tuple[Argument, str]]:
        """Return the numbers of a record with their components in Fortran, by default of the same name."""
        record = self.records.get(argument.kind, {"numbers": ""})
        named = record.get("components", {})
        return [(n, f"{argument.name}%{named.get(n.name, n.name)}") for n in parsed(record["numbers"])]

    def python(self) -> str:
        """Return the function that calls the flat procedure."""
        points = {a.name: f"({a.name}, {len(a.shape) - 1})" for a in self.takes if "n_any" in a.shape}
        lines = [f"points, {', '.join(points)} = flattened({', '.join(points.values())})"] if points else []
        passed = [f"_flat.{self.name}"] if self.fails else []
        for argument in self.takes:
            name, kind = argument.name, argument.kind
            if kind in self.records:
                passed.append(f"[getattr({name}, name) for name in {class_of(kind)}._fields]")
            elif kind in self.kinds:
                passed.append(self.kinds[kind]["python"].format(name))
            else:
                turned = len(argument.shape) > 1 and name not in points
                passed.append(f"np.asarray({name}).T" if turned else name)
        passed += [f"{name}={count}" for name, count in self.counts.items()]
        call = f"{'called' if self.fails else f'_flat.{self.name}'}({', '.join(passed)})"
        results = ", ".join(f"{given.name}_" for given in self.gives)
        lines.append(f"{results} = {call}" if results else call)
        lines += [f"return {', '.join(map(self.returned, self.gives))}"] if results else []
        told = " -> ".join(" ".join(self.row[key].split()) for key in ("takes", "gives") if self.row.get(key))
        names = ", ".join(f"{a.name}={a.default}" if a.default else a.name for a in self.takes)
        text = textwrap.indent("\n".join([f'"""{self.row["does"]}\n\n{told}\n"""', *lines]), "    ")
        return f"\n\ndef {self.name}({names}):\n{text}\n"

    def returned(self, given: Argument) -> str:
        """Return what the function makes of a result."""
        name = f"{given.name}_"
        if given.kind in self.records:
            return f"record({class_of(given.kind)}, {name})"
        name += ".decode(errors='replace').strip()" * (given.kind == "text") + ".T" * (len(given.shape) > 1)
        name = f"shaped({given.name}_, points)" if "n_any" in given.shape else name
        return f"{name} != 0" if given.kind == "flag" else name


def main(source: str, fortran: str, python: str) -> None:
    """Write both files."""
    table = tomllib.loads(Path(source).read_text())
    rows = [Procedure(name, row, table) for name, row in table["procedures"].items()]
    text = ["module hc_flat\n  use iso_c_binding, only: c_double, c_float, c_int, c_int64_t"]
    text += [listed(f"  use {module}, only: ", [names], "") for module, names in table["use"].items()]
    text += [
        "  implicit none\n  private",
        listed("  public :: ", list(table["procedures"]), ""),
        "\ncontains\n",
    ]
    Path(fortran).write_text("\n".join([*text, *(row.fortran() for row in rows), "end module hc_flat\n"]))
    lines = ["from typing import NamedTuple\n\nimport numpy as np\n\nfrom . import _core"]
    lines += ["from .calls import called, flattened, record, shaped\n\n_flat = _core.hc_flat"]
    lines += ["LIBRARY = str(_core.__file__)\n"]
    for kind, row in table["records"].items():
        numbers = [f"    {n.name}: {NUMBER[n.kind][2]}  # [{n.unit}]" for n in parsed(row["numbers"])]
        lines += [f'\nclass {class_of(kind)}(NamedTuple):\n    """{row["does"]}"""\n', *numbers, ""]
    Path(python).write_text("\n".join(lines) + "".join(row.python() for row in rows))


if __name__ == "__main__":
    main(*sys.argv[1:])
