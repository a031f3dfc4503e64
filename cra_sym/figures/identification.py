"""A fit to measured natural frequencies: data, fitted frequencies, and how far these are off."""

from __future__ import annotations

from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from cra_sym.analysis.identification import Identification
from cra_sym.checks import instance
from cra_sym.figures import styled
from cra_sym.figures.drawing import Panels, figure_of, panels

__all__ = ["figure_fit"]


def figure_fit(fit: Identification, *, axes: Panels | None = None) -> Figure:
    """Draw measured and fitted natural frequencies, and the residuals in units of the uncertainty.

    The band holds two of three residuals if the model is right; the largest is named if the data do not fit.

    Parameters
    ----------
    fit : Identification
        Of any system, from :func:`cra_sym.identify`.
    axes : pair of Axes, optional
    """
    instance("fit", fit, Identification)
    with styled():
        ((left, right),) = panels(axes, 1, 2, (8.6, 3.9))
        left.errorbar(fit.modes, fit.measured, fit.uncertainty, fmt="o", markersize=4, capsize=3, label="measured")
        left.plot(fit.modes, fit.frequencies, "_", markersize=14, label="fitted")
        left.set_yscale("log")
        left.set_ylabel("natural frequency / Hz")
        left.legend()
        right.axhspan(-1.0, 1.0, color="0.9")
        right.axhline(0.0, color="0.45", linewidth=0.8)
        right.plot(fit.modes, fit.residuals, "o", markersize=4)
        right.set_ylabel("(measured - fitted) / uncertainty")
        degrees = f"$\\chi^2$ = {fit.chi2:.3g} with {fit.degrees_of_freedom} degrees of freedom"
        right.set_title(degrees if fit.fits else f"{degrees}: no fit")
        worst = max(zip(abs(fit.residuals), fit.modes, fit.residuals, strict=True))
        if not fit.fits:
            right.annotate(f"mode {worst[1]}", worst[1:], xytext=(6, 0), textcoords="offset points", va="center")
        for ax in (left, right):
            ax.set_xlabel("mode")
            ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    return figure_of(right)
