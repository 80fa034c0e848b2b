"""Pictures of a reachability map: cuts and projections, coloured as K shows them. They need matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array, choice
from ..errors import InputError
from ..kinematics.pictures import new_axes

if TYPE_CHECKING:
    from .map import ReachabilityMap

PLANES = {"xy": (0, 1, 2), "xz": (0, 2, 1), "yz": (1, 2, 0)}
LABELS = {"reachability": "share of orientations reached", "manipulability": "best manipulability"}


def draw(reach: ReachabilityMap, plane: str, at: float | None, of: str, *, axes: Any = None) -> Any:
    """Draw the cut of the map along *plane* (``"xy"``, ``"xz"``, ``"yz"`` of the robot's root) at coordinate *at* (m).

    Without *at*: the best voxel along the line of sight. *of* is ``"reachability"``, the share of the orientations
    that are reached, or ``"manipulability"``, the best over the orientations. Returns the matplotlib axes;
    ``axes.figure.savefig(...)`` writes the picture.
    """
    right, up, deep = PLANES[choice(plane, "plane", tuple(PLANES))]
    values = reach.capability if choice(of, "of", tuple(LABELS)) == "reachability" else reach.best_manipulability
    values = values.transpose(right, up, deep)
    where = "best along " + "xyz"[deep]
    if at is None:
        cut: Array = values.max(axis=2)
    else:
        layer = int(np.floor((at - reach.grid.origin[deep]) / reach.resolution))
        if not 0 <= layer < values.shape[2]:
            low = reach.grid.origin[deep]
            raise InputError(
                f"at is {at:g} m; the map goes from {low:.3g} to {low + values.shape[2] * reach.resolution:.3g} m "
                f"along {'xyz'[deep]}"
            )
        cut, where = values[:, :, layer], f"{'xyz'[deep]} = {at:g} m"
    if axes is None:
        axes = new_axes(2)
    low, size = reach.grid.origin[[right, up]], reach.resolution * np.array(cut.shape)
    extent = (low[0], low[0] + size[0], low[1], low[1] + size[1])
    image = axes.imshow(
        np.ma.masked_equal(cut.T, 0.0), origin="lower", extent=extent, interpolation="nearest", cmap="turbo"
    )
    axes.plot(0.0, 0.0, "k+", markersize=10)
    axes.set_aspect("equal")
    axes.set_xlabel(f"{'xyz'[right]} (m)")
    axes.set_ylabel(f"{'xyz'[up]} (m)")
    axes.set_title(f"{reach.settings.robot}: {reach.settings.frame}, {where}")
    label = LABELS[of] + (f" ({reach.settings.measure})" if of == "manipulability" else "")
    axes.figure.colorbar(image, ax=axes, label=label, shrink=0.8)
    return axes
