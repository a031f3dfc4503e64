"""Sweeps written to a Zarr store region by region; a stopped sweep goes on where it was."""

from __future__ import annotations

import os
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any

from tqdm import tqdm

from cra_sym.extras import require
from cra_sym.files import OutputError, draft, writing
from cra_sym.studies.study import Study

__all__ = ["sweep_into"]

_DIGEST = "cra_sym.studies"
Region = tuple[slice, ...]


def sweep_into(study: Study, path: Path, chunks: int, client: Any = None) -> Any:
    """Compute what the store lacks and return the dataset, opened lazily.

    A region is one Zarr chunk, which the store writes as a whole or not at all; so the chunks that are there are the
    record of what is done, and nothing else is kept.

    Parameters
    ----------
    study : Study
    path : Path
        The store; made if it does not exist.
    chunks : int
        Longest piece of each swept axis; a store keeps the pieces it was made with.
    client : dask.distributed.Client, optional
        Where regions are computed and written; by default here, one after another.

    Raises
    ------
    ValueError
        If the store holds something else than this sweep.
    OutputError
        If it cannot be written; what is there is whole, and a later sweep goes on from it.
    """
    xarray = require("xarray", "scale")
    zarr = require("zarr", "scale")
    if not os.path.exists(path):
        _make(study, path, chunks)
    stored = _opened(zarr, study, path)
    missing = [region for region in _regions(study.shape, stored.chunks) if not _is_there(stored, path, region)]
    progress = tqdm(total=len(missing), desc=study.quantity.name, disable=None if missing else True)
    with progress, writing(path, path):
        for _ in _written(study, path, missing, client):
            progress.update()
    return xarray.open_zarr(path, consolidated=False)


def _make(study: Study, path: Path, chunks: int) -> None:
    """Write coordinates, attributes and the empty variable, under a temporary name until all is there."""
    require("dask.array", "scale")
    dataset = study.dataset(study.lazy(chunks)).assign_attrs({_DIGEST: study.digest()})
    encoding = {study.quantity.name: {"chunks": _chunk_shape(study, chunks), "write_empty_chunks": True}}
    try:
        with draft(path) as place:
            dataset.to_zarr(place, mode="w", compute=False, consolidated=False, encoding=encoding)
    except OutputError:
        if not os.path.exists(path):  # else another process has made it meanwhile
            raise


def _chunk_shape(study: Study, chunks: int) -> tuple[int, ...]:
    return (*(min(chunks, length) for length in study.shape), *study.added.values())


def _opened(zarr: Any, study: Study, path: Path) -> Any:
    try:
        group = zarr.open_group(path, mode="r")
        same = group.attrs.get(_DIGEST) == study.digest()
    except (OSError, ValueError, KeyError):
        same = False
    if not same:
        raise ValueError(f"store = {str(path)!r}: holds something else; must be a new path or the same sweep")
    return group[study.quantity.name]


def _regions(shape: tuple[int, ...], chunks: tuple[int, ...]) -> Iterator[Region]:
    starts = [range(0, length, piece) for length, piece in zip(shape, chunks, strict=False)]
    for corner in product(*starts):
        yield tuple(slice(start, start + piece) for start, piece in zip(corner, chunks, strict=False))


def _is_there(stored: Any, path: Path, region: Region) -> bool:
    index = [part.start // piece for part, piece in zip(region, stored.chunks, strict=False)]
    index += [0] * (len(stored.shape) - len(index))
    return (path / stored.name.strip("/") / stored.metadata.encode_chunk_key(tuple(index))).exists()


def _written(study: Study, path: Path, regions: list[Region], client: Any) -> Iterator[None]:
    if client is None:
        for region in regions:
            _write(study, path, region)
            yield
        return
    distributed = require("distributed", "scale")
    shared = client.scatter(study, broadcast=True) if regions else None
    futures = [client.submit(_write, shared, path, region, pure=False) for region in regions]
    for future in distributed.as_completed(futures):
        yield future.result()


def _write(study: Study, path: Path, region: Region) -> None:
    """Compute one region and write it."""
    pieces = [axis[part] for axis, part in zip(study.axes.values(), region, strict=True)]
    labels = dict(zip(study.axes, region, strict=True))
    dataset = study.dataset(study.block(*pieces)) if not pieces else _piece(study, pieces)
    dataset.to_zarr(path, region=labels, consolidated=False) if labels else dataset.to_zarr(path, mode="r+")


def _piece(study: Study, pieces: list[Any]) -> Any:
    """The dataset of a region without coordinates, which the store has already."""
    part = Study(study.arm, study.quantity, dict(zip(study.axes, pieces, strict=True)), study.options, study.added)
    return part.dataset(part.block(*pieces)).drop_vars([*study.axes, "mode"], errors="ignore")
