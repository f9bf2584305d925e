"""Mutants: lines of fortran/ and pydriver/ with one operator, one constant or the whole line changed."""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from hashlib import blake2b
from itertools import pairwise
from pathlib import Path

FOLDERS = {"fortran": ("fortran", "*.f90"), "python": ("pydriver/hexcontact", "*.py")}
PAIRS = (
    "+ -", "* /", "< <=", "> >=", ".and. .or.", ".true. .false.", ".eqv. .neqv.", "max min", "maxval minval",
    "any all", "and or", "True False",
)  # fmt: skip
SWAPPED = {one: other for pair in PAIRS for one, other in (pair.split(), pair.split()[::-1])}
SWAPPED |= {
    "==": "/=",
    "/=": "==",
    ".not.": "",
    "not": "",
    "is": "is not",
    "is not": "is",
    "in": "not in",
    "not in": "in",
}

# Fortran statements that compute nothing, or that cannot be dropped by themselves.
_DECLARES = re.compile(
    r"(use|implicit|private|public|module|submodule|program|contains|end\w*|(abstract )?interface|import"
    r"|procedure|generic|pure|elemental|impure|recursive|subroutine|function|type|class|real|integer|logical"
    r"|character|complex|enum|block|format)\b|.*::"
)
_BLOCK = re.compile(
    r"(do|else|case|select|associate|critical|forall)\b|\w+ *: *do\b|if *\(.*\) *then$|where *\([^=]*\)$"
)
_NUMBER = r"(?<![\w.%])(?:\d+\.\d*|\.\d+|\d+)(?:e[+-]?\d+)?(?:_\w+)?(?![\w.])"
_TOKEN = re.compile(
    rf"(?P<constant>{_NUMBER})"
    r"|(?P<other>\*\*|//|=>|\(/|/\))"
    r"|(?P<operator>/=|==|<=|>=|\.(?:and|or|not|true|false|eqv|neqv)\.|[-+*/<>]|\b(?:max|min|maxval|minval|any|all)(?=\())"
)
_PYTHON_OPERATOR = re.compile(
    r"(?<!\w)(?:not\ in|in|is\ not|is|and|or)(?!\w)|[<>=!]=|(?<![*/<>])[-+*/<>](?![*/<>=])"
)


@dataclass(frozen=True)
class Mutant:
    """One line of a file as it is and as it is tried."""

    path: str  # below the checkout
    number: int  # of the line, from 1
    kind: str  # operator, constant, dropped
    change: str  # in words
    line: str
    changed: str

    @property
    def key(self) -> str:
        """Name that stays if other lines of the file change."""
        return f"{self.path}: {self.line.strip()} -> {self.changed.strip()}"


def drawn(root: Path, language: str, seed: int) -> Iterator[Mutant]:
    """Draw mutants, each kind in turn; an edit of other lines changes neither them nor their order."""
    folder, pattern = FOLDERS[language]
    found: dict[str, list[tuple[bytes, Mutant]]] = {"operator": [], "constant": [], "dropped": []}
    for file in sorted((root / folder).rglob(pattern)):
        path = file.relative_to(root).as_posix()
        seen: Counter[str] = Counter()
        for mutants in by_line(path, file.read_text(), language):
            line = mutants[0].line.strip()
            seen[line] += 1
            for kind in {mutant.kind for mutant in mutants}:
                # by line first, so that long formulas are not drawn more often
                rank = _rank(seed, kind, path, line, seen[line])
                of_kind = [mutant for mutant in mutants if mutant.kind == kind]
                found[kind].append((rank, min(of_kind, key=lambda m: _rank(seed, m.change, m.changed))))
    in_order = [sorted(mutants, key=lambda ranked: ranked[0]) for mutants in found.values()]
    for three in zip(*in_order, strict=False):
        yield from (mutant for _, mutant in three)


def by_line(path: str, text: str, language: str) -> list[list[Mutant]]:
    """Find the mutants of each line that has any."""
    lines = text.splitlines()
    find: Callable[[str], Iterable[tuple[int, int, int, str, str]]]
    find = _fortran_sites if language == "fortran" else _python_sites
    found: dict[int, list[Mutant]] = {}
    for number, start, end, kind, new in sorted(set(find(text))):
        line = lines[number]
        old, changed = line[start:end], line[:start] + new + line[end:]
        change = "line dropped" if kind == "dropped" else f"{new.strip() or 'nothing'} for {old.strip()}"
        found.setdefault(number, []).append(Mutant(path, number + 1, kind, change, line, changed))
    return [found[number] for number in sorted(found)]


