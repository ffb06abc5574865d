"""Runs of a learning robot as tables of others: all of them as a dataset of xarray, their errors as one of pandas."""

from typing import TYPE_CHECKING, Any

import numpy as np

from gantrytau.results.files import extra_module

if TYPE_CHECKING:
    import pandas
    import xarray

AXES = ("x", "y", "z")


def history_dataset(history: Any) -> "xarray.Dataset":
    """All runs as one dataset; see `History.to_xarray`."""
    labelled: Any = extra_module("xarray")
    corrected, joints, tool = ("run", "time", "correction"), ("run", "time", "joint"), ("run", "time", "axis")
    metres = {"units": "m"}
    variables = {
        "input": (corrected, history.inputs, {"long_name": "corrections"}),
        "estimate": (corrected, history.estimates, {"long_name": "of what is learnt from"}),
        "wanted": (corrected[1:], history.wanted, {"long_name": "what is learnt from, as it should be"}),
        "q_ref": (joints, history.q_ref, {"long_name": "references of the joints"}),
        "q": (joints, history.q, {"long_name": "measured positions of the joints"}),
        "tool": (tool, history.tool, {"long_name": "measured position of the tool", **metres}),
        "reference": (tool[1:], history.reference.r, {"long_name": "reference of the tool", **metres}),
        "full": ("time", history.full, {"long_name": "whether errors are judged by this sample"}),
    }
    coordinates = {
        "run": ("run", np.arange(len(history))),
        "time": ("time", history.reference.t, {"units": "s", "long_name": "time"}),
        "correction": ("correction", list(history.names)),
        "joint": ("joint", list(history.joints)),
        "axis": ("axis", list(AXES)),
    }
    return labelled.Dataset(variables, coords=coordinates, attrs={"title": repr(history)[1:-1]})


def error_table(history: Any) -> "pandas.DataFrame":
    """Errors of all runs in % of the first; see `History.to_pandas`."""
    frames: Any = extra_module("pandas")
    moving = list(history.reference.moving)
    columns = [*history.names, *(f"tool {AXES[k]}" for k in moving)]
    values = np.hstack([history.relative, history.tool_relative[:, moving]])
    frame = frames.DataFrame(values, index=frames.Index(range(len(history)), name="run"), columns=columns)
    frame.attrs["units"] = dict.fromkeys(columns, "%")
    return frame
