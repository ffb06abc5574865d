"""A history of learning in words."""

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from gantrytau_optimica.learning.runs.history import History


def words(history: "History") -> str:
    """Relative errors run by run, of what is learnt from and of the tool."""
    tool = [k for k in range(3) if np.isfinite(history.tool_relative[0, k])]
    heads = [*history.names, *(f"tool {'xyz'[k]}" for k in tool)]
    width = max(8, *(len(head) + 2 for head in heads))
    lines = [repr(history)[1:-1]]
    if history.stability is not None:
        lines.append(str(history.stability))
    lines.append("errors in % of the first run")
    lines.append("run " + "".join(f"{head:>{width}}" for head in heads))
    table = np.hstack([history.relative, history.tool_relative[:, tool]])
    lines += [f"{k:3d} " + "".join(f"{value:{width}.2f}" for value in row) for k, row in enumerate(table)]
    return "\n".join(lines)
