"""The blocks of a Dae as readable text."""

from typing import TYPE_CHECKING

import casadi as ca

if TYPE_CHECKING:
    from gantrytau.dae import Dae


def block_text(dae: "Dae") -> str:
    """One line per solved unknown, in the order of solution, with the component equation it comes from."""
    lines = [
        f"{dae.name}",
        f"known: {', '.join(dae.known) or 'nothing'}",
        f"states: {', '.join(dae.states) or 'none'}",
    ]
    for number, block in enumerate(dae.blocks, start=1):
        origin = "; ".join(dict.fromkeys(dae.equation_name(k) for k in block.equations))
        if len(block.unknowns) == 1 and block.solution is not None:
            value = ca.vertcat(*block.solution)
            lines.append(f"[{number}] {block.unknowns[0]} = {_text(value)}    # {block.kind}, from {origin}")
            continue
        lines.append(
            f"[{number}] {block.kind} block of {len(block.unknowns)} unknowns, torn to "
            f"{len(block.tears)}    # from {origin}"
        )
        lines += [
            f"      0 = {_text(r)}    # determines {y}"
            for y, r in zip(block.tears, block.residuals, strict=True)
        ]
        lines += [f"      {symbol} = {_text(value)}" for symbol, value in block.inner]
    return "\n".join(lines) + "\n"


def _text(expression: ca.SX) -> str:
    text = str(expression)
    return text[1:-1] if text.startswith("[") and text.endswith("]") and ", " not in text else text