def _rank(*words: object) -> bytes:
    return blake2b("\0".join(map(str, words)).encode(), digest_size=8).digest()


def _fortran_sites(text: str) -> Iterator[tuple[int, int, int, str, str]]:
    """Yield line, columns, kind and new text of what can be changed in Fortran."""
    first, continued = "", False
    for number, line in enumerate(text.splitlines()):
        code = re.sub(r"'[^']*'|\"[^\"]*\"", lambda found: "'" + " " * (len(found[0]) - 2) + "'", line)
        code = code.partition("!")[0].rstrip().lower()
        if not code or code.startswith("#"):
            continue
        whole = not continued
        if whole:
            first = code.strip()
        continued = code.endswith("&")
        if _DECLARES.match(first):
            continue
        if whole and not continued and not _BLOCK.match(first):
            start = len(code) - len(code.lstrip())
            yield number, start, len(code), "dropped", ""
        for token in _TOKEN.finditer(code):
            if token.lastgroup == "constant":
                yield number, *token.span(), "constant", _next(line[slice(*token.span())])
            elif token.lastgroup == "operator":
                end = token.end() + (token[0] == ".not." and code[token.end()] == " ")
                yield number, token.start(), end, "operator", SWAPPED[token[0]]


def _next(number: str) -> str:
    """Return a constant plus one, an exponent and a kind apart."""
    whole = re.match(r"\d*", number)
    assert whole
    return f"{int(whole[0] or 0) + 1}{number[whole.end() :]}"


def _python_sites(text: str) -> Iterator[tuple[int, int, int, str, str]]:
    """Yield line, columns, kind and new text of what can be changed in the bodies of Python functions."""
    lines = text.splitlines()
    if not text.isascii():  # columns of ast count bytes
        lines = [line.encode().decode("latin-1") for line in lines]

    def between(left: ast.expr, right: ast.expr) -> Iterator[tuple[int, int, int, str, str]]:
        assert left.end_lineno and left.end_col_offset
        for row in range(left.end_lineno - 1, right.lineno):
            start = left.end_col_offset if row == left.end_lineno - 1 else 0
            end = right.col_offset if row == right.lineno - 1 else len(lines[row])
            found = _PYTHON_OPERATOR.search(lines[row][start:end].partition("#")[0])
            if found:
                new = {"==": "!=", "!=": "=="}.get(found[0]) or SWAPPED[found[0]]
                yield row, start + found.start(), start + found.end(), "operator", new
                return

    def visit(node: ast.AST) -> Iterator[tuple[int, int, int, str, str]]:
        match node:
            case ast.JoinedStr() | ast.Import() | ast.ImportFrom():
                return
            case ast.If(test=ast.Name(id="TYPE_CHECKING")):
                return
            case ast.BinOp(left=left, right=right):
                yield from between(left, right)
            case ast.BoolOp(values=operands):
                for left, right in pairwise(operands):
                    yield from between(left, right)
            case ast.Compare(left=first, comparators=others):
                for left, right in pairwise([first, *others]):
                    yield from between(left, right)
            case ast.UnaryOp(op=ast.Not()):
                yield node.lineno - 1, node.col_offset, node.operand.col_offset, "operator", ""
            case ast.Constant(value=bool()):
                yield *_span(node), "operator", str(not node.value)
            case ast.Constant(value=int() | float()):
                row, start, end = _span(node)
                yield row, start, end, "constant", _next(lines[row][start:end])
            case ast.Call(func=ast.Name(id="max" | "min" | "any" | "all" as word)):
                yield *_span(node.func), "operator", SWAPPED[word]
        if _droppable(node):
            yield *_span(node), "dropped", "pass"
        for name, child in ast.iter_fields(node):
            if name not in ("annotation", "returns", "decorator_list", "type_params"):
                for item in child if isinstance(child, list) else [child]:
                    if isinstance(item, ast.AST):
                        yield from visit(item)

    bodies = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.FunctionDef)]
    for function in bodies:
        for statement in function.body:
            for row, start, end, kind, new in visit(statement):
                if lines[row].isascii():
                    yield row, start, end, kind, new


def _span(node: ast.expr | ast.stmt) -> tuple[int, int, int]:
    assert node.end_col_offset
    return node.lineno - 1, node.col_offset, node.end_col_offset


def _droppable(node: ast.AST) -> bool:
    """Test for a statement of one line that does something; a docstring does nothing."""
    simple = ast.Assign | ast.AugAssign | ast.Raise | ast.Return | ast.Continue | ast.Break
    does = isinstance(node, simple) or (isinstance(node, ast.Expr) and isinstance(node.value, ast.Call))
    return does and node.lineno == node.end_lineno
