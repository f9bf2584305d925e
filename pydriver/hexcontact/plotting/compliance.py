"""The initial tangential compliance of several runs (Figure 13.4)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from ..analytic.friction import MindlinContact
from ..analytic.hertz_gap import QuadraticGap
from ..analytic.shear import CIRCULAR
from ..errors import NotInResult
from ..result.view import Results, as_list, dataset_of
from .history import values_of, vectors_of
from .registry import SEVERAL_RUNS, figure
from .style import COMPUTED, EXACT, GUIDE, THIRD, drawing, set_title

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes


def initial_compliance(dataset: xarray.Dataset) -> tuple[float, float]:
    """Return the shift of the first step with a tangential load over that of Mindlin, and its Q/(mu P).

    Spheres are pressed, then sheared at a constant normal load; another result is an error.
    """
    gap, attributes = QuadraticGap.of(dataset), dataset.attrs
    friction = float(attributes.get("friction_coefficient", np.nan))
    frictional = attributes.get("algorithm") in ("static", "incremental") and 0.0 < friction < np.inf
    if not frictional or gap is None:
        raise NotInResult("the tangential compliance is that of spheres with friction")
    normal = values_of(dataset, "normal_load")
    load, shift = vectors_of(dataset, "tangential_load"), vectors_of(dataset, "shift")
    step = int(np.argmax(np.hypot(*load) > 1e-6 * friction * normal))  # 0 also without a tangential load
    if step == 0 or abs(normal[step] - normal[step - 1]) > 1e-6 * normal[step]:
        raise NotInResult(
            "the tangential compliance needs a load step of shear alone after those of pressing"
        )
    hertz = gap.contact(float(normal[step]))
    if hertz.semi_minor < CIRCULAR * hertz.semi_major:
        raise NotInResult("the tangential compliance is that of spheres with friction")
    gamma = float(attributes["tangential_compliance_ratio"])
    compliance = 4.0 / float(attributes["effective_modulus"]) * (1.0 + 0.5 * gamma)
    mindlin = MindlinContact(friction, float(normal[step]), hertz.semi_major, compliance)
    size = float(np.hypot(*load[:, step]))
    moved = float((shift[:, step] - shift[:, step - 1]) @ load[:, step]) / size
    if not size < mindlin.sliding_load:
        raise NotInResult("the first tangential load is as large as friction can carry")
    return moved / float(mindlin.shift(size)), size / mindlin.sliding_load


@figure("compliance", "initial tangential compliance of some files against beta", needs=SEVERAL_RUNS)
def compliance(results: Results, ax: Axes | None = None) -> Figure:
    """Draw the initial tangential compliance of spheres against Dundurs' beta, a point for each result.

    The spheres are pressed, then sheared.

    Raises
    ------
    ValueError
        If one of the results is another one.
    """
    several = [dataset_of(one) for one in as_list(results)]
    series: dict[tuple[float, str], list[tuple[float, float]]] = {}
    shares = []
    for dataset in several:
        ratio, share = initial_compliance(dataset)
        shares.append(share)
        key = float(dataset.attrs["friction_coefficient"]), str(dataset.attrs.get("coupling", "full"))
        series.setdefault(key, []).append((abs(float(dataset.attrs["dundurs_beta"])), ratio))
    canvas, axes = drawing(ax, 4.6, 3.6)
    axes.axhline(1.0, color=GUIDE, lw=0.8, ls=":", label="Mindlin")
    colors = dict(zip(sorted({mu for mu, _ in series}), (COMPUTED, EXACT, THIRD), strict=False))
    for (mu, coupling), points in sorted(series.items()):
        beta, ratio_of = np.array(sorted(points)).T
        full = coupling == "full"
        look: dict[str, Any] = {"marker": "o"} if full else {"marker": "s", "ls": "--", "mfc": "none"}
        label = f"$\\mu$ = {mu:g}" + ("" if full else f", {coupling.title()}")
        axes.plot(beta, ratio_of, color=colors.get(mu, "black"), ms=4, lw=0.9, label=label, **look)
    axes.set(xlabel=r"$|\beta|$", ylabel=r"initial compliance $\Delta/\Delta_\mathrm{Mindlin}$")
    axes.legend()
    low, high = min(shares), max(shares)
    at = f"{low:.3g}" if high - low < 1e-3 else f"{low:.3g} to {high:.3g}"
    set_title(canvas, f"Spheres pressed, then sheared to $Q/\\mu P$ = {at}", ax)
    return canvas
