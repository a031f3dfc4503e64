"""Sweeps written to a Zarr store region by region; a stopped sweep is resumed."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from cra_sym.checks import shown
from cra_sym.extras import require
from cra_sym.files import OutputError
from cra_sym.studies.places import AxisPlace, place_of
from cra_sym.studies.study import Study

__all__ = ["sweep_into"]

_DESCRIBED = "cra_sym.studies"
_SHORT = 60  # characters of a value in an error
Region = tuple[slice, ...]


def sweep_into(study: Study, store: str | Path, chunks: int, client: Any = None) -> Any:
    """Compute the missing regions of the store and return the dataset, opened lazily.

    A region is one Zarr chunk, written atomically, so that the existing chunks are the only record of the work done.

    Parameters
    ----------
    study : Study
    store : path or URL
        Created if it does not exist.
    chunks : int
        Longest piece of each swept axis; an existing store keeps its own.
    client : dask.distributed.Client, optional
        Where regions are computed and written; by default here, one after another.

    Raises
    ------
    ValueError
        If the store is not of this sweep; the message names the differences.
    OutputError
        If it cannot be written; existing regions are complete, and a later sweep resumes.
    """
    xarray = require("xarray", "scale")
    require("zarr", "scale")
    place = place_of(store)
    if client is not None and not all(hasattr(client, name) for name in ("scatter", "submit")):
        raise TypeError(f"client = {shown(client)}: must be a dask.distributed.Client")
    if client is not None and not place.is_shared:
        raise ValueError(f"store = {place.name!r}: is in the memory of one process; must be another with a client")
    if not place.exists():
        _make(study, place, chunks)
    stored = _opened(study, place)
    missing = _missing(study, place, stored)
    progress = tqdm(total=len(missing), desc=study.quantity.name, disable=None if missing else True)
    with progress, place.writing():
        for _ in _written(study, place, missing, client):
            progress.update()
    found = xarray.open_zarr(place.opened(), consolidated=True)
    for name, (_, values, _) in study.coordinates().items():
        if name not in found.coords or not np.array_equal(found.coords[name].values, np.asarray(values)):
            raise ValueError(f"store = {place.name!r}: the coordinate {name!r} is missing there; must be a new path")
    return found


def _make(study: Study, place: AxisPlace, chunks: int) -> None:
    """Write coordinates, attributes and the empty variable; the store is there with its consolidated metadata."""
    xarray, zarr = require("xarray", "scale"), require("zarr", "scale")
    attributes = study.attributes() | {_DESCRIBED: study.described()}
    labels = xarray.Dataset({}, study.coordinates(), attributes)
    try:
        with place.new() as made:
            labels.to_zarr(made, mode="w-", consolidated=False, zarr_format=2)
            group = zarr.open_group(made, mode="r+", zarr_format=2)
            group.create_array(
                study.quantity.name,
                shape=(*study.shape, *study.added.values()),
                chunks=_chunk_shape(study, chunks),
                dtype=study.dtype,
                fill_value=np.nan if study.dtype.kind == "f" else None,  # fill value of missing regions
                attributes={"_ARRAY_DIMENSIONS": [*study.dims, *study.added], **study.variable_attributes()},
            )
            zarr.consolidate_metadata(made, zarr_format=2)
    except OutputError:
        if not place.exists():  # else another process has created it meanwhile
            raise


def _chunk_shape(study: Study, chunks: int) -> tuple[int, ...]:
    return (*(min(chunks, length) for length in study.shape), *(max(1, length) for length in study.added.values()))


def _opened(study: Study, place: AxisPlace) -> Any:
    """Return the variable of a store that holds this sweep."""
    zarr = require("zarr", "scale")
    try:
        group = zarr.open_group(place.opened(), mode="r", zarr_format=2, use_consolidated=True)
        there = dict(group.attrs).get(_DESCRIBED)
    except (OSError, ValueError, KeyError):
        there = None
    if not isinstance(there, dict):
        raise ValueError(
            f"store = {place.name!r}: holds something else than a sweep of this version; must be a new path"
        )
    differences = _differences(there, study.described())
    if differences:
        raise ValueError(f"store = {place.name!r}: holds another sweep ({'; '.join(differences)}); must be a new place")
    try:
        return _array(place, study.quantity.name, "r")
    except (OSError, ValueError, KeyError):
        raise ValueError(f"store = {place.name!r}: a part of the sweep is missing there; must be a new path") from None


def _differences(there: dict[str, str], here: dict[str, str]) -> list[str]:
    """Return the differences between two descriptions."""
    found = []
    for name in dict.fromkeys([*there, *here]):
        labels = f"dimension {name}"
        if labels in there and labels in here and there[labels] != here[labels]:
            continue  # the labels tell it
        if name not in here:
            found.append(f"{name} is swept or given there only")
        elif name not in there:
            found.append(f"{name} is swept or given here only")
        elif there[name] != here[name]:
            texts = [one if len(one) <= _SHORT else one.partition(":")[0] for one in (there[name], here[name])]
            told = texts[0] != texts[1] and max(map(len, texts)) <= _SHORT
            found.append(f"{name} is {texts[0]} there, {texts[1]} here" if told else f"{name} differs")
    return found


def _array(place: AxisPlace, name: str, mode: str) -> Any:
    array = require("zarr", "scale").open_array(place.opened(), path=name, mode=mode, zarr_format=2)
    return array.with_config({"write_empty_chunks": True, "order": "C"})


def _regions(shape: tuple[int, ...], chunks: tuple[int, ...]) -> Iterator[Region]:
    starts = [range(0, length, piece) for length, piece in zip(shape, chunks, strict=False)]
    for corner in product(*starts):
        yield tuple(
            slice(start, min(start + piece, length))
            for start, piece, length in zip(corner, chunks, shape, strict=False)
        )


def _missing(study: Study, place: AxisPlace, stored: Any) -> list[Region]:
    """Return the regions whose chunk is not there."""
    found = place.keys(study.quantity.name)
    missing = []
    for region in _regions(study.shape, stored.chunks):
        index = [part.start // piece for part, piece in zip(region, stored.chunks, strict=False)]
        index += [0] * (len(stored.shape) - len(index))
        if stored.metadata.encode_chunk_key(tuple(index)) not in found:
            missing.append(region)
    return missing


def _written(study: Study, place: AxisPlace, regions: list[Region], client: Any) -> Iterator[None]:
    if client is None:
        target = _array(place, study.quantity.name, "r+") if regions else None
        for region in regions:
            _write(study, target, region)
            yield
        return
    distributed = require("distributed", "scale")
    shared = client.scatter(study, broadcast=True) if regions else None
    futures = [client.submit(_write, shared, place, region, pure=False) for region in regions]
    for future in distributed.as_completed(futures):
        yield future.result()


def _write(study: Study, target: Any, region: Region) -> None:
    """Compute one region and write it into an array, or into that of the store at a place."""
    array = _array(target, study.quantity.name, "r+") if isinstance(target, AxisPlace) else target
    values = study.block(*(np.arange(part.start, part.stop) for part in region))
    array[(*region, ...)] = values
