"""XML of others, looked through before a parser builds anything from it."""

from xml.parsers import expat

from gantrytau.border.refusal import ModelError

_DEPTH = 100  # of elements inside each other; readers recurse
_ENCODINGS = (
    "utf-8",
    "utf8",
    "us-ascii",
    "ascii",
    "iso-8859-1",
    "windows-1252",
    "utf-16",
)  # read alike by all


def check_xml(text: bytes, place: str) -> None:
    """Raise ModelError at `place` for XML that is malformed, in another encoding, or nested too deeply.

    A document type is refused, as with it come entities: files of the machine, and billions of laughs.
    """
    depth = 0

    def declared(version: str, encoding: str | None, standalone: int) -> None:
        if (encoding or "utf-8").lower() not in _ENCODINGS:
            raise ModelError(
                f"found the encoding {encoding}, expected UTF-8; export or fetch the file again",
                place=place,
            )

    def typed(*_: object) -> None:
        raise ModelError(
            "found a document type (DTD), expected XML without one; do not trust this file",
            place=place,
        )

    def begun(*_: object) -> None:
        nonlocal depth
        depth += 1
        if depth > _DEPTH:
            raise ModelError(
                f"found elements {depth} deep, expected no more than {_DEPTH}; export or fetch the file again",
                place=place,
            )

    def ended(_: object) -> None:
        nonlocal depth
        depth -= 1

    parser = expat.ParserCreate(
        namespace_separator="}"
    )  # as xml.etree has it, so that it accepts what passes here
    parser.XmlDeclHandler, parser.StartDoctypeDeclHandler = declared, typed
    parser.StartElementHandler, parser.EndElementHandler = begun, ended
    try:
        parser.Parse(text, True)
    except (expat.ExpatError, LookupError, ValueError) as error:
        raise ModelError(
            f"found no proper XML ({error}), expected a well-formed file; export or fetch the file again",
            place=place,
        ) from error
