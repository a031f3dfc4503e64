"""Labelled parameter studies: a quantity of a system over its parameters, in memory, lazily, or into a store."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from cra_sym import checks
from cra_sym.extras import require
from cra_sym.model.system import System
from cra_sym.si import Numbers
from cra_sym.studies.quantities import QUANTITIES, Quantity
from cra_sym.studies.study import make_study

if TYPE_CHECKING:
    from distributed import Client
    from xarray import Dataset

__all__ = ["QUANTITIES", "Quantity", "sweep"]

_CHUNKS = 64


def sweep(
    system: System,
    quantity: str | Callable[..., Numbers] = "natural_frequencies",
    *,
    chunks: int | None = None,
    store: str | Path | None = None,
    client: Client | None = None,
    **parameters: Numbers,
) -> Dataset:
    """Evaluate a quantity over the product of parameter axes.

    Parameters
    ----------
    system : System
        An :class:`cra_sym.Arm` or any other: it holds every parameter that is not swept; its values are numbers.
    quantity : str or callable
        A key of `QUANTITIES`, ``df_dNAME`` or ``log_NAME`` of a parameter NAME, or ``f(system, **options)`` that
        broadcasts over ``system.shape`` and may add axes at the end: of real or complex numbers, or truth values.
    chunks : int, optional
        Longest piece of each axis. If given, the dataset is lazy (Dask); with ``store`` it is the size of the regions,
        by default 64.
    store : path or URL, optional
        A Zarr store (format 2), written region by region while the sweep runs: a local directory, or a URL of an object
        store such as ``"s3://bucket/study.zarr"``, which fsspec reaches with a library of its own (``s3fs``). A
        stopped sweep is resumed: regions are written atomically, and existing ones are not computed again.
    client : dask.distributed.Client, optional
        Where the regions of a store are computed; its workers write them, so the store must be in their reach.
    **parameters
        Parameters of the system and ``zeta``: a one-dimensional array is an axis, a number replaces the system's. A
        labelled array (xarray) lies along its dimensions, which it may share with others: these are then paired.
        Anything else is an option of the quantity (``modes``, ``motion``, ``excitation``, ...); options that broadcast
        with the system (``epsilon``, ``angular_frequency``) may be axes too, and a motion, force or excitation that is
        a batch is one.

    Returns
    -------
    xarray.Dataset
        One variable named like the quantity, a named dimension and coordinate for each axis, units in the attributes.

    Raises
    ------
    MissingExtraError
        If xarray, or Dask or Zarr where they are asked for, is not installed (extra ``scale``).
    TypeError, ValueError
        If a parameter is unknown or out of range, an axis is not one-dimensional, or the store holds another sweep or
        cannot give that promise; the error says which.

    Examples
    --------
    >>> import numpy as np
    >>> from cra_sym import Arm
    >>> study = sweep(Arm.nominal(), "natural_frequencies", k_t=[1e3, 1e4, np.inf], m_e=[0.0, 0.005], modes=2)
    >>> dict(study.sizes)
    {'k_t': 3, 'm_e': 2, 'mode': 2}
    >>> study.natural_frequencies.attrs["units"]
    'Hz'
    """
    require("xarray", "scale")
    study = make_study(system, quantity, parameters)
    if chunks is not None:
        checks.count("chunks", chunks, high=10**9)
    if store is not None:
        from cra_sym.studies.store import sweep_into

        stored: Dataset = sweep_into(study, store, chunks or _CHUNKS, client)
        return stored
    if client is not None:
        raise ValueError("client: must be given together with a store, whose regions it computes")
    swept: Dataset = study.dataset(study.evaluate() if chunks is None else study.lazy(chunks))
    return swept
