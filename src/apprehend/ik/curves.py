"""The curves of G fig. 6: what each treatment of singular values makes of 1/σ. Needs matplotlib (extra ``plot``)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import as_array
from ..errors import InputError
from ..kinematics import pictures
from .inverse import METHODS, inverse_singular_values

LABELS = {
    "rank": "1/σ (pseudo-inverse)",
    "damped": "σ/(σ² + λ²) (damping)",
    "clipped": "clipping below λ σ_max",
    "smooth": "smooth clipping below λ σ_max",
}
STYLES = {"rank": ("--", 1.5, 1.0), "damped": ("-", 1.5, 1.0), "clipped": ("-", 5.0, 0.35), "smooth": ("-", 1.5, 1.0)}


def plot_inverses(parameter: float = 0.1, *, sigma: ArrayLike | None = None, axes: Any = None) -> Any:
    """Draw 1/σ, damping, clipping and smooth clipping over σ, λ = *parameter* (G fig. 6, `inverse_singular_values`).

    With *sigma* ``(k,)``, the singular values of a Jacobian, the axis reaches to the largest of them, and every one is
    marked on every curve; else to 1. Returns the matplotlib axes; ``axes.figure.savefig(...)`` writes the picture.
    """
    marks = np.zeros(0) if sigma is None else as_array(sigma, "sigma")
    if marks.ndim != 1:
        raise InputError(f"sigma has shape {marks.shape}; expected (k,), the singular values of one matrix")
    largest = float(marks.max(initial=0.0)) if marks.size else 1.0
    if not largest > 0.0:
        raise InputError("sigma has no positive entry: the matrix is zero and has no inverse to draw")
    s = np.linspace(0.0, largest, 2001)
    axes = pictures.new_axes(2) if axes is None else axes
    top = 0.0
    for number, method in enumerate(METHODS):
        curve = inverse_singular_values(s, method, parameter)
        if method == "clipped":  # show the jump as one
            at = int(np.argmax(curve > 0.0))
            curve[max(at - 1, 0)] = np.nan
        if method == "rank":
            curve[0] = np.nan
        else:
            top = max(top, float(np.nanmax(curve)))
        color = f"C{number}"
        line, width, alpha = STYLES[method]
        axes.plot(s, curve, line, color=color, linewidth=width, alpha=alpha, label=LABELS[method])
        axes.plot(marks, inverse_singular_values(marks, method, parameter), "o", color=color, markersize=4)
    axes.set_xlim(0.0, 1.02 * largest)
    axes.set_ylim(0.0, 1.25 * top)
    axes.set_xlabel("singular value σ")
    axes.set_ylabel("factor in the inverse")
    axes.set_title(f"Inverses of singular values, λ = {parameter:g}")
    axes.legend(loc="upper right")
    return axes
