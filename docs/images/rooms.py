"""Draw the rooms of the sources and the arrows between them: ``python docs/images/rooms.py``."""

import re
import sys
import textwrap
from collections import defaultdict
from itertools import product
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch
from matplotlib.path import Path as Curve

sys.path.insert(0, str(Path(__file__).parents[2] / "tests/python"))

from arrows import RULES, Arrows, fortran_arrows, python_arrows

PICTURE = Path(__file__).with_suffix(".svg")
UNSEEN = {"names", "__init__"}  # public names, which add nothing to what they pass on

# Columns of the rooms that do not stand in the middle; rows follow from the arrows.
COLUMNS = {
    "python.study": 2.2, "python.case": 2.2, "python.solve": 2.2, "python.problem": 2.2, "python.deck": 2.2,
    "python.ground": 2.2, "python.plotting": 7.1, "python.result": 7.1, "python.core": 7.1,
    "fortran.hexcontact": 2.2, "fortran.python": 7.1, "fortran.linalg": 8.25,
    "fortran.frictionless": 1.05, "fortran.friction": 3.45, "fortran.direct": 5.85, "fortran.path": 8.25,
}  # fmt: skip
MIDDLE, WIDTH, HEIGHT, ROW = 4.65, 2.2, 0.62, 1.0
HOLDS = {f"{side}.{room}": text for side, texts in RULES["holds"].items() for room, text in texts.items()}
COLORS = {"python": ("#e8f0f8", "#1f5f8b"), "fortran": ("#f6efe3", "#8a5a12")}


def drawn_arrows() -> Arrows:
    """The arrows between rooms that no chain of others implies, with the step from Python into Fortran."""
    exceptions = RULES["exceptions"]["arrows"]
    between: Arrows = set()
    for language, (rooms, arrows) in {"python": python_arrows(), "fortran": fortran_arrows()}.items():
        for user, used in arrows:
            a, b = rooms[user], rooms[used]
            if a != b and not {a, b} & UNSEEN and f"{user} -> {used}" not in exceptions:
                between.add((f"{language}.{a}", f"{language}.{b}"))
            if used.endswith(".core.flat"):
                between.add((f"{language}.{a}", "fortran.python"))
    return {(a, b) for a, b in between if b not in reached(a, between - {(a, b)})}


def reached(room: str, arrows: Arrows) -> set[str]:
    """The rooms that arrows lead to."""
    found: set[str] = set()
    todo = [room]
    while todo:
        new = {b for a, b in arrows if a == todo[-1]} - found
        todo.pop()
        found |= new
        todo += new
    return found


def rows(arrows: Arrows) -> dict[str, int]:
    """Number of the row of each room, from the lowest of its language: above all that it uses."""
    inside = {(a, b) for a, b in arrows if language(a) == language(b)}
    return {
        room: max((len(chain) for chain in chains(room, inside)), default=0)
        for room in {room for arrow in arrows for room in arrow}
    }


def chains(room: str, arrows: Arrows) -> list[list[str]]:
    """The ways down from a room."""
    return [[b, *rest] for a, b in arrows if a == room for rest in [[], *chains(b, arrows)]]


def language(room: str) -> str:
    return room.partition(".")[0]


def groups(arrows: Arrows) -> dict[str, tuple[str, ...]]:
    """The rooms that have the same users and the same used ones, which one frame holds."""
    inside = {(a, b) for a, b in arrows if language(a) == language(b)}
    alike = defaultdict(list)
    for room in sorted(rows(arrows)):
        ends = [frozenset(a for a, b in inside if b == room), frozenset(b for a, b in inside if a == room)]
        alike[language(room), *ends].append(room)
    return {room: tuple(group) for group in alike.values() for room in group}


def shown(picture: str) -> tuple[set[str], Arrows]:
    """Read the rooms and the arrows from the names of a picture's parts."""
    rooms = set(re.findall(r'id="room:([\w.]+)"', picture))
    named = re.findall(r'id="arrow:([^":]+):([^":]+)"', picture)
    return rooms, {pair for a, b in named for pair in product(a.split("+"), b.split("+"))}


def place(room: str, row: dict[str, int]) -> tuple[float, float]:
    """Middle of a room's box."""
    above = (
        0.0
        if language(room) == "fortran"
        else 1.5 + max(n for r, n in row.items() if language(r) == "fortran")
    )
    return COLUMNS.get(room, MIDDLE), ROW * (row[room] + above)


