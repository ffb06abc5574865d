"""CasADi for the type checker: untyped.

The stubs that come with CasADi 3.8 say that `SX.elements()` gives `SXElem`, which has none of the
methods of the `SX` that it gives, and refuse it wherever an `SX` may stand.
"""

from typing import Any

def __getattr__(name: str) -> Any: ...
