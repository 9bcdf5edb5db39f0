"""How the pictures look: one set of colours, no boxes, quiet grids.

`tidy` dresses the axes of figures that are made without pyplot. `HOUSE` are matplotlib's settings for the same look in scripts
and notebooks of one's own: `plt.rcParams.update(HOUSE)`.
"""

from types import MappingProxyType

from matplotlib.axes import Axes

# Okabe & Ito's colours: told apart by colour-blind readers and on paper.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
MEASURED, NOISE = "0.55", "0.88"
"""Greys of what was measured, and of what noise alone does."""
_GRID_ALPHA, _GRID_WIDTH = 0.25, 0.6

HOUSE = MappingProxyType(
    {
        "axes.grid": True,
        "axes.prop_cycle": f"cycler(color={COLOURS})",
        "axes.spines.right": False,
        "axes.spines.top": False,
        "axes.titlelocation": "left",
        "axes.titlesize": "medium",
        "figure.constrained_layout.use": True,
        "figure.titlesize": "medium",
        "grid.alpha": _GRID_ALPHA,
        "grid.linewidth": _GRID_WIDTH,
        "legend.fontsize": "small",
        "legend.frameon": False,
        "xtick.labelsize": "small",
        "ytick.labelsize": "small",
    }
)
"""Settings for `matplotlib.rcParams`."""


def tidy(ax: Axes) -> None:
    """No box, a quiet grid, small numbers."""
    ax.grid(alpha=_GRID_ALPHA, lw=_GRID_WIDTH)
    ax.spines[["top", "right"]].set_visible(False)
    ax.tick_params(labelsize="small")