def box(group: tuple[str, ...], row: dict[str, int]) -> tuple[float, float, float, float]:
    """Left, right, lower and upper end of the frame of some rooms, which for one room is its box."""
    places = [place(room, row) for room in group]
    more = 0.12 if len(group) > 1 else 0.0
    x, y = [x for x, _ in places], places[0][1]
    return min(x) - WIDTH / 2 - more, max(x) + WIDTH / 2 + more, y - HEIGHT / 2 - more, y + HEIGHT / 2 + more


def draw() -> Figure:
    """Draw rooms as boxes and arrows from users down to what they use."""
    arrows = drawn_arrows()
    row, together = rows(arrows), groups(arrows)
    joined = {(together[a], together[b]) if language(a) == language(b) else ((a,), (b,)) for a, b in arrows}
    high = max(place(room, row)[1] for room in row)
    figure = Figure(figsize=(8.2, 8.2 / 9.9 * (high + 1.35)), facecolor="white")
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(-0.3, 9.6), ylim=(-0.55, high + 0.8), aspect="equal")
    axes.set_axis_off()
    for group in sorted(set(together.values())):
        if len(group) > 1:
            left, right, low, top = box(group, row)
            patch = FancyBboxPatch((left, low), right - left, top - low, "round,pad=0,rounding_size=0.12")
            patch.set(
                facecolor="white",
                edgecolor=COLORS[language(group[0])][1],
                linewidth=0.8,
                linestyle=(0, (4, 3)),
            )
            axes.add_patch(patch)
    for room in sorted(row):
        fill, line = COLORS[language(room)]
        x, y = place(room, row)
        patch = FancyBboxPatch(
            (x - WIDTH / 2, y - HEIGHT / 2), WIDTH, HEIGHT, "round,pad=0,rounding_size=0.08"
        )
        patch.set(facecolor=fill, edgecolor=line, linewidth=1.1, gid=f"room:{room}")
        axes.add_patch(patch)
        name = room.partition(".")[2]
        lines = textwrap.fill(HOLDS[room], 32)
        axes.text(x, y + 0.16, name, ha="center", va="center", fontsize=9.5, fontweight="bold", color=line)
        axes.text(x, y - 0.1, lines, ha="center", va="center", fontsize=6.2, color="0.25", linespacing=1.15)
    leaving, coming = defaultdict(list), defaultdict(list)
    for users, used in sorted(joined):
        leaving[users].append(used)
        coming[used].append(users)
    for users, used in sorted(joined):
        x0, y0 = port(users, leaving[users], used, row), box(users, row)[2]
        x1, y1 = port(used, coming[used], users, row), box(used, row)[3] + 0.02
        # from side to side between two rows, and straight down from there
        turn = max(y1, y0 - (ROW - HEIGHT)) if x0 != x1 else y1
        bend = 0.75 * (y0 - turn)
        knots = [(x0, y0), (x0, y0 - bend), (x1, turn + bend), (x1, turn), (x1, y1)]
        curve = Curve(knots, [1, 4, 4, 4, 2]) if turn > y1 else Curve(knots[:4], [1, 4, 4, 4])
        across = language(users[0]) != language(used[0])
        arrow = FancyArrowPatch(path=curve, arrowstyle="-|>,head_length=4,head_width=2.2", linewidth=1.2)
        arrow.set(color=COLORS[language(users[0])][1], gid=f"arrow:{'+'.join(users)}:{'+'.join(used)}")
        if across:
            arrow.set(linewidth=2.0)
            axes.text(
                x1 + 0.12, 0.5 * (y0 + y1), "f2py", fontsize=8, style="italic", va="center", color="0.25"
            )
        axes.add_patch(arrow)
    for name, title in {"python": "pydriver/hexcontact", "fortran": "fortran"}.items():
        top = max(place(room, row)[1] for room in row if language(room) == name)
        axes.text(-0.15, top + 0.1, title, fontsize=9, family="monospace", va="center", color=COLORS[name][1])
    return figure


def port(
    group: tuple[str, ...], others: list[tuple[str, ...]], other: tuple[str, ...], row: dict[str, int]
) -> float:
    """Where an arrow touches a box: side by side in the order of their other ends."""

    def middle(rooms: tuple[str, ...]) -> float:
        return 0.5 * sum(box(rooms, row)[:2])

    beside = middle(other) - middle(group)
    same_side = sorted(
        abs(middle(one) - middle(group)) for one in others if (middle(one) - middle(group)) * beside > 0
    )
    if not same_side or len(others) == 1:
        return middle(group)
    return middle(group) + (0.45 if beside > 0 else -0.45) * (1 + same_side.index(abs(beside)))


def main() -> None:
    mpl.rcParams["svg.hashsalt"] = "rooms"
    draw().savefig(PICTURE, metadata={"Date": None})
    print(f"written: {PICTURE}")


if __name__ == "__main__":
    main()
