"""What ``hexcontact plot`` offers, in words: kept apart from the pictures so that --help comes at once."""

from __future__ import annotations

OF_A_RESULT = {
    "overview": "pressure and a section; with friction shear and zones, too",
    "pressure": "map of the contact pressure",
    "section": "pressure along a line, and its difference from Hertz",
    "boundary": "nodes in contact (and stick) with fitted circle or ellipse",
    "history": "loads, motions, areas, p_max by step or over a load",
    "tractions": "pressure and shear traction along a line, at some steps",
    "zones": "map of stick and slip, for some steps or files",
    "outlines": "outlines of contact and stick area, for some steps or files",
    "traction": "map of the size of the shear traction, with arrows",
    "traction_x": "map of its component along x",
    "traction_y": "map of its component along y",
    "slip_increment": "map of the slip of body 1 in the step, with arrows",
    "accumulated_slip": "map of the length of the slip path so far",
    "loop": "tangential load against shift",
    "torsion": "torque against twist",
    "compliance": "initial tangential compliance of some files against beta",
}
OF_NO_RESULT = {
    "pyramid": "displacements by one pyramid (Figure 5.6)",
    "load-shapes": "pyramid, point force and constant load compared (Figure 7.3)",
}


def help_text() -> str:
    """Return the help of the command: a line for each choice of --what."""
    width = 2 + max(map(len, OF_A_RESULT))

    def lines(choices: dict[str, str]) -> str:
        return "\n".join(f"{name:<{width}}{words}" for name, words in choices.items())

    return (
        "Draw a result, or what the influence functions and load shapes look like.\n\n"
        "Closed solutions (Hertz, Cattaneo-Mindlin, Mindlin-Deresiewicz, Lubkin) are drawn beside where they "
        "apply.\n\n"
        f"\b\nChoices of --what:\n{lines(OF_A_RESULT | {'all': 'each that there is, in a file of its own'})}"
        f"\n\n\b\nWithout FILE:\n{lines(OF_NO_RESULT)}"
    )
