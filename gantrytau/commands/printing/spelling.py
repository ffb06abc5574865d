"""How arguments of functions are written on the command line: `loss='robust'` as `--robust`."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from gantrytau import GantryTauError


@dataclass(frozen=True)
class Spelling:
    """The options of a command, or the places of a file, that stand for arguments of a function.

    functions: whose messages are said without their names; options: by argument; flags: arguments whose options take no
    value; exactly: what is not put together from argument and value, as it stands in Python -> as it is said here.
    """

    functions: tuple[str, ...]
    options: Mapping[str, str]
    flags: tuple[str, ...] = ()
    exactly: Mapping[str, str] = field(default_factory=dict)

    def of(self, error: GantryTauError) -> str:
        """The message of an error, which names the option where an argument is wrong that has one."""
        text = str(error)
        for function in self.functions:
            text = text.removeprefix(f"{function}: ").removeprefix(f"{function}.")
        option = self.options.get(error.argument or "")
        if option and re.match(rf"{error.argument}(?![\w=])", text):
            text = option + text.removeprefix(str(error.argument))
        if option and text.startswith(f"found {error.argument}="):
            text = text.removeprefix("found ").replace(", expected", ": expected", 1)
        text = self.words(text)
        return text if option is None or option in text else f"{option}: {text}"

    def words(self, message: str) -> str:
        """A message with options in place of arguments, which Python writes as `name=value` or `name=`."""
        for python, here in self.exactly.items():
            message = message.replace(python, here)
        names = "|".join(self.options)
        keyword = (
            rf"\b({names})=(?!=)('[^']*'|\[[^\]]*\]|{{'[^']*': [^}}]*}}|[\w.+-]*\w)?" if names else r"(?!)"
        )
        return re.sub(keyword, self._option, message).strip()

    def _option(self, found: re.Match[str]) -> str:
        option, value = self.options[found[1]], found[2]
        if value is None or found[1] in self.flags:
            return option
        pair = re.fullmatch(r"{'([^']*)': ([^}]*)}", value)  # of a dictionary
        if pair:
            return f"{option} {pair[1]}={pair[2]}"
        plain = value.strip("'")
        word = re.fullmatch(r"[\w.+-]+", plain)  # a shell needs quotes for the rest
        return f"{option} {plain if word else value}"
