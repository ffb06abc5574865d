"""The platforms an FMU can be compiled for, and where their binaries stand in the file.

Names are the platform tuples of FMI 3.0.2, section 2.5.1.4. FMI 2.0.4 keeps `linux64`, `win64` and
`darwin64` for 64-bit x86 and takes the tuples of FMI 3 for everything else.
"""

import platform as machine
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace

from gantrytau.border.checks import one_of


@dataclass(frozen=True)
class Platform:
    """A system and a processor.

    name: the tuple of FMI 3, e.g. "x86_64-linux"; target: how zig calls it, with the oldest system that will do,
    "" if only the machine's own compiler can build for it; suffix: of a shared library; folder_2: below
    `binaries` in FMI 2; native: built by the machine's own C compiler, for systems not older than this one.
    """

    name: str
    target: str
    suffix: str
    folder_2: str
    native: bool = False

    @property
    def folder_3(self) -> str:
        """The folder below `binaries` in FMI 3."""
        return self.name

    @property
    def system(self) -> str:
        """linux, windows or darwin."""
        return self.name.split("-")[-1]


PLATFORMS = {
    found.name: found
    for found in (
        Platform("x86_64-linux", "x86_64-linux-gnu.2.17", ".so", "linux64"),
        Platform("x86_64-windows", "x86_64-windows-gnu", ".dll", "win64"),
        Platform("x86_64-darwin", "x86_64-macos.11.0", ".dylib", "darwin64"),
        Platform("aarch64-linux", "aarch64-linux-gnu.2.17", ".so", "aarch64-linux"),
        Platform("aarch64-windows", "aarch64-windows-gnu", ".dll", "aarch64-windows"),
        Platform("aarch64-darwin", "aarch64-macos.11.0", ".dylib", "aarch64-darwin"),
    )
}
ALIASES = {"linux64": "x86_64-linux", "win64": "x86_64-windows", "darwin64": "x86_64-darwin"}
_GROUPS = ("native", "all")


def native() -> Platform:
    """The platform of this machine; one that is not in `PLATFORMS` has no target."""
    processor = {"amd64": "x86_64", "arm64": "aarch64"}.get(
        machine.machine().lower(), machine.machine().lower()
    )
    system = {"win32": "windows", "cygwin": "windows"}.get(sys.platform, sys.platform.rstrip("0123456789"))
    name = f"{processor}-{system}"
    suffix = {"windows": ".dll", "darwin": ".dylib"}.get(system, ".so")
    return replace(PLATFORMS.get(name, Platform(name, "", suffix, name)), native=True)


def chosen(platforms: str | Sequence[str]) -> tuple[Platform, ...]:
    """The platforms that are asked for, each once, in the order of `PLATFORMS`; none gives none.

    platforms: names such as "x86_64-linux" or "win64", "native", or "all" for the six of `PLATFORMS`; one
    text may hold several with commas between. A platform named besides "native" is built as the named one.

    Raises ModelError for a name that does not exist.
    """
    names = platforms.split(",") if isinstance(platforms, str) else platforms
    found: dict[str, Platform] = {}
    for given in names:
        name = ALIASES.get(str(given).strip(), str(given).strip())
        if name == "all":
            found |= PLATFORMS
        elif name == "native":
            here = native()
            found.setdefault(here.name, here)
        elif name in PLATFORMS:
            found[name] = PLATFORMS[name]
        else:
            one_of("Build", "platforms", name, (*_GROUPS, *PLATFORMS, *ALIASES))
    order = {name: place for place, name in enumerate(PLATFORMS)}
    return tuple(sorted(found.values(), key=lambda platform: order.get(platform.name, len(order))))
