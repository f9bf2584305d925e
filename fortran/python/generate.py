"""Write flat Fortran procedures for f2py, and the Python functions that call them, from the rows of a table.

Its arguments are the table, the Fortran file and the Python file. A row,

    [procedures.mindlin_traction]
    does = "Compute the shear traction between spheres under a first tangential load."
    takes = "Mindlin spheres; r(*) [m]; load [N]"
    gives = "traction(*) [Pa]"
    calls = "traction = spheres%traction(r, load)"

becomes a Fortran procedure, whose arguments f2py can wrap and of which it counts the points,

    subroutine mindlin_traction(spheres_numbers, r, load, n_any, traction)
      ... declarations ...
      spheres%friction_coefficient = spheres_numbers(1)   ! and so on: numbers of a record, by name
      traction = spheres%traction(r, load)
    end subroutine mindlin_traction

and a Python function `mindlin_traction(spheres, r, load)` with this sentence and these units as docstring.

An argument is `kind name(shape) [unit] = default`. The kind is real (if left out), int, long, single, flag
(with a shape a mask), text, a record of [records], or an object: of several flat arguments ([kinds]), or
behind a handle ([objects]). The default of a number of a record is its component in Fortran, if this has
another name.
Python has the axes of Fortran in reverse order; `*` stands for points of any shape. An array that is taken
and given changes in place; a record that is given under the name of an object is read from it. A procedure
with an `error` ends with a status, which becomes an exception. `gil = true` holds the interpreter's lock.
Arrays that the compiler makes cannot fail; a procedure on a window, or on rows of one, asks for the memory of
some `fields` first where its row says how many it takes at most.
"""

import re
import sys
import textwrap
import tomllib
from collections import namedtuple
from pathlib import Path
from typing import Any

DECLARED = {"real": "real(c_double)", "int": "integer(c_int)", "flag": "integer(c_int8_t)"}
DECLARED |= {"long": "integer(c_int64_t)", "single": "real(c_float)", "text": "character(len=*)"}
# A number of a record: from the array, into it, and its Python type.
NUMBER = {
    "real": ("{}", "{}", "float"),
    "int": ("nint({})", "real({}, c_double)", "int"),
    "flag": ("{} > 0.5_c_double", "merge(1.0_c_double, 0.0_c_double, {})", "bool"),
}
ARGUMENT = re.compile(r"(?:(\w+) )?(\w+)(?:\((.*?)\))?(?: \[(.*)\])?(?: = (.*))?", re.DOTALL)
Argument = namedtuple("Argument", "kind name shape unit default")


def parsed(text: str) -> list[Argument]:
    """Return the arguments of a text such as `lattice lattice; pressure(n_col, n_row) [Pa]`."""
    found = []
    for part in filter(str.strip, text.split(";")):
        match = ARGUMENT.fullmatch(part.strip()) or sys.exit(f"{part}: expected kind name(shape) [unit]")
        axes = ["n_any" if axis == "*" else axis for axis in re.findall(r"[^, ]+", match[3] or "")]
        found.append(Argument(match[1] or "real", match[2], axes, match[4] or "-", match[5] or ""))
    return found


def listed(text: str) -> str:
    """Return a statement over lines of Fortran."""
    return " &\n".join(textwrap.wrap(text, 118, subsequent_indent="    "))


def kind_of(name: str, record: dict[str, str]) -> dict[str, Any]:
    """Return a record as a kind of object, which one array of numbers makes."""
    parts = parsed(record["numbers"])
    numbers = [(NUMBER[n.kind], f"{{0}}%{n.default or n.name}", k) for k, n in enumerate(parts, 1)]
    made = [f"{place} = {kind[0].format(f'{{0}}_numbers({k})')}" for kind, place, k in numbers]
    return {
        "flat": f"numbers({len(numbers)})",
        "python": f"[getattr({{0}}, name) for name in {name}._fields]",
        "local": f"type({record['type']}) :: {{0}}",
        "set": "\n".join(made),
        "found": f"{{0}}_found = [{', '.join(kind[1].format(place) for kind, place, _ in numbers)}]",
    }


