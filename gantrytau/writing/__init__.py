"""The equations of a translated model, written out for readers and for other tools."""

from collections.abc import Callable

from gantrytau.border.refusal import ModelError
from gantrytau.compiler.translated import Translated

FORMATS = ("text", "latex", "html", "modelica")


def write_equations(dae: Translated, format: str, summary: Callable[[], str]) -> str:
    """The equations as "text", "latex", "html" (blocks, with their origin) or "modelica" (the flat model).

    Of a translation with `find=`, what the wanted names depend on, but "modelica" is the whole model always.
    summary: what the page opens with. Raises ModelError for another format, and for a function that the
    format has no words for.
    """
    if format == "text":
        from gantrytau.writing.text import block_text

        return block_text(dae)
    if format == "latex":
        from gantrytau.writing.latex import latex_text

        return latex_text(dae)
    if format == "html":
        from gantrytau.writing.equations_page.equations_page import html_page

        return html_page(dae, "" if dae.request.find else summary())
    if format == "modelica":
        from gantrytau.writing.modelica import modelica_text

        return modelica_text(dae)
    expected = ", ".join(f"'{f}'" for f in FORMATS)
    raise ModelError(f"{dae.name}.equations(format={format!r}): expected one of {expected}; choose one")
