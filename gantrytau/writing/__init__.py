"""The equations of a translated model, written out for readers and for other tools."""

from collections.abc import Callable
from typing import Literal

from gantrytau.border.checks import check_words
from gantrytau.compiler.translated import Translated


def write_equations(
    dae: Translated, format: Literal["text", "latex", "html", "base-modelica"], summary: Callable[[], str]
) -> str:
    """The equations as "text", "latex", "html" (blocks, with their origin) or "base-modelica" (the flat model).

    Of a translation with `find=`, what the wanted names depend on, but "base-modelica" is the whole model always.
    summary: what the page opens with. Raises ModelError for another format, and for a function that the
    format has no words for.
    """
    check_words(write_equations, locals(), f"{dae.name}.equations")
    if format == "text":
        from gantrytau.writing.text import block_text

        return block_text(dae)
    if format == "latex":
        from gantrytau.writing.latex import latex_text

        return latex_text(dae)
    if format == "html":
        from gantrytau.writing.equations_page.equations_page import html_page

        return html_page(dae, "" if dae.request.find else summary())
    from gantrytau.writing.base_modelica import base_modelica_text

    return base_modelica_text(dae)