def object_of(name: str, where: str) -> dict[str, Any]:
    """Return an object behind a handle as a kind, by its class and its pointer in a slot."""
    kind, pointer = where.split()
    return {
        "flat": "long handle",
        "counts": "n_col={0}.own.n_col, n_row={0}.own.n_row",
        "python": "{0}._handle",
        "local": f"type(slot_t), pointer :: {{0}}_slot\nclass({kind}), pointer :: {{0}}",
        "set": f"call enter({{0}}_handle, '{name}', [n_col, n_row], {{0}}_slot, error)\n"
        f"if (.not. allocated(error)) {{0}} => {{0}}_slot%{pointer}",
        "after": "call leave({0}_slot)",
    }


class Procedure:
    """A row of the table."""

    def __init__(self, name: str, row: dict[str, Any], kinds: dict[str, dict[str, Any]]) -> None:
        self.name, self.row, self.kinds = name, row, kinds
        self.takes, gives = parsed(row.get("takes", "")), parsed(row.get("gives", ""))
        names = {argument.name for argument in self.takes}
        self.changed = {given.name for given in gives if given.name in names and given.kind in DECLARED}
        self.gives = [given for given in gives if given.name not in self.changed]
        # objects before those that have to be left again
        objects = (argument for argument in self.takes if argument.kind in kinds)
        self.objects = sorted(objects, key=lambda argument: "after" in kinds[argument.kind])
        counts = [kinds[a.kind]["counts"].format(a.name) for a in self.objects if "counts" in kinds[a.kind]]
        self.counts = counts[-1] if counts else ""
        self.guarded = any(re.search(r"\berror\b", kinds[argument.kind]["set"]) for argument in self.objects)
        self.fails = self.guarded or bool(re.search(r"\berror\b", row["calls"])) or bool(self.asked())

    def asked(self) -> list[str]:
        """Return the statements that ask for memory."""
        if not (fields := self.row.get("fields")):
            return []
        parts = [part for argument in self.takes for part in self.flat(argument)]
        names = {*re.findall(r"(\w+)=", self.counts), *(axis for part in parts for axis in part.shape)}
        rows, agree = "n_row", []
        if "n_own" in names:
            shared = any(argument.name == "shared" for argument in self.takes)
            rows, agree = "n_own*ranks%on_node", ["shared /= 0" if shared else "n_own < n_row"]
        return [
            f"call require_memory({fields}*8_c_int64_t*n_col*{rows}, error)",
            *(f"if ({some}) call ranks%agree(error)" for some in agree),
            *("if (allocated(error)) then", "  call report(error, code, message)", "  return", "end if"),
        ]

    def flat(self, argument: Argument, given: bool = False) -> list[Argument]:
        """Return what stands for an argument in the flat procedure."""
        if argument.kind in DECLARED:
            return [argument]
        parts = parsed(self.kinds[argument.kind]["flat"])
        return [part._replace(name=f"{argument.name}_{'found' if given else part.name}") for part in parts]

    def fortran(self) -> str:
        """Return the flat procedure."""
        takes = [part for argument in self.takes for part in self.flat(argument)]
        gives = [part for argument in self.gives for part in self.flat(argument, given=True)]
        axes = [axis for part in takes for axis in part.shape if not axis.isdecimal()]
        counts = dict.fromkeys([*re.findall(r"(\w+)=", self.counts), *axes])
        takes += [Argument("int", name, [], "-", "") for name in counts]
        lines = [] if self.row.get("gil") else ["!f2py threadsafe"]
        for part in sorted(takes + gives, key=lambda part: part.kind != "int" or bool(part.shape)):
            intent = "inout" if part.name in self.changed else "in" if part in takes else "out"
            kind = DECLARED[part.kind].replace("*", "*" if intent == "in" else "2048")
            shape = f"({', '.join(part.shape)})" if part.shape else ""
            lines.append(f"{kind}, intent({intent}) :: {part.name}{shape} ! [{part.unit}]")
        names = [part.name for part in takes + gives] + ["code", "message"] * self.fails
        if self.fails:
            lines += ["integer(c_int), intent(out) :: code", "character(len=512), intent(out) :: message"]
            lines += ["type(error_t), allocatable :: error"]
        objects = {a.name: a.kind for a in [*self.gives, *self.takes] if a.kind in self.kinds}
        for name, kind in objects.items():
            lines += self.kinds[kind]["local"].format(name).strip().splitlines()
        lines += [*self.row.get("local", "").strip().splitlines(), "", *self.statements(gives)]
        head, text = (
            f"  subroutine {self.name}({', '.join(names)})",
            textwrap.indent("\n".join(lines), "    "),
        )
        return f"{listed(head)}\n{text}\n  end subroutine {self.name}\n"

    def statements(self, gives: list[Argument]) -> list[str]:
        """Return the body: objects from their arguments, calls, records to numbers, status."""
        lines = [f"{part.name} = 0" for part in gives if self.fails] + self.asked()
        records = (argument for argument in self.gives if argument.kind in self.kinds)
        solved = "if (.not. allocated(error)) " * self.fails
        after = [listed(solved + self.kinds[given.kind]["found"].format(given.name)) for given in records]
        for argument in self.objects:
            kind = self.kinds[argument.kind]
            for line in kind["set"].format(argument.name).strip().splitlines():
                can_fail = line.startswith("call ") and "error" in line
                lines.append(listed(f"if (.not. allocated(error)) {line}" if can_fail else line))
            after += [kind["after"].format(argument.name)] if "after" in kind else []
        calls = self.row["calls"].strip()
        for flag in (argument.name for argument in self.takes if argument.kind == "flag"):
            calls = re.sub(rf"\b{flag}\b(?! *=[^=])", f"({flag} /= 0)", calls)
        inner = "\n".join([*map(listed, calls.splitlines()), *after])
        if self.guarded:
            inner = f"if (.not. allocated(error)) then\n{textwrap.indent(inner, '  ')}\nend if"
        return [*lines, inner, *(["call report(error, code, message)"] if self.fails else [])]

    def python(self) -> str:
        """Return the function that calls the flat procedure."""
        points = {a.name: f"({a.name}, {len(a.shape) - 1})" for a in self.takes if "n_any" in a.shape}
        lines = [f"points, {', '.join(points)} = flattened({', '.join(points.values())})"] if points else []
        passed = [f"_flat.{self.name}"] if self.fails else []
        for argument in self.takes:
            name, kind = argument.name, self.kinds.get(argument.kind)
            turned = len(argument.shape) > 1 and name not in points
            lines += [kind["prepare"].format(name)] if kind and "prepare" in kind else []
            # a byte holds no count: marks of any kind become true or false first
            marks = argument.kind == "flag" and bool(argument.shape)
            value = f"np.asarray({name}{', bool' * marks})" if turned or marks else name
            value += ".T" * turned
            passed.append(kind["python"].format(name) if kind else value)
        passed += filter(None, [self.counts])
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
        if given.kind in self.kinds:
            return f"record({given.kind}, {name})"
        name += ".decode(errors='replace').strip()" * (given.kind == "text") + ".T" * (len(given.shape) > 1)
        name = f"shaped({given.name}_, points)" if "n_any" in given.shape else name
        return f"{name} != 0" if given.kind == "flag" else name


