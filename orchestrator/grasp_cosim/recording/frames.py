"""Recorded signals as tables of pandas and xarray (the optional extras of these names)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..base.checks import extra_module

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

TIME = "time"
"""The name of the index, and of the coordinate."""


def as_pandas(
    time: npt.NDArray[np.float64],
    signals: Mapping[str, npt.NDArray[Any]],
    units: Mapping[str, str | None],
    about: Mapping[str, Any],
) -> pd.DataFrame:
    """A column per signal on the time in s; `attrs` has "units" by column, and `about`."""
    module = extra_module("pandas", "it makes the table", "pandas")
    index = module.Index(time, name=TIME)
    frame: pd.DataFrame = module.DataFrame(dict(signals), index=index)
    frame.attrs = {"units": {TIME: "s", **units}, **about}
    return frame


def as_xarray(
    time: npt.NDArray[np.float64],
    signals: Mapping[str, npt.NDArray[Any]],
    units: Mapping[str, str | None],
    descriptions: Mapping[str, str],
    about: Mapping[str, Any],
) -> xr.Dataset:
    """A variable per signal on the coordinate time, each with its units and long_name."""
    module = extra_module("xarray", "it makes the data set", "xarray")
    variables = {
        name: (TIME, column, _attributes(units.get(name), descriptions.get(name)))
        for name, column in signals.items()
    }
    coordinate = {TIME: (TIME, time, {"units": "s", "long_name": "time"})}
    data: xr.Dataset = module.Dataset(variables, coords=coordinate, attrs=dict(about))
    return data


def _attributes(unit: str | None, description: str | None) -> dict[str, str]:
    """The attributes of a signal as netCDF has them: what there is none of is left out."""
    found = {"units": unit, "long_name": description}
    return {key: text for key, text in found.items() if text}
