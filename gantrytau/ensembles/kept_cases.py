"""Finished cases in a folder, each in a file of its own that is there whole or not at all.

study.json says what the folder is of: a fingerprint, and in words what it was made from. A file of a case is a digest of
what follows it; one that does not fit, after a crash of the disk, is as good as none. Files are read by Python's pickle:
open only folders of your own.
"""

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path

from gantrytau.border.checks import instance
from gantrytau.border.refusal import ModelError
from gantrytau.ensembles.workers.payloads import pack, unpack
from gantrytau.ensembles.workers.worker import Outcome
from gantrytau.whole_files import replacing

DIGEST = 32  # bytes of SHA-256


class KeptCases:
    """The folder of a study; made if it is not there, refused if it is of another one.

    fingerprint: part -> digest of it, "over" and "stop" for example, by which two studies are told apart.
    """

    def __init__(self, folder: str | os.PathLike[str], fingerprint: Mapping[str, str]):
        instance("study", "folder", folder, (str, os.PathLike), "the path of a folder")
        self.folder = Path(folder)
        self.fingerprint = dict(fingerprint)
        if self.folder.exists() and not self.folder.is_dir():
            raise ModelError(f"study: {self.folder} is a file, expected a folder", argument="folder")
        title = self.folder / "study.json"
        if title.is_file():
            self._compare(title)
        elif self.folder.is_dir() and any(self.folder.iterdir()):
            raise ModelError(
                f"study: {self.folder}: found files but no study.json, expected the folder of a study or an empty one; "
                "name another folder",
                argument="folder",
            )
        (self.folder / "cases").mkdir(parents=True, exist_ok=True)
        with replacing(title) as partial:
            partial.write_text(json.dumps(self.fingerprint, indent=2) + "\n", encoding="utf-8")

    def _compare(self, title: Path) -> None:
        try:
            found = json.loads(title.read_text(encoding="utf-8"))
            other = [part for part in self.fingerprint if found.get(part) != self.fingerprint[part]]
        except (OSError, ValueError, AttributeError):
            raise ModelError(
                f"study: {title}: found a file that cannot be read, expected what a study wrote; name another folder",
                argument="folder",
            ) from None
        if other:
            raise ModelError(
                f"study: {self.folder}: found the cases of another study, which differs in {', '.join(other)}, expected "
                "those of this one; name another folder, or remove this one",
                argument="folder",
            )

    def __iter__(self) -> Iterator[Outcome]:
        """The outcomes that are there and whole."""
        for path in sorted((self.folder / "cases").glob("*.case")):
            contents = path.read_bytes()
            if hashlib.sha256(contents[DIGEST:]).digest() == contents[:DIGEST]:
                yield unpack(contents[DIGEST:])

    def keep(self, outcome: Outcome) -> None:
        """File what is finished; a case whose process died may have been killed, and is tried again another time."""
        if outcome.lost:
            return
        contents = pack(outcome)
        with replacing(self.folder / "cases" / f"{outcome.number:06d}.case") as partial:
            partial.write_bytes(hashlib.sha256(contents).digest() + contents)