def main(source: str, fortran: str, python: str, built: str = "") -> None:
    """Write both files; the one of Python keeps what the core was built with."""
    table = tomllib.loads(Path(source).read_text())
    kinds = table["kinds"] | {name: kind_of(name, record) for name, record in table["records"].items()}
    kinds |= {name: object_of(name, where) for name, where in table["objects"].items()}
    rows = [Procedure(name, row, kinds) for name, row in table["procedures"].items()]
    text = ["module hc_flat\n  use iso_c_binding, only: c_double, c_float, c_int, c_int8_t, c_int64_t"]
    text += [listed(f"  use {module}, only: {names}") for module, names in table["use"].items()]
    text += [
        "  implicit none\n  private",
        listed(f"  public :: {', '.join(table['procedures'])}"),
        "\ncontains\n",
    ]
    Path(fortran).write_text("\n".join([*text, *(row.fortran() for row in rows), "end module hc_flat\n"]))
    lines = ["from typing import NamedTuple\n\nimport numpy as np\n\nfrom . import _core"]
    lines += ["from .calls import called, flattened, record, shaped\n\n_flat = _core.hc_flat"]
    lines += [f"LIBRARY = str(_core.__file__)\nBUILT = {built!r}\n"]
    for kind, row in table["records"].items():
        numbers = [f"    {n.name}: {NUMBER[n.kind][2]}  # [{n.unit}]" for n in parsed(row["numbers"])]
        lines += [f'\nclass {kind}(NamedTuple):\n    """{row["does"]}"""\n', *numbers, ""]
    Path(python).write_text("\n".join(lines) + "".join(row.python() for row in rows))


if __name__ == "__main__":
    main(*sys.argv[1:])
